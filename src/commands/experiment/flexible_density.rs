//! Paper FD's Tables I to V: how personal space gives way to walls, and whether the robot passes.

use super::table::{Cell, Row, Table};
use crate::Failure;
use agents::social_mapping::adaptation::{Passage, WallAdaptation};

/// FD prints two decimals, and its own rounding and fit take a little more.
const TOLERANCE: f64 = 0.02;
const NO_WALL: f64 = f64::INFINITY;

/// A row of Tables I to III: the wall's distance; what is printed of `d'`, the inverse width and both
/// verdicts; why ours differs.
struct Printed {
    distance: f64,
    room: f64,
    width: f64,
    before: bool,
    after: bool,
    note: Option<&'static str>,
}

const fn printed(distance: f64, room: f64, width: f64, before: bool, after: bool) -> Printed {
    Printed {
        distance,
        room,
        width,
        before,
        after,
        note: None,
    }
}

const fn noted(
    (distance, room, width): (f64, f64, f64),
    before: bool,
    after: bool,
    note: &'static str,
) -> Printed {
    Printed {
        distance,
        room,
        width,
        before,
        after,
        note: Some(note),
    }
}

const UNADAPTED: &str = "READING.md 3: rows that are not adapted print d_max as d' and the width of an unhindered person";
const UNITS: &str = "Widths are FD's inverse widths, 1/m: as a standard deviation a width w is 1/w m \
(READING.md 3).\nsigma(d') = 1.2 d'^-0.976 with d' = d_s - 0.05 and d_s = d - 0.8.";

/// Front, left, rear, right.
#[derive(Clone, Copy)]
enum Side {
    Front = 0,
    Left = 1,
    Rear = 2,
}

fn yes(answer: bool) -> &'static str {
    if answer { "yes" } else { "no" }
}

/// One side of the unhindered person, as FD's inverse width.
fn unhindered(side: Side) -> f64 {
    match side {
        Side::Front => 1.0,
        Side::Left => 4.0 / 3.0,
        Side::Rear => 2.0,
    }
}

fn one_wall(side: Side, rows: &[Printed]) -> Table {
    let law = WallAdaptation::default();
    let rows = rows.iter().map(|row| {
        let mut distances = [NO_WALL; 4];
        distances[side as usize] = row.distance;
        let passage = law.passages(distances)[side as usize];
        let (room, width) = match passage {
            Passage::Adapted {
                room,
                inverse_width,
            } => (
                Cell::numbers(room, row.room, 1e-9),
                Cell::numbers(inverse_width, row.width, TOLERANCE),
            ),
            Passage::Free | Passage::Blocked => (
                Cell::texts("-", format!("{:.2}", row.room)),
                Cell::numbers(unhindered(side), row.width, TOLERANCE),
            ),
        };
        let before = passage == Passage::Free;
        Row {
            label: format!("d = {:.2} m", row.distance),
            cells: vec![
                Cell::number(row.distance - law.clearance),
                Cell::texts(yes(before), yes(row.before)),
                room,
                width,
                Cell::texts(yes(passage.is_passable()), yes(row.after)),
            ],
            note: row.note,
        }
    });
    Table {
        columns: vec![
            "d_s",
            "passes, rigid",
            "d'",
            "inverse width",
            "passes, adapted",
        ],
        rows: rows.collect(),
        notes: vec![UNITS],
    }
}

#[allow(
    clippy::unnecessary_wraps,
    reason = "one kind of function for all experiments"
)]
pub(super) fn table1() -> Result<Table, Failure> {
    let rows = [
        noted((2.5, 1.3, 1.0), true, true, UNADAPTED),
        noted(
            (2.05, 1.2, 1.05),
            false,
            true,
            "READING.md 3: the printed width does not follow from the paper's law, which gives 1.00",
        ),
        printed(1.95, 1.1, 1.10, false, true),
        printed(1.85, 1.0, 1.21, false, true),
        printed(1.75, 0.9, 1.34, false, true),
        printed(1.65, 0.8, 1.50, false, true),
        printed(1.55, 0.7, 1.71, false, true),
        printed(1.45, 0.6, 1.99, false, true),
        noted((1.35, 1.3, 1.0), false, false, UNADAPTED),
    ];
    Ok(one_wall(Side::Front, &rows))
}

#[allow(
    clippy::unnecessary_wraps,
    reason = "one kind of function for all experiments"
)]
pub(super) fn table2() -> Result<Table, Failure> {
    let rows = [
        noted((1.9, 1.0, 1.33), true, true, UNADAPTED),
        noted(
            (1.8, 0.95, 1.05),
            false,
            true,
            "READING.md 3: the printed width is wrong; the paper's law gives 1.26",
        ),
        printed(1.7, 0.85, 1.41, false, true),
        printed(1.6, 0.75, 1.60, false, true),
        printed(1.5, 0.65, 1.84, false, true),
        printed(1.4, 0.55, 2.16, false, true),
        noted((1.3, 1.0, 1.33), false, false, UNADAPTED),
    ];
    let mut table = one_wall(Side::Left, &rows);
    table.notes.push(
        "d_min and d_max of Tables II and III are exchanged in print: sides .5/1.0, rear .3/.6 \
         (READING.md 3).\nThe printed d_s of rows 3 to 6 is .85 throughout; d - d_r is meant.",
    );
    Ok(table)
}

#[allow(
    clippy::unnecessary_wraps,
    reason = "one kind of function for all experiments"
)]
pub(super) fn table3() -> Result<Table, Failure> {
    let rows = [
        noted(
            (1.5, 0.85, 1.0),
            true,
            true,
            "READING.md 3: not adapted; the width of an unhindered person to the rear is 2, as the last row has it",
        ),
        noted(
            (1.4, 0.55, 1.05),
            false,
            true,
            "READING.md 3: the printed width is wrong; the paper's law gives 2.15",
        ),
        printed(1.3, 0.45, 2.63, false, true),
        printed(1.2, 0.35, 3.36, false, true),
        noted((1.1, 0.6, 2.0), false, false, UNADAPTED),
    ];
    Ok(one_wall(Side::Rear, &rows))
}

/// A person of Tables IV and V: distances to walls as the paper numbers them (1 behind, 2 and 4 to the
/// sides, 3 ahead), printed verdicts before and after, and printed widths ahead, behind, to the sides.
struct Person {
    name: &'static str,
    distances: [f64; 4],
    before: [bool; 4],
    after: [bool; 4],
    widths: [f64; 3],
    note: Option<&'static str>,
}

fn people(people: &[Person]) -> Table {
    let law = WallAdaptation::default();
    let rows = people.iter().map(|person| {
        let [rear, right, front, left] = person.distances;
        let [in_front, to_left, behind, to_right] = law.passages([front, left, rear, right]);
        let order = [behind, to_right, in_front, to_left];
        let width = |sides: &[Passage], side: Side| {
            sides
                .iter()
                .filter_map(|passage| match passage {
                    Passage::Adapted { inverse_width, .. } => Some(*inverse_width),
                    Passage::Free | Passage::Blocked => None,
                })
                .fold(unhindered(side), f64::max)
        };
        let ours = [
            width(&[in_front], Side::Front),
            width(&[behind], Side::Rear),
            width(&[to_left, to_right], Side::Left),
        ];
        let verdicts = |answers: [bool; 4]| answers.map(yes).join(" ");
        let widths = ours.into_iter().zip(person.widths);
        let mut cells = vec![
            Cell::texts(
                verdicts(order.map(|passage| passage == Passage::Free)),
                verdicts(person.before),
            ),
            Cell::texts(
                verdicts(order.map(Passage::is_passable)),
                verdicts(person.after),
            ),
        ];
        cells.extend(widths.map(|(ours, printed)| Cell::numbers(ours, printed, TOLERANCE)));
        Row {
            label: person.name.to_owned(),
            cells,
            note: person.note,
        }
    });
    Table {
        columns: vec![
            "passes d1..d4, rigid",
            "passes d1..d4, adapted",
            "width ahead",
            "width behind",
            "width to the sides",
        ],
        rows: rows.collect(),
        notes: vec![
            UNITS,
            "d1 is the distance to the wall behind, d3 ahead, d2 and d4 to the sides; where the paper prints *, there is no wall.",
        ],
    }
}

#[allow(
    clippy::unnecessary_wraps,
    reason = "one kind of function for all experiments"
)]
pub(super) fn table4() -> Result<Table, Failure> {
    Ok(people(&[
        Person {
            name: "first",
            distances: [1.5, 1.0, 1.5, NO_WALL],
            before: [true, false, false, true],
            after: [true, false, true, true],
            widths: [1.84, 2.0, 1.33],
            note: None,
        },
        Person {
            name: "second",
            distances: [5.5, 1.1, NO_WALL, 1.4],
            before: [true, false, true, false],
            after: [true, false, true, true],
            widths: [1.0, 2.0, 2.16],
            note: None,
        },
        Person {
            name: "third",
            distances: [5.5, 1.1, NO_WALL, 2.4],
            before: [true, false, true, true],
            after: [true, false, true, true],
            widths: [1.0, 2.0, 1.33],
            note: None,
        },
    ]))
}

#[allow(
    clippy::unnecessary_wraps,
    reason = "one kind of function for all experiments"
)]
pub(super) fn table5() -> Result<Table, Failure> {
    Ok(people(&[
        Person {
            name: "first",
            distances: [NO_WALL, 1.41, 1.73, 1.41],
            before: [true, false, false, false],
            after: [true, true, true, true],
            widths: [1.36, 2.0, 2.1],
            note: None,
        },
        Person {
            name: "second",
            distances: [1.5, 1.35, 2.89, 0.38],
            before: [true, false, true, false],
            after: [true, true, true, false],
            widths: [1.0, 2.0, 2.3],
            note: Some(
                "READING.md 3: the paper's law gives 2.36 for its d2 of 1.35 m; 2.3 is that of 1.36 m, \
                 printed to one place",
            ),
        },
        Person {
            name: "third",
            distances: [2.16, 4.87, 3.25, 1.62],
            before: [true, true, true, false],
            after: [true, true, true, true],
            widths: [1.0, 2.0, 1.55],
            note: None,
        },
    ]))
}
