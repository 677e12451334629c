//! The elastic band (paper TD 5.3, eq. 13 to 16): a path that tightens by itself and yields to
//! obstacles and people. This file guarantees that no point is ever moved so that the robot would
//! touch an obstacle at it or half-way to its neighbours, nor to a place that the social grid holds
//! dearer; and that a band which cannot stay free says so.
//!
//! Eq. 14 and 15 are read as READING.md item 12 settles them: the force points along the gradient
//! of the clearance, and acts below the distance `D0`. The part of it along the band is removed
//! (item 14). Beyond the paper, people push the band out of their space at the place where they
//! will be when the robot gets there.

use super::obstacles::Obstacles;
use super::people::Person;
use crate::grid::{BLOCKED, CostGrid};
use nalgebra::{Point2, Vector2, distance};

/// The band's gains, SI units (READING.md item 12). The figures of length are the authors' own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gains {
    /// Contraction `k_c`, metres: what a right-angled bend moves in one iteration, over sqrt 2.
    pub contraction: f64,
    /// Repulsion `k_r`: metres moved in one iteration per metre of missing clearance.
    pub repulsion: f64,
    /// Repulsion from people, metres moved in one iteration at the person.
    pub social: f64,
    /// `D0`: obstacles farther away do not repel, metres.
    pub reach: f64,
    /// Half the robot's length L: points farther apart get another between, metres.
    pub spacing: f64,
    /// The step of the discrete Jacobian of eq. 14, metres.
    pub delta: f64,
}

impl Default for Gains {
    /// Contraction and repulsion are what `cortex experiment td-gains` finds.
    fn default() -> Self {
        Self {
            contraction: 0.055,
            repulsion: 0.045,
            social: 0.05,
            reach: 1.0,
            spacing: 0.25,
            delta: 0.05,
        }
    }
}

/// No point moves farther than this in one iteration, metres, so that none jumps over a wall.
const LARGEST_STEP: f64 = 0.05;
/// Sensor noise may take this much off the clearance before a point counts as touching, metres.
const NOISE: f64 = 0.05;
/// A band that touches for so many updates in a row is broken; noise and passers-by last less.
const PATIENCE: u32 = 4;
/// A person's space pushes where its squared deviation is below this: density 0.3, a little
/// outside the personal space.
const SOCIAL_REACH: f64 = 2.41;
/// Constant velocity says nothing about people farther ahead in time than this, seconds.
const FORESIGHT: f64 = 4.0;

/// Where no point moves farther in an update, the band has settled, metres.
const REST: f64 = 1e-3;

/// What an update came to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BandState {
    /// Every point is free, or was lately, and some move on.
    Moving,
    /// Every point is free, and the forces cancel out.
    Settled,
    /// The band has touched an obstacle for several updates and cannot get away: ask for a path.
    Broken {
        /// Where it touches, world frame.
        at: Point2<f64>,
    },
}

/// What the band moves among.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    /// Laser points and walls.
    pub obstacles: &'a Obstacles,
    /// People whose space repels; none where the robot shall not be social.
    pub people: &'a [Person],
    /// What places cost, such as in the space of an object in use; forces know nothing of it.
    pub grid: Option<&'a CostGrid>,
    /// The robot's radius, metres.
    pub radius: f64,
    /// The speed at which the robot is taken to follow the band, m/s.
    pub speed: f64,
}

/// A band from the robot to its goal.
#[derive(Debug, Clone, Default)]
pub struct Band {
    points: Vec<Point2<f64>>,
    /// Of each point when the band was last updated, metres.
    radii: Vec<f64>,
    touching: u32,
    near: Obstacles,
}

impl Band {
    /// A band along `path`; its first point is the robot and its last the goal.
    pub fn new(path: &[Point2<f64>], gains: &Gains) -> Self {
        let mut band = Self {
            points: path.to_vec(),
            ..Self::default()
        };
        band.space(gains.spacing, |_, _| true);
        band
    }

    /// The points from the robot to the goal, world frame; empty where there is no band.
    pub fn points(&self) -> &[Point2<f64>] {
        &self.points
    }

    /// The radii of the bubbles about the points, metres (TD 5.3): the clearance of each at the last
    /// update, as far as obstacles repel. The ends have none of their own and take their neighbour's.
    pub fn radii(&self) -> &[f64] {
        &self.radii
    }

    /// Its length, metres.
    pub fn length(&self) -> f64 {
        self.points
            .windows(2)
            .map(|pair| distance(&pair[0], &pair[1]))
            .sum()
    }

    /// Drops what the robot has passed and begins the band at `robot`. Only the next `reach`
    /// metres are looked at, so that a band that comes back close to itself is not cut short.
    pub fn follow(&mut self, robot: Point2<f64>, reach: f64) {
        let mut best = (f64::INFINITY, 0);
        let mut along = 0.0;
        for k in 0..self.points.len() {
            if k > 0 {
                along += distance(&self.points[k - 1], &self.points[k]);
            }
            if along > reach {
                break;
            }
            let gap = distance(&self.points[k], &robot);
            if gap < best.0 {
                best = (gap, k);
            }
        }
        let nearest = best.1;
        if self.points.len() < 2 {
            return;
        }
        // The nearest point is passed where the robot stands on the far side of it.
        let last = self.points.len() - 1;
        let passed = nearest < last
            && (self.points[nearest + 1] - self.points[nearest])
                .dot(&(robot - self.points[nearest]))
                > 0.0;
        let keep = if passed { nearest + 1 } else { nearest.max(1) };
        self.points.drain(1..keep);
        if keep <= self.radii.len() {
            self.radii.drain(1..keep);
        }
        self.points[0] = robot;
    }

    /// Lets the forces act `iterations` times (eq. 16) and keeps the points evenly spaced.
    pub fn update(&mut self, around: &Surroundings, gains: &Gains, iterations: usize) -> BandState {
        let mut touching = None;
        let mut near = std::mem::take(&mut self.near);
        // A point moves at most so far during this update; what is beyond cannot act on it.
        let reach = gains.reach + gains.delta + LARGEST_STEP * iterations as f64;
        self.space(gains.spacing, |before, after| {
            let middle = nalgebra::center(&before, &after);
            around.obstacles.clearance(middle) >= around.radius
        });
        self.radii.clear();
        self.radii.resize(self.points.len(), gains.reach);
        let (mut along, mut farthest) = (0.0, 0.0);
        for i in 1..self.points.len().saturating_sub(1) {
            along += distance(&self.points[i - 1], &self.points[i]);
            let start = self.points[i];
            around.obstacles.collect_near(start, reach, &mut near);
            let time = (along / around.speed.max(0.05)).min(FORESIGHT);
            for _ in 0..iterations {
                self.relax(i, &near, around, gains, time);
            }
            farthest = f64::max(farthest, distance(&start, &self.points[i]));
            let clearance = near.clearance(self.points[i]);
            self.radii[i] = clearance.min(gains.reach);
            if touching.is_none() && clearance < around.radius - NOISE {
                touching = Some(self.points[i]);
            }
        }
        if let [first, second, .., before, last] = &mut self.radii[..] {
            (*first, *last) = (*second, *before);
        }
        self.near = near;
        self.touching = match touching {
            Some(_) => self.touching + 1,
            None => 0,
        };
        match touching {
            Some(at) if self.touching >= PATIENCE => BandState::Broken { at },
            None if farthest <= REST => BandState::Settled,
            _ => BandState::Moving,
        }
    }

    /// Moves point `i` by the forces on it, unless that would bring it to an obstacle.
    fn relax(
        &mut self,
        i: usize,
        near: &Obstacles,
        around: &Surroundings,
        gains: &Gains,
        time: f64,
    ) {
        let (before, here, after) = (self.points[i - 1], self.points[i], self.points[i + 1]);
        let unit = |v: Vector2<f64>| v.try_normalize(1e-9).unwrap_or_default();
        let contraction = (unit(before - here) + unit(after - here)) * gains.contraction;
        let clearance = near.clearance(here);
        let repulsion = repulsion(near, here, clearance, gains);
        let tangent = unit(after - before);
        let social = people_push(around.people, here, tangent, time) * gains.social;
        let push = repulsion + social;
        let push = push - tangent * push.dot(&tangent);
        let mut step = (contraction + push).cap_magnitude(LARGEST_STEP);
        let cost = |place| {
            let cell = around
                .grid
                .and_then(|grid| Some(grid.cost(grid.cell_at(place)?)));
            cell.unwrap_or(BLOCKED)
        };
        let middles =
            |place| [before, after].map(|end| near.clearance(nalgebra::center(&end, &place)));
        let tightest = middles(here);
        for _ in 0..3 {
            let there = here + step;
            let open = |now: f64, then: f64| then >= around.radius || then >= now;
            let between = tightest.into_iter().zip(middles(there));
            if open(clearance, near.clearance(there))
                && between.into_iter().all(|(now, then)| open(now, then))
                && (around.grid.is_none() || cost(there) <= cost(here))
            {
                self.points[i] = there;
                return;
            }
            step *= 0.5;
        }
    }

    /// Drops a point whose neighbours are at most `spacing` apart, if they `may_join`, and inserts
    /// points where two are farther apart: on a straight stretch no point is inserted only to be
    /// dropped again.
    fn space(&mut self, spacing: f64, may_join: impl Fn(Point2<f64>, Point2<f64>) -> bool) {
        let mut k = 1;
        while k + 1 < self.points.len() {
            let (before, after) = (self.points[k - 1], self.points[k + 1]);
            if distance(&before, &after) <= spacing && may_join(before, after) {
                self.points.remove(k);
            } else {
                k += 1;
            }
        }
        let mut k = 1;
        while k < self.points.len() {
            let (before, here) = (self.points[k - 1], self.points[k]);
            let pieces = (distance(&before, &here) / spacing - 1e-9).ceil().max(1.0) as usize;
            let between =
                (1..pieces).map(|j| before + (here - before) * (j as f64 / pieces as f64));
            self.points.splice(k..k, between);
            k += pieces;
        }
    }
}

/// Eq. 14 and 15 at `here`.
fn repulsion(near: &Obstacles, here: Point2<f64>, clearance: f64, gains: &Gains) -> Vector2<f64> {
    if clearance >= gains.reach {
        return Vector2::zeros();
    }
    // Capped, since farther obstacles were left out and would read as a slope.
    let capped = |x, y| near.clearance(here + Vector2::new(x, y)).min(gains.reach);
    let d = gains.delta;
    let gradient = Vector2::new(
        capped(d, 0.0) - capped(-d, 0.0),
        capped(0.0, d) - capped(0.0, -d),
    ) / (2.0 * d);
    gradient * (gains.repulsion * (gains.reach - clearance))
}

/// How people push `here`, where the robot will be in `time` seconds: 1 at a person, 0 from
/// [`SOCIAL_REACH`] on, out of their space. Somebody whom the band meets head-on pushes along it
/// only, which moves nothing; then the band yields to the side they come from.
fn people_push(
    people: &[Person],
    here: Point2<f64>,
    tangent: Vector2<f64>,
    time: f64,
) -> Vector2<f64> {
    let normal = Vector2::new(-tangent.y, tangent.x);
    let mut push = Vector2::zeros();
    for person in people {
        let then = person.predicted(time);
        let deviation = then.squared_deviation(here);
        if deviation >= SOCIAL_REACH {
            continue;
        }
        let strength = 1.0 - (deviation / SOCIAL_REACH).sqrt();
        let outward = then.gradient(here).try_normalize(1e-9).unwrap_or_default();
        let aside = outward.dot(&normal);
        push += if aside.abs() > 0.2 {
            outward * strength
        } else {
            let crossing = person.velocity.dot(&normal);
            let side = if crossing.abs() > 0.1 {
                -crossing.signum()
            } else {
                1.0
            };
            normal * (side * strength)
        };
    }
    push
}

#[cfg(test)]
mod tests;
