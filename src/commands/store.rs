//! `cortex store`: the process that alone writes an instance's graph.

use crate::cli::Store as Arguments;
use crate::{Answer, Failure};
use dsr::{Image, Instance, Pace, Store, Turns};
use std::sync::Arc;
use std::time::Duration;

/// How often the store looks after the dead, in rounds of serving.
const CLEANING: u32 = 40;

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let instance = super::instance(&arguments.instance.instance)?;
    let pace = if arguments.supervised {
        Pace::Free
    } else {
        Pace::Alone
    };
    let served = serve(arguments, &instance, pace);
    if pace == Pace::Alone {
        instance.remove_if_unused().map_err(Failure::internal)?;
    }
    served.map(|()| Answer::Yes)
}

/// Opens the store and serves until it shall end.
fn serve(arguments: &Arguments, instance: &Instance, pace: Pace) -> Result<(), Failure> {
    let scenario = super::load_scenario(&arguments.scenario)?;
    let (schema, grammar) = super::load_rules(&scenario)?;
    let interrupted = super::interruption()?;
    let mut store = Store::open(instance, schema).map_err(Failure::internal)?;
    store.graph_mut().set_rules(Arc::new(grammar));
    match &arguments.restore {
        Some(path) => {
            let bytes = std::fs::read(path).map_err(Failure::input)?;
            let image: Image = dsr::decode_image(&bytes).map_err(Failure::input)?;
            store.restore(&image).map_err(Failure::internal)?;
            tracing::info!("restored version {}", image.version());
        }
        None => {
            let mut initial = scenarios::initial_graph(&scenario);
            initial.set(scenarios::WORLD, "social", !arguments.no_social);
            store
                .commit(&initial, scenario.start)
                .map_err(Failure::internal)?;
        }
    }
    let mut lifeline = Turns::begin(pace, interrupted).map_err(Failure::internal)?;
    let mut round = 0u32;
    while !lifeline.ended() {
        store
            .serve(Duration::from_millis(25))
            .map_err(Failure::internal)?;
        round = round.wrapping_add(1);
        if round.is_multiple_of(CLEANING) {
            store.clean_up_after_the_dead();
        }
    }
    Ok(())
}
