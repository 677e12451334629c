//! A report as an aligned table. Guarantees that each figure stands under the run it belongs to and
//! that a missing one reads `-`.

use super::Report;
use crate::metrics::{
    CHC_STEP, Company, MOVING, Metrics, Motion, PersonMetrics, Psi, RobotMetrics,
};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Of the people met, so many are listed.
const CLOSEST: usize = 8;
const MISSING: &str = "-";

/// A line of the table.
enum Row {
    Heading(String),
    Figures {
        label: String,
        unit: &'static str,
        cells: Vec<String>,
    },
    Note(String),
}

/// The runs side by side.
struct Runs<'a>(Vec<&'a Metrics>);

impl Runs<'_> {
    /// A figure of each run.
    fn row(
        &self,
        label: &str,
        unit: &'static str,
        cell: impl Fn(&Metrics) -> Option<String>,
    ) -> Row {
        let cells = self
            .0
            .iter()
            .map(|metrics| cell(metrics).unwrap_or_else(|| MISSING.to_owned()));
        Row::Figures {
            label: label.to_owned(),
            unit,
            cells: cells.collect(),
        }
    }

    fn robot(
        &self,
        label: &str,
        unit: &'static str,
        figure: impl Fn(&RobotMetrics) -> String,
    ) -> Row {
        self.row(label, unit, |metrics| metrics.robot.as_ref().map(&figure))
    }

    /// Figures of how evenly the robot moved, and how near it came to people on the whole.
    fn conduct(&self) -> Vec<Row> {
        let both =
            |mean: f64, greatest: f64| format!("{} ({})", fixed(mean, 2), fixed(greatest, 2));
        let motion = |label: &str, unit: &'static str, figure: &dyn Fn(&Motion) -> String| {
            self.row(label, unit, |metrics| metrics.motion.as_ref().map(figure))
        };
        let company = |label: &str, unit: &'static str, figure: &dyn Fn(&Company) -> String| {
            self.row(label, unit, |metrics| metrics.company.as_ref().map(figure))
        };
        vec![
            motion("mean speed (greatest)", "m/s", &|motion| {
                both(motion.mean_speed, motion.max_speed)
            }),
            motion("mean acceleration (greatest)", "m/s2", &|motion| {
                both(motion.mean_acceleration, motion.max_acceleration)
            }),
            motion("mean jerk (greatest)", "m/s3", &|motion| {
                both(motion.mean_jerk, motion.max_jerk)
            }),
            motion("stalled", "s", &|motion| fixed(motion.stalled, 1)),
            company("distance to the nearest, mean (least)", "m", &|company| {
                both(company.mean_distance, company.min_distance)
            }),
            company("the same between surfaces", "m", &|company| {
                both(company.mean_clearance, company.min_clearance)
            }),
            self.row("least time to a collision", "s", |metrics| {
                let time = metrics
                    .company
                    .and_then(|company| company.time_to_collision);
                time.map(|time| fixed(time, 1))
            }),
            company(
                "share of time with 0.5 m of space for all",
                "%",
                &|company| fixed(company.space_compliance, 1),
            ),
            company(
                "share of time between the members of a group",
                "%",
                &|company| fixed(company.psi_groups, 1),
            ),
        ]
    }

    fn shares(&self, title: &str, psi: impl Fn(&Metrics) -> Option<Psi>) -> Vec<Row> {
        let share = |label: &str, part: fn(&Psi) -> f64| {
            self.row(label, "%", |metrics| {
                psi(metrics).map(|psi| fixed(part(&psi), 1))
            })
        };
        vec![
            Row::Heading(title.to_owned()),
            share("  intimate zone", |psi| psi.intimate),
            share("  personal zone", |psi| psi.personal),
            share("  social zone", |psi| psi.social),
            share("  public space", |psi| psi.public),
            share("  space of an object in use", |psi| psi.objects),
        ]
    }

    fn people(&self) -> Vec<Row> {
        let mut least: BTreeMap<&str, f64> = BTreeMap::new();
        for person in self.0.iter().flat_map(|metrics| &metrics.people) {
            let entry = least.entry(&person.name).or_insert(f64::INFINITY);
            *entry = entry.min(person.min_distance);
        }
        let mut order: Vec<(&str, f64)> = least.into_iter().collect();
        order.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(b.0)));

        let mut rows = Vec::new();
        if !order.is_empty() {
            let title = "least distance of centres (of surfaces)";
            rows.push(Row::Heading(title.to_owned()));
        }
        for (name, _) in order.iter().take(CLOSEST) {
            let person = |metrics: &Metrics| {
                let found = metrics.people.iter().find(|person| person.name == *name);
                found.map(
                    |PersonMetrics {
                         min_distance,
                         min_clearance,
                         ..
                     }| {
                        format!("{} ({})", fixed(*min_distance, 2), fixed(*min_clearance, 2))
                    },
                )
            };
            rows.push(self.row(&format!("  {name}"), "m", person));
        }
        if let Some((_, next)) = order.get(CLOSEST) {
            let others = order.len() - CLOSEST;
            let closest = fixed(*next, 2);
            rows.push(Row::Note(format!(
                "  and {others} more, none closer than {closest} m"
            )));
        }
        rows
    }
}

/// The table of `report`.
pub(super) fn of(report: &Report) -> String {
    let behaviour = |social| {
        if social {
            "social behaviour"
        } else {
            "no social behaviour"
        }
    };
    let mut titles = vec![behaviour(report.social)];
    let mut outcomes = vec![report.success];
    let mut metrics = vec![&report.metrics];
    if let Some(baseline) = &report.baseline {
        titles.push(behaviour(false));
        outcomes.push(baseline.success);
        metrics.push(&baseline.metrics);
    }
    let runs = Runs(metrics);
    let outcome = |success: &bool| match (&report.mission, success) {
        (None, _) => MISSING.to_owned(),
        (Some(_), true) => "succeeded".to_owned(),
        (Some(_), false) => "failed".to_owned(),
    };

    let mut rows = vec![
        Row::Figures {
            label: "mission".to_owned(),
            unit: "",
            cells: outcomes.iter().map(outcome).collect(),
        },
        runs.robot("path length", "m", |robot| fixed(robot.path_length, 2)),
        runs.robot("duration", "s", |robot| fixed(robot.duration, 1)),
        runs.robot(
            &format!("heading changes (CHC, every {CHC_STEP} m)"),
            "rad",
            |robot| fixed(robot.chc, 2),
        ),
        runs.robot("collisions (walls, objects, people)", "", |robot| {
            let kinds = robot.collisions_by_kind;
            let (walls, objects, people) = (kinds.walls, kinds.objects, kinds.people);
            format!("{} ({walls}, {objects}, {people})", robot.collisions)
        }),
    ];
    let weighted = [
        Some(report.spl),
        report.baseline.as_ref().map(|other| other.spl),
    ];
    rows.push(Row::Figures {
        label: "success weighted by path length (SPL)".to_owned(),
        unit: "",
        cells: weighted
            .into_iter()
            .flatten()
            .map(|spl| spl.map_or_else(|| MISSING.to_owned(), |spl| fixed(spl, 2)))
            .collect(),
    });
    rows.extend(runs.conduct());
    rows.extend(runs.shares("share of time in", |metrics| metrics.psi));
    rows.extend(runs.shares(
        &format!("share of moving time (over {MOVING} m/s) in"),
        |metrics| metrics.psi_moving,
    ));
    rows.extend(runs.people());

    let mut text = summary(report);
    text.push('\n');
    text.push_str(&aligned(&titles, &rows));
    text
}

/// Which run it was and what came of it.
fn summary(report: &Report) -> String {
    let outcome = match (&report.mission, report.success) {
        (None, _) => "no mission".to_owned(),
        (Some(_), true) => "mission succeeded".to_owned(),
        (Some(mission), false) => {
            let mission = mission.decisive();
            let reason = mission.reason.as_deref().unwrap_or("no reason given");
            format!("mission {} {}: {reason}", mission.name, mission.status)
        }
    };
    format!("{}, seed {}: {outcome}\n", report.scenario, report.seed)
}

fn aligned(titles: &[&str], rows: &[Row]) -> String {
    let width = |text: &str| text.chars().count();
    let mut label_width = 0;
    let mut unit_width = 0;
    let mut widths: Vec<usize> = titles.iter().map(|title| width(title)).collect();
    for row in rows {
        if let Row::Figures { label, unit, cells } = row {
            label_width = label_width.max(width(label));
            unit_width = unit_width.max(width(unit));
            for (column, cell) in widths.iter_mut().zip(cells) {
                *column = (*column).max(width(cell));
            }
        }
    }
    let mut text = String::new();
    let mut line = |label: &str, unit: &str, cells: &mut dyn Iterator<Item = &str>| {
        let mut line = format!("{label:label_width$}  {unit:unit_width$}");
        for (cell, width) in cells.zip(&widths) {
            // Writing to a string cannot fail.
            let _ = write!(line, "   {cell:>width$}");
        }
        text.push_str(line.trim_end());
        text.push('\n');
    };
    line("", "", &mut titles.iter().copied());
    for row in rows {
        match row {
            Row::Heading(label) | Row::Note(label) => line(label, "", &mut std::iter::empty()),
            Row::Figures { label, unit, cells } => {
                line(label, unit, &mut cells.iter().map(String::as_str));
            }
        }
    }
    text
}

/// With so many decimals; what is not finite is missing, and zero has no sign.
fn fixed(value: f64, decimals: usize) -> String {
    if value.is_finite() {
        let text = format!("{value:.decimals$}");
        match text.strip_prefix('-') {
            Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
            _ => text,
        }
    } else {
        MISSING.to_owned()
    }
}
