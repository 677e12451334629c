//! Holds what the packages depend on against ARCHITECTURE.md and deny.toml, from the manifests and
//! from what cargo resolved, so that it is checked wherever the tests run.

use crate::tree::{self, assert_none};
use serde_json::Value as Json;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

type Names = BTreeSet<String>;

/// What each manifest says that its package, or the tests of it, depend on.
fn dependencies_by_manifest() -> BTreeMap<String, Names> {
    let mut all = BTreeMap::new();
    for (path, manifest) in tree::manifests() {
        let mut names = Names::new();
        for kind in ["dependencies", "dev-dependencies", "build-dependencies"] {
            let table = manifest.get(kind).and_then(toml::Value::as_table);
            for (name, value) in table.into_iter().flatten() {
                // One list of versions and features for all.
                let inherited = value.get("workspace").and_then(toml::Value::as_bool);
                assert_eq!(inherited, Some(true), "{path}: `{name}`");
                names.insert(name.clone());
            }
        }
        all.insert(path, names);
    }
    all
}

/// What each package of the workspace depends on, itself or its tests, by name.
fn dependencies() -> BTreeMap<String, Names> {
    let mut by_manifest = dependencies_by_manifest();
    let packages = tree::manifests().into_iter().map(|(path, manifest)| {
        let name = manifest["package"]["name"].as_str().unwrap().to_owned();
        (name, by_manifest.remove(&path).unwrap_or_default())
    });
    packages.collect()
}

fn spans(cell: &str) -> Names {
    tree::spans(cell).map(str::to_owned).collect()
}

#[test]
fn packages_depend_on_each_other_as_the_table_says() {
    let dependencies = dependencies();
    let ours: Names = dependencies.keys().cloned().collect();
    let mut told = BTreeMap::new();
    for row in tree::table(&tree::read("ARCHITECTURE.md"), "Dependencies") {
        let [package, on, ipc] = &row[..] else {
            panic!("{row:?}")
        };
        let package = package.trim_matches('`').to_owned();
        told.insert(package, (spans(on), ipc == "yes"));
    }
    let found: BTreeMap<String, (Names, bool)> = dependencies
        .into_iter()
        .map(|(name, on)| {
            let ipc = on.iter().any(|name| name.starts_with("iceoryx2"));
            let on: Names = on.intersection(&ours).cloned().collect();
            (name, (on, ipc))
        })
        .collect();
    assert_eq!(told, found, "left: ARCHITECTURE.md; right: the manifests");
}

#[test]
fn crates_with_one_door_are_used_by_nobody_else() {
    let dependencies = dependencies();
    for row in tree::table(&tree::read("ARCHITECTURE.md"), "Doors") {
        let [crates, doors, _] = &row[..] else {
            panic!("{row:?}")
        };
        let doors = spans(doors);
        for name in spans(crates) {
            let users = dependencies.iter().filter(|(_, on)| on.contains(&name));
            let users: Names = users.map(|(user, _)| user.clone()).collect();
            assert_eq!(
                doors, users,
                "left: ARCHITECTURE.md; right: who depends on `{name}`"
            );
        }
    }
}

#[test]
fn nothing_is_depended_on_that_is_not_used() {
    let sources = tree::sources();
    let mut unused = Vec::new();
    let mut used = Names::from(["cortex".to_owned()]);
    for (path, names) in dependencies_by_manifest() {
        let folder = path.trim_end_matches("Cargo.toml");
        // The package at the root has its sources in `src/`; the others are folders beside it.
        let folder = if folder.is_empty() { "src/" } else { folder };
        let sources = sources.iter().filter(|file| file.path.starts_with(folder));
        let codes: Vec<String> = sources.map(|file| tree::code(&file.text)).collect();
        for name in names {
            let word = name.replace('-', "_");
            if !codes.iter().any(|code| tree::names(code, &word)) {
                unused.push(format!("{path}: {name}"));
            }
            used.insert(name);
        }
    }
    let manifest: toml::Table = tree::read("Cargo.toml").parse().unwrap();
    let listed = manifest["workspace"]["dependencies"].as_table().unwrap();
    let idle = listed.keys().filter(|name| !used.contains(*name));
    unused.extend(idle.map(|name| format!("[workspace.dependencies]: {name}")));
    assert_none("is not used", unused);
}

/// What cargo resolved for this platform, from the lock file and without network.
fn metadata() -> Json {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let platform = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    let output = Command::new(cargo)
        .args(["metadata", "--format-version=1", "--offline", "--locked"])
        .args(["--filter-platform", &platform])
        .current_dir(tree::root())
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).unwrap()
}

fn text<'a>(json: &'a Json, key: &str) -> &'a str {
    json[key].as_str().unwrap_or_default()
}

fn deny() -> toml::Table {
    tree::read("deny.toml").parse().unwrap()
}

#[test]
fn every_licence_is_allowed_and_every_package_from_the_registry() {
    let deny = deny();
    let list = |table: &str, key: &str| -> Names {
        let list = deny[table][key].as_array().unwrap();
        list.iter()
            .map(|item| item.as_str().unwrap().to_owned())
            .collect()
    };
    let allowed = list("licenses", "allow");
    let registries = list("sources", "allow-registry");
    let metadata = metadata();
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 20, "{} packages", packages.len());
    for package in packages {
        let (name, licence) = (text(package, "name"), text(package, "license"));
        assert!(
            satisfied(licence, &allowed),
            "`{name}` is under `{licence}`"
        );
        if let Some(source) = package["source"].as_str() {
            let registry = source.strip_prefix("registry+").unwrap_or(source);
            assert!(
                registries.contains(registry),
                "`{name}` comes from {source}"
            );
        }
    }
}

#[test]
fn banned_packages_have_no_other_door() {
    let deny = deny();
    let metadata = metadata();
    let packages = metadata["packages"].as_array().unwrap();
    let banned = deny["bans"]["deny"].as_array().unwrap();
    assert!(
        banned
            .iter()
            .any(|ban| ban["name"].as_str() == Some("iceoryx2"))
    );
    for ban in banned {
        let name = ban["name"].as_str().unwrap();
        let wrappers = ban.get("wrappers").and_then(toml::Value::as_array);
        let wrappers: Vec<&str> = wrappers
            .into_iter()
            .flatten()
            .filter_map(|w| w.as_str())
            .collect();
        for package in packages {
            let dependencies = package["dependencies"].as_array().unwrap();
            let direct = dependencies
                .iter()
                .any(|dependency| text(dependency, "name") == name);
            let user = text(package, "name");
            assert!(
                !direct || wrappers.contains(&user),
                "`{user}` depends on `{name}`"
            );
        }
    }
}

/// Whether an SPDX expression can be met with the allowed licences; `AND` binds tighter than `OR`,
/// and `/` is an old way to write `OR`.
fn satisfied(expression: &str, allowed: &Names) -> bool {
    let spaced = expression
        .replace('(', " ( ")
        .replace(')', " ) ")
        .replace('/', " OR ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut at = 0;
    let met = any(&words, &mut at, allowed);
    met && at == words.len()
}

fn any(words: &[&str], at: &mut usize, allowed: &Names) -> bool {
    let mut met = all(words, at, allowed);
    while words.get(*at) == Some(&"OR") {
        *at += 1;
        met |= all(words, at, allowed);
    }
    met
}

fn all(words: &[&str], at: &mut usize, allowed: &Names) -> bool {
    let mut met = one(words, at, allowed);
    while words.get(*at) == Some(&"AND") {
        *at += 1;
        met &= one(words, at, allowed);
    }
    met
}

fn one(words: &[&str], at: &mut usize, allowed: &Names) -> bool {
    let word = words.get(*at).copied().unwrap_or_default();
    *at += 1;
    if word == "(" {
        let met = any(words, at, allowed);
        *at += 1;
        return met;
    }
    let mut licence = word.to_owned();
    if words.get(*at) == Some(&"WITH") {
        licence = format!("{word} WITH {}", words.get(*at + 1).unwrap_or(&""));
        *at += 2;
    }
    allowed.contains(&licence)
}

#[test]
fn licence_expressions_are_read_as_spdx_means_them() {
    let allowed: Names = ["MIT", "Zlib"].map(str::to_owned).into();
    for good in [
        "MIT",
        "MIT OR GPL-3.0",
        "GPL-3.0/MIT",
        "(GPL-3.0 OR MIT) AND Zlib",
    ] {
        assert!(satisfied(good, &allowed), "{good}");
    }
    for bad in [
        "",
        "GPL-3.0",
        "MIT AND GPL-3.0",
        "MIT WITH x",
        "(GPL-3.0 OR MIT) AND X",
        "MIT MIT",
    ] {
        assert!(!satisfied(bad, &allowed), "{bad}");
    }
}
