//! Worlds in files: graph JSON (see [`crate::json`]), RoboComp DSR JSON and AGM models in XML come
//! in, graph JSON, RoboComp DSR JSON, Graphviz DOT and GraphML go out. Guarantees that nothing of a
//! file is dropped in silence, that every problem has its place in the text, and that no text, however
//! broken, makes it panic.

mod agm;
mod check;
mod dot;
mod graph_json;
mod graphml;
mod place;
mod problem;
mod robocomp;
mod world;
mod write;

pub use check::check_graph;
pub use dot::to_dot;
pub use graphml::to_graphml;
pub use problem::{InterchangeError, Problem, Problems, Severity};
pub use world::{Format, LeftOut, Stamp, World};
pub use write::to_robocomp;

use crate::Schema;
use place::Text;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;

/// What tells the JSON formats from each other.
#[derive(Deserialize)]
struct Probe {
    #[serde(rename = "DSRModel")]
    dsr_model: Option<IgnoredAny>,
}

/// The world that a text says: graph JSON, RoboComp DSR JSON or AGM model XML. A byte-order mark may
/// come first, and anything may follow the closing brace of a RoboComp file. `schema` says of which
/// kind the plain numbers of graph JSON are; [`Schema::open`] where there is none.
///
/// Names that the schema does not have are no errors here: see [`World::check`].
///
/// # Errors
/// [`InterchangeError`], with the places.
///
/// # Example
/// ```
/// use dsr::{Graph, Schema, Time, interchange};
///
/// let xml = r#"<AGMModel>
///     <link src="1" dst="2" label="in"/>
///     <symbol id="1" type="robot"/>
///     <symbol id="2" type="room"><attribute key="imName" value="kitchen"/></symbol>
/// </AGMModel>"#;
/// let mut graph = Graph::in_memory(Schema::open());
/// graph.import(&interchange::read(xml, &Schema::open())?, "me", Time::default())?;
/// assert!(graph.snapshot().find_node_by_name("kitchen")?.is_some());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read(text: &str, schema: &Schema) -> Result<World, InterchangeError> {
    let text = Text::new(text);
    let mut problems = Vec::new();
    let body = text.body();
    let world = if body.trim_start().starts_with('<') {
        agm::read(&text, &mut problems)
    } else if is_robocomp(body) {
        robocomp::read(&text, &mut problems)
    } else {
        graph_json::read(&text, schema, &mut problems)
    };
    if let Some(world) = &world {
        world.check_references(&text, &mut problems);
    }
    match world {
        Some(world) if problems.is_empty() => Ok(world),
        _ => Err(InterchangeError::new(problems)),
    }
}

fn is_robocomp(body: &str) -> bool {
    let mut values = serde_json::Deserializer::from_str(body).into_iter::<Probe>();
    match values.next() {
        Some(Ok(probe)) => probe.dsr_model.is_some(),
        // Broken: whose error it is, the first name tells.
        _ => body
            .trim_start_matches(['{', ' ', '\n', '\r', '\t'])
            .starts_with("\"DSRModel\""),
    }
}

/// The unique name of each node: the name that it asks for, if no other node asks for it or has it
/// as its id; else its id.
fn unique_names(wanted: &[(String, Option<String>)]) -> Vec<String> {
    let mut times: BTreeMap<&str, usize> = BTreeMap::new();
    for (id, name) in wanted {
        *times.entry(id).or_default() += 1;
        if let Some(name) = name.as_ref().filter(|name| *name != id) {
            *times.entry(name).or_default() += 1;
        }
    }
    let unique = |name: &&String| !name.is_empty() && times.get(name.as_str()) == Some(&1);
    let name =
        |(id, name): &(String, Option<String>)| name.as_ref().filter(unique).unwrap_or(id).clone();
    wanted.iter().map(name).collect()
}

#[cfg(test)]
mod tests;
