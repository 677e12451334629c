//! The processes of an instance: what the operating system says of each, and how often one of its name
//! was started again since the inspector looks.

use dsr::Instance;
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use std::time::Instant;

/// What was seen of one process.
#[derive(Debug, Clone, Default)]
struct Seen {
    id: u32,
    restarts: u64,
    cpu: f64,
}

/// The processes of an instance from one look to the next.
pub(super) struct Processes {
    instance: Instance,
    seen: BTreeMap<String, Seen>,
    looked: Option<Instant>,
}

impl Processes {
    pub(super) fn of(instance: &Instance) -> Self {
        Self {
            instance: instance.clone(),
            seen: BTreeMap::new(),
            looked: None,
        }
    }

    /// Each with name, id, state, load (share of a processor since the last look), memory (bytes) and restarts.
    pub(super) fn look(&mut self) -> Json {
        let now = crate::supervise::now();
        let passed = self
            .looked
            .map(|at| now.saturating_duration_since(at).as_secs_f64());
        self.looked = Some(now);
        let mut rows = Vec::new();
        for id in self.instance.processes().unwrap_or_default() {
            let Some((name, status)) = described(id) else {
                continue;
            };
            let cpu = crate::supervise::cpu_seconds(id).unwrap_or(0.0);
            let seen = self.seen.entry(name.clone()).or_insert_with(|| Seen {
                id,
                restarts: 0,
                cpu,
            });
            if seen.id != id {
                seen.restarts += 1;
                (seen.id, seen.cpu) = (id, 0.0);
            }
            let load = passed.map(|passed| (cpu - seen.cpu).max(0.0) / passed.max(1e-3));
            seen.cpu = cpu;
            rows.push(json!({
                "name": name, "id": id, "state": status.0, "memory": status.1, "load": load,
                "cpu": cpu, "restarts": seen.restarts,
            }));
        }
        rows.sort_by_key(|row| row["name"].as_str().unwrap_or_default().to_owned());
        Json::Array(rows)
    }
}

/// A process's name in its instance, with its state and resident memory in bytes.
fn described(id: u32) -> Option<(String, (String, u64))> {
    let line = std::fs::read(format!("/proc/{id}/cmdline")).ok()?;
    let mut words = line
        .split(|byte| *byte == 0)
        .map(|word| String::from_utf8_lossy(word).into_owned());
    let program = words.next()?;
    let verb = words.next().unwrap_or_default();
    let name = match verb.as_str() {
        "agent" => words.next().unwrap_or(verb),
        "run" => "supervisor".to_owned(),
        "" => program.rsplit('/').next().unwrap_or(&program).to_owned(),
        _ if verb.starts_with('-') => program.rsplit('/').next().unwrap_or(&program).to_owned(),
        _ => verb,
    };
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).ok()?;
    let field = |key: &str| {
        let line = status.lines().find(|line| line.starts_with(key))?;
        Some(line[key.len()..].trim().to_owned())
    };
    let state = field("State:")?;
    let state = state
        .split_once('(')
        .map_or(state.as_str(), |(_, word)| word.trim_end_matches(')'));
    let memory = field("VmRSS:").and_then(|text| text.split(' ').next()?.parse::<u64>().ok());
    Some((name, (state.to_owned(), memory.unwrap_or(0) * 1024)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_very_process_has_a_name_a_state_and_memory() {
        let (name, (state, memory)) = described(std::process::id()).unwrap();
        assert!(!name.is_empty());
        assert!(["running", "sleeping"].contains(&state.as_str()), "{state}");
        assert!(memory > 0);
    }
}
