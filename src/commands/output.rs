//! Printing answers on standard output.

use crate::Failure;
use std::io::Write;

/// Prints; a reader that went away (`| head`) is no error.
#[allow(clippy::unnecessary_wraps, reason = "reads as the end of a verb")]
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    drop(std::io::stdout().write_all(text.as_bytes()));
    Ok(())
}

/// Prints JSON for people and machines.
pub(crate) fn print_json(json: &serde_json::Value) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(json).map_err(Failure::internal)?;
    print(&format!("{text}\n"))
}

/// Says something beside the answer, on standard error.
pub(crate) fn tell(text: &str) {
    drop(std::io::stderr().write_all(text.as_bytes()));
}
