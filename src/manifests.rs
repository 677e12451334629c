//! Who may write what in an instance: the manifests that come with the program, and those that a
//! scenario adds or puts in their place. It guarantees that every agent that `cortex` starts has one.

use crate::Failure;
use dsr::{Manifest, Schema};
use std::path::Path;

/// The manifests of the agents that come with Cortex.
const SHIPPED: [(&str, &str); 7] = [
    (
        "human_observer",
        include_str!("manifests/human_observer.toml"),
    ),
    (
        "object_recognition",
        include_str!("manifests/object_recognition.toml"),
    ),
    (
        "social_mapping",
        include_str!("manifests/social_mapping.toml"),
    ),
    ("navigation", include_str!("manifests/navigation.toml")),
    ("executive", include_str!("manifests/executive.toml")),
    ("world", include_str!("manifests/world.toml")),
    ("supervisor", include_str!("manifests/supervisor.toml")),
];

/// The name that `cortex graph` goes by.
pub(crate) const TERMINAL: &str = "cortex-graph";
/// The name that the inspector goes by. It changes something only for who has its token.
pub(crate) const INSPECTOR: &str = "inspector";

/// The manifests of an instance: those of the program, then those of the scenario's folder
/// `manifests`, of which one of the same agent counts instead.
pub(crate) fn load(scenario: &Path, schema: &Schema) -> Result<Vec<Manifest>, Failure> {
    // The person at the terminal owns all of it anyway.
    let mut manifests = vec![
        Manifest::everything(TERMINAL),
        Manifest::everything(INSPECTOR),
    ];
    for (name, text) in SHIPPED {
        let manifest = Manifest::from_toml(&format!("{name}.toml"), text, schema);
        manifests.push(manifest.map_err(|error| Failure::Internal(error.into()))?);
    }
    let folder = scenario.join("manifests");
    if !folder.is_dir() {
        return Ok(manifests);
    }
    let cannot = |error| Failure::input(format!("cannot read {}: {error}", folder.display()));
    let entries = std::fs::read_dir(&folder).map_err(cannot)?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path()));
    let mut paths = paths.collect::<Result<Vec<_>, _>>().map_err(cannot)?;
    paths.retain(|path| {
        path.extension()
            .is_some_and(|extension| extension == "toml")
    });
    paths.sort();
    for path in paths {
        let text = crate::commands::read_text(&path)?;
        let manifest = Manifest::from_toml(&path.display().to_string(), &text, schema);
        manifests.push(manifest.map_err(|error| Failure::Input(error.into()))?);
    }
    Ok(manifests)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_manifests_are_read_and_each_is_the_one_of_its_agent() {
        let schema = scenarios::schema().unwrap();
        let manifests = load(Path::new("."), &schema).unwrap();
        let agents: Vec<&str> = manifests.iter().map(Manifest::agent).collect();
        assert_eq!(agents[..2], [TERMINAL, INSPECTOR]);
        for ((name, _), agent) in SHIPPED.iter().zip(&agents[2..]) {
            assert_eq!(name, agent);
        }
        for agent in crate::commands::AGENTS {
            assert!(agents.contains(&agent), "{agent}");
        }
    }
}
