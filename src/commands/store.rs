//! `cortex store`: the process that alone writes an instance's graph.

use crate::cli::Store as Arguments;
use crate::{Answer, Failure};
use dsr::{
    Durability, Graph, Instance, Pace, Schema, State, Store, StoreError, Transaction, Turns, Value,
};
use grammar::Grammar;
use grammar::live::Published;
use scenarios::Scenario;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// How far groups of commits that nobody waits for are apart on their way to the disk.
const SYNC_INTERVAL: Duration = Duration::from_millis(100);

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let instance = super::instance(&arguments.instance.instance)?;
    let pace = if arguments.supervised {
        Pace::Free
    } else {
        Pace::Alone
    };
    let served = serve(arguments, &instance, pace);
    if pace == Pace::Alone {
        instance.leave().map_err(Failure::internal)?;
    }
    served.map(|()| Answer::Yes)
}

/// Opens the store and serves until it shall end.
fn serve(arguments: &Arguments, instance: &Instance, pace: Pace) -> Result<(), Failure> {
    let scenario = super::load_scenario(&arguments.scenario)?;
    let (schema, grammar) = super::load_rules(&scenario)?;
    let manifests = crate::manifests::load(&scenario.folder, &schema)?;
    let interrupted = super::interruption()?;
    let state = arguments.state.as_deref().map(open_state).transpose()?;
    let mut store = Store::open(instance, schema).map_err(|error| match error {
        StoreError::InUse { .. } => Failure::input(error),
        error => Failure::internal(error),
    })?;
    store.graph_mut().set_rules(Arc::new(grammar.clone()));
    store.graph_mut().set_rights(manifests);
    begin(&mut store, arguments, &scenario, &grammar, state.as_ref())?;
    if let Some(state) = state {
        let durability = if arguments.durable {
            Durability::OnDisk
        } else {
            Durability::InMemory
        };
        let kept = store.keep(state, SYNC_INTERVAL, durability);
        kept.map_err(Failure::internal)?;
    }
    let mut lifeline = Turns::begin(pace, interrupted).map_err(Failure::internal)?;
    while !lifeline.ended() {
        store
            .serve(Duration::from_millis(25))
            .map_err(Failure::internal)?;
    }
    Ok(())
}

/// Opens a state folder that the user named.
pub(super) fn open_state(folder: &Path) -> Result<State, Failure> {
    State::open(folder).map_err(Failure::input)
}

/// Whether a run of the scenario can go on from the folder: for who wants to know it before there is
/// a store.
pub(super) fn check_state(
    folder: &Path,
    scenario: &Scenario,
    schema: Schema,
) -> Result<(), Failure> {
    if let Some(image) = open_state(folder)?.load().map_err(Failure::input)? {
        let mut graph = Graph::in_memory(schema);
        graph.restore(&image).map_err(Failure::input)?;
        scenarios::resume(scenario, &graph.snapshot()).map_err(Failure::input)?;
    }
    Ok(())
}

/// Fills the empty graph: with what a store that was killed left in memory, else with what is on disk,
/// brought in line with the scenario, else with the scenario's.
fn begin(
    store: &mut Store,
    arguments: &Arguments,
    scenario: &Scenario,
    grammar: &Grammar,
    state: Option<&State>,
) -> Result<(), Failure> {
    let left = if arguments.fresh {
        None
    } else {
        store.orphaned(state).map_err(no_way_on)?
    };
    if let Some(left) = left {
        store.take_over(&left).map_err(no_way_on)?;
        let snapshot = store.graph_mut().snapshot();
        scenarios::check_scenario(scenario, &snapshot).map_err(no_way_on)?;
        go_by_published(store)?;
        let version = left.version();
        tracing::info!("version {version} goes on from memory; --fresh begins without it");
        return go_by_flags(store, arguments);
    }
    let saved = state.map(State::load).transpose().map_err(Failure::input)?;
    let mut first = match saved.flatten() {
        Some(image) => {
            store.restore(&image).map_err(Failure::input)?;
            tracing::info!("version {} goes on from disk", image.version());
            let snapshot = store.graph_mut().snapshot();
            scenarios::resume(scenario, &snapshot).map_err(Failure::input)?
        }
        None => scenarios::initial_graph(scenario),
    };
    if !go_by_published(store)? {
        let empty = store.graph_mut().snapshot();
        let rules = grammar.publish(&empty).map_err(Failure::internal)?;
        first.operations.extend(rules.operations);
    }
    first.set(scenarios::WORLD, "social", !arguments.no_social);
    let committed = store.commit(&first, scenario.start);
    committed.map_err(Failure::internal)?;
    Ok(())
}

/// Makes the graph say what this start's flags say.
fn go_by_flags(store: &mut Store, arguments: &Arguments) -> Result<(), Failure> {
    let snapshot = store.graph_mut().snapshot();
    let world = snapshot.find_node_by_name(scenarios::WORLD);
    let world = world.map_err(Failure::internal)?;
    let social = world.map(|world| world.value("social")).transpose();
    let social = social.map_err(Failure::internal)?.flatten();
    if social != Some(Value::Bool(!arguments.no_social)) {
        let mut flags = Transaction::new();
        flags.set(scenarios::WORLD, "social", !arguments.no_social);
        let committed = store.commit(&flags, snapshot.time());
        committed.map_err(Failure::internal)?;
    }
    Ok(())
}

/// What a killed store left stands in the way.
fn no_way_on(error: impl std::fmt::Display) -> Failure {
    Failure::input_with_help(
        error,
        "`cortex store --fresh` begins without what the killed store left in memory; its own scenario, \
         without --state or with another folder, goes on with that",
    )
}

/// Goes by the rules that the graph has: those that were loaded while the system ran. Whether it has
/// any.
fn go_by_published(store: &mut Store) -> Result<bool, Failure> {
    let snapshot = store.graph_mut().snapshot();
    let Some(published) = Published::find(&snapshot).map_err(Failure::internal)? else {
        return Ok(false);
    };
    let grammar = published.read(snapshot.schema());
    let grammar = grammar.map_err(|defects| Failure::Input(defects.into()))?;
    store.graph_mut().set_rules(Arc::new(grammar));
    Ok(true)
}
