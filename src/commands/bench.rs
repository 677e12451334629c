//! `cortex bench`: how fast it is here, beside what it is made of and what it replaces.

use super::output::{print, print_json};
use crate::cli::{Bench as Arguments, BenchAction};
use crate::{Answer, Failure, bench};

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let figures = match &arguments.action {
        BenchAction::Plan { tasks } => bench::plans(tasks.as_deref())?,
    };
    if arguments.json {
        let figures: Vec<_> = figures.iter().map(bench::Figure::to_json).collect();
        print_json(&figures.into())?;
    } else {
        print(&bench::table(&figures))?;
    }
    Ok(Answer::Yes)
}
