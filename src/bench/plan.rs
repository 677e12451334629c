//! Measuring the planner end to end: from the text of rules, world and goal to the plan. It guarantees
//! that every plan which is timed is one, and that the figures that are compared come from the same
//! run, taken in turns.

use super::figure::{Figure, median};
use super::indoor::{self, RULES, Size, Task};
use crate::Failure;
use dsr::{Graph, Schema, Time, interchange};
use executive::{Effort, Limits, Options, Outcome, Status};
use std::path::Path;
use std::time::Instant;

const R10: Size = Size {
    rooms: 10,
    people: 4,
    deliveries: 1,
    informed: 1,
};
pub(super) const R50: Size = Size {
    rooms: 50,
    people: 20,
    deliveries: 2,
    informed: 2,
};
const R200: Size = Size {
    rooms: 200,
    people: 80,
    deliveries: 1,
    informed: 0,
};

/// A kitchen that lays a table for a guest: each plate that it takes out is a new node.
const TABLE: &str = "name=table
===
take : active(2) { { c:cupboard t:table } => { c:cupboard t:table p:plate p->t(on) } }
fill : active(1) { { p:plate t:table g:guest p->t(on) p->p(full)* } =>
                   { p:plate t:table g:guest p->t(on) p->p(full) p->g(for) } }
";

fn table() -> Task {
    let world = r#"{"format":"dsr/1","nodes":[{"id":1,"type":"cupboard","name":"cupboard"},
        {"id":2,"type":"table","name":"table"},{"id":3,"type":"guest","name":"ana"},
        {"id":4,"type":"guest","name":"ben"}],"edges":[]}"#;
    let goal = "{ p:plate q:plate \"ana\":guest \"ben\":guest p->\"ana\"(for) q->\"ben\"(for) }";
    Task {
        world: world.to_owned(),
        goal: goal.to_owned(),
    }
}

/// Plans from text; the seconds that it took and what came of it.
fn plan(rules: &str, task: &Task, options: &Options) -> Result<(f64, Outcome), Failure> {
    let started = Instant::now();
    let (grammar, _) = grammar::parse_grammar(rules, "rules.aggl");
    let goal = grammar::parse_goal(&task.goal, "goal.aggt", &grammar.types)
        .map_err(|defects| Failure::Internal(defects.into()))?;
    let import = interchange::read(&task.world, &Schema::open()).map_err(Failure::internal)?;
    let mut graph = Graph::in_memory(Schema::open());
    graph
        .commit(&import.transaction(), "file", Time::default())
        .map_err(Failure::internal)?;
    let limits = &mut Limits::new();
    let outcome = executive::plan(&grammar, &graph.snapshot(), &goal, options, limits)
        .map_err(Failure::internal)?;
    let seconds = started.elapsed().as_secs_f64();
    if outcome.status == Status::Solved {
        Ok((seconds, outcome))
    } else {
        let reason = outcome.reason.unwrap_or_default();
        Err(Failure::internal(format!(
            "a task of the measurement has no plan: {reason}"
        )))
    }
}

/// The middle of several runs, in seconds, and the plan, which is the same in all of them.
fn timed(
    rules: &str,
    task: &Task,
    options: &Options,
    runs: usize,
) -> Result<(f64, Outcome), Failure> {
    let (_, outcome) = plan(rules, task, options)?;
    let mut samples = Vec::new();
    for _ in 0..runs {
        let (seconds, again) = plan(rules, task, options)?;
        if again != outcome {
            return Err(Failure::internal("the same task was given two plans"));
        }
        samples.push((seconds * 1e9) as u64);
    }
    Ok((median(&mut samples) * 1e-9, outcome))
}

/// All figures of the planner. With a folder, the tasks are written into it, for other planners.
pub(crate) fn plans(folder: Option<&Path>) -> Result<Vec<Figure>, Failure> {
    let first = Options {
        effort: Effort::First,
        ..Options::default()
    };
    let optimal = Options {
        effort: Effort::Optimal,
        ..Options::default()
    };
    let tasks = [
        ("r10_first", indoor::task(R10), &first, 21),
        ("r50_first", indoor::task(R50), &first, 11),
        ("r200_first", indoor::task(R200), &first, 5),
        ("rooms_5x5", indoor::grid(5), &first, 21),
        ("r10_optimal", indoor::task(R10), &optimal, 5),
    ];
    let mut figures = Vec::new();
    for (name, task, options, runs) in &tasks {
        if let Some(folder) = folder {
            write(folder, name, RULES, task)?;
        }
        let (value, outcome) = timed(RULES, task, options, *runs)?;
        let (steps, cost) = (outcome.steps.len(), outcome.cost.unwrap_or_default());
        figures.push(Figure {
            name,
            value,
            unit: "s",
            raw: None,
            peer: format!("{steps} steps, cost {cost}, {} states", outcome.expanded),
        });
    }
    let offering = |spares| Options {
        spares,
        ..first.clone()
    };
    let table = table();
    let (few, _) = timed(TABLE, &table, &offering(5), 21)?;
    let (many, _) = timed(TABLE, &table, &offering(50), 21)?;
    figures.push(Figure {
        name: "spares_50",
        value: many,
        unit: "s",
        raw: Some(few),
        peer: "5 new nodes offered to each rule".to_owned(),
    });
    figures.push(super::replan::live()?);
    Ok(figures)
}

fn write(folder: &Path, name: &str, rules: &str, task: &Task) -> Result<(), Failure> {
    let folder = folder.join(name);
    let cannot = |error| Failure::input(format!("cannot write {}: {error}", folder.display()));
    std::fs::create_dir_all(&folder).map_err(cannot)?;
    let files = [
        ("rules.aggl", rules),
        ("world.json", &task.world),
        ("goal.aggt", &task.goal),
    ];
    for (name, text) in files {
        std::fs::write(folder.join(name), text).map_err(cannot)?;
    }
    Ok(())
}
