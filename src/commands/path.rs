//! `cortex path`: the cheapest path over a grid map, and whether those that a list calls optimal
//! are what the planner of the robot finds.

use super::output::{print, print_json};
use crate::cli::{self, Path as Arguments};
use crate::{Answer, Failure};
use agents::grid::{Cell, CostGrid};
use agents::navigation::path::{
    Algorithm, CostModel, Path, PathError, Replanner, Request, Search, length_of,
};
use scenarios::grid_file::{parse_map, parse_problems};
use serde_json::json;
use std::fmt::Write as _;

/// A length that differs by less than this, in cells, is the same: lists round theirs.
const SAME: f64 = 1e-3;

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let file = arguments.map.as_ref().or(arguments.grid.as_ref());
    let file = file.ok_or_else(|| Failure::input("give a map by --map or --grid"))?;
    let grid = parse_map(&file.display().to_string(), &super::read_text(file)?)
        .map_err(|invalid| Failure::Input((*invalid).into()))?;
    match (&arguments.scen, arguments.from, arguments.to) {
        (Some(list), ..) => check(arguments, &grid, list),
        (None, Some(from), Some(to)) => find(arguments, &grid, from, to),
        _ => Err(Failure::input("give both --from and --to, or --scen")),
    }
}

/// The cheapest path as the arguments ask for it.
fn cheapest(
    arguments: &Arguments,
    search: &mut Search,
    grid: &CostGrid,
    (from, to): (Cell, Cell),
) -> Result<Path, PathError> {
    let model = match arguments.model {
        cli::CostModel::LengthMean => CostModel::LengthMean,
        cli::CostModel::LengthDest => CostModel::LengthDest,
        cli::CostModel::NodeSum => CostModel::NodeSum,
    };
    let algorithm = match arguments.algorithm {
        cli::PathAlgorithm::Dijkstra => Algorithm::Dijkstra,
        cli::PathAlgorithm::AStar => Algorithm::AStar,
        cli::PathAlgorithm::DStarLite => {
            return Replanner::new(grid, to, model)?.find(grid, from);
        }
    };
    let request = Request {
        model,
        algorithm,
        ..Request::new(from, to)
    };
    search.find(grid, &request)
}

fn find(arguments: &Arguments, grid: &CostGrid, from: Cell, to: Cell) -> Result<Answer, Failure> {
    for (flag, cell) in [("--from", from), ("--to", to)] {
        if cell.0 >= grid.width || cell.1 >= grid.height {
            return Err(Failure::input(format!(
                "{flag} {},{} lies outside the map, which has {} x {} cells",
                cell.0, cell.1, grid.width, grid.height
            )));
        }
    }
    match cheapest(arguments, &mut Search::default(), grid, (from, to)) {
        Ok(path) => {
            let length = length_of(&path.cells);
            if arguments.json {
                print_json(&json!({ "cost": path.cost, "length": length, "cells": path.cells }))?;
            } else {
                print(&told(&path, length))?;
            }
            Ok(Answer::Yes)
        }
        Err(reason) => {
            if arguments.json {
                print_json(&json!({
                    "cost": null, "length": null, "cells": [], "reason": reason.to_string(),
                }))?;
            } else {
                print(&format!("no path: {reason}\n"))?;
            }
            Ok(Answer::No)
        }
    }
}

fn told(path: &Path, length: f64) -> String {
    let mut text = String::new();
    for cell in &path.cells {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{},{}", cell.0, cell.1);
    }
    let count = path.cells.len();
    let _ = writeln!(
        text,
        "{count} cells, length {length:.3}, cost {:.3}",
        path.cost
    );
    text
}

fn check(
    arguments: &Arguments,
    grid: &CostGrid,
    list: &std::path::Path,
) -> Result<Answer, Failure> {
    let problems = parse_problems(&list.display().to_string(), &super::read_text(list)?, grid)
        .map_err(|invalid| Failure::Input((*invalid).into()))?;
    let mut search = Search::default();
    let mut mismatches = Vec::new();
    for problem in &problems {
        let ends = (problem.start, problem.goal);
        let found = cheapest(arguments, &mut search, grid, ends);
        let length = found.as_ref().map(|path| length_of(&path.cells));
        if !length
            .as_ref()
            .is_ok_and(|length| (length - problem.length).abs() < SAME)
        {
            let found = length.map_or_else(|reason| json!(reason.to_string()), |l| json!(l));
            mismatches.push(json!({
                "line": problem.line, "from": problem.start, "to": problem.goal,
                "expected": problem.length, "found": found,
            }));
        }
    }
    let (checked, mismatched) = (problems.len(), mismatches.len());
    let matched = checked - mismatched;
    if arguments.json {
        print_json(&json!({
            "checked": checked, "matched": matched, "mismatched": mismatched,
            "mismatches": mismatches,
        }))?;
    } else {
        let mut text = String::new();
        for m in &mismatches {
            let _ = writeln!(
                text,
                "line {}: expected length {}, found {}",
                m["line"], m["expected"], m["found"]
            );
        }
        let _ = writeln!(
            text,
            "{checked} checked, {matched} matched, {mismatched} mismatched"
        );
        print(&text)?;
    }
    Ok(if mismatched == 0 {
        Answer::Yes
    } else {
        Answer::No
    })
}
