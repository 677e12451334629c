//! Grid maps in the formats of path planning research: `MovingAI` maps (`.map`), the same with a cost
//! a cell (`.wmap`), and lists of problems with their optimal lengths (`.scen`). This file owns the
//! formats, and guarantees that a file is read whole or every broken line of it is told.
//!
//! A cell is (column, row) from the upper left, as in the files; a cell is 1 wide, so that lengths
//! are in cells. Source: Sturtevant, "Benchmarks for Grid-Based Pathfinding", 2012.

#[cfg(test)]
mod tests;

use crate::scenario::{Invalid, Problem, ProblemKind};
use agents::grid::{BLOCKED, Cell, CostGrid};
use nalgebra::Point2;
use std::ops::Range;

/// Larger maps are refused: 10^8 cells take 400 MB.
const MOST_CELLS: usize = 100_000_000;

/// One line of a `.scen` file.
#[derive(Debug, Clone, PartialEq)]
pub struct GridProblem {
    /// Its line in the file, from 1.
    pub line: usize,
    /// Where the path begins.
    pub start: Cell,
    /// Where it ends.
    pub goal: Cell,
    /// The length of the shortest path, cells: straight steps 1, diagonal ones sqrt 2.
    pub length: f64,
}

/// The lines of a text, each with the bytes it takes without its end.
fn lines(text: &str) -> impl Iterator<Item = (&str, Range<usize>)> {
    let mut start = 0;
    text.split_inclusive('\n').map(move |whole| {
        let line = whole.trim_end_matches(['\n', '\r']);
        let span = start..start + line.len();
        start += whole.len();
        (line, span)
    })
}

fn problem(message: impl Into<String>, span: Range<usize>) -> Problem {
    let message = message.into();
    Problem::new(ProblemKind::Syntax { message }, span)
}

/// Reads a map: `type octile` or `type weighted_octile`, `height H`, `width W`, `map`, then H rows of
/// W characters. `file` is how diagnostics call it.
///
/// `.` and `G` are free and cost 1, `@`, `O`, `T` (trees) and `W` (water) are blocked. Under
/// `octile`, `S` (swamp) is free; under `weighted_octile`, the digits 1 to 9 are costs, `o` costs 1.5
/// and `r` 3.5 (READING.md item 7: an object without and with activity).
///
/// # Errors
/// Every broken line.
pub fn parse_map(file: &str, text: &str) -> Result<CostGrid, Box<Invalid>> {
    read_map(text).map_err(|problems| Box::new(Invalid::new(file, text, problems)))
}

fn read_map(text: &str) -> Result<CostGrid, Vec<Problem>> {
    let mut lines = lines(text);
    let end = text.len()..text.len();
    let mut header = |key: &str| -> Result<(String, Range<usize>), Vec<Problem>> {
        let (line, span) = lines.next().unwrap_or(("", end.clone()));
        let mut words = line.split_whitespace();
        if words.next() != Some(key) {
            return Err(vec![problem(format!("expected `{key} ...` here"), span)]);
        }
        Ok((words.next().unwrap_or_default().to_owned(), span))
    };
    let (kind, span) = header("type")?;
    let cost: fn(u8) -> Option<f32> = match kind.as_str() {
        "octile" => octile_cost,
        "weighted_octile" => weighted_cost,
        _ => {
            let message = format!("`{kind}` is no type of map: octile or weighted_octile");
            return Err(vec![problem(message, span)]);
        }
    };
    let mut side = |key: &str| {
        let (value, span) = header(key)?;
        match value.parse::<usize>() {
            Ok(side) if (1..=MOST_CELLS).contains(&side) => Ok((side, span)),
            _ => Err(vec![problem(
                format!("the {key} must be a whole number from 1"),
                span,
            )]),
        }
    };
    let (height, span) = side("height")?;
    let (width, _) = side("width")?;
    if width.saturating_mul(height) > MOST_CELLS {
        let message = format!("{width} x {height} cells are too many: at most {MOST_CELLS}");
        return Err(vec![problem(message, span)]);
    }
    header("map")?;
    let mut problems = Vec::new();
    let mut costs = Vec::with_capacity(width * height);
    let mut rows = 0;
    for (line, span) in lines.filter(|(line, _)| !line.trim().is_empty()) {
        rows += 1;
        if line.chars().count() != width {
            let message = format!(
                "this row has {} cells, the map is {width} wide",
                line.chars().count()
            );
            problems.push(problem(message, span));
            continue;
        }
        for (at, cell) in line.char_indices() {
            match u8::try_from(cell).ok().and_then(cost) {
                Some(cost) => costs.push(cost),
                None => {
                    let at = span.start + at..span.start + at + cell.len_utf8();
                    problems.push(problem(format!("`{cell}` is no cell of type {kind}"), at));
                }
            }
        }
    }
    if rows != height {
        let message = format!("the map has {rows} rows, its height is {height}");
        problems.push(problem(message, end));
    }
    if !problems.is_empty() {
        return Err(problems);
    }
    Ok(CostGrid {
        origin: Point2::origin(),
        resolution: 1.0,
        width,
        height,
        costs,
    })
}

fn octile_cost(cell: u8) -> Option<f32> {
    match cell {
        b'.' | b'G' | b'S' => Some(1.0),
        b'@' | b'O' | b'T' | b'W' => Some(BLOCKED),
        _ => None,
    }
}

fn weighted_cost(cell: u8) -> Option<f32> {
    match cell {
        b'1'..=b'9' => Some(f32::from(cell - b'0')),
        b'o' => Some(1.5),
        b'r' => Some(3.5),
        b'S' => None,
        _ => octile_cost(cell),
    }
}

/// Reads a list of problems for a map of `grid`'s size: `version 1`, then a line each of bucket, map,
/// width, height, start column and row, goal column and row, optimal length.
///
/// # Errors
/// Every broken line, also one for a map of another size or with an end outside the map.
pub fn parse_problems(
    file: &str,
    text: &str,
    grid: &CostGrid,
) -> Result<Vec<GridProblem>, Box<Invalid>> {
    let mut problems = Vec::new();
    let mut read = Vec::new();
    for (at, (line, span)) in lines(text).enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.is_empty() || (at == 0 && words[0] == "version") {
            continue;
        }
        match grid_problem(&words, grid) {
            Ok((start, goal, length)) => read.push(GridProblem {
                line: at + 1,
                start,
                goal,
                length,
            }),
            Err(message) => problems.push(problem(message, span)),
        }
    }
    if problems.is_empty() && read.is_empty() {
        problems.push(problem("this file lists no problems", 0..text.len().min(1)));
    }
    if problems.is_empty() {
        Ok(read)
    } else {
        Err(Box::new(Invalid::new(file, text, problems)))
    }
}

fn grid_problem(words: &[&str], grid: &CostGrid) -> Result<(Cell, Cell, f64), String> {
    let &[_, _, width, height, x, y, goal_x, goal_y, length] = words else {
        let message = "expected 9 words: bucket, map, width, height, start x and y, goal x and y, optimal length";
        return Err(format!("{message}; here are {}", words.len()));
    };
    let whole = |word: &str| {
        let number = word.parse::<usize>();
        number.map_err(|_| format!("`{word}` must be a whole number from 0"))
    };
    if (whole(width)?, whole(height)?) != (grid.width, grid.height) {
        let (columns, rows) = (grid.width, grid.height);
        return Err(format!(
            "this problem is for a map of {width} x {height} cells, the map has {columns} x {rows}"
        ));
    }
    let cell = |x: &str, y: &str| {
        let cell = (whole(x)?, whole(y)?);
        if cell.0 < grid.width && cell.1 < grid.height {
            Ok(cell)
        } else {
            Err(format!("cell {x},{y} lies outside the map"))
        }
    };
    let optimum = length.parse().ok().filter(|&length: &f64| length >= 0.0);
    let optimum = optimum.ok_or_else(|| format!("`{length}` must be a length"))?;
    Ok((cell(x, y)?, cell(goal_x, goal_y)?, optimum))
}
