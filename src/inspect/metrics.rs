//! Figures of a running instance in Prometheus' text format. It guarantees that every name is declared
//! once, with help and type, before its samples.

use super::look::{Looker, Source};
use super::processes::Processes;
use crate::Failure;
use std::fmt::Write as _;

/// The figures as of now.
pub(super) fn metrics(looker: &mut Looker) -> Result<String, Failure> {
    let snapshot = looker.newest()?;
    let mut text = String::new();
    let mut alone = |name, kind, help, value: f64| {
        declare(&mut text, (name, kind, help), &[(String::new(), value)]);
    };
    let commits = snapshot.version().0 as f64;
    alone("cortex_commits_total", "counter", "Commits so far", commits);
    let nodes = snapshot.node_count() as f64;
    alone("cortex_nodes", "gauge", "Nodes of the graph", nodes);
    let edges = snapshot.edge_count() as f64;
    alone("cortex_edges", "gauge", "Edges of the graph", edges);
    let time = snapshot.time().seconds();
    alone("cortex_time_seconds", "gauge", "Time of the graph", time);
    if let Source::Live(session) = &looker.source {
        let processes = Processes::of(session.instance()).look(&snapshot);
        let each = |key: &str| -> Vec<(String, f64)> {
            let rows = processes.as_array().into_iter().flatten();
            // A JSON text is quoted and escaped as a label is.
            rows.map(|row| {
                let label = format!("{{process={}}}", row["name"]);
                (label, row[key].as_f64().unwrap_or(0.0))
            })
            .collect()
        };
        let (cpu, memory) = (each("cpu"), each("memory"));
        let what = (
            "cortex_process_cpu_seconds_total",
            "counter",
            "Processor time",
        );
        declare(&mut text, what, &cpu);
        let what = ("cortex_process_memory_bytes", "gauge", "Resident memory");
        declare(&mut text, what, &memory);
    }
    Ok(text)
}

fn declare(text: &mut String, what: (&str, &str, &str), samples: &[(String, f64)]) {
    let (name, kind, help) = what;
    // Writing to a string does not fail.
    let _ = writeln!(text, "# HELP {name} {help}\n# TYPE {name} {kind}");
    for (labels, value) in samples {
        let _ = writeln!(text, "{name}{labels} {value}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::{Graph, Schema};

    #[test]
    fn every_figure_has_help_a_type_and_a_number() {
        let graph = Graph::in_memory(Schema::open());
        let mut looker = Looker::new(Source::Recording(Box::new(graph)));
        let text = metrics(&mut looker).unwrap();
        assert!(
            text.contains("# TYPE cortex_nodes gauge\ncortex_nodes 0\n"),
            "{text}"
        );
        for line in text.lines().filter(|line| !line.starts_with('#')) {
            let (_, value) = line.rsplit_once(' ').unwrap();
            assert!(value.parse::<f64>().is_ok(), "{line}");
        }
    }
}
