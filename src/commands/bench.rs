//! `cortex bench`: how fast it is here, beside what it is made of and what it replaces.

use super::output::{print, print_json};
use crate::bench::{self, Effort};
use crate::cli::{Bench as Arguments, BenchAction};
use crate::{Answer, Failure};

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let figures = match &arguments.action {
        BenchAction::Graph { quick, thorough } => bench::graph(match (quick, thorough) {
            (true, _) => Effort::QUICK,
            (_, true) => Effort::THOROUGH,
            _ => Effort::NORMAL,
        })?,
        BenchAction::Rules => return tell(&bench::rules()?, arguments.json),
        BenchAction::Social => return tell(&bench::social()?, arguments.json),
        BenchAction::Perception => return tell(&bench::perception()?, arguments.json),
        BenchAction::Plan { tasks } => bench::plans(tasks.as_deref())?,
        BenchAction::Path => bench::paths()?,
    };
    if arguments.json {
        let figures: Vec<_> = figures.iter().map(bench::Figure::to_json).collect();
        print_json(&figures.into())?;
    } else {
        print(&bench::table(&figures))?;
    }
    Ok(Answer::Yes)
}

fn tell(quantities: &[bench::Quantity], as_json: bool) -> Result<Answer, Failure> {
    if as_json {
        let rows: Vec<_> = quantities.iter().map(bench::Quantity::to_json).collect();
        print_json(&rows.into())?;
    } else {
        print(&bench::quantities_table(quantities))?;
    }
    Ok(Answer::Yes)
}
