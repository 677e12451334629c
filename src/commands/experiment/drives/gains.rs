//! The search for the band's gains (paper TD 5.4, eq. 17 to 20): directly over a range of each in turn, then
//! down a stochastic gradient. This file owns the penalty of a drive, and the places that are driven to.

use super::scene;
use crate::Failure;
use crate::bench::Chance;
use crate::commands::experiment::table::{Cell, Row, Table};
use agents::navigation::band::Gains;
use agents::navigation::navigator::Config;
use agents::navigation::target::Target;
use nalgebra::Point2;
use scenarios::Scenario;
use scenarios::metrics::measure;
use scenarios::trial::{Method, Trial};

/// The values tried of both gains: `k_c` in metres, `k_r` in metres per metre (READING.md item 12).
const VALUES: [f64; 5] = [0.02, 0.04, 0.06, 0.09, 0.13];
const COLUMNS: [&str; 5] = ["k_r 0.02", "k_r 0.04", "k_r 0.06", "k_r 0.09", "k_r 0.13"];
/// Weights of heading changes (per rad), length (per m), time (per s) and distance to people (per m).
/// TD prints none. READING.md item 13: more distance is better.
const WEIGHTS: [f64; 4] = [1.0, 1.0, 0.1, -1.0];
/// A target that is not reached costs as much as many metres.
const FAILURE: f64 = 100.0;
/// Steps of the stochastic gradient, and the first of its steps as a share of the gains.
const DESCENTS: usize = 6;
const PERTURBATION: f64 = 0.2;
/// Where the targets lie in the scene, with a margin to its walls, m.
const CORNERS: [(f64, f64); 2] = [(1.0, 1.0), (14.0, 6.5)];
/// From people and furniture, m.
const ROOM: f64 = 0.9;

/// All there is to drive through.
struct Course {
    scenario: Scenario,
    targets: Vec<Point2<f64>>,
}

impl Course {
    fn new(count: usize) -> Result<Self, Failure> {
        let scenario = scene("td-gains", include_str!("scenes/table1.toml"))?;
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
            let walls = scenario.walls.iter().all(|wall| {
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

    /// G of one drive (eq. 17).
    fn penalty(&self, contraction: f64, repulsion: f64, target: usize) -> Result<f64, Failure> {
        let gains = Gains {
            contraction,
            repulsion,
            ..Gains::default()
        };
        let trial = Trial {
            scenario: &self.scenario,
            seed: target as u64 + 1,
            tracks: None,
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
        Ok(sum + if drive.arrived { 0.0 } else { FAILURE })
    }

    /// The mean of G over these targets.
    fn mean(
        &self,
        (contraction, repulsion): (f64, f64),
        targets: impl Iterator<Item = usize>,
    ) -> Result<f64, Failure> {
        let (mut sum, mut count) = (0.0, 0.0);
        for target in targets {
            sum += self.penalty(contraction, repulsion, target)?;
            count += 1.0;
        }
        Ok(sum / f64::max(count, 1.0))
    }

    fn all(&self, gains: (f64, f64)) -> Result<f64, Failure> {
        self.mean(gains, 0..self.targets.len())
    }
}

/// Fixes one gain and takes the best of the other, in turn, until nothing gets better: indices of
/// [`VALUES`].
fn direct(surface: &[[f64; 5]; 5]) -> (usize, usize) {
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
fn descend(course: &Course, from: (f64, f64), penalty: f64) -> Result<((f64, f64), f64), Failure> {
    let mut chance = Chance::new(54);
    let (mut at, mut least) = (from, penalty);
    for descent in 0..DESCENTS {
        let size = PERTURBATION / (1.0 + descent as f64);
        let mut sign = || if chance.below(2) == 0 { -size } else { size };
        let step = (sign(), sign());
        let few: Vec<usize> = (0..course.targets.len().div_ceil(4))
            .map(|_| chance.below(course.targets.len() as u32) as usize)
            .collect();
        let beside = |way: f64| (at.0 * (1.0 + way * step.0), at.1 * (1.0 + way * step.1));
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

/// TD 5.4, to twice as many targets as there are seeds.
pub(in super::super) fn gains(seeds: u64) -> Result<Table, Failure> {
    let course = Course::new(2 * seeds as usize)?;
    let mut surface = [[0.0; 5]; 5];
    for (row, contraction) in surface.iter_mut().zip(VALUES) {
        for (penalty, repulsion) in row.iter_mut().zip(VALUES) {
            *penalty = course.all((contraction, repulsion))?;
        }
    }
    let mut rows: Vec<Row> = surface
        .iter()
        .zip(VALUES)
        .map(|(row, contraction)| Row {
            label: format!("k_c {contraction}"),
            cells: row.iter().copied().map(Cell::number).collect(),
            note: None,
        })
        .collect();
    let found = direct(&surface);
    let start = (VALUES[found.0], VALUES[found.1]);
    let penalty = surface[found.0][found.1];
    let (best, least) = descend(&course, start, penalty)?;
    let default = Gains::default();
    let default = (default.contraction, default.repulsion);
    let result = |label: &str, (contraction, repulsion): (f64, f64), penalty: f64| {
        let mut cells = vec![Cell::number(penalty)];
        cells.resize_with(VALUES.len(), || Cell::text(""));
        Row {
            label: format!("{label}: k_c {contraction:.3} m, k_r {repulsion:.3}"),
            cells,
            note: None,
        }
    };
    rows.push(result("direct search", start, penalty));
    rows.push(result("stochastic gradient", best, least));
    rows.push(result("default", default, course.all(default)?));
    Ok(Table {
        columns: COLUMNS.to_vec(),
        rows,
        notes: vec![
            "G = H + D + 0.1 Q - P, the mean over the targets: heading changes (rad), length (m), time (s), mean\n\
             distance to the nearest person (m). TD prints no weights. Its 120 and 60 are in millimetres of\n\
             another robot's loop (READING.md 12) and cannot be held against ours.",
        ],
    })
}
