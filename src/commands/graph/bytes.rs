//! `cortex graph get PATH --bytes FILE`: a large value as it lies in its owner's memory.

use super::path::Path;
use super::source::Source;
use crate::cli::GraphSource;
use crate::commands::output::tell;
use crate::{Answer, Failure};
use dsr::{LargeReadError, LargeSample, Session, Value};
use std::time::Duration;

/// How long to wait for the owner's next turn.
const PATIENCE: Duration = Duration::from_secs(5);
/// How often to look again where the owner was faster.
const LOOKS: u32 = 100;

pub(super) fn save(
    source: &GraphSource,
    path: &str,
    file: &std::path::Path,
) -> Result<Answer, Failure> {
    let Source::Live(mut session) = Source::open(source)? else {
        return Err(Failure::input(
            "a file has no large values, only their handles",
        ));
    };
    for _ in 0..LOOKS {
        match read(&mut session, path)? {
            Ok(sample) => {
                let written = std::fs::write(file, &*sample);
                written.map_err(|error| {
                    Failure::input(format!("cannot write {}: {error}", file.display()))
                })?;
                tell(&format!("{path}: {}\n", sample.handle()));
                return Ok(Answer::Yes);
            }
            Err(LargeReadError::Overtaken { .. }) => {}
            Err(LargeReadError::Instance(error)) => return Err(Failure::internal(error)),
            Err(error) => {
                tell(&format!("{path}: {error}\n"));
                return Ok(Answer::No);
            }
        }
    }
    tell(&format!(
        "{path}: its owner is faster than it can be read\n"
    ));
    Ok(Answer::No)
}

fn read(session: &mut Session, path: &str) -> Result<Result<LargeSample, LargeReadError>, Failure> {
    let snapshot = session.snapshot().map_err(Failure::internal)?;
    let (thing, name) = Path::find_attribute(&snapshot, path)?;
    let id = snapshot.schema().attribute_id(&name);
    let attribute = thing.attribute(&snapshot, id.map_err(Failure::input)?);
    let value = attribute
        .map_err(Failure::internal)?
        .map(|attribute| attribute.value);
    let Some(handle) = value.as_ref().and_then(Value::as_large) else {
        return Err(Failure::input(format!("{path} has no large value")));
    };
    Ok(session.read_large(handle, PATIENCE))
}
