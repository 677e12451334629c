//! The tables themselves. This file owns what is printed, and how ours is held beside it.

use super::{scene, spread};
use crate::Failure;
use crate::commands::experiment::table::{Cell, Row, Table};
use agents::navigation::navigator::Config;
use agents::navigation::target::Target;
use nalgebra::Point2;
use scenarios::metrics::{measure, object_spaces};
use scenarios::trial::{Method, Trial};

/// The part of a printed length within which ours counts as the same.
const LENGTH: f64 = 0.03;
/// Of other figures of movement: the printed scenes are known by their pictures only.
const FOLLOWS: f64 = 0.15;
/// A share of time, percent, that counts as the same.
const SHARE: f64 = 2.0;

/// One column of a table.
struct Way {
    title: &'static str,
    social: bool,
    /// The activities that there are.
    activities: &'static [&'static str],
    /// From when on the robot knows of them, s.
    agenda_from: f64,
}

/// A scene, the ways through it, and what is printed of them in the order of [`figures`].
struct Printed {
    name: &'static str,
    text: &'static str,
    goal: (f64, f64),
    people: &'static [&'static str],
    /// The last is the one without social behaviour.
    ways: Vec<Way>,
    movement: [(&'static str, &'static [f64]); 3],
    distances: &'static [&'static [f64]],
    shares: [&'static [f64]; 5],
    notes: Vec<&'static str>,
}

const SHARES: [&str; 5] = [
    "Psi (Intimate), %",
    "Psi (Personal), %",
    "Psi (Social), %",
    "Psi (Public), %",
    "Psi (Objects), %",
];
const SCENE: &str = "TD prints the scene as a picture without measures: only the way without social \
behaviour is set to its length";
const PACE: &str =
    "Ours drives at up to 0.3 m/s, the authors' limit; TD does not say how fast its robot went";
const CHC: &str =
    "READING.md 15: the papers filter what they sum; ours is over steps of 0.2 m, unfiltered";
const ZONES: &str = "READING.md 16: ours counts each moment once, in the closest of nested zones; \
the printed shares cannot come from nested zones";
const EVERY: &str = "Of every seed; printed where TD says so or must mean it";
const EDGES: &str =
    "Of every seed, where it can be kept out of them: control cuts curves by a few centimetres";
const OBJECTS: &str = "Ours counts the spaces of objects in use; TD counts those not in use, too";

/// What one drive came to: arrived, then every figure in the order of the rows.
fn figures(printed: &Printed, way: &Way, seed: u64) -> Result<(bool, u64, Vec<f64>), Failure> {
    let mut scenario = scene(printed.name, printed.text)?;
    scenario
        .activities
        .retain(|activity| way.activities.contains(&activity.name.as_str()));
    let trial = Trial {
        scenario: &scenario,
        seed,
        tracks: None,
        unmapped: &[],
        method: Method::Navigation,
        social: way.social,
        targets: vec![Target::Point(Point2::new(printed.goal.0, printed.goal.1))],
        navigation: Config::default(),
        agenda_from: way.agenda_from,
    };
    let drive = trial.drive().map_err(Failure::internal)?;
    let spaces = object_spaces(&scenario, &scenario.social).map_err(Failure::internal)?;
    let metrics = measure(&drive.samples, scenario.robot.radius, &spaces);
    let (Some(robot), Some(psi)) = (metrics.robot, metrics.psi) else {
        return Err(Failure::internal("a drive of no time"));
    };
    let mut figures = vec![robot.path_length, robot.duration, robot.chc];
    for name in printed.people {
        let person = metrics.people.iter().find(|person| person.name == *name);
        figures.push(person.map_or(f64::NAN, |person| person.min_distance));
    }
    figures.extend([
        psi.intimate,
        psi.personal,
        psi.social,
        psi.public,
        psi.objects,
    ]);
    Ok((drive.arrived, drive.plans, figures))
}

/// All drives of one column: how many arrived, paths taken up on average, figures by row.
struct Column {
    arrived: usize,
    plans: f64,
    figures: Vec<Vec<f64>>,
}

fn column(printed: &Printed, way: &Way, seeds: u64) -> Result<Column, Failure> {
    let mut column = Column {
        arrived: 0,
        plans: 0.0,
        figures: Vec::new(),
    };
    for seed in 1..=seeds {
        let (arrived, plans, figures) = figures(printed, way, seed)?;
        column.arrived += usize::from(arrived);
        column.plans += plans as f64 / seeds as f64;
        column.figures.resize(figures.len(), Vec::new());
        for (all, one) in column.figures.iter_mut().zip(figures) {
            all.push(one);
        }
    }
    Ok(column)
}

fn table(printed: &Printed, seeds: u64) -> Result<Table, Failure> {
    let mut columns = Vec::new();
    for way in &printed.ways {
        columns.push(column(printed, way, seeds)?);
    }
    let cells = |row: usize, figures: &[f64], tolerance: &dyn Fn(usize, f64) -> f64| {
        let cell = |at: usize| {
            let (mean, deviation) = spread(&columns[at].figures[row]);
            Cell::numbers(mean, figures[at], tolerance(at, figures[at])).deviating(deviation)
        };
        (0..columns.len()).map(cell).collect()
    };
    let mut rows = Vec::new();
    let mut at = 0;
    let mut push = |label: String, figures: &[f64], tolerance: &dyn Fn(usize, f64) -> f64, note| {
        rows.push(Row {
            label,
            cells: cells(at, figures, tolerance),
            note: Some(note),
        });
        at += 1;
    };
    let notes = [SCENE, PACE, CHC];
    for ((label, figures), note) in printed.movement.iter().zip(notes) {
        let share = |way: usize| {
            if way + 1 == printed.ways.len() && *label == "d_t, m" {
                LENGTH
            } else {
                FOLLOWS
            }
        };
        push(
            (*label).to_owned(),
            figures,
            &|way, printed| printed * share(way),
            note,
        );
    }
    for (name, figures) in printed.people.iter().zip(printed.distances) {
        let label = format!("d_min {name}, m");
        push(label, figures, &|_, printed| printed * FOLLOWS, SCENE);
    }
    for (label, figures) in SHARES.iter().zip(&printed.shares) {
        let note = if label.contains("Objects") {
            OBJECTS
        } else {
            ZONES
        };
        push((*label).to_owned(), figures, &|_, _| SHARE, note);
    }
    rows.extend(claims(printed, &columns, seeds));
    Ok(Table {
        columns: printed.ways.iter().map(|way| way.title).collect(),
        rows,
        notes: printed.notes.clone(),
    })
}

/// What TD says of its ways, as far as it holds of ours. The last column is the one without social
/// behaviour, of which nothing is claimed.
fn claims(printed: &Printed, columns: &[Column], seeds: u64) -> Vec<Row> {
    let first_share = 3 + printed.people.len();
    let greatest =
        |column: &Column, row: usize| column.figures[row].iter().copied().fold(0.0, f64::max);
    let plain = columns
        .last()
        .map_or(f64::INFINITY, |column| spread(&column.figures[0]).0);
    let row = |label: &str, holds: &dyn Fn(&Column) -> bool, claimed: &dyn Fn(&Way) -> bool| Row {
        label: label.to_owned(),
        cells: columns
            .iter()
            .zip(&printed.ways)
            .map(|(column, way)| {
                let ours = if holds(column) { "yes" } else { "no" };
                if claimed(way) {
                    Cell::texts(ours, "yes")
                } else {
                    Cell::text(ours)
                }
            })
            .collect(),
        note: Some(if label.contains("in use") {
            EDGES
        } else {
            EVERY
        }),
    };
    vec![
        row("arrives", &|column| column.arrived as u64 == seeds, &|_| {
            true
        }),
        row(
            "never in intimate space",
            &|column| greatest(column, first_share) <= 0.0,
            &|way| way.social,
        ),
        row(
            "under 5 % of the time in spaces in use",
            &|column| greatest(column, first_share + 4) < 5.0,
            &|way| way.social && way.agenda_from.is_finite(),
        ),
        row(
            "takes another way midway",
            &|column| column.plans > 1.5,
            &|way| way.agenda_from.is_finite() && way.agenda_from > 0.0,
        ),
        row(
            "at most 1.5 times as long as without",
            &|column| greatest(column, 0) <= 1.5 * plain,
            &|way| way.social && printed.name != "td-table4",
        ),
    ]
}

/// TD Table 1: a table and a television, in use or not.
pub(in super::super) fn table1(seeds: u64) -> Result<Table, Failure> {
    let way = |title, social, activities| Way {
        title,
        social,
        activities,
        agenda_from: 0.0,
    };
    let printed = Printed {
        name: "td-table1",
        text: include_str!("scenes/table1.toml"),
        goal: (13.77, 4.2),
        people: &["senior_1", "senior_2"],
        ways: vec![
            way("Path 1", true, &["handicraft"]),
            way("Path 2", true, &["handicraft", "gymnastics"]),
            way("Non social", false, &["handicraft", "gymnastics"]),
        ],
        movement: [
            ("d_t, m", &[14.03, 17.40, 12.81]),
            ("tau, s", &[101.79, 124.24, 97.21]),
            ("CHC, rad", &[0.47, 1.75, 2.12]),
        ],
        distances: &[&[1.39, 1.89, 0.51], &[2.14, 1.13, 2.11]],
        shares: [
            &[0.0, 0.0, 4.21],
            &[0.0, 11.0, 0.0],
            &[0.0, 8.0, 12.44],
            &[100.0, 81.0, 83.35],
            &[34.98, 1.64, 4.62],
        ],
        notes: vec![
            "Mean, and in brackets the standard deviation, over seeds of the noise of laser and localisation.\n\
             Path 1: therapy at the table only. Path 2: also at the television.",
        ],
    };
    table(&printed, seeds)
}

/// TD Table 2: the agenda changes while the robot is on its way.
pub(in super::super) fn table2(seeds: u64) -> Result<Table, Failure> {
    let way = |title, social, agenda_from| Way {
        title,
        social,
        activities: &["handicraft", "gymnastics"],
        agenda_from,
    };
    let printed = Printed {
        name: "td-table2",
        text: include_str!("scenes/table2.toml"),
        goal: (11.9, 3.2),
        people: &["therapist", "senior_1", "senior_2", "senior_3"],
        ways: vec![
            way("Path 1", true, f64::INFINITY),
            way("Path 2", true, 8.0),
            way("Non social", false, f64::INFINITY),
        ],
        movement: [
            ("d_t, m", &[11.30, 16.28, 10.92]),
            ("tau, s", &[52.5, 63.1, 51.1]),
            ("CHC, rad", &[9.28, 3.5, 12.12]),
        ],
        distances: &[
            &[3.16, 5.17, 3.11],
            &[2.70, 2.88, 2.65],
            &[1.82, 3.41, 1.42],
            &[1.58, 2.10, 1.65],
        ],
        shares: [
            &[0.0, 0.0, 0.0],
            &[0.0, 0.0, 0.0],
            &[16.47, 0.0, 18.03],
            &[83.53, 100.0, 81.97],
            &[69.85, 0.0, 73.22],
        ],
        notes: vec![
            "Mean, and in brackets the standard deviation, over seeds of the noise of laser and localisation.\n\
             Path 1: the robot knows of no agenda. Path 2: it learns of it after 8 s.",
        ],
    };
    table(&printed, seeds)
}

/// TD Table 4: a television that a therapist uses, as TD tried it in a laboratory.
pub(in super::super) fn table4(seeds: u64) -> Result<Table, Failure> {
    let way = |title, social| Way {
        title,
        social,
        activities: &["gymnastics"],
        agenda_from: 0.0,
    };
    let printed = Printed {
        name: "td-table4",
        text: include_str!("scenes/table4.toml"),
        goal: (6.55, 5.8),
        people: &["therapist", "participant_1"],
        ways: vec![way("Path", true), way("Non social", false)],
        movement: [
            ("d_t, m", &[7.2, 4.1]),
            ("tau, s", &[58.5, 22.1]),
            ("CHC, rad", &[8.1, 7.2]),
        ],
        distances: &[&[0.9, 0.8], &[1.1, 1.5]],
        shares: [
            &[0.0, 0.0],
            &[24.2, 8.1],
            &[10.2, 11.3],
            &[55.6, 81.6],
            &[0.0, 35.2],
        ],
        notes: vec![
            "Mean, and in brackets the standard deviation, over seeds of the noise of laser and localisation. The\n\
             printed shares of zones sum to 90 and 101 (READING.md 16). Printed objects: the television alone.",
        ],
    };
    table(&printed, seeds)
}
