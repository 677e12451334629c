//! `cortex social comfort`: how little the robot's place suits it, scene by scene.

use super::refused;
use crate::commands::output::print;
use crate::{Answer, Failure};
use agents::social_mapping::Comfort;
use nalgebra::Point2;
use scenarios::scenes::parse_scenes;
use serde_json::json;
use std::fmt::Write as _;
use std::path::Path;

pub(super) fn run(file: &Path, json: bool) -> Result<Answer, Failure> {
    let text = crate::commands::read_text(file)?;
    let scenes = parse_scenes(&text).map_err(|error| refused(file, error))?;
    let model = Comfort::default();
    let mut text = String::new();
    let mut costs = Vec::with_capacity(scenes.len());
    for scene in &scenes {
        let cost = model
            .cost(&scene.scene, Point2::origin())
            .map_err(|error| refused(file, format!("scene {}: {error}", scene.identifier)))?;
        costs.push(cost);
        // Writing to a string does not fail.
        let _ = if json {
            let line = json!({"identifier": scene.identifier, "cost": cost});
            writeln!(text, "{line}")
        } else {
            let score = scene
                .score
                .map_or_else(String::new, |s| format!("  rated {s}"));
            writeln!(text, "{:16} {cost:.3}{score}", scene.identifier)
        };
    }
    let rated: Vec<(f64, f64)> = scenes
        .iter()
        .zip(&costs)
        .filter_map(|(scene, cost)| Some((*cost, scene.score?)))
        .collect();
    if !json && let Some(correlation) = rank_correlation(&rated) {
        let _ = writeln!(
            text,
            "\nrank correlation of cost and people's ratings over {} scenes: {correlation:.3}",
            rated.len()
        );
    }
    print(&text)?;
    Ok(Answer::Yes)
}

/// Spearman's rank correlation, equals sharing their mean rank; `None` where one side has no two
/// different values.
pub(super) fn rank_correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let ranks = |values: Vec<f64>| -> Vec<f64> {
        let mut order: Vec<usize> = (0..values.len()).collect();
        order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
        let mut ranks = vec![0.0; values.len()];
        let same = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]).is_eq();
        let mut before = 0;
        for equals in order.chunk_by(same) {
            let mean = before as f64 + (equals.len() - 1) as f64 / 2.0;
            for index in equals {
                ranks[*index] = mean;
            }
            before += equals.len();
        }
        ranks
    };
    let (a, b) = pairs.iter().copied().unzip();
    let (a, b): (Vec<f64>, Vec<f64>) = (ranks(a), ranks(b));
    let middle = (pairs.len() as f64 - 1.0) / 2.0;
    let product = |one: &[f64], other: &[f64]| -> f64 {
        one.iter()
            .zip(other)
            .map(|(x, y)| (x - middle) * (y - middle))
            .sum()
    };
    let scale = (product(&a, &a) * product(&b, &b)).sqrt();
    (scale > 0.0).then(|| product(&a, &b) / scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_correlate_whatever_the_values() {
        let close = |pairs: &[(f64, f64)], expected: f64| {
            let found = rank_correlation(pairs).unwrap();
            assert!((found - expected).abs() < 1e-12, "{found}");
        };
        close(&[(1.0, 9.0), (2.0, 80.0), (5.0, 81.0)], 1.0);
        close(&[(0.0, 9.0), (0.1, 3.0), (100.0, -5.0)], -1.0);
        // Ranks 0, 1, 2, 3 and 0.5, 0.5, 3, 2.
        close(
            &[(1.0, 5.0), (2.0, 5.0), (3.0, 9.0), (4.0, 6.0)],
            3.5 / (5.0f64 * 4.5).sqrt(),
        );
        assert_eq!(rank_correlation(&[(1.0, 2.0), (1.0, 3.0)]), None);
        assert_eq!(rank_correlation(&[]), None);
    }
}
