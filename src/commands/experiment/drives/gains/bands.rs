//! Bands among scattered points, as a laser shows furniture: with gains that are too large for the distances
//! between a band's points they never come to rest. This file owns what counts as never.

use crate::bench::Chance;
use agents::navigation::band::{Band, BandState, Gains, Surroundings};
use agents::navigation::obstacles::{Obstacles, nearest};
use nalgebra::{Point2, distance};

/// Updates after which a band that still moves will not settle: tightening takes some hundreds.
const UPDATES: usize = 1500;
/// Where points lie, m, and how many there are at most.
const AREA: (f64, f64) = (6.0, 4.0);
const POINTS: u32 = 30;
/// What the robot needs, and how much more of room every band has at first, m.
const RADIUS: f64 = 0.3;
const CLEAR: f64 = 0.02;

/// How many of so many bands never come to rest and do not break either, percent.
pub(super) fn unsettled(gains: &Gains, bands: u64) -> f64 {
    let restless = (0..bands).filter(|seed| !settles(gains, *seed)).count();
    100.0 * restless as f64 / bands.max(1) as f64
}

fn settles(gains: &Gains, seed: u64) -> bool {
    let mut chance = Chance::new(seed);
    let corners: Vec<Point2<f64>> = (0..2 + chance.below(3))
        .map(|_| somewhere(&mut chance))
        .collect();
    let mut band = Band::new(&corners, gains);
    let mut obstacles = Obstacles::new();
    for _ in 0..chance.below(POINTS) {
        let point = somewhere(&mut chance);
        let clear = |pair: &[Point2<f64>]| {
            distance(&nearest(&[pair[0], pair[1]], point), &point) > RADIUS + CLEAR
        };
        if band.points().windows(2).all(clear) {
            obstacles.push_point(point);
        }
    }
    let around = Surroundings {
        obstacles: &obstacles,
        people: &[],
        grid: None,
        radius: RADIUS,
        speed: 0.3,
    };
    (0..UPDATES).any(|_| band.update(&around, gains, 1) != BandState::Moving)
}

fn somewhere(chance: &mut Chance) -> Point2<f64> {
    Point2::new(AREA.0 * chance.share(), AREA.1 * chance.share())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_settle_with_small_gains_and_not_with_large_ones() {
        let of = |contraction, repulsion| {
            let gains = Gains {
                contraction,
                repulsion,
                ..Gains::default()
            };
            unsettled(&gains, 200)
        };
        assert!(of(0.02, 0.02) <= 0.0);
        assert!(of(0.13, 0.13) > 2.0);
    }
}
