//! The shortest way that there could have been. This file owns what a way may lead through: anything
//! but walls and furniture, with nobody there.

use super::mapped;
use crate::scenario::Scenario;
use agents::navigation::path::{Request, Search, length_of};
use agents::social_mapping::{SocialConfig, SocialMapper, SocialScene};
use nalgebra::{Point2, distance};

/// Ends in a wall's or an object's margin give way so far, m.
const TOLERANCE: f64 = 1.0;

/// The length of the shortest way from one place of `scenario` to another on an octile grid, m: past
/// walls and objects, at the robot's radius. `None` where there is no way or no map.
pub fn shortest_way(scenario: &Scenario, from: Point2<f64>, to: Point2<f64>) -> Option<f64> {
    let scene = SocialScene {
        bounds: scenario.bounds,
        walls: scenario.walls.clone(),
        robot_radius: scenario.robot.radius,
        social: false,
        objects: scenario.objects.iter().map(mapped).collect(),
        ..SocialScene::default()
    };
    let mut mapper = SocialMapper::new(SocialConfig::default()).ok()?;
    let map = mapper.update(scenario.start, &scene).ok()?;
    let mut grid = (*map.grid).clone();
    // A length, whatever it costs to be near a wall.
    for cost in grid.costs.iter_mut().filter(|cost| cost.is_finite()) {
        *cost = 1.0;
    }
    let request = Request {
        start_tolerance: TOLERANCE,
        goal_tolerance: TOLERANCE,
        ..Request::new(grid.cell_at(from)?, grid.cell_at(to)?)
    };
    let path = Search::default().find(&grid, &request).ok()?;
    let (first, last) = (*path.cells.first()?, *path.cells.last()?);
    let ends = distance(&from, &grid.centre(first)) + distance(&to, &grid.centre(last));
    // Within a cell of its ends the way needs no detour by the centres.
    let detour = if ends < 2.0 * grid.resolution {
        0.0
    } else {
        ends
    };
    let way = length_of(&path.cells) * grid.resolution + detour;
    Some(way.max(distance(&from, &to)))
}

/// Success weighted by path length (Anderson et al., "On Evaluation of Embodied Navigation Agents",
/// 2018): 0 without success, else shortest / max(path, shortest).
pub fn spl(success: bool, shortest: f64, path: f64) -> f64 {
    match () {
        () if !success => 0.0,
        () if shortest <= 0.0 => 1.0,
        () => shortest / path.max(shortest),
    }
}
