//! `cortex graph`: the shared graph of a running instance, or of a file, for people and scripts.

mod bytes;
mod check;
mod diff;
mod export;
mod history;
mod import;
mod path;
mod read;
mod source;
mod transform;
mod watch;
mod write;

pub(super) use history::oldest_time;
pub(crate) use history::rows as history_rows;
pub(super) use path::{Path, Thing, last_with};
pub(crate) use source::{Source, attach, name_of, no_such, read_graph};
pub(crate) use write::transaction as setting;

use crate::cli::{Graph as Arguments, GraphAction};
use crate::{Answer, Failure};

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let source = &arguments.source;
    match &arguments.action {
        GraphAction::Show { what } => read::show(source, what.as_deref()),
        GraphAction::Get { path, bytes: None } => read::get(source, path),
        GraphAction::Get {
            path,
            bytes: Some(file),
        } => bytes::save(source, path, file),
        GraphAction::Set { path, value } => write::set(source, path, value),
        GraphAction::Watch(watch) => watch::watch(source, watch),
        GraphAction::History { path, limit } => history::history(source, path, *limit),
        GraphAction::Export { format } => export::export(source, *format),
        GraphAction::Import { from, replace } => import::import(source, from, *replace),
        GraphAction::Diff { a, b } => diff::diff(source, a, b.as_deref()),
        GraphAction::Check { schema } => check::check(source, schema.as_deref()),
        GraphAction::Transform {
            target,
            source: node,
        } => transform::transform(source, target, node),
    }
}
