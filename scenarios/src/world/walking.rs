//! How a person picks the next step: the velocity nearest to the wanted one that runs into nobody
//! soon. A plain choice among a few velocities, not a model of people.

use super::Body;
use super::obstacles::Obstacles;
use nalgebra::{Point2, Rotation2, Vector2};

/// Collisions further ahead than this are left for later, s.
const HORIZON: f64 = 2.5;
/// Nobody further away than this matters within the horizon, m.
const NEIGHBOURHOOD: f64 = 6.0;
/// People leave each other this gap, and the robot the larger one, m.
const GAP_TO_PEOPLE: f64 = 0.15;
const GAP_TO_ROBOT: f64 = 0.3;
const TURNS: [f64; 9] = [0.0, -0.35, 0.35, -0.7, 0.7, -1.1, 1.1, -1.6, 1.6];
const PACES: [f64; 3] = [1.0, 0.6, 0.3];

/// Somebody or something round that moves.
#[derive(Debug, Clone, Copy)]
pub(super) struct Disc {
    pub(super) position: Point2<f64>,
    pub(super) velocity: Vector2<f64>,
    pub(super) radius: f64,
    pub(super) is_robot: bool,
}

/// Seconds until two discs touch, seen from the one at the origin: 0 where they overlap and
/// close in, infinity where they never do.
pub(super) fn time_to_contact(offset: Vector2<f64>, closing: Vector2<f64>, reach: f64) -> f64 {
    let approach = offset.dot(&closing);
    if approach <= 0.0 {
        return f64::INFINITY;
    }
    let gap = offset.norm_squared() - reach * reach;
    if gap <= 0.0 {
        return 0.0;
    }
    let speed = closing.norm_squared();
    let discriminant = approach * approach - speed * gap;
    if discriminant < 0.0 {
        f64::INFINITY
    } else {
        (approach - discriminant.sqrt()) / speed
    }
}

/// The velocity to walk with. `wanted` is the velocity straight along the way.
pub(super) fn choose(
    body: &Body,
    wanted: Vector2<f64>,
    others: &[Disc],
    obstacles: &Obstacles,
) -> Vector2<f64> {
    let near: Vec<&Disc> = others
        .iter()
        .filter(|other| (other.position - body.position).norm() < NEIGHBOURHOOD)
        .collect();
    let pace = wanted.norm();
    let danger = |velocity: Vector2<f64>| {
        let soonest = near
            .iter()
            .map(|other| {
                let gap = if other.is_robot {
                    GAP_TO_ROBOT
                } else {
                    GAP_TO_PEOPLE
                };
                let reach = body.radius + other.radius;
                let offset = other.position - body.position;
                let closing = velocity - other.velocity;
                let touch = time_to_contact(offset, closing, reach);
                // Coming closer than one likes is half as bad as touching.
                touch.min(HORIZON * 0.5 + 0.5 * time_to_contact(offset, closing, reach + gap))
            })
            .fold(HORIZON, f64::min);
        (HORIZON - soonest) / HORIZON
    };
    let clearance = |seconds: f64, velocity: Vector2<f64>| {
        obstacles.clearance_of_walker(body.position + velocity * seconds)
    };
    let here = clearance(0.0, wanted);
    let into_wall = |velocity: Vector2<f64>| {
        let ahead = clearance(0.1, velocity).min(clearance(0.3, velocity));
        ahead < body.radius + 0.02 && ahead < here
    };
    if danger(wanted) <= 0.0 && !into_wall(wanted) {
        return wanted;
    }
    let mut best = (f64::INFINITY, Vector2::zeros());
    let still = std::iter::once((0.0, 0.0));
    let moves = TURNS
        .iter()
        .flat_map(|turn| PACES.iter().map(move |part| (*turn, *part)));
    for (turn, part) in moves.chain(still) {
        let velocity = Rotation2::new(turn) * wanted * part;
        if into_wall(velocity) {
            continue;
        }
        let detour = (velocity - wanted).norm() / pace;
        let change = (velocity - body.velocity).norm() / pace;
        // Of two equal sides the right one, as people do where they drive on the right.
        let left = if turn > 0.0 { 0.05 } else { 0.0 };
        let cost = detour + 0.2 * change + left + 4.0 * danger(velocity);
        if cost < best.0 {
            best = (cost, velocity);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_to_contact_is_that_of_two_discs() {
        let time = time_to_contact(Vector2::new(5.0, 0.0), Vector2::new(2.0, 0.0), 1.0);
        assert!((time - 2.0).abs() < 1e-12);
        let misses = time_to_contact(Vector2::new(5.0, 1.1), Vector2::new(2.0, 0.0), 1.0);
        assert!(misses.is_infinite());
        let apart = time_to_contact(Vector2::new(0.5, 0.0), Vector2::new(-1.0, 0.0), 1.0);
        assert!(apart.is_infinite(), "overlapping but leaving");
    }

    #[test]
    fn two_who_meet_head_on_pass_without_touching() {
        let obstacles = Obstacles {
            walls: Vec::new(),
            objects: Vec::new(),
        };
        let mut walkers = [
            Body::standing("ana", Point2::new(0.0, 0.0), 0.0, 0.2),
            Body::standing("ben", Point2::new(8.0, 0.02), 0.0, 0.2),
        ];
        let goals = [Point2::new(8.0, 0.0), Point2::new(0.0, 0.0)];
        let mut nearest = f64::INFINITY;
        for _ in 0..200 {
            let discs = walkers.clone().map(|b| Disc {
                position: b.position,
                velocity: b.velocity,
                radius: b.radius,
                is_robot: false,
            });
            for (at, walker) in walkers.iter_mut().enumerate() {
                let to_go = goals[at] - walker.position;
                let wanted = to_go.normalize() * to_go.norm().min(1.0);
                let other = &discs[1 - at..2 - at];
                walker.velocity = choose(walker, wanted, other, &obstacles);
                walker.position += walker.velocity * 0.05;
            }
            nearest = nearest.min((walkers[0].position - walkers[1].position).norm());
        }
        assert!(nearest > 0.4, "{nearest}");
        for (walker, goal) in walkers.iter().zip(goals) {
            assert!(
                (walker.position - goal).norm() < 0.3,
                "{} got to {}",
                walker.name,
                walker.position
            );
        }
    }
}
