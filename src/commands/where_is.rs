//! `cortex where`: the places at which an object may be, the likeliest first.

use super::graph::{Source, no_such};
use super::output::{Table, bold, print, print_json, tell};
use crate::cli::Where as Arguments;
use crate::{Answer, Failure};
use agents::object_recognition::{Whereabouts, whereabouts};
use serde_json::json;

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let snapshot = Source::open(&arguments.source)?.snapshot()?;
    let name = &arguments.name;
    let found = whereabouts(&snapshot, name).map_err(Failure::internal)?;
    let Some(places) = found else {
        return Err(no_such(&snapshot, name, "node or type"));
    };
    let now = snapshot.time().seconds();
    if arguments.source.json {
        let rows = places.iter().map(row);
        print_json(&json!({
            "name": name, "time": now, "places": rows.collect::<Vec<_>>(),
        }))?;
    } else if places.is_empty() {
        tell(&format!("nobody knows where {name} is\n"));
    } else {
        print(&table(&places, now))?;
    }
    Ok(if places.is_empty() {
        Answer::No
    } else {
        Answer::Yes
    })
}

fn row(found: &Whereabouts) -> serde_json::Value {
    let place = &found.place;
    let at = place.pose.translation.vector;
    json!({
        "object": found.object,
        "room": found.room,
        "x": at.x,
        "y": at.y,
        "heading": place.pose.rotation.angle(),
        "probability": place.probability,
        "visits": place.visits,
        "last_seen": place.last_seen.seconds(),
    })
}

fn table(places: &[Whereabouts], now: f64) -> String {
    let mut table = Table::new(&["object", "probability", "room", "place", "last seen there"]);
    for found in places {
        let at = found.place.pose.translation.vector;
        let ago = now - found.place.last_seen.seconds();
        table.row([
            bold(&found.object),
            format!("{:.2}", found.place.probability),
            found.room.clone().unwrap_or_default(),
            format!("({:.2}, {:.2}) m", at.x, at.y),
            format!("{ago:.0} s ago"),
        ]);
    }
    table.to_string()
}
