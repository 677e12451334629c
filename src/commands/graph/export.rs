//! `cortex graph export`.

use super::source::Source;
use crate::cli::{ExportFormat, GraphSource};
use crate::commands::output::{print, print_json};
use crate::{Answer, Failure};
use dsr::{interchange, json};

pub(super) fn export(source: &GraphSource, format: ExportFormat) -> Result<Answer, Failure> {
    let snapshot = Source::open(source)?.snapshot()?;
    let written = match format {
        ExportFormat::Json => json::to_json(&snapshot).map(Ok),
        ExportFormat::Robocomp => interchange::to_robocomp(&snapshot).map(Ok),
        ExportFormat::Dot => interchange::to_dot(&snapshot).map(Err),
        ExportFormat::Graphml => interchange::to_graphml(&snapshot).map(Err),
    };
    match written.map_err(Failure::internal)? {
        Ok(json) => print_json(&json)?,
        Err(text) => print(&text)?,
    }
    Ok(Answer::Yes)
}
