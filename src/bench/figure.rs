//! What was measured, for people and for machines.

use serde_json::{Value, json};
use std::fmt::Write as _;
use std::fs;

/// The names of the graph's figures, in the order in which they are told.
const ORDER: [&str; 16] = [
    "commit_ack_poll",
    "visible_poll",
    "commit_ack_block",
    "read_attribute",
    "read_pose",
    "label_edges_per_edge",
    "commits_flat_out",
    "attach_100k",
    "private_memory_per_agent",
    "torn_reads",
    "hot_pose_visible",
    "commit_ack_beside_stopped",
    "commit_ack_beside_killed",
    "commit_ack_inspected",
    "inspector_cores",
    "inspector_first_answer",
];

/// One measured quantity.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Figure {
    pub(crate) name: &'static str,
    pub(crate) value: f64,
    pub(crate) unit: &'static str,
    /// The same of what it is compared with, in the same run.
    pub(crate) raw: Option<f64>,
    /// What it is compared with, for people.
    pub(crate) peer: String,
}

impl Figure {
    /// How many times the peer's figure ours is.
    pub(crate) fn ratio(&self) -> Option<f64> {
        self.raw
            .filter(|raw| *raw > 0.0)
            .map(|raw| self.value / raw)
    }

    pub(crate) fn to_json(&self) -> Value {
        json!({
            "name": self.name,
            "value": self.value,
            "unit": self.unit,
            "raw": self.raw,
            "ratio": self.ratio(),
        })
    }
}

pub(super) fn sort(figures: &mut [Figure]) {
    figures.sort_by_key(|figure| ORDER.iter().position(|name| *name == figure.name));
}

/// The figures for people, below what they were measured on.
pub(crate) fn table(figures: &[Figure]) -> String {
    let number = |number: f64| match number.abs() {
        size if size >= 1000.0 || number == 0.0 => format!("{number:.0}"),
        size if size >= 10.0 => format!("{number:.1}"),
        size if size >= 0.1 => format!("{number:.2}"),
        _ => format!("{number:.2e}"),
    };
    let mut text = host();
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "\n{:<26}{:>12} {:<11}{:>12}{:>8}  beside",
        "", "ours", "", "peer's", "ratio"
    );
    for figure in figures {
        let optional = |value: Option<f64>| value.map_or_else(String::new, number);
        let _ = writeln!(
            text,
            "{:<26}{:>12} {:<11}{:>12}{:>8}  {}",
            figure.name,
            number(figure.value),
            figure.unit,
            optional(figure.raw),
            optional(figure.ratio()),
            figure.peer,
        );
    }
    text
}

/// The machine, its load, and the program's version and commit.
pub(super) fn host() -> String {
    let read = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let cpuinfo = read("/proc/cpuinfo");
    let model = cpuinfo
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(": "))
        .map_or("unknown processor", |(_, model)| model.trim());
    let count = std::thread::available_parallelism().map_or(1, usize::from);
    let kernel = read("/proc/sys/kernel/osrelease");
    let load = read("/proc/loadavg");
    let load = load.split(' ').next().unwrap_or_default();
    format!(
        "{count} x {model}, Linux {}, load {load}; cortex {} at {}\n",
        kernel.trim(),
        env!("CARGO_PKG_VERSION"),
        commit(),
    )
}

/// The commit of the working tree that the program is run in, where it is one.
fn commit() -> String {
    let git = |arguments: &[&str]| {
        let output = std::process::Command::new("git")
            .args(arguments)
            .output()
            .ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    };
    match git(&["rev-parse", "--short=12", "HEAD"]) {
        None => "an unknown commit".to_owned(),
        Some(commit) => {
            let changed = git(&["status", "--porcelain", "--untracked-files=no"]);
            let changed = changed.is_none_or(|changes| !changes.is_empty());
            commit + if changed { " with changes" } else { "" }
        }
    }
}

/// The middle of what was measured.
pub(super) fn median(samples: &mut [u64]) -> f64 {
    samples.sort_unstable();
    samples.get(samples.len() / 2).copied().unwrap_or(0) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_is_told_with_its_ratio_where_there_is_one() {
        let mut figure = Figure {
            name: "commit_ack_poll",
            value: 3.0,
            unit: "us",
            raw: Some(2.0),
            peer: "a round trip".to_owned(),
        };
        assert_eq!(
            figure.to_json(),
            json!({"name": "commit_ack_poll", "value": 3.0, "unit": "us", "raw": 2.0, "ratio": 1.5})
        );
        assert!(table(std::slice::from_ref(&figure)).contains("1.50  a round trip"));
        figure.raw = None;
        assert_eq!(figure.to_json()["ratio"], Value::Null);
    }

    #[test]
    fn the_median_is_the_middle_one() {
        assert_eq!(median(&mut [9, 1, 5]).to_bits(), 5.0f64.to_bits());
    }
}
