//! `cortex graph transform`.

use super::source::{Source, find_node, is_recording};
use crate::cli::GraphSource;
use crate::commands::output::{print, print_json, tell, value_text};
use crate::{Answer, Failure};
use dsr::{Time, TransformError, Value};
use serde_json::json;

pub(super) fn transform(
    graph: &GraphSource,
    target: &str,
    source: &str,
) -> Result<Answer, Failure> {
    // A recording is opened as of then.
    let (at, graph) = if is_recording(graph) {
        (None, graph.clone())
    } else {
        let at = None;
        (
            graph.at,
            GraphSource {
                at,
                ..graph.clone()
            },
        )
    };
    let snapshot = Source::open(&graph)?.snapshot()?;
    let ids = (find_node(&snapshot, target)?, find_node(&snapshot, source)?);
    // Before 0 counts back from the newest version.
    let time = at.map(|at| match at {
        at if at < 0.0 => snapshot.time() + at,
        at => Time::from_seconds(at),
    });
    let found = match time {
        None => snapshot.transform(ids.0, ids.1),
        Some(time) => snapshot.transform_at(ids.0, ids.1, time),
    };
    let pose = match found {
        Ok(pose) => pose,
        Err(TransformError::Read(error)) => return Err(Failure::internal(error)),
        Err(refused) => {
            tell(&format!("{refused}\n"));
            return Ok(Answer::No);
        }
    };
    if !graph.json {
        print(&format!("{}\n", value_text(&Value::Pose(pose))))?;
        return Ok(Answer::Yes);
    }
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    print_json(&json!({
        "target": target, "source": source, "time": time.map(Time::seconds),
        "translation": [t.x, t.y, t.z], "rotation": [q.x, q.y, q.z, q.w],
        "roll": roll, "pitch": pitch, "yaw": yaw,
    }))?;
    Ok(Answer::Yes)
}
