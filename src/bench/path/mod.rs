//! Measuring path search and the elastic band. It guarantees that every path that is timed costs what
//! the searches beside it find, and that they take turns in one run.

mod floor;
mod peers;
mod reaction;

use super::chance::Chance;
use super::figure::{Figure, median};
use crate::Failure;
use agents::grid::{BLOCKED, Cell, CostGrid};
use agents::navigation::band::{Band, Gains, Surroundings};
use agents::navigation::obstacles::Obstacles;
use agents::navigation::path::{Algorithm, CostModel, PathError, Replanner, Request, Search};
use floor::RESOLUTION;
use nalgebra::Point2;
use std::hint::black_box;
use std::time::Instant;

/// Costs in cells that differ by less are the same.
const SAME: f64 = 1e-3;

/// How long `act` takes, in nanoseconds, and what came of it.
fn time<T>(act: impl FnOnce() -> T) -> (u64, T) {
    let start = Instant::now();
    let done = act();
    (start.elapsed().as_nanos() as u64, done)
}

fn agree(found: f64, other: Option<f64>) -> Result<(), Failure> {
    match other {
        Some(other) if (found - other).abs() < SAME => Ok(()),
        _ => Err(Failure::internal(format!(
            "a path of the measurement costs {found}, another search says {other:?}"
        ))),
    }
}

/// The cost in cells and the time of a search of ours.
fn ours(search: &mut Search, grid: &CostGrid, algorithm: Algorithm) -> Result<(u64, f64), Failure> {
    let [start, goal] = floor::corners(grid);
    let request = Request {
        algorithm,
        ..Request::new(start, goal)
    };
    let (nanoseconds, path) = time(|| search.find(grid, &request));
    let path = path.map_err(Failure::internal)?;
    Ok((nanoseconds, path.cost / RESOLUTION))
}

/// Figures of searches from corner to corner of a floor of `side` x `side` cells.
fn searches(
    names: [&'static str; 3],
    side: usize,
    turns: usize,
    figures: &mut Vec<Figure>,
) -> Result<(), Failure> {
    let grid = floor::floor(side);
    let [start, goal] = floor::corners(&grid);
    let mut search = Search::default();
    let mut samples: [Vec<u64>; 4] = Default::default();
    for _ in 0..turns {
        let (dijkstra, cost) = ours(&mut search, &grid, Algorithm::Dijkstra)?;
        let (astar, by_astar) = ours(&mut search, &grid, Algorithm::AStar)?;
        agree(cost, Some(by_astar))?;
        let (flat, found) = time(|| peers::flat_dijkstra(&grid, start, goal));
        agree(cost, found)?;
        let (crate_astar, found) = time(|| peers::pathfinding_astar(&grid, start, goal));
        agree(cost, found)?;
        let turn = [dijkstra, astar, flat, crate_astar];
        for (samples, sample) in samples.iter_mut().zip(turn) {
            samples.push(sample);
        }
    }
    let [dijkstra, astar, flat, crate_astar] =
        samples.map(|mut samples| median(&mut samples) * 1e-6);
    let flat_name = "Dijkstra with a binary heap on flat arrays";
    for (name, value, raw, peer) in [
        (names[0], dijkstra, flat, flat_name),
        (names[1], astar, flat, flat_name),
        (names[2], astar, crate_astar, "A* of the crate pathfinding"),
    ] {
        figures.push(Figure {
            name,
            value,
            unit: "ms",
            raw: Some(raw),
            peer: peer.to_owned(),
        });
    }
    Ok(())
}

/// How often somebody stands in the way and is gone again.
const VISITORS: usize = 30;

/// Time until there is a path again when somebody steps on it, as the robot goes along a floor of `side`
/// x `side` cells: beside the same planner as it begins anew, and beside A*.
fn replanning(
    names: [&'static str; 2],
    side: usize,
    figures: &mut Vec<Figure>,
) -> Result<(), Failure> {
    let mut grid = floor::floor(side);
    let [start, goal] = floor::corners(&grid);
    let mut chance = Chance::new(8);
    let planner_from = |grid: &CostGrid, robot: Cell| {
        let mut planner = Replanner::new(grid, goal, CostModel::LengthMean)?;
        let path = planner.find(grid, robot)?;
        Ok::<_, PathError>((planner, path))
    };
    let (mut planner, mut path) = planner_from(&grid, start).map_err(Failure::internal)?;
    let mut search = Search::default();
    let (mut again, mut anew, mut scratch) = (Vec::new(), Vec::new(), Vec::new());
    while path.cells.len() > 120 && again.len() < 2 * VISITORS {
        // The robot goes on by 4 cells; somebody stands up to 4 m ahead, then is gone.
        let robot = path.cells[4];
        let ahead = path.cells[24 + chance.below(60) as usize];
        let person: Vec<Cell> = floor::disc(&grid, ahead, 9);
        let before: Vec<f32> = person.iter().map(|&cell| grid.cost(cell)).collect();
        for there in [true, false] {
            for (&cell, &cost) in person.iter().zip(&before) {
                let at = grid.index(cell);
                grid.costs[at] = if there { BLOCKED } else { cost };
            }
            let (ours, found) = time(|| {
                planner.update(&grid, person.iter().copied());
                planner.find(&grid, robot)
            });
            let (theirs, other) = time(|| search.find(&grid, &Request::new(robot, goal)));
            match (found, other) {
                (Ok(found), Ok(other)) => {
                    agree(found.cost / RESOLUTION, Some(other.cost / RESOLUTION))?;
                    if !there {
                        path = found;
                    }
                }
                (found, other) => {
                    if found.is_ok() != other.is_ok() {
                        return Err(Failure::internal("one search finds a path, the other none"));
                    }
                }
            }
            again.push(ours);
            scratch.push(theirs);
        }
        if anew.len() < 5 {
            anew.push(time(|| planner_from(&grid, robot)).0);
        }
    }
    let value = median(&mut again) * 1e-6;
    for (name, mut samples, peer) in [
        (names[0], anew, "the same planner from scratch"),
        (names[1], scratch, "our own A* from scratch"),
    ] {
        figures.push(Figure {
            name,
            value,
            unit: "ms",
            raw: Some(median(&mut samples) * 1e-6),
            peer: peer.to_owned(),
        });
    }
    Ok(())
}

/// Time of one update of a band of 100 points among the 720 points of a laser scan.
fn band(figures: &mut Vec<Figure>) {
    let gains = Gains::default();
    // A corridor of 3 m with pillars, as a laser in its middle sees it.
    let mut obstacles = Obstacles::new();
    for beam in 0..720u32 {
        let along = 25.0 * f64::from(beam / 2) / 360.0;
        let pillar = if beam % 90 < 6 { 0.6 } else { 0.0 };
        let side = if beam % 2 == 0 {
            1.5 - pillar
        } else {
            pillar - 1.5
        };
        obstacles.push_point(Point2::new(along, side));
    }
    let ends = [
        Point2::new(0.0, 0.0),
        Point2::new(99.0 * gains.spacing, 0.0),
    ];
    let around = Surroundings {
        obstacles: &obstacles,
        people: &[],
        grid: None,
        radius: 0.3,
        speed: 0.6,
    };
    let mut band = Band::new(&ends, &gains);
    let mut samples = Vec::new();
    for _ in 0..500 {
        let (nanoseconds, state) = time(|| band.update(&around, &gains, 1));
        black_box(state);
        samples.push(nanoseconds);
    }
    figures.push(Figure {
        name: "band_100",
        value: median(&mut samples) * 1e-6,
        unit: "ms",
        raw: None,
        peer: format!("{} points, 720 beams", band.points().len()),
    });
}

/// All figures of path search and band.
pub(crate) fn paths() -> Result<Vec<Figure>, Failure> {
    let mut figures = Vec::new();
    searches(
        ["dijkstra_400", "astar_400", "astar_400_crate"],
        400,
        21,
        &mut figures,
    )?;
    searches(
        ["dijkstra_2000", "astar_2000", "astar_2000_crate"],
        2000,
        3,
        &mut figures,
    )?;
    replanning(["replan_400", "replan_400_astar"], 400, &mut figures)?;
    replanning(["replan_2000", "replan_2000_astar"], 2000, &mut figures)?;
    band(&mut figures);
    reaction::reaction(&mut figures)?;
    Ok(figures)
}
