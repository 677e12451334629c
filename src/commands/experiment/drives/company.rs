//! Paper AP's collaborative tasks: approaching somebody from ahead (Table 1) and escorting somebody
//! through a door (Fig. 9), with and without its cooperation zones. This file owns how a moment of them is
//! judged.

use super::{scene, spread};
use crate::Failure;
use crate::bench::Chance;
use crate::commands::experiment::table::{Cell, Row, Table};
use agents::navigation::navigator::Config;
use agents::navigation::target::{Company, Target};
use agents::social_mapping::{CooperationZone, SocialConfig};
use nalgebra::{Isometry2, Point2};
use scenarios::Scenario;
use scenarios::metrics::path_length;
use scenarios::trial::{Drive, Method, Trial};
use scenarios::world::Truth;
use std::f64::consts::{PI, TAU};

/// Approaches for each seed asked for: AP makes 100.
const APPROACHES: u64 = 10;
/// AP's zones: intimate within, personal within, metres.
const INTIMATE: f64 = 0.4;
const PERSONAL: f64 = 1.2;
/// From the person to the first place to talk from, metres: in the middle of the .54 to .60 m that AP
/// calls adequate.
const TALKING: f64 = 0.57;

fn robot(sample: &Truth) -> Point2<f64> {
    sample.world_from_robot.translation.vector.into()
}

/// Time in AP's zones of the one person there, percent of the drive.
struct Shares {
    intimate: f64,
    /// Personal space without the cooperation zone, which counts as free (READING.md item 18).
    unwanted: f64,
    /// Personal space whole.
    personal: f64,
}

fn shares(samples: &[Truth], zone: Option<CooperationZone>) -> Shares {
    let mut counts = [0usize; 3];
    for sample in samples {
        for body in &sample.people {
            let pose = Isometry2::new(body.position.coords, body.heading);
            let place = pose.inverse_transform_point(&robot(sample));
            let far = place.coords.norm();
            let wanted = zone.is_some_and(|zone| zone.contains(place));
            counts[0] += usize::from(far < INTIMATE);
            counts[1] += usize::from((INTIMATE..PERSONAL).contains(&far) && !wanted);
            counts[2] += usize::from((INTIMATE..PERSONAL).contains(&far));
        }
    }
    let [intimate, unwanted, personal] =
        counts.map(|count| 100.0 * count as f64 / samples.len().max(1) as f64);
    Shares {
        intimate,
        unwanted,
        personal,
    }
}

fn least_distance(samples: &[Truth]) -> f64 {
    distances(samples).fold(f64::INFINITY, f64::min)
}

fn distances(samples: &[Truth]) -> impl Iterator<Item = f64> + '_ {
    let of = |sample: &Truth| {
        let place = robot(sample);
        let people = sample.people.iter();
        people
            .map(|body| (body.position - place).norm())
            .fold(f64::INFINITY, f64::min)
    };
    samples.iter().map(of)
}

fn drive(
    scenario: &Scenario,
    seed: u64,
    social: bool,
    targets: Vec<Target>,
) -> Result<Drive, Failure> {
    let trial = Trial {
        scenario,
        seed,
        tracks: None,
        unmapped: &[],
        method: Method::Navigation,
        social,
        targets,
        navigation: Config {
            goal_tolerance: 0.08,
            ..Config::default()
        },
        agenda_from: 0.0,
    };
    trial.drive().map_err(Failure::internal)
}

/// AP Table 1, with so many times ten approaches.
pub(in super::super) fn approaches(seeds: u64) -> Result<Table, Failure> {
    let mut scenario = scene("ap-table1", include_str!("scenes/approach.toml"))?;
    scenario.social = SocialConfig::adaptive_proxemics();
    let home = Point2::from(scenario.robot.pose.translation.vector);
    let count = APPROACHES * seeds;
    // Figures of the way without the model and with it: time, length, least distance, shares.
    let mut figures: [[Vec<f64>; 6]; 2] = Default::default();
    let mut arrived = [0u64; 2];
    let mut chance = Chance::new(1);
    for seed in 1..=count {
        let heading = TAU * f64::from(chance.below(1 << 20)) / f64::from(1 << 20) - PI;
        let person = &mut scenario.people[0];
        person.pose = Isometry2::new(person.pose.translation.vector, heading);
        let targets = vec![
            Target::Person {
                name: person.name.clone(),
                distance: TALKING,
            },
            Target::Point(home),
        ];
        for (column, social) in [false, true].into_iter().enumerate() {
            let drive = drive(&scenario, seed, social, targets.clone())?;
            arrived[column] += u64::from(drive.arrived);
            let samples = &drive.samples;
            let path: Vec<_> = samples.iter().map(robot).collect();
            let zone = social.then_some(CooperationZone::AHEAD);
            let shares = shares(samples, zone);
            let seconds = match (samples.first(), samples.last()) {
                (Some(first), Some(last)) => last.time.since(first.time),
                _ => 0.0,
            };
            let row = [
                seconds,
                path_length(&path),
                least_distance(samples),
                shares.unwanted,
                shares.intimate,
                shares.personal,
            ];
            for (all, one) in figures[column].iter_mut().zip(row) {
                all.push(one);
            }
        }
    }
    let row = |label: &str, at: usize, printed: Option<[f64; 2]>, tolerance: f64, note| {
        let cell = |column: usize| {
            let (mean, deviation) = spread(&figures[column][at]);
            let cell = match printed {
                Some(printed) => Cell::numbers(mean, printed[column], tolerance),
                None => Cell::number(mean),
            };
            cell.deviating(deviation)
        };
        Row {
            label: label.to_owned(),
            cells: vec![cell(0), cell(1)],
            note,
        }
    };
    let yes = |holds: bool| if holds { "yes" } else { "no" };
    let most = spread(&figures[1][3]).0;
    let rows = vec![
        row("tau, s", 0, Some([89.4, 89.28]), 9.0, Some(PACE)),
        row("d_t, m", 1, Some([7.06, 7.71]), 0.8, Some(ROOM)),
        row("d_min, m", 2, Some([0.68, 0.57]), 0.04, Some(NEAR)),
        row(
            "Psi (Personal), %",
            3,
            Some([39.86, 7.83]),
            5.33,
            Some(SHARE),
        ),
        row("Psi (Intimate), %", 4, Some([0.0, 0.0]), 1e-9, None),
        row("Psi (Personal), with the zone, %", 5, None, 0.0, None),
        Row {
            label: "arrives, and gets home".to_owned(),
            cells: arrived
                .map(|arrived| Cell::texts(yes(arrived == count), "yes"))
                .to_vec(),
            note: Some(EVERY),
        },
        Row {
            label: "at most 8 % in personal space".to_owned(),
            cells: vec![
                Cell::texts(yes(spread(&figures[0][3]).0 <= 8.0), "no"),
                Cell::texts(yes(most <= 8.0), "yes"),
            ],
            note: Some(EVERY),
        },
    ];
    Ok(Table {
        columns: vec!["Without the model", "With it"],
        rows,
        notes: vec![
            "Mean, and in brackets the standard deviation, over ten approaches for each seed, to a person who looks\n\
             anywhere. A cooperation zone counts as free space (READING.md 18), also in the print; below it stands the\n\
             share with the zone. AP's \"32 %\" are percentage points.",
        ],
    })
}

const PACE: &str = "At up to 0.3 m/s, as AP; AP does not say how its robot turns, waits and speaks";
const ROOM: &str = "AP prints the room as a picture without measures; only the 3.5 m are its";
const NEAR: &str =
    "AP's default navigation keeps off a person by its inflation, ours by the two bodies";
const SHARE: &str =
    "How long the robot stands before the person is not printed; ours turns round at once";
const EVERY: &str = "Of every approach, or on the mean of all; printed where AP says so";

/// How an escort went: figures of one drive.
struct Escort {
    mean: f64,
    beside_before: f64,
    behind_in_door: bool,
    beside_after: f64,
    collisions: u64,
}

fn judge(drive: &Drive, door: f64) -> Escort {
    let beside = |sample: &Truth| {
        let body = &sample.people[0];
        let pose = Isometry2::new(body.position.coords, body.heading);
        let place = pose.inverse_transform_point(&robot(sample));
        place.x.abs() < place.y.abs()
    };
    let walking: Vec<&Truth> = drive
        .samples
        .iter()
        .filter(|sample| sample.people[0].velocity.norm() > 0.2)
        .collect();
    let share = |part: &dyn Fn(f64) -> bool| {
        let part: Vec<bool> = walking
            .iter()
            .filter(|sample| part(sample.people[0].position.x))
            .map(|sample| beside(sample))
            .collect();
        100.0 * part.iter().filter(|beside| **beside).count() as f64 / part.len().max(1) as f64
    };
    let mean = walking
        .iter()
        .map(|sample| (sample.people[0].position - robot(sample)).norm())
        .sum::<f64>()
        / walking.len().max(1) as f64;
    // While the robot itself is in the door the person must be through it.
    let behind_in_door = drive
        .samples
        .iter()
        .filter(|sample| (robot(sample).x - door).abs() < 0.25)
        .all(|sample| sample.people[0].position.x > robot(sample).x && !beside(sample));
    Escort {
        mean,
        beside_before: share(&|x| (2.0..door - 1.5).contains(&x)),
        behind_in_door,
        beside_after: share(&|x| x > door + 2.5),
        collisions: drive
            .samples
            .last()
            .map_or(0, |sample| sample.collisions.total()),
    }
}

/// AP Fig. 9: how far the robot is from whom it escorts, with cooperation zones and where the space
/// around the person is closed to it.
pub(in super::super) fn escort(seeds: u64) -> Result<Table, Failure> {
    let mut scenario = scene("ap-escort", include_str!("scenes/escort.toml"))?;
    scenario.social = SocialConfig::adaptive_proxemics();
    let door = scenario
        .doors
        .first()
        .map_or(f64::NAN, |door| door.position.x);
    let mut judged: [Vec<Escort>; 2] = Default::default();
    for seed in 1..=seeds {
        for (column, place) in [Company::Behind, Company::Beside].into_iter().enumerate() {
            let target = Target::Company {
                name: scenario.people[0].name.clone(),
                place,
                until: None,
            };
            let drive = drive(&scenario, seed, true, vec![target])?;
            judged[column].push(judge(&drive, door));
        }
    }
    let row = |label: &str, of: &dyn Fn(&Escort) -> f64| {
        let cells = judged.iter().map(|all| {
            let (mean, deviation) = spread(&all.iter().map(of).collect::<Vec<_>>());
            Cell::number(mean).deviating(deviation)
        });
        Row {
            label: label.to_owned(),
            cells: cells.collect(),
            note: None,
        }
    };
    let mean = |column: usize| {
        let all: Vec<f64> = judged[column].iter().map(|one| one.mean).collect();
        spread(&all).0
    };
    let all = |holds: &dyn Fn(&Escort) -> bool| {
        let cells = judged.iter().map(|all| all.iter().all(holds));
        cells
            .map(|holds| if holds { "yes" } else { "no" })
            .collect::<Vec<_>>()
    };
    let claim = |label: &str, ours: Vec<&str>, printed: [&str; 2]| Row {
        label: label.to_owned(),
        cells: ours
            .into_iter()
            .zip(printed)
            .map(|(ours, printed)| match printed {
                "" => Cell::text(ours),
                printed => Cell::texts(ours, printed),
            })
            .collect(),
        note: Some("Of every seed; printed where AP says so"),
    };
    let nearer = if mean(1) < mean(0) { "yes" } else { "no" };
    Ok(Table {
        columns: vec!["Space closed", "Cooperation zones"],
        rows: vec![
            row("mean distance, m", &|one| one.mean),
            row("beside before the door, % of the way", &|one| {
                one.beside_before
            }),
            row("beside after it, % of the way", &|one| one.beside_after),
            row("collisions", &|one| one.collisions as f64),
            claim(
                "behind in the door",
                all(&|one| one.behind_in_door),
                ["yes", "yes"],
            ),
            claim(
                "side by side before and after",
                all(&|one| one.beside_before > 80.0 && one.beside_after > 80.0),
                ["no", "yes"],
            ),
            claim(
                "nearer than where space is closed",
                vec!["", nearer],
                ["", "yes"],
            ),
        ],
        notes: vec![
            "Mean, and in brackets the standard deviation, over seeds. AP's Fig. 9 prints curves without figures. Where\n\
             the space around a person is closed on all sides, the places beside them are closed, too, and the robot\n\
             goes behind.",
        ],
    })
}
