//! The processes of an instance: what the operating system says of each, and how often one of its name
//! was started again since the inspector looks.

use super::news::rates;
use dsr::{Instance, Snapshot};
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use std::time::Instant;

/// The processes of an instance from one look to the next.
pub(super) struct Processes {
    instance: Instance,
    /// Of each process that was there, the name and the processor time.
    seen: BTreeMap<u32, (String, f64)>,
    names: BTreeMap<String, Name>,
    looked: Option<Instant>,
}

/// What became of the processes of a name.
#[derive(Debug, Clone, Default)]
struct Name {
    /// Those that ended and that none has taken the place of.
    gone: u64,
    restarts: u64,
}

/// What the operating system says of a process.
struct Found {
    id: u32,
    name: String,
    state: String,
    memory: u64,
    cpu: f64,
}

impl Processes {
    pub(super) fn of(instance: &Instance) -> Self {
        Self {
            instance: instance.clone(),
            seen: BTreeMap::new(),
            names: BTreeMap::new(),
            looked: None,
        }
    }

    /// Each with name, id, state, load (share of a processor since the last look), memory (bytes), restarts, and
    /// the commits a second of the agent of that name, with the time of its last.
    pub(super) fn look(&mut self, snapshot: &Snapshot) -> Json {
        let now = crate::supervise::now();
        let passed = self
            .looked
            .map(|at| now.saturating_duration_since(at).as_secs_f64());
        self.looked = Some(now);
        let ids = self.instance.processes().unwrap_or_default();
        let mut found: Vec<Found> = ids.into_iter().filter_map(described).collect();
        found.sort_by(|a, b| (&a.name, a.id).cmp(&(&b.name, b.id)));
        let before = self.note(&found);
        let rates = rates(snapshot);
        let row = |one: &Found| {
            let rate = rates.get(&one.name);
            let since = before.get(&one.id).map_or(0.0, |(_, cpu)| *cpu);
            let load = passed.map(|passed| (one.cpu - since).max(0.0) / passed.max(1e-3));
            json!({
                "name": one.name, "id": one.id, "state": one.state, "memory": one.memory, "load": load,
                "cpu": one.cpu, "restarts": self.names.get(&one.name).map_or(0, |name| name.restarts),
                "commits": rate.map_or(0.0, |rate| rate.commits), "last": rate.map(|rate| rate.last),
            })
        };
        found.iter().map(row).collect()
    }

    /// Counts who took the place of whom; those that were there before.
    fn note(&mut self, found: &[Found]) -> BTreeMap<u32, (String, f64)> {
        let seen = found
            .iter()
            .map(|one| (one.id, (one.name.clone(), one.cpu)));
        let before = std::mem::replace(&mut self.seen, seen.collect());
        for (id, (name, _)) in &before {
            if !self.seen.contains_key(id) {
                self.names.entry(name.clone()).or_default().gone += 1;
            }
        }
        for one in found.iter().filter(|one| !before.contains_key(&one.id)) {
            let name = self.names.entry(one.name.clone()).or_default();
            let instead = name.gone.min(1);
            name.gone -= instead;
            name.restarts += instead;
        }
        before
    }
}

fn described(id: u32) -> Option<Found> {
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
    Some(Found {
        id,
        name,
        state: state.to_owned(),
        memory: memory.unwrap_or(0) * 1024,
        cpu: crate::supervise::cpu_seconds(id).unwrap_or(0.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_very_process_has_a_name_a_state_and_memory() {
        let found = described(std::process::id()).unwrap();
        assert!(!found.name.is_empty());
        assert!(["running", "sleeping"].contains(&found.state.as_str()));
        assert!(found.memory > 0);
    }

    #[test]
    fn who_takes_the_place_of_one_that_ended_counts_as_a_restart_and_a_namesake_does_not() {
        let mut processes = Processes::of(&Instance::new("nobody").unwrap());
        let mut look = |ids: &[u32]| {
            let found = ids.iter().map(|id| Found {
                id: *id,
                name: "inspect".to_owned(),
                state: String::new(),
                memory: 0,
                cpu: 0.0,
            });
            processes.note(&found.collect::<Vec<_>>());
            processes.names.get("inspect").unwrap().restarts
        };
        // Two of a name, one that ends, one in its place, and one more.
        assert_eq!(
            [look(&[1, 2]), look(&[1, 2]), look(&[2]), look(&[2, 3])],
            [0, 0, 0, 1]
        );
        assert_eq!([look(&[2, 3, 4]), look(&[5, 6, 7])], [1, 4]);
    }
}
