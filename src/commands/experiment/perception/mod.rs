//! The agents that perceive, held against the truth: people seen through four cameras that err, by the
//! human observer and by the SORT-style tracker that it has as an option; and things in a home, as object
//! recognition remembers them. This module owns the conditions of the experiment, and guarantees that both
//! trackers get the same frames.

mod home;

use super::drives::{scene, spread};
use super::table::{Cell, Row, Table};
use crate::Failure;
use agents::human_observer::{Association, Config, Observer, Surroundings};
use nalgebra::{Isometry2, Point2, Vector2};
use scenarios::metrics::{TrackingFigures, TrackingScore};
use scenarios::{Inputs, Scenario, Tracks, World};
use serde_json::Value;
use std::path::Path;
use std::time::Instant;

const SQUARE: &str = include_str!("square.toml");
/// From one moment to the next, s: as often as the cameras look.
const PERIOD: f64 = 0.1;
/// The square reaches this far beyond everywhere that somebody was recorded, m.
const MARGIN: f64 = 1.0;
/// The figures of a tracker, in the order of the columns.
const COLUMNS: [&str; 7] = [
    "mota",
    "idf1",
    "id_switches",
    "position_rmse",
    "heading_error",
    "latency_p99",
    "right_place",
];
const NOTES: [&str; 4] = [
    "Four cameras in the corners, each with 0.1 m of noise, 10 % misses, 1 false detection a second, 10 images a \
second. Everybody who is there counts, at every moment, also who is hidden from all cameras.",
    "mota, id_switches: CLEAR-MOT; idf1: identities over the whole recording; both within 0.5 m. position_rmse in m, \
heading_error (mean) in rad, latency_p99 in s: from the frames of a moment to the people, 99 % of the moments.",
    "The second row is the agent's option `association = \"nearest\"`, after SORT. Figures are means over the seeds.",
    "right_place: of a hundred questions where one of six things is, in a home in which they are carried about unseen, how \
many got the right answer: from the place that object recognition ranks first, from where it saw the thing last, and from \
somebody who knows by what law things are carried about and whose looks never err, which nobody can surpass.",
];

/// What a recording or the square came to, as one tracker saw it.
struct Watched {
    figures: TrackingFigures,
    latency_p99: f64,
}

/// How the experiment is called.
pub(super) const NAME: &str = "perception";

/// The experiment with so many seeds, on a recording or on the square with simulated people.
pub(super) fn perception(seeds: u64, recording: Option<&Path>) -> Result<Table, Failure> {
    let mut square = scene("square", SQUARE)?;
    let tracks = match recording {
        Some(path) => Some(Tracks::load(path).map_err(|error| Failure::Input(error.into()))?),
        None => None,
    };
    if let Some(tracks) = &tracks {
        let [left, bottom, right, top] = tracks.extent();
        square.bounds = [left - MARGIN, bottom - MARGIN, right + MARGIN, top + MARGIN];
        square.tracks.translation = Some(Vector2::zeros());
        square.duration = tracks.duration();
    }
    aim(&mut square);
    let trackers = [
        ("human observer", Association::Evidence),
        ("SORT-style", Association::Nearest),
    ];
    let rows = trackers.map(|(label, association)| {
        let watched: Vec<Watched> = (1..=seeds)
            .filter_map(|seed| watch(&square, tracks.as_ref(), seed, association))
            .collect();
        let mean = |figure: fn(&Watched) -> f64| {
            let values: Vec<f64> = watched.iter().map(figure).collect();
            Cell::fine(spread(&values).0)
        };
        let cells = [
            mean(|w| w.figures.mota),
            mean(|w| w.figures.idf1),
            mean(|w| w.figures.id_switches as f64),
            mean(|w| w.figures.position_rmse),
            mean(|w| w.figures.heading_error),
            mean(|w| w.latency_p99),
            Cell::nothing(),
        ];
        Row {
            label: label.to_owned(),
            cells: cells.into(),
            note: None,
        }
    });
    let mut rows = Vec::from(rows);
    for home in [home::TIDY, home::BUSY] {
        let lives: Vec<home::Right> = (1..=seeds).map(|seed| home::live(&home, seed)).collect();
        let answers = ["ranked first", "seen last", "law known"];
        rows.extend(answers.into_iter().enumerate().map(|(index, answer)| {
            let values: Vec<f64> = lives.iter().map(|right| right.shares()[index]).collect();
            let mut cells = vec![Cell::nothing(); COLUMNS.len() - 1];
            cells.push(Cell::number(spread(&values).0));
            Row {
                label: format!("{}: {answer}", home.name),
                cells,
                note: None,
            }
        }));
    }
    Ok(Table {
        columns: COLUMNS.into(),
        rows,
        notes: NOTES.into(),
    })
}

/// Puts the figures of our agents, the first and the third row, beside the table.
pub(super) fn put_on_top(json: &mut Value) {
    for row in [0, 2] {
        let values = json["rows"][row]["values"].clone();
        if let (Some(table), Value::Object(values)) = (json.as_object_mut(), values) {
            table.extend(values.into_iter().filter(|(_, value)| !value.is_null()));
        }
    }
}

/// Puts the cameras into the corners of the square, each looking at its middle.
fn aim(square: &mut Scenario) {
    let [left, bottom, right, top] = square.bounds;
    let middle = Point2::new(f64::midpoint(left, right), f64::midpoint(bottom, top));
    let corners = [(left, bottom), (right, bottom), (right, top), (left, top)];
    let diagonal = (right - left).hypot(top - bottom);
    for (camera, (x, y)) in square.cameras.iter_mut().zip(corners) {
        let to_middle = middle - Point2::new(x, y);
        camera.pose = Isometry2::new([x, y].into(), to_middle.y.atan2(to_middle.x));
        camera.range = diagonal;
        // The further of the two sides is less than a right angle from the middle.
        camera.field_of_view =
            2.0 * (to_middle.x.abs().max(to_middle.y.abs()) / (diagonal / 2.0)).asin() + 0.02;
    }
}

/// One tracker on all that the cameras show; `None` where nobody ever came.
#[allow(
    clippy::disallowed_methods,
    reason = "measuring takes the host's clock"
)]
fn watch(
    square: &Scenario,
    tracks: Option<&Tracks>,
    seed: u64,
    association: Association,
) -> Option<Watched> {
    let mut world = World::new(square, seed, tracks.cloned());
    let mut config = Config::default();
    config.tracking.association = association;
    let mut observer = Observer::new(config);
    let mut score = TrackingScore::default();
    let mut latencies = Vec::new();
    for _ in 0..(square.duration / PERIOD) as usize {
        let outputs = world.step(PERIOD, &Inputs::default());
        let began = Instant::now();
        let seen = observer.observe(world.time(), &outputs.frames, &Surroundings::default());
        latencies.push(began.elapsed().as_secs_f64());
        score.add(
            outputs.truth.people.iter().map(|body| {
                let pose = Isometry2::new(body.position.coords, body.heading);
                (body.name.as_str(), pose)
            }),
            seen.people.iter().map(|person| (person.id, person.pose)),
        );
    }
    latencies.sort_by(f64::total_cmp);
    Some(Watched {
        figures: score.figures()?,
        latency_p99: latencies.get(latencies.len() * 99 / 100).copied()?,
    })
}
