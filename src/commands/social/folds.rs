//! `cortex social comfort --folds K`: how well the figures of comfort would do on scenes that they were
//! not chosen on. In each of K parts of the scenes, figures chosen on all others are held against
//! people's ratings, beside the documented ones, which were chosen on none.

use super::comfort::rank_correlation;
use super::refused;
use crate::commands::output::{print, print_json};
use crate::{Answer, Failure};
use agents::social_mapping::{AsymmetricGaussian, Comfort};
use nalgebra::Point2;
use scenarios::scenes::{RatedScene, parse_scenes};
use serde_json::json;
use std::fmt::Write as _;
use std::path::Path;

/// What the widths of people's density may be multiplied by, what it may cost to be between two, and how
/// wide that may be, metres. The documented figures are among them.
const SCALES: [f64; 5] = [0.8, 0.9, 1.0, 1.1, 1.25];
const BETWEEN: [f64; 5] = [0.7, 0.8, 0.9, 0.95, 1.0];
const WIDTHS: [f64; 5] = [0.3, 0.4, 0.5, 0.6, 0.75];

/// One part.
struct Part {
    scenes: usize,
    documented: f64,
    chosen: Comfort,
    held_out: f64,
}

pub(super) fn run(file: &Path, folds: usize, json: bool) -> Result<Answer, Failure> {
    let text = crate::commands::read_text(file)?;
    let mut scenes = parse_scenes(&text).map_err(|error| refused(file, error))?;
    scenes.retain(|scene| scene.score.is_some());
    let candidates = candidates();
    let mut costs = Vec::with_capacity(candidates.len());
    for model in &candidates {
        costs.push(rated(file, model, &scenes)?);
    }
    let documented = rated(file, &Comfort::default(), &scenes)?;
    let parts = parts(folds, &candidates, &costs, &documented)
        .ok_or_else(|| refused(file, "too few rated scenes for so many parts"))?;
    let mean = |value: fn(&Part) -> f64| parts.iter().map(value).sum::<f64>() / folds as f64;
    let (documented, held_out) = (mean(|part| part.documented), mean(|part| part.held_out));
    if json {
        let rows = parts.iter().map(|part| {
            json!({
                "scenes": part.scenes, "documented": part.documented, "held_out": part.held_out,
                "front": part.chosen.shape.front, "between": part.chosen.between,
                "between_width": part.chosen.between_width,
            })
        });
        let rows: Vec<_> = rows.collect();
        print_json(&json!({"folds": rows, "documented": documented, "held_out": held_out}))?;
        return Ok(Answer::Yes);
    }
    let mut text = String::from("rank correlation of cost and people's ratings, part by part\n\n");
    // Writing to a string does not fail.
    let _ = writeln!(
        text,
        "{:>7} {:>12} {:>16}   chosen on the others",
        "scenes", "documented", "chosen elsewhere"
    );
    for part in &parts {
        let Comfort {
            shape,
            between,
            between_width,
            ..
        } = part.chosen;
        let _ = writeln!(
            text,
            "{:7} {:12.3} {:16.3}   front {:.2} m, between {between}, width {between_width} m",
            part.scenes, part.documented, part.held_out, shape.front
        );
    }
    let _ = writeln!(text, "{:>7} {documented:12.3} {held_out:16.3}", "mean");
    print(&text)?;
    Ok(Answer::Yes)
}

fn candidates() -> Vec<Comfort> {
    let AsymmetricGaussian { front, side, rear } = AsymmetricGaussian::HALL;
    let mut all = Vec::new();
    for scale in SCALES {
        let shape = AsymmetricGaussian {
            front: front * scale,
            side: side * scale,
            rear: rear * scale,
        };
        for between in BETWEEN {
            all.extend(WIDTHS.map(|between_width| Comfort {
                shape,
                between,
                between_width,
                ..Comfort::default()
            }));
        }
    }
    all
}

/// The cost of each scene, and what people said.
fn rated(file: &Path, model: &Comfort, scenes: &[RatedScene]) -> Result<Vec<(f64, f64)>, Failure> {
    let one = |scene: &RatedScene| {
        let cost = model
            .cost(&scene.scene, Point2::origin())
            .map_err(|error| refused(file, format!("scene {}: {error}", scene.identifier)))?;
        Ok((cost, scene.score.unwrap_or_default()))
    };
    scenes.iter().map(one).collect()
}

/// The parts take scenes in turns. `None` where some part has no correlation.
fn parts(
    folds: usize,
    candidates: &[Comfort],
    costs: &[Vec<(f64, f64)>],
    documented: &[(f64, f64)],
) -> Option<Vec<Part>> {
    let correlation = |rated: &[(f64, f64)], within: &dyn Fn(usize) -> bool| {
        let kept = rated.iter().enumerate().filter(|(at, _)| within(*at));
        rank_correlation(&kept.map(|(_, pair)| *pair).collect::<Vec<_>>())
    };
    let part = |fold: usize| {
        let (inside, outside) = (
            |at: usize| at % folds == fold,
            |at: usize| at % folds != fold,
        );
        // A high cost shall go with a low rating.
        let scores = costs.iter().map(|rated| correlation(rated, &outside));
        let scores: Option<Vec<f64>> = scores.collect();
        let best = scores?
            .into_iter()
            .enumerate()
            .min_by(|a, b| a.1.total_cmp(&b.1))?
            .0;
        Some(Part {
            scenes: (0..documented.len()).filter(|at| inside(*at)).count(),
            documented: correlation(documented, &inside)?,
            chosen: candidates[best],
            held_out: correlation(&costs[best], &inside)?,
        })
    };
    (0..folds).map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_part_is_judged_with_what_was_chosen_on_the_others() {
        let candidates = candidates();
        assert!(candidates.contains(&Comfort::default()));
        // Two sets of figures: one is right on even scenes, the other on odd ones.
        let rated = |right: usize| -> Vec<(f64, f64)> {
            let cost = |at: usize| {
                if at % 2 == right {
                    -(at as f64)
                } else {
                    at as f64
                }
            };
            (0..12).map(|at| (cost(at), at as f64)).collect()
        };
        let costs = [rated(0), rated(1)];
        let parts = parts(2, &candidates[..2], &costs, &costs[0]).unwrap();
        let told: Vec<(usize, f64, f64)> = parts
            .iter()
            .map(|part| (part.scenes, part.documented, part.held_out))
            .collect();
        assert_eq!(told, [(6, -1.0, 1.0), (6, 1.0, 1.0)]);
        assert!(super::parts(7, &candidates[..2], &costs, &costs[0]).is_none());
    }
}
