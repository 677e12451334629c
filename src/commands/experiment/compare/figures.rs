//! What a comparison tells of each way of driving. This file owns the figures, all of them taken from what was
//! recorded of the world, and which direction of each is the better one.

use crate::commands::experiment::drives::spread;
use crate::commands::experiment::table::{Cell, Row, Table};
use scenarios::metrics::Metrics;
use serde_json::{Map, Value, json};

/// Every figure of one drive, in the order of [`FIGURES`]; `None` where it does not apply.
pub(super) type Values = Vec<Option<f64>>;

/// A figure of a drive.
pub(super) struct Figure {
    name: &'static str,
    unit: &'static str,
    /// Whether less of it is better; `None` where neither is.
    less_is_better: Option<bool>,
    /// Of whether the robot arrived, SPL and all metrics.
    pub(super) of: fn(bool, f64, &Metrics) -> Option<f64>,
}

const LESS: Option<bool> = Some(true);
const MORE: Option<bool> = Some(false);

macro_rules! figure {
    ($name:literal, $unit:literal, $better:expr, $of:expr) => {
        Figure {
            name: $name,
            unit: $unit,
            less_is_better: $better,
            of: $of,
        }
    };
}

pub(super) const FIGURES: [Figure; 22] = [
    figure!("success", "%", MORE, |arrived, _, _| Some(if arrived {
        100.0
    } else {
        0.0
    })),
    figure!("duration", "s", LESS, |_, _, m| m
        .robot
        .map(|robot| robot.duration)),
    figure!("path_length", "m", LESS, |_, _, m| m
        .robot
        .map(|robot| robot.path_length)),
    figure!("spl", "", MORE, |_, spl, _| Some(spl)),
    figure!("chc", "rad", LESS, |_, _, m| m.robot.map(|robot| robot.chc)),
    figure!("psi_intimate", "%", LESS, |_, _, m| m
        .psi
        .map(|psi| psi.intimate)),
    figure!("psi_personal", "%", LESS, |_, _, m| m
        .psi
        .map(|psi| psi.personal)),
    figure!("psi_social", "%", LESS, |_, _, m| m
        .psi
        .map(|psi| psi.social)),
    figure!("psi_objects", "%", LESS, |_, _, m| m
        .psi
        .map(|psi| psi.objects)),
    figure!("psi_groups", "%", LESS, |_, _, m| m
        .company
        .map(|c| c.psi_groups)),
    figure!("psi_moving_personal", "%", LESS, |_, _, m| m
        .psi_moving
        .map(|psi| psi.intimate + psi.personal)),
    figure!("min_distance", "m", MORE, |_, _, m| m
        .company
        .map(|c| c.min_distance)),
    figure!("mean_distance", "m", MORE, |_, _, m| m
        .company
        .map(|c| c.mean_distance)),
    figure!("min_clearance", "m", MORE, |_, _, m| m
        .company
        .map(|c| c.min_clearance)),
    figure!("space_compliance", "%", MORE, |_, _, m| m
        .company
        .map(|c| c.space_compliance)),
    figure!("time_to_collision", "s", MORE, |_, _, m| m
        .company
        .and_then(|c| c.time_to_collision)),
    figure!("collisions_people", "", LESS, |_, _, m| m
        .robot
        .map(|robot| robot.collisions_by_kind.people as f64)),
    figure!("collisions_other", "", LESS, |_, _, m| m.robot.map(
        |robot| { (robot.collisions_by_kind.walls + robot.collisions_by_kind.objects) as f64 }
    )),
    figure!("stalled", "s", LESS, |_, _, m| m
        .motion
        .map(|motion| motion.stalled)),
    figure!("mean_speed", "m/s", None, |_, _, m| m
        .motion
        .map(|motion| motion.mean_speed)),
    figure!("mean_acceleration", "m/s^2", LESS, |_, _, m| m
        .motion
        .map(|motion| motion.mean_acceleration)),
    figure!("mean_jerk", "m/s^3", LESS, |_, _, m| m
        .motion
        .map(|motion| motion.mean_jerk)),
];

/// Mean and standard deviation of one figure, and of how many drives; `None` where it applied to none.
pub(super) type Summary = Option<(f64, f64, usize)>;

/// Of each figure, over those drives that it applies to.
pub(super) fn summary(drives: &[Values]) -> Vec<Summary> {
    let of = |figure: usize| {
        let values: Vec<f64> = drives.iter().filter_map(|drive| drive[figure]).collect();
        (!values.is_empty()).then(|| {
            let (mean, deviation) = spread(&values);
            (mean, deviation, values.len())
        })
    };
    (0..FIGURES.len()).map(of).collect()
}

/// A world, and what each way of driving came to in it.
pub(super) struct World {
    pub(super) name: &'static str,
    pub(super) about: &'static str,
    pub(super) ways: Vec<Vec<Summary>>,
}

/// Everything that was compared.
pub(in super::super) struct Comparison {
    pub(super) seeds: u64,
    pub(super) ways: Vec<&'static str>,
    pub(super) worlds: Vec<World>,
}

impl Comparison {
    /// For people.
    pub(in super::super) fn table(&self) -> Table {
        let mut rows = Vec::new();
        for world in &self.worlds {
            rows.push(Row {
                label: world.name.to_owned(),
                cells: vec![Cell::nothing(); self.ways.len()],
                note: Some(world.about),
            });
            for (k, figure) in FIGURES.iter().enumerate() {
                let cell = |way: &Vec<Summary>| match way[k] {
                    Some((mean, deviation, _)) => Cell::number(mean).deviating(deviation),
                    None => Cell::nothing(),
                };
                let comma = if figure.unit.is_empty() { "" } else { ", " };
                rows.push(Row {
                    label: format!("  {}{comma}{}", figure.name, figure.unit),
                    cells: world.ways.iter().map(cell).collect(),
                    note: None,
                });
            }
        }
        Table {
            columns: self.ways.clone(),
            rows,
            notes: vec![
                "Mean, and in brackets the standard deviation, over seeds, of figures that are measured on what was\n\
                 true. A figure that never applied is left out.",
            ],
        }
    }

    /// For machines.
    pub(in super::super) fn json(&self, about: &str) -> Value {
        let value = |summary: &Summary| match summary {
            Some((mean, deviation, drives)) => {
                json!({"mean": mean, "deviation": deviation, "drives": drives})
            }
            None => Value::Null,
        };
        let worlds = self.worlds.iter().map(|world| {
            let ways = self.ways.iter().zip(&world.ways).map(|(name, figures)| {
                let figures = FIGURES.iter().zip(figures);
                let figures: Map<String, Value> = figures
                    .map(|(figure, summary)| (figure.name.to_owned(), value(summary)))
                    .collect();
                ((*name).to_owned(), Value::Object(figures))
            });
            json!({
                "world": world.name,
                "about": world.about,
                "methods": ways.collect::<Map<String, Value>>(),
            })
        });
        let figures = FIGURES.iter().map(|figure| {
            let better = figure
                .less_is_better
                .map(|less| if less { "less" } else { "more" });
            json!({"name": figure.name, "unit": figure.unit, "better": better})
        });
        json!({
            "name": super::NAME,
            "about": about,
            "seeds": self.seeds,
            "methods": self.ways,
            "figures": figures.collect::<Vec<_>>(),
            "worlds": worlds.collect::<Vec<_>>(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_that_does_not_apply_to_a_drive_is_not_counted_as_none() {
        let mut first = vec![Some(1.0); FIGURES.len()];
        let second = vec![Some(3.0); FIGURES.len()];
        first[15] = None;
        let summary = summary(&[first, second]);
        assert_eq!(summary[0].map(|(mean, ..)| mean), Some(2.0));
        assert_eq!(summary[15], Some((3.0, 0.0, 1)));
    }

    #[test]
    fn every_figure_is_told_of_every_way_in_both_forms() {
        let comparison = Comparison {
            seeds: 2,
            ways: vec!["a", "b"],
            worlds: vec![World {
                name: "there",
                about: "somewhere",
                ways: vec![
                    vec![Some((1.25, 0.5, 2)); FIGURES.len()],
                    vec![None; FIGURES.len()],
                ],
            }],
        };
        let json = comparison.json("a test");
        let methods = &json["worlds"][0]["methods"];
        assert_eq!(methods["a"]["psi_personal"]["mean"], 1.25);
        assert_eq!(methods["b"]["psi_personal"], Value::Null);
        assert_eq!(json["figures"].as_array().unwrap().len(), FIGURES.len());
        let text = comparison.table().text("compare", "a test");
        assert!(
            text.contains("psi_personal, %") && text.contains("1.25 (0.50)"),
            "{text}"
        );
        assert!(!text.contains("printed"), "{text}");
    }
}
