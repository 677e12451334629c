//! People's density as one draws it without more thought: everybody's window of cells, the greatest
//! density kept. With numpy in a process of its own where there is one, else the same loop in Rust. Both
//! are refused where their cells do not add up to what ours add up to.

use super::{CELL, CELLS, RUNS, field, seconds, sources};
use crate::Failure;
use agents::social_mapping::FourSided;
use agents::social_mapping::density::LEAST_DENSITY;
use nalgebra::{Isometry2, Point2};
use std::fmt::Write as _;
use std::hint::black_box;
use std::io::Write as _;
use std::process::{Command, Stdio};

/// What numpy or the loop is called, and its seconds.
pub(super) fn peer(people: &[Isometry2<f64>]) -> Result<(&'static str, f64), Failure> {
    let (name, seconds, sum) = match numpy(people) {
        Some((seconds, sum)) => ("windowed numpy", seconds, sum),
        None => {
            let seconds = seconds(RUNS, || (), |()| drop(black_box(draw(black_box(people)))));
            let name = "the windowed loop in Rust, for want of numpy";
            (name, seconds, total(&draw(people)))
        }
    };
    let ours = total(field(&sources(people)).densities());
    if (sum - ours).abs() > 1e-4 * ours {
        return Err(Failure::internal(format!(
            "{name} draws densities that add up to {sum}, ours to {ours}"
        )));
    }
    Ok((name, seconds))
}

fn total(densities: &[f32]) -> f64 {
    densities.iter().copied().map(f64::from).sum()
}

/// Median seconds and the sum of all cells; `None` where python3 or numpy are missing.
fn numpy(people: &[Isometry2<f64>]) -> Option<(f64, f64)> {
    let figures = [
        CELLS.to_string(),
        CELL.to_string(),
        LEAST_DENSITY.to_string(),
        RUNS.to_string(),
    ];
    let mut child = Command::new("python3")
        .args(["-c", include_str!("windowed.py")])
        .args(figures)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .ok()?;
    let mut text = String::new();
    for pose in people {
        let place = pose.translation.vector;
        // Writing to a string does not fail.
        let _ = writeln!(text, "{} {} {}", place.x, place.y, pose.rotation.angle());
    }
    // A child without numpy has ended already; its exit says so.
    let mut input = child.stdin.take()?;
    drop(input.write_all(text.as_bytes()));
    drop(input);
    let output = child.wait_with_output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let (seconds, sum) = text.trim().split_once(' ')?;
    Some((seconds.parse().ok()?, sum.parse().ok()?))
}

/// What `windowed.py` does.
fn draw(people: &[Isometry2<f64>]) -> Vec<f32> {
    let shape = FourSided::HALL;
    let reach = f64::from(-2.0 * LEAST_DENSITY.ln()).sqrt();
    let mut densities = vec![0.0f32; CELLS * CELLS];
    for pose in people {
        let (place, ahead) = (pose.translation.vector, pose.rotation);
        let extent = |cos: f64, sin: f64| reach * (shape.front * cos).hypot(shape.left * sin);
        let (cos, sin) = (ahead.angle().cos(), ahead.angle().sin());
        // A float to integer cast saturates.
        let span = |middle: f64, extent: f64| {
            let cell = |x: f64| ((x / CELL) as usize).min(CELLS);
            cell(middle - extent)..(cell(middle + extent) + 1).min(CELLS)
        };
        for row in span(place.y, extent(sin, cos)) {
            for column in span(place.x, extent(cos, sin)) {
                let centre = Point2::new((column as f64 + 0.5) * CELL, (row as f64 + 0.5) * CELL);
                let density = shape.density(pose, centre) as f32;
                let slot = &mut densities[row * CELLS + column];
                *slot = slot.max(density);
            }
        }
    }
    for density in &mut densities {
        if *density < LEAST_DENSITY {
            *density = 0.0;
        }
    }
    densities
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loop_draws_what_ours_draws() {
        let people = super::super::crowd(5, super::super::SIDE);
        let (ours, loops) = (field(&sources(&people)), draw(&people));
        for (ours, loops) in ours.densities().iter().zip(&loops) {
            assert!((ours - loops).abs() < 1e-4, "{ours} {loops}");
        }
    }
}
