//! The social-force model in the form of Moussaid et al., "Experimental study of the behavioural mechanisms
//! underlying self-organization in human crowds", Proc. R. Soc. B 276, 2009, with the figures that they
//! measured on pedestrians. This file guarantees that a force is finite.
//!
//! Accelerations in m/s^2, world frame.

use agents::navigation::obstacles::Obstacles;
use agents::navigation::people::Person;
use nalgebra::{Point2, Vector2, distance_squared};

/// How fast somebody gets to the velocity that they want, s.
const RELAXATION: f64 = 0.54;
/// Strength of the interaction, m/s^2, and what the relative velocity counts beside the direction, s/m.
const STRENGTH: f64 = 4.5;
const IMPORTANCE: f64 = 2.0;
/// Range of the interaction for each m/s, and angular ranges of turning and of braking.
const RANGE: f64 = 0.35;
const TURNING: f64 = 2.0;
const BRAKING: f64 = 3.0;
/// Strength of walls, m/s^2, and their range, m.
const WALL: (f64, f64) = (3.0, 0.1);
/// Nobody farther away counts, m.
const SIGHT: f64 = 10.0;

/// Who is acted upon.
#[derive(Debug, Clone, Copy)]
pub(super) struct Agent {
    pub(super) position: Point2<f64>,
    pub(super) velocity: Vector2<f64>,
    pub(super) radius: f64,
    /// The velocity toward the next point of the way.
    pub(super) wanted: Vector2<f64>,
}

/// All forces on `agent`.
pub(super) fn force(agent: &Agent, people: &[Person], obstacles: &Obstacles) -> Vector2<f64> {
    let mut sum = (agent.wanted - agent.velocity) / RELAXATION;
    for person in people {
        let near = distance_squared(&person.position(), &agent.position) < SIGHT * SIGHT;
        if near {
            sum += interaction(agent, person.position(), person.velocity);
        }
    }
    sum + obstacles_push(agent, obstacles)
}

/// The force of one person: braking along the direction of interaction, and turning across it.
fn interaction(agent: &Agent, position: Point2<f64>, velocity: Vector2<f64>) -> Vector2<f64> {
    let way = position - agent.position;
    let far = way.norm().max(1e-3);
    let toward = way / far;
    let interaction = (agent.velocity - velocity) * IMPORTANCE + toward;
    let length = interaction.norm();
    if length < 1e-6 {
        return Vector2::zeros();
    }
    let along = interaction / length;
    let left = Vector2::new(-along.y, along.x);
    let angle = along.perp(&toward).atan2(along.dot(&toward));
    let reach = RANGE * length;
    let falls = |range: f64| (-far / reach - (range * reach * angle).powi(2)).exp();
    // Who is met head-on is passed on the right.
    let side = if angle >= 0.0 { 1.0 } else { -1.0 };
    (along * falls(BRAKING) + left * (side * falls(TURNING))) * -STRENGTH
}

/// The force of the nearest wall or piece of furniture, away from it.
fn obstacles_push(agent: &Agent, obstacles: &Obstacles) -> Vector2<f64> {
    let step = 0.01;
    let clearance = |x: f64, y: f64| obstacles.clearance(agent.position + Vector2::new(x, y));
    let here = clearance(0.0, 0.0);
    if here > agent.radius + 10.0 * WALL.1 {
        return Vector2::zeros();
    }
    let slope = Vector2::new(
        clearance(step, 0.0) - clearance(-step, 0.0),
        clearance(0.0, step) - clearance(0.0, -step),
    );
    let away = slope.try_normalize(1e-9).unwrap_or_default();
    away * (WALL.0 * (-(here - agent.radius).max(0.0) / WALL.1).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry2;

    fn agent() -> Agent {
        Agent {
            position: Point2::origin(),
            velocity: Vector2::new(1.0, 0.0),
            radius: 0.2,
            wanted: Vector2::new(1.0, 0.0),
        }
    }

    fn wall(y: f64) -> Obstacles {
        let mut obstacles = Obstacles::new();
        obstacles.push_wall([Point2::new(-5.0, y), Point2::new(5.0, y)]);
        obstacles
    }

    fn person(x: f64, y: f64, velocity: Vector2<f64>) -> Person {
        Person {
            name: "ana".into(),
            world_from_person: Isometry2::new(Vector2::new(x, y), 0.0),
            velocity,
            radius: 0.2,
        }
    }

    #[test]
    fn who_comes_head_on_is_braked_for_and_passed_on_the_right() {
        let force = force(
            &agent(),
            &[person(2.0, 0.0, Vector2::new(-1.0, 0.0))],
            &Obstacles::new(),
        );
        assert!(force.x < -0.1 && force.y < -0.1, "{force}");
    }

    #[test]
    fn the_figures_of_the_paper_give_the_force_that_its_formula_says() {
        // The interaction is 2 (1 - 0) + 1 = 3 long, so B = 1.05; straight ahead the angle is none.
        let force = interaction(&agent(), Point2::new(2.1, 0.0), Vector2::zeros());
        let expected = 4.5 * f64::exp(-2.0);
        assert!(
            (force - Vector2::new(-expected, -expected)).norm() < 1e-9,
            "{force}"
        );
        let left = interaction(&agent(), Point2::new(2.0, 0.5), Vector2::zeros());
        let right = interaction(&agent(), Point2::new(2.0, -0.5), Vector2::zeros());
        assert!(left.y < 0.0 && right.y > 0.0, "{left} {right}");
    }

    #[test]
    fn who_walks_alike_beside_and_far_walls_do_not_matter_much() {
        let beside = person(0.0, 2.0, Vector2::new(1.0, 0.0));
        assert!(force(&agent(), &[beside], &wall(-2.0)).norm() < 0.1);
        let push = force(&agent(), &[], &wall(-0.3));
        assert!(
            (push - Vector2::new(0.0, 3.0 * f64::exp(-1.0))).norm() < 1e-6,
            "{push}"
        );
    }
}
