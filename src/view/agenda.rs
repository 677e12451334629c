//! What is to take place when, and what the spaces of the objects then cost: R(t) over the hours about
//! now, as social mapping has it.

use agents::social_mapping::graph::usages;
use dsr::{Node, ReadError, Snapshot, Time, Value};
use serde_json::{Value as Json, json};

/// What is shown before the first and after the last of it, seconds.
const MARGIN: f64 = 3600.0;
/// Nothing is shown that is farther from now than this, seconds.
const FARTHEST: f64 = 24.0 * 3600.0;
/// R(t) is told every so many seconds.
const STEP: f64 = 300.0;

/// Activities by start, and R(t) of each object that has a space, from `from` to `to` every `step` seconds.
///
/// # Errors
/// [`ReadError`].
pub(crate) fn agenda(snapshot: &Snapshot) -> Result<Json, ReadError> {
    let now = snapshot.time().seconds();
    let mut rows = Vec::new();
    let [mut from, mut to] = [now; 2];
    for activity in snapshot.nodes_of("activity") {
        let activity = activity?;
        let [start, end] = ["start", "end"].map(|name| seconds(&activity, name));
        let (start, end) = (start?, end?);
        for time in [start, end].into_iter().flatten() {
            (from, to) = (from.min(time), to.max(time));
        }
        let is_cancelled = activity.value("cancelled")?.and_then(|v| v.as_bool());
        rows.push(json!({
            "name": activity.name()?, "id": activity.id().0, "start": start, "end": end,
            "objects": objects(snapshot, &activity)?, "cancelled": is_cancelled.unwrap_or(false),
        }));
    }
    let start = |row: &Json| row["start"].as_f64().unwrap_or(f64::NEG_INFINITY);
    rows.sort_by(|a, b| start(a).total_cmp(&start(b)));
    from = ((from - MARGIN).max(now - FARTHEST) / STEP).floor() * STEP;
    to = ((to + MARGIN).min(now + FARTHEST) / STEP).ceil() * STEP;
    let count = ((to - from) / STEP).round() as u32;
    let times = (0..=count).map(|n| Time::from_seconds(from + STEP * f64::from(n)));
    let usages = usages(snapshot, &times.collect::<Vec<_>>())?;
    Ok(json!({
        "now": now, "from": from, "to": to, "step": STEP, "activities": rows, "usage": usages,
    }))
}

fn seconds(activity: &Node<'_>, name: &str) -> Result<Option<f64>, ReadError> {
    let value = activity.value(name)?.and_then(|value| value.as_f64());
    Ok(value.filter(|seconds| seconds.is_finite()))
}

/// Names of the objects that an activity uses.
fn objects(snapshot: &Snapshot, activity: &Node<'_>) -> Result<Vec<String>, ReadError> {
    let mut names = Vec::new();
    if let Some(label) = snapshot.schema().find_label("uses") {
        for id in activity.targets_of(label) {
            if let Some(object) = snapshot.find_node(id?)? {
                names.push(object.name()?);
            }
        }
    }
    let named = activity.value("object")?;
    names.extend(named.as_ref().and_then(Value::as_str).map(str::to_owned));
    names.sort_unstable();
    names.dedup();
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::{EdgeRef, Graph, Operation, Transaction, planar_pose};
    use nalgebra::{Isometry2, Vector2};

    #[test]
    fn usage_rises_to_an_activity_and_falls_after_it() {
        let mut graph = Graph::in_memory(scenarios::schema().unwrap());
        let mut transaction = Transaction::new();
        transaction.create_node("world", "w", vec![]);
        let size = ("size".into(), Value::Vector(vec![1.0, 0.5]));
        transaction.create_node("table", "desk", vec![size]);
        let pose = Isometry2::new(Vector2::new(1.0, 2.0), 0.0);
        transaction.push(Operation::CreateEdge {
            edge: EdgeRef::new("w", "pose", "desk"),
            attributes: vec![("transform".into(), Value::Pose(planar_pose(&pose)))],
        });
        let nine = 1_800_000_000.0;
        let times = vec![
            ("start".into(), (nine + 7200.0).into()),
            ("end".into(), (nine + 9000.0).into()),
            ("object".into(), "desk".into()),
        ];
        transaction.create_node("activity", "lunch", times);
        let now = Time::from_seconds(nine);
        graph.commit(&transaction, "test", now).unwrap();
        let json = agenda(&graph.snapshot()).unwrap();
        assert_eq!(json["activities"][0]["objects"], json!(["desk"]));
        assert_eq!(json["from"], nine - 3600.0);
        let at =
            |seconds: f64| json["usage"]["desk"][((3600.0 + seconds) / 300.0) as usize].as_f64();
        assert_eq!(
            [at(0.0), at(7200.0), at(9000.0), at(12600.0)],
            [1.5, 3.5, 3.5, 1.5].map(Some)
        );
        assert!((2.0..3.0).contains(&at(6000.0).unwrap()));
    }
}
