//! How soon a broken plan is followed by the next one in a running system: a store, an executive and
//! whoever surprises them are processes of their own. It guarantees that each surprise that is timed
//! made the plan in force impossible.

use super::figure::{Figure, median};
use super::hall::Hall;
use super::indoor::{self, RULES};
use super::peer::{attach, end_of_input, say};
use super::plan::R50;
use crate::Failure;
use dsr::{Instance, Pace, Schema, Session, Store, Tick, Time, Transaction, Turns, interchange};
use executive::{Mission, MissionSpec, Preemption, Schedule};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// So many surprises are timed.
const SURPRISES: usize = 9;
/// How often the clock of the instance ticks, seconds.
const TICK: f64 = 0.05;
/// So many ticks lie between surprises: the executive makes no plans faster than two in a second.
const TICKS: usize = 14;

/// The store of the indoor task.
pub(super) fn indoor(instance: &Instance) -> Result<(), Failure> {
    let schema = Schema::open();
    let import = interchange::read(&indoor::task(R50).world, &schema).map_err(Failure::internal)?;
    let mut store = Store::open(instance, schema).map_err(Failure::internal)?;
    let (grammar, _) = grammar::parse_grammar(RULES, "rules.aggl");
    store.graph_mut().set_rules(Arc::new(grammar));
    let committed = store.commit(&import.transaction(), Time::default());
    committed.map_err(Failure::internal)?;
    let ended = end_of_input();
    say("ready")?;
    while !ended.load(Ordering::Acquire) {
        let served = store.serve(Duration::from_millis(20));
        served.map_err(Failure::internal)?;
    }
    Ok(())
}

/// The executive, with the indoor task's goal for a mission.
pub(super) fn executive(instance: &Instance) -> Result<(), Failure> {
    let (grammar, _) = grammar::parse_grammar(RULES, "rules.aggl");
    let mission = MissionSpec {
        name: MISSION.to_owned(),
        goal: indoor::task(R50).goal,
        priority: 0,
        deadline: None,
        preemption: Preemption::default(),
        schedule: Schedule::default(),
    };
    let session = attach(instance, "executive")?;
    let begin: dsr::Begin = Box::new(move || Turns::begin(Pace::Free, Arc::default()));
    executive::process::run(session, begin, grammar, vec![mission]).map_err(Failure::internal)
}

const MISSION: &str = "deliver";

/// The mission as the graph has it, with its steps.
fn mission(session: &mut Session) -> Result<Option<Mission>, Failure> {
    let missions = session.read(executive::missions_with_steps);
    let mut missions = missions.map_err(Failure::internal)?.into_iter();
    Ok(missions.find(|mission| mission.name == MISSION))
}

/// The room of a node, and another one that the plan does not expect it in.
fn rooms(session: &mut Session, name: &str) -> Result<(String, String), Failure> {
    let found = session.read(|snapshot| {
        let label = snapshot.schema().find_label("in");
        let (Some(node), Some(label)) = (snapshot.find_node_by_name(name)?, label) else {
            return Ok(None);
        };
        let Some(key) = node.out_edges_of(label).next() else {
            return Ok(None);
        };
        let room = snapshot.find_node(key?.to)?;
        room.map(|room| room.name()).transpose()
    });
    let room = found.map_err(Failure::internal)?;
    let room = room.ok_or_else(|| Failure::internal(format!("`{name}` is in no room")))?;
    let number = room.trim_start_matches("room").parse::<u32>();
    let number = number.map_err(Failure::internal)?;
    let other = format!("room{}", (number + R50.rooms / 2) % R50.rooms);
    Ok((room, other))
}

/// Moves a thing that the plan is to fetch, again and again, and takes the time until the next plan
/// is in the graph.
pub(super) fn live() -> Result<Figure, Failure> {
    let hall = Hall::open()?;
    let store = hall.ready("indoor", &[])?;
    let mut session = hall.session("world")?;
    let clock = session.clock().map_err(Failure::internal)?;
    let executive = hall.ready("executive", &[])?;
    let mut index = 0;
    let mut tick = |ticks: usize| -> Result<Time, Failure> {
        let mut time = Time::default();
        for _ in 0..ticks {
            index += 1;
            time = Time::from_seconds(index as f64 * TICK);
            clock(Tick { index, time }).map_err(Failure::internal)?;
            std::thread::sleep(Duration::from_secs_f64(TICK));
        }
        Ok(time)
    };
    let started = Instant::now();
    while mission(&mut session)?.is_none_or(|mission| mission.steps.is_empty()) {
        tick(1)?;
        if started.elapsed() > super::PATIENCE {
            return Err(Failure::internal("the executive made no plan"));
        }
    }
    let mut samples = Vec::new();
    for _ in 0..SURPRISES {
        let now = tick(TICKS)?;
        let replans = mission(&mut session)?.map_or(0, |mission| mission.replans);
        let (from, to) = rooms(&mut session, "thing0")?;
        let mut surprise = Transaction::new();
        surprise.delete_edge("thing0", "in", from.as_str());
        surprise.create_edge("thing0", "in", to.as_str());
        let moved = Instant::now();
        session.commit(&surprise, now).map_err(Failure::internal)?;
        while mission(&mut session)?.is_none_or(|mission| mission.replans == replans) {
            if moved.elapsed() > super::PATIENCE {
                return Err(Failure::internal("the executive made no other plan"));
            }
        }
        samples.push(moved.elapsed().as_nanos() as u64);
    }
    executive.end()?;
    store.end()?;
    Ok(Figure {
        name: "replan_r50_live",
        value: median(&mut samples) * 1e-9,
        unit: "s",
        raw: None,
        peer: "from the surprise's commit to the next plan in the graph".to_owned(),
    })
}
