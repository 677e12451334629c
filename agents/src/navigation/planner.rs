//! The global path as the navigator uses it: from the robot to a place, on the social grid and on
//! what the robot knows beyond it. This file guarantees that the caller's grid is left alone, and
//! that as long as the goal stays, only what changed on the grid is searched again.

use super::obstacles::Obstacles;
use super::path::{CostModel, Path, PathError, Replanner, Request, Search, free_cells_near};
use super::people::{INTIMATE, PERSONAL, Person, Presence};
use super::target::Destination;
use crate::grid::{BLOCKED, Cell, CostGrid};
use nalgebra::{Point2, Vector2, distance, distance_squared};

/// The cost of a node in personal space (READING.md item 7).
const PERSONAL_COST: f32 = 4.0;
/// What a metre through blocked cells counts as when paths are compared.
const BLOCKED_COST: f64 = 20.0;
/// A line that stays in blocked cells for longer than this is blocked, metres; the band may well cut
/// the corner of a cell.
const BLOCKED_STRETCH: f64 = 0.3;
/// Walkers are expected at the places where they will be in so many seconds.
const EXPECTED: [f64; 6] = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0];
/// A place counts as taken when the robot would be there within so many seconds of the walker.
const MEETING: f64 = 1.0;
/// A blocked start gives way this far, metres: the robot may stand in a space that has just grown.
const START_TOLERANCE: f64 = 1.0;

/// A path search on a grid of its own.
#[derive(Debug, Clone)]
pub(super) struct Planner {
    search: Search,
    grid: CostGrid,
    /// Of the goal asked for last.
    replanner: Option<Replanner>,
}

impl Default for Planner {
    fn default() -> Self {
        Self {
            search: Search::default(),
            grid: CostGrid::covering([0.0; 4], 1.0),
            replanner: None,
        }
    }
}

/// What a line meets on the grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Price {
    /// Metres times node cost.
    pub(super) cost: f64,
    /// Whether the line runs through blocked cells.
    pub(super) blocked: bool,
}

impl Planner {
    /// Takes `grid` as it is now.
    pub(super) fn load(&mut self, grid: &CostGrid) {
        let mut costs = std::mem::take(&mut self.grid.costs);
        costs.clear();
        costs.extend_from_slice(&grid.costs);
        self.grid = CostGrid { costs, ..*grid };
    }

    /// Makes the places dearer where somebody who walks will be when a robot from `robot` at
    /// `speed` m/s can be there too.
    pub(super) fn expect(&mut self, people: &[Person], robot: Point2<f64>, speed: f64) {
        for person in people.iter().filter(|person| person.is_walking()) {
            for time in EXPECTED {
                let then = person.predicted(time);
                self.within(then.position, 1.2, |place, cost| {
                    let arrival = distance(&robot, &place) / speed.max(0.05);
                    let met = (arrival - time).abs() < MEETING;
                    if met && then.squared_deviation(place) < PERSONAL {
                        cost.max(PERSONAL_COST)
                    } else {
                        cost
                    }
                });
            }
        }
    }

    /// Blocks what the laser sees within `reach` metres of `robot` and where people stand, for a
    /// robot of that `radius`: for when the map has shown to be wrong.
    pub(super) fn block(
        &mut self,
        obstacles: &Obstacles,
        people: &[Presence],
        robot: Point2<f64>,
        (radius, reach): (f64, f64),
    ) {
        for &point in obstacles.points() {
            if distance_squared(&point, &robot) < reach * reach {
                let touches =
                    |place: Point2<f64>| distance_squared(&place, &point) < radius * radius;
                self.within(
                    point,
                    radius,
                    |place, cost| if touches(place) { BLOCKED } else { cost },
                );
            }
        }
        for person in people {
            let near = radius + person.radius;
            self.within(person.position, near.max(0.5), |place, cost| {
                let taken = person.squared_deviation(place) < INTIMATE
                    || distance(&place, &person.position) < near;
                if taken { BLOCKED } else { cost }
            });
        }
    }

    /// Gives the cells around `centre` a new cost, from their own centre and cost.
    fn within(&mut self, centre: Point2<f64>, reach: f64, new: impl Fn(Point2<f64>, f32) -> f32) {
        let corner = centre - Vector2::new(reach, reach);
        let cell = |offset: f64| (offset / self.grid.resolution).floor().max(0.0) as usize;
        let low = corner - self.grid.origin;
        let high = low + Vector2::new(2.0 * reach, 2.0 * reach);
        if high.x < 0.0 || high.y < 0.0 {
            return;
        }
        let columns = cell(low.x)..(cell(high.x) + 1).min(self.grid.width);
        for row in cell(low.y)..(cell(high.y) + 1).min(self.grid.height) {
            for column in columns.clone() {
                let index = self.grid.index((column, row));
                let place = self.grid.centre((column, row));
                self.grid.costs[index] = new(place, self.grid.costs[index]);
            }
        }
    }

    /// The cheapest line from `robot` to `destination`, or to the nearest place within `tolerance`
    /// metres of it that can be reached.
    ///
    /// # Errors
    /// [`PathError`]; a place outside the grid counts as one.
    pub(super) fn line_to(
        &mut self,
        robot: Point2<f64>,
        destination: &Destination,
        tolerance: f64,
    ) -> Result<Vec<Point2<f64>>, PathError> {
        let outside: Cell = (self.grid.width, self.grid.height);
        let start = self
            .grid
            .cell_at(robot)
            .ok_or(PathError::StartOutside(outside))?;
        let goal = self
            .grid
            .cell_at(destination.point)
            .ok_or(PathError::GoalOutside(outside))?;
        let path = self.path(start, goal, tolerance)?;
        let mut line = vec![robot];
        line.extend(
            path.cells
                .iter()
                .skip(1)
                .map(|&cell| self.grid.centre(cell)),
        );
        if path.cells.last() == Some(&goal) {
            if line.len() > 1 {
                line.pop();
            }
            line.push(destination.point);
        } else if line.len() == 1 {
            line.push(self.grid.centre(path.cells[0]));
        }
        Ok(line)
    }

    /// Whether anything that was loaded since the last path could make it another one.
    pub(super) fn has_news(&self) -> bool {
        let known = self.replanner.as_ref();
        known.is_none_or(|replanner| replanner.differs(&self.grid))
    }

    /// The cheapest path, by the planner that is kept for the goal; where an end has to give way to
    /// another than the nearest free cell, by a search that looks at all of them.
    fn path(&mut self, start: Cell, goal: Cell, goal_tolerance: f64) -> Result<Path, PathError> {
        let end = free_cells_near(&self.grid, goal, goal_tolerance);
        if let (true, Some(&end)) = (self.grid.cost(start) < BLOCKED, end.first()) {
            let kept = self.replanner.take().filter(|kept| kept.goal() == end);
            let mut replanner = match kept {
                Some(mut kept) => {
                    kept.observe(&self.grid);
                    kept
                }
                None => Replanner::new(&self.grid, end, CostModel::default())?,
            };
            let found = replanner.find(&self.grid, start);
            self.replanner = Some(replanner);
            if !matches!(found, Err(PathError::Unreachable { .. })) {
                return found;
            }
        }
        let request = Request {
            start_tolerance: START_TOLERANCE,
            goal_tolerance,
            ..Request::new(start, goal)
        };
        self.search.find(&self.grid, &request)
    }

    /// What `line` meets on the grid as it is loaded.
    pub(super) fn price(&self, line: &[Point2<f64>]) -> Price {
        price(&self.grid, line)
    }
}

/// What `line` meets on `grid`. The first half metre is not held against it, since the robot is
/// there already.
pub(super) fn price(grid: &CostGrid, line: &[Point2<f64>]) -> Price {
    let mut price = Price {
        cost: 0.0,
        blocked: false,
    };
    let (mut along, mut stretch) = (0.0, 0.0);
    for pair in line.windows(2) {
        let length = distance(&pair[0], &pair[1]);
        let pieces = (length / (0.5 * grid.resolution)).ceil().max(1.0) as usize;
        let step = length / pieces as f64;
        for k in 0..pieces {
            let place = pair[0] + (pair[1] - pair[0]) * ((k as f64 + 0.5) / pieces as f64);
            let cost = grid.cell_at(place).map_or(BLOCKED, |cell| grid.cost(cell));
            along += step;
            let free = cost < BLOCKED;
            price.cost += step * if free { f64::from(cost) } else { BLOCKED_COST };
            stretch = if free || along < 0.5 {
                0.0
            } else {
                stretch + step
            };
            price.blocked |= stretch > BLOCKED_STRETCH;
        }
    }
    price
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry2;

    fn planner() -> Planner {
        let mut planner = Planner::default();
        planner.load(&CostGrid::covering([0.0, 0.0, 6.0, 4.0], 0.1));
        planner
    }

    fn to(x: f64, y: f64) -> Destination {
        Destination {
            point: Point2::new(x, y),
            heading: None,
        }
    }

    #[test]
    fn a_line_runs_from_the_robot_to_the_very_place() {
        let robot = Point2::new(0.52, 2.03);
        let line = planner().line_to(robot, &to(5.33, 2.04), 0.0).unwrap();
        assert_eq!(
            (line[0], line[line.len() - 1]),
            (robot, Point2::new(5.33, 2.04))
        );
        let outside = planner().line_to(robot, &to(7.0, 2.0), 1.0);
        assert!(matches!(outside, Err(PathError::GoalOutside(_))));
    }

    #[test]
    fn what_the_laser_sees_is_driven_round_once_it_is_blocked() {
        let mut planner = planner();
        let robot = Point2::new(0.5, 2.0);
        let direct = planner.line_to(robot, &to(5.5, 2.0), 0.0).unwrap();
        let mut obstacles = Obstacles::new();
        (10..24).for_each(|k| obstacles.push_point(Point2::new(3.0, 0.1 * f64::from(k))));
        planner.block(&obstacles, &[], robot, (0.3, 4.0));
        assert!(planner.price(&direct).blocked);
        let round = planner.line_to(robot, &to(5.5, 2.0), 0.0).unwrap();
        assert!(!planner.price(&round).blocked);
        assert!(round.iter().all(|place| obstacles.clearance(*place) > 0.25));
    }

    #[test]
    fn a_walker_is_avoided_where_the_robot_would_meet_them_and_nowhere_else() {
        let walker = |x: f64| Person {
            name: "w".into(),
            world_from_person: Isometry2::new(Vector2::new(x, 0.2), 1.57),
            velocity: Vector2::new(0.0, 1.2),
            radius: 0.25,
        };
        let robot = Point2::new(0.5, 2.0);
        let cost = |x: f64| {
            let mut planner = planner();
            planner.expect(&[walker(x)], robot, 0.8);
            planner.price(&[robot, Point2::new(5.5, 2.0)]).cost
        };
        // The walker crosses the robot's line after 1.5 s, when the robot has come 1.2 m.
        assert!(cost(1.7) > 6.0, "{}", cost(1.7));
        assert!((cost(5.0) - 5.0).abs() < 1e-6);
    }
}
