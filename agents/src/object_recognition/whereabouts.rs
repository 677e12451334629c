//! What the graph answers to the question where something is. Guarantees that places come with the
//! likeliest first.

use super::Place;
use super::graph::{object_nodes, places};
use crate::perception::graph::{floor_plan, number};
use dsr::{ReadError, Snapshot, Time};
use nalgebra::Point2;
use std::collections::BTreeMap;

/// A thing and a place at which it may be.
#[derive(Debug, Clone, PartialEq)]
pub struct Whereabouts {
    /// The thing's name.
    pub object: String,
    /// The place, and how likely it is that the thing is there.
    pub place: Place,
    /// The room that the place is in, where there is one.
    pub room: Option<String>,
}

/// Where the thing called `what` may be, or where there is none all things of the class `what`;
/// `None` where there are neither. A thing that nobody keeps places of is where its pose says, as
/// surely as its `confidence` says (1 where it has none).
///
/// # Errors
/// [`ReadError`].
pub fn whereabouts(snapshot: &Snapshot, what: &str) -> Result<Option<Vec<Whereabouts>>, ReadError> {
    let mut meant = BTreeMap::new();
    if let Some(node) = snapshot.find_node_by_name(what)? {
        meant.insert(node.name()?, node);
    } else {
        for node in snapshot.nodes_of(what) {
            let node = node?;
            meant.insert(node.name()?, node);
        }
        // An object of a class that the schema does not know is called by it all the same.
        meant.extend(object_nodes(snapshot)?.into_iter().filter(|(name, _)| {
            let numbered = name
                .strip_prefix(what)
                .and_then(|rest| rest.strip_prefix('_'));
            numbered.is_some_and(|number| number.parse::<u64>().is_ok())
        }));
    }
    if meant.is_empty() {
        return Ok(None);
    }
    let plan = floor_plan(snapshot)?;
    let mut found = Vec::new();
    for (object, node) in meant {
        let mut known = places(&node)?;
        if let Some(pose) = snapshot.world_from(node.id())?
            && known.is_empty()
        {
            known.push(Place {
                pose,
                probability: number(&node, "confidence")?.unwrap_or(1.0),
                visits: 0,
                last_seen: number(&node, "last_seen")?
                    .map_or_else(Time::default, Time::from_seconds),
            });
        }
        found.extend(known.into_iter().map(|place| {
            Whereabouts {
                object: object.clone(),
                room: plan
                    .room_at(Point2::from(place.pose.translation.vector))
                    .map(str::to_owned),
                place,
            }
        }));
    }
    found.sort_by(|a, b| {
        let by_probability = b.place.probability.total_cmp(&a.place.probability);
        by_probability.then_with(|| a.object.cmp(&b.object))
    });
    Ok(Some(found))
}
