//! Paper TG's Figs 11, 12 and 15: groups by triangulation, and the space of a group. The figures
//! print neither places nor widths; the arrangements here are ours, made to be what the text
//! says each figure shows.

use super::table::{Cell, Row, Table};
use crate::Failure;
use agents::social_mapping::FourSided;
use agents::social_mapping::features::{Feature, Features, Influence};
use agents::social_mapping::groups::{GroupEntity, Grouping, Method, Triangulation};
use nalgebra::{Isometry2, Vector2};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

fn at(x: f64, y: f64, heading: f64) -> Isometry2<f64> {
    Isometry2::new(Vector2::new(x, y), heading)
}

/// The groups of people, counted from 1 as in the figures.
fn strict(people: &[Isometry2<f64>], longest_side: f64, vector: f64) -> Result<String, Failure> {
    let rules = Triangulation {
        longest_side,
        vector,
    };
    let grouping = Grouping {
        triangulation_strict: rules,
        ..Grouping::of(Method::TriangulationStrict)
    };
    let groups = grouping.groups(people).map_err(Failure::internal)?;
    let one = |group: &Vec<usize>| {
        let names: Vec<String> = group.iter().map(|i| (i + 1).to_string()).collect();
        format!("{{{}}}", names.join(" "))
    };
    Ok(groups.iter().map(one).collect::<Vec<_>>().join(" "))
}

/// Ten people in the unit square, in two bunches of which one is looser.
fn ten() -> Vec<Isometry2<f64>> {
    [
        (0.10, 0.10),
        (0.30, 0.12),
        (0.18, 0.32),
        (0.38, 0.35),
        (0.05, 0.40),
        (0.62, 0.95),
        (0.95, 0.90),
        (0.80, 0.62),
        (0.98, 0.55),
        (0.60, 0.70),
    ]
    .map(|(x, y)| at(x, y, 0.0))
    .to_vec()
}

/// Three who face their middle, and a fourth beside them who looks there or away.
fn four(last: f64) -> Vec<Isometry2<f64>> {
    let mut people: Vec<_> = (0..3)
        .map(|i| {
            let angle = TAU * f64::from(i) / 3.0;
            at(0.7 * angle.cos(), 0.7 * angle.sin(), angle + PI)
        })
        .collect();
    people.push(at(-0.9, 0.0, last));
    people
}

/// The two rows of one figure of the paper.
fn row(label: &str, ours: String, says: &str, note: Option<&'static str>) -> Row {
    Row {
        label: label.to_owned(),
        cells: vec![Cell::text(ours), Cell::text(says)],
        note,
    }
}

pub(super) fn groups() -> Result<Table, Failure> {
    let mut rows = vec![
        row(
            "11b, d_max .40",
            strict(&ten(), 0.40, 0.0)?,
            "two groups, A and B",
            None,
        ),
        row(
            "11c, d_max .32",
            strict(&ten(), 0.32, 0.0)?,
            "other groups, for a smaller distance",
            None,
        ),
        row(
            "12a, person 4 looks away",
            strict(&four(PI), 2.0, 0.4)?,
            "not part of the group",
            None,
        ),
        row(
            "12b, person 4 looks there",
            strict(&four(0.0), 2.0, 0.4)?,
            "a member of the group",
            None,
        ),
        row(
            "two face to face",
            strict(&[at(0.0, 0.0, 0.0), at(0.8, 0.0, PI)], 2.0, 0.4)?,
            "(not in the paper)",
            Some("READING.md 19: three are the least; `facing` is the default method"),
        ),
    ];
    let feature = Feature {
        influence: Influence {
            front: 0.6,
            left: 0.4,
            rear: 0.3,
            right: 0.4,
        },
        ..Feature::default()
    };
    let features = Features {
        known: BTreeMap::from([("emotional_state".to_owned(), feature)]),
        ..Features::default()
    };
    let group = [
        at(0.0, 0.6, -FRAC_PI_2),
        at(0.8, 0.0, FRAC_PI_2),
        at(-0.8, 0.0, FRAC_PI_2),
    ];
    for (mood, value) in [
        ("sad", 0.56),
        ("neutral", 0.7),
        ("disgusted", 0.28),
        ("happy", 0.98),
    ] {
        let values = BTreeMap::from([("emotional_state".to_owned(), value)]);
        let entity = GroupEntity::new(&group)
            .ok_or_else(|| Failure::internal("a group of three has no place"))?;
        let widths = features.apply(entity.widths(&FourSided::HALL), &values);
        let sides = widths.sides().map(|side| format!("{side:.2}"));
        rows.push(row(
            &format!("15, {mood} group"),
            sides.join(" "),
            "the happier, the smaller",
            None,
        ));
    }
    Ok(Table {
        columns: vec!["ours", "the paper says"],
        rows,
        notes: vec![
            "The figures print no coordinates: the arrangements are ours. Fig. 15 has widths ahead, left, behind and \
             right of one group of three in metres, with the figure's influences (.6 .4 .3 .4, preset positive_is_closer).",
            "Where members face each other and no mean heading exists, a group faces its first member (READING.md 20).",
        ],
    })
}
