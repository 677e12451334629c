//! The search for the band's gains (paper TD 5.4, eq. 17 to 20): directly over a range of each in turn, then
//! down a stochastic gradient. This file owns the penalty of a drive, and guarantees that gains with which
//! bands do not settle, or the robot does not arrive or touches something, are never the best.

mod bands;

use super::scene;
use crate::Failure;
use crate::bench::Chance;
use crate::commands::experiment::drawn::Drawn;
use crate::commands::experiment::table::{Cell, Row, Table};
use crate::commands::experiment::workers;
use crate::progress::Progress;
use agents::navigation::band::Gains;
use agents::navigation::navigator::Config;
use agents::navigation::target::Target;
use nalgebra::Point2;
use scenarios::Scenario;
use scenarios::metrics::measure;
use scenarios::picture::Surface;
use scenarios::scenario::Wall;
use scenarios::trial::{Method, Trial};
use serde_json::{Value, json};

/// How the search is called.
pub(in super::super) const NAME: &str = "td-gains";

/// The values tried of both gains: `k_c` in metres, `k_r` in metres per metre (READING.md item 12).
const VALUES: [f64; 6] = [0.02, 0.04, 0.06, 0.08, 0.10, 0.13];
const COLUMNS: [&str; 6] = [
    "k_r 0.02", "k_r 0.04", "k_r 0.06", "k_r 0.08", "k_r 0.10", "k_r 0.13",
];
/// Weights of heading changes (per rad), length (per m), time (per s) and distance to people (per m).
/// TD prints none. READING.md item 13: more distance is better.
const WEIGHTS: [f64; 4] = [1.0, 1.0, 0.1, -1.0];
/// A target that is not reached, or only by touching something, costs as much as many metres.
const FAILURE: f64 = 100.0;
/// So does each hundredth of the bands that do not settle, of so many for each target.
const BANDS: u64 = 150;
/// Steps of the stochastic gradient, and the first of its steps as a share of the gains.
const DESCENTS: usize = 8;
const PERTURBATION: f64 = 0.2;
/// Gains are told to this, m: finer differences are lost in the noise of laser and localisation.
const DIGITS: f64 = 5e-3;
/// Where the targets lie in the scene, with a margin to its walls, m.
const CORNERS: [(f64, f64); 2] = [(1.0, 1.0), (14.0, 6.5)];
/// From people and furniture, m.
const ROOM: f64 = 0.9;
/// Walls that the map does not show: past them the band alone leads, until a path past them is found.
const UNMAPPED: [Wall; 3] = [
    [Point2::new(2.5, 0.0), Point2::new(2.5, 4.6)],
    [Point2::new(5.6, 3.0), Point2::new(5.6, 5.0)],
    [Point2::new(12.4, 3.6), Point2::new(12.4, 7.5)],
];

/// `k_c` and `k_r`.
type Pair = (f64, f64);

/// All there is to drive through.
struct Course {
    scenario: Scenario,
    targets: Vec<Point2<f64>>,
}

impl Course {
    fn new(count: usize) -> Result<Self, Failure> {
        let scenario = scene(NAME, include_str!("scenes/gains.toml"))?;
        let mut chance = Chance::new(20);
        let mut targets = Vec::new();
        let mut along = |from: f64, to: f64| {
            from + (to - from) * f64::from(chance.below(1 << 20)) / f64::from(1 << 20)
        };
        while targets.len() < count {
            let target = Point2::new(
                along(CORNERS[0].0, CORNERS[1].0),
                along(CORNERS[0].1, CORNERS[1].1),
            );
            let far = |place: Point2<f64>, gap: f64| (place - target).norm() > gap;
            let people = scenario.people.iter().map(|person| person.pose);
            let objects = scenario.objects.iter().map(|object| object.pose);
            let clear = people
                .chain(objects)
                .all(|pose| far(pose.translation.vector.into(), ROOM + 0.3));
            let walls = scenario.walls.iter().chain(&UNMAPPED).all(|wall| {
                let way = wall[1] - wall[0];
                let share = (target - wall[0]).dot(&way) / way.norm_squared().max(1e-9);
                far(wall[0] + way * share.clamp(0.0, 1.0), 0.6)
            });
            if clear && walls && far(scenario.robot.pose.translation.vector.into(), 2.0) {
                targets.push(target);
            }
        }
        Ok(Self { scenario, targets })
    }

    /// G of one drive (eq. 17), and what failing costs.
    fn penalty(&self, gains: Gains, target: usize) -> Result<f64, Failure> {
        let trial = Trial {
            scenario: &self.scenario,
            seed: target as u64 + 1,
            tracks: None,
            unmapped: &UNMAPPED,
            method: Method::Navigation,
            social: false,
            targets: vec![Target::Point(self.targets[target])],
            navigation: Config {
                gains,
                ..Config::default()
            },
            agenda_from: f64::INFINITY,
        };
        let drive = trial.drive().map_err(Failure::internal)?;
        let metrics = measure(&drive.samples, self.scenario.robot.radius, &[]);
        let (Some(robot), Some(company)) = (metrics.robot, metrics.company) else {
            return Err(Failure::internal("a drive of no time"));
        };
        let terms = [
            robot.chc,
            robot.path_length,
            robot.duration,
            company.mean_distance,
        ];
        let sum: f64 = terms
            .iter()
            .zip(WEIGHTS)
            .map(|(term, weight)| term * weight)
            .sum();
        let fails = !drive.arrived || robot.collisions > 0;
        Ok(sum + if fails { FAILURE } else { 0.0 })
    }

    /// The mean of G over these targets, and what bands cost that do not settle.
    fn mean(&self, pair: Pair, targets: impl Iterator<Item = usize>) -> Result<f64, Failure> {
        let gains = gains_of(pair);
        let (mut sum, mut count) = (0.0, 0.0);
        for target in targets {
            sum += self.penalty(gains, target)?;
            count += 1.0;
        }
        let bands = BANDS * self.targets.len() as u64;
        Ok(sum / f64::max(count, 1.0) + FAILURE * bands::unsettled(&gains, bands))
    }

    fn all(&self, pair: Pair) -> Result<f64, Failure> {
        self.mean(pair, 0..self.targets.len())
    }
}

fn gains_of((contraction, repulsion): Pair) -> Gains {
    Gains {
        contraction,
        repulsion,
        ..Gains::default()
    }
}

fn default() -> Pair {
    let Gains {
        contraction,
        repulsion,
        ..
    } = Gains::default();
    (contraction, repulsion)
}

/// Fixes one gain and takes the best of the other, in turn, until nothing gets better: indices of
/// [`VALUES`].
fn direct(surface: &[Vec<f64>]) -> (usize, usize) {
    let least = |of: &dyn Fn(usize) -> f64| {
        (0..VALUES.len())
            .min_by(|a, b| of(*a).total_cmp(&of(*b)))
            .unwrap_or(0)
    };
    let mut at = (VALUES.len() / 2, VALUES.len() / 2);
    loop {
        let contraction = least(&|k| surface[k][at.1]);
        let repulsion = least(&|k| surface[contraction][k]);
        let better = surface[contraction][repulsion] < surface[at.0][at.1];
        if !better {
            return at;
        }
        at = (contraction, repulsion);
    }
}

/// Down the gradient that two drives to the same few targets show along a direction drawn by lot (Spall's
/// simultaneous perturbation), as long as that is better for all targets.
fn descend(course: &Course, from: Pair, penalty: f64) -> Result<(Pair, f64), Failure> {
    let mut chance = Chance::new(54);
    let (mut at, mut least) = (from, penalty);
    for descent in 0..DESCENTS {
        let size = PERTURBATION / (1.0 + 0.5 * descent as f64);
        let mut sign = || if chance.below(2) == 0 { -size } else { size };
        let step = (sign(), sign());
        let few: Vec<usize> = (0..course.targets.len().div_ceil(4))
            .map(|_| chance.below(course.targets.len() as u32) as usize)
            .collect();
        let round = |gain: f64| (gain / DIGITS).round() * DIGITS;
        let beside = |way: f64| {
            (
                round(at.0 * (1.0 + way * step.0)),
                round(at.1 * (1.0 + way * step.1)),
            )
        };
        let ahead = course.mean(beside(1.0), few.iter().copied())?;
        let behind = course.mean(beside(-1.0), few.iter().copied())?;
        let next = beside(if ahead < behind { 1.0 } else { -1.0 });
        let penalty = course.all(next)?;
        if penalty < least {
            (at, least) = (next, penalty);
        }
    }
    Ok((at, least))
}

/// What the search came to: gains, and their penalty.
pub(in super::super) struct Search {
    targets: usize,
    /// A row for each `k_c`, of a penalty for each `k_r`.
    surface: Vec<Vec<f64>>,
    direct: (Pair, f64),
    best: (Pair, f64),
    default: (Pair, f64),
}

/// TD 5.4, to twice as many targets as there are seeds.
pub(in super::super) fn search(seeds: u64, progress: &Progress) -> Result<Search, Failure> {
    let course = Course::new(2 * seeds as usize)?;
    let count = VALUES.len();
    let penalties = workers::each(count * count, progress, |job| {
        course.all((VALUES[job / count], VALUES[job % count]))
    })?;
    let surface: Vec<Vec<f64>> = penalties.chunks(count).map(<[f64]>::to_vec).collect();
    let found = direct(&surface);
    let start = (VALUES[found.0], VALUES[found.1]);
    let direct = (start, surface[found.0][found.1]);
    Ok(Search {
        targets: course.targets.len(),
        direct,
        best: descend(&course, start, direct.1)?,
        default: (default(), course.all(default())?),
        surface,
    })
}

impl Search {
    /// What was found, by name.
    fn results(&self) -> [(&'static str, (Pair, f64)); 3] {
        [
            ("direct search", self.direct),
            ("stochastic gradient", self.best),
            ("default", self.default),
        ]
    }

    /// For people.
    pub(in super::super) fn table(&self) -> Table {
        let surface = self.surface.iter().zip(VALUES);
        let mut rows: Vec<Row> = surface
            .map(|(row, contraction)| Row {
                label: format!("k_c {contraction:.2}"),
                cells: row.iter().copied().map(Cell::number).collect(),
                note: None,
            })
            .collect();
        for (label, ((contraction, repulsion), penalty)) in self.results() {
            let mut cells = vec![Cell::number(penalty)];
            cells.resize_with(VALUES.len(), || Cell::text(""));
            rows.push(Row {
                label: format!("{label}: k_c {contraction:.3} m, k_r {repulsion:.3}"),
                cells,
                note: None,
            });
        }
        Table {
            columns: COLUMNS.to_vec(),
            rows,
            notes: vec![
                "G = H + D + 0.1 Q - P, the mean over the targets: heading changes (rad), length (m), time (s), mean\n\
                 distance to the nearest person (m); 100 for a target that is not reached or only by touching something,\n\
                 and 100 for each percent of bands among scattered points that do not settle. TD prints no weights. Its\n\
                 120 and 60 are in millimetres of another robot's loop (READING.md 12) and cannot be held against ours.",
            ],
        }
    }

    /// For machines: the table, the surface, and what was found.
    pub(in super::super) fn json(&self, about: &str) -> Value {
        let mut json = self.table().json(NAME, about);
        let surface = self
            .surface
            .iter()
            .zip(VALUES)
            .flat_map(|(row, contraction)| {
                let cells = row.iter().zip(VALUES);
                cells
                    .map(move |(penalty, repulsion)| gains_json((contraction, repulsion), *penalty))
            });
        json["targets"] = json!(self.targets);
        json["surface"] = surface.collect();
        for (name, (pair, penalty)) in self.results() {
            json[name.replace(' ', "_")] = gains_json(pair, penalty);
        }
        json
    }

    /// The surface with what was found.
    pub(in super::super) fn picture(&self) -> Drawn {
        let marks = self.results().map(|(name, ((down, across), penalty))| {
            let name = format!("{name}: k_c {down:.3} m, k_r {across:.3}, G {penalty:.2}");
            (down, across, name)
        });
        let surface = Surface {
            title: "G over the gains of the elastic band",
            across: ("repulsion k_r, m per m of missing clearance", &VALUES),
            down: ("k_c, m", &VALUES),
            values: &self.surface,
            marks: &marks,
        };
        Drawn::new(NAME, surface.svg())
    }
}

fn gains_json((contraction, repulsion): Pair, penalty: f64) -> Value {
    json!({"contraction": contraction, "repulsion": repulsion, "penalty": penalty})
}

#[cfg(test)]
mod tests;
