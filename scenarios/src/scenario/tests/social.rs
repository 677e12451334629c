//! The tables of the agents' figures, `[social]` and `[human_observer]`: every figure by name, what is
//! not given by default, and what cannot be.

use super::*;
use crate::scenario::parse_social;
use agents::grid::shared::SOCIAL_GRID;
use agents::human_observer::Association;
use agents::social_mapping::adaptation::WallAdaptation;
use agents::social_mapping::groups::Method;
use agents::social_mapping::scene::MOST_CELLS;
use agents::social_mapping::{AsymmetricGaussian, SocialConfig, UsageCurve};
use std::collections::BTreeMap;

/// The example of the book.
fn example() -> &'static str {
    let page = include_str!("../../../../docs/src/social-maps.md");
    let start = page.find("[social]\n").expect("an example");
    let end = page[start..].find("```").expect("its end");
    &page[start..start + end]
}

#[test]
fn the_example_of_the_book_is_read() {
    // Its room is one of another scenario.
    let text = format!("{TWO_ROOMS}\n{}", example().replace("garden", "hall"));
    let social = parse(&text).expect("a good file").social;
    assert_eq!(social.proxemics.shape, AsymmetricGaussian::HALL);
    assert_eq!(social.grouping.method, Method::Facing);
    assert!(social.walls.is_some());
    assert_eq!(social.cooperation.keys().collect::<Vec<_>>(), ["guide"]);
    assert!((social.usage.ramp - 1800.0).abs() < 1e-9);
    assert_eq!(
        parse(TWO_ROOMS).expect("a good file").social,
        SocialConfig::default()
    );
}

#[test]
fn what_social_mapping_cannot_use_is_told_with_its_place() {
    let with = |social: &str| match parse(&format!("{TWO_ROOMS}\n{social}")) {
        Ok(_) => Vec::new(),
        Err(invalid) => {
            let told =
                |problem: &crate::scenario::Problem| format!("{}: {}", problem.line, problem.kind);
            invalid.problems.iter().map(told).collect::<Vec<_>>()
        }
    };
    let line = TWO_ROOMS.lines().count() + 2;
    let [problem] = &with("[social]\nresolutoin = 0.1")[..] else {
        panic!("one problem");
    };
    assert!(
        problem.starts_with(&format!("{}: unknown field `resolutoin`", line + 1)),
        "{problem}"
    );
    let [problem] = &with("[social.proxemics]\nshape = \"hal\"")[..] else {
        panic!("one problem");
    };
    assert!(
        problem.contains(
            "there are no widths `hal`; there are `hall`, `printed` and `adaptive_proxemics`"
        ),
        "{problem}"
    );
    let problems = with("[social]\nresolution = 0\nclearance_cost = -1");
    assert_eq!(problems.len(), 2, "{problems:?}");
    assert!(problems[0].contains("resolution must be from 0.005 m to 10 m"));
}

#[test]
fn a_grid_that_is_too_large_is_told_where_bounds_or_resolution_stand() {
    let text = format!("bounds = [-120, -120, 130, 130]\n{TWO_ROOMS}");
    let invalid = parse(&text).unwrap_err();
    assert_eq!(
        invalid.problems[0].kind.to_string(),
        "the map's bounds [-120.0, -120.0, 130.0, 130.0] at 0.1 m a cell need 6250000 cells; a grid has at most 4194304"
    );
    assert_eq!(invalid.problems[0].line, 1);
    let text = format!("bounds = [-120, -120, 130, 130]\n{TWO_ROOMS}\n[social]\nresolution = 0.2");
    let scenario = parse(&text).expect("a good file");
    let settings = "[social]\nresolution = 0.1\n";
    let invalid = parse_social("settings.toml", settings, Some(&scenario)).unwrap_err();
    assert_eq!(invalid.problems[0].line, 2, "{invalid}");
    assert!(parse_social("settings.toml", settings, None).is_ok());
}

#[test]
fn the_vocabulary_has_room_for_the_largest_grid() {
    let schema = crate::schema().unwrap();
    let grid = schema.find_attribute(SOCIAL_GRID).unwrap();
    let room = schema.large_type(grid).unwrap().max_bytes;
    assert!(4.0 * MOST_CELLS <= room as f64);
}

#[test]
fn names_that_nothing_in_the_scenario_has_are_told_with_what_there_is() {
    let with = |social: &str| {
        let invalid = parse(&format!("{TWO_ROOMS}\n[social]\n{social}")).unwrap_err();
        let problems = invalid.problems.iter();
        problems
            .map(|problem| problem.kind.to_string())
            .collect::<Vec<_>>()
    };
    let told = with(
        "spaces = { tabel = { margin = 0.5 } }\nactivity_in = { hal = \"cooking\" }\n\
         [social.usage_of.rond]\nleast = 1.0\n",
    );
    assert_eq!(
        told,
        [
            "there is no class of object called `tabel`",
            "there is no room called `hal`",
            "there is no object called `rond`",
        ]
    );
    // The same in a file of its own.
    let scenario = parse(TWO_ROOMS).unwrap();
    let settings = "[social]\nactivity_in = { hal = \"coking\" }\nusage_of.rond.ramp = 60.0\n";
    let read = |scenario| parse_social("settings.toml", settings, scenario).unwrap_err();
    let lines: Vec<String> = read(Some(&scenario))
        .problems
        .iter()
        .map(|problem| format!("{}: {}", problem.line, problem.kind))
        .collect();
    assert_eq!(
        lines,
        [
            "2: there is no room called `hal`",
            "2: activity_in.hal needs the name of an activity, and `coking` is none; did you mean `cooking`?",
            "3: there is no object called `rond`",
        ]
    );
    assert_eq!(read(None).problems.len(), 1);
    // A figure that cannot be is told where it stands.
    let text = format!("{TWO_ROOMS}\n[social]\nclearance_cost = 1.0\nresolution = 0\n");
    let invalid = parse(&text).unwrap_err();
    let line = TWO_ROOMS.lines().count() + 4;
    assert_eq!(invalid.problems[0].line, line, "{invalid}");
}

#[test]
fn the_human_observers_figures_are_read_and_unusable_ones_told() {
    let with = |table: &str| parse(&format!("{TWO_ROOMS}\n{table}"));
    let config = with("[human_observer.tracking]\nassociation = \"nearest\"\nposition_noise = 0.2")
        .expect("a good file")
        .human_observer;
    assert_eq!(config.tracking.association, Association::Nearest);
    assert!((config.tracking.position_noise - 0.2).abs() < 1e-12);
    for (table, says) in [
        (
            "[human_observer.tracking]\nposition_noise = 0.0",
            "greater than 0",
        ),
        (
            "[human_observer.tracking]\nassociation = \"sort\"",
            "unknown variant `sort`",
        ),
    ] {
        let invalid = with(table).expect_err("a bad file");
        let told = invalid.problems[0].kind.to_string();
        assert!(told.contains(says), "{told}");
    }
}

/// Each key of the configuration that the code has, with its default.
fn keys(value: &serde_json::Value, path: &str, found: &mut BTreeMap<String, serde_json::Value>) {
    /// What has names of its own, and what stands for these in the book.
    const NAMED: [(&str, &str); 7] = [
        ("spaces", "CLASS"),
        ("usage_of", "OBJECT"),
        ("activities", "NAME"),
        ("activity_in", "ROOM"),
        ("features.known", "NAME"),
        ("features.known.NAME.levels", "LEVEL"),
        ("cooperation", "TASK"),
    ];
    match value {
        serde_json::Value::Object(fields) if path != "usage_of.OBJECT" => {
            let named = NAMED.iter().find(|(owner, _)| *owner == path);
            for (key, field) in fields {
                let key = named.map_or(key.as_str(), |(_, name)| name);
                let dot = if path.is_empty() { "" } else { "." };
                keys(field, &format!("{path}{dot}{key}"), found);
            }
        }
        serde_json::Value::Array(items) => items.iter().for_each(|one| keys(one, path, found)),
        _ => drop(found.insert(path.to_owned(), value.clone())),
    }
}

#[test]
fn the_book_has_every_key_and_its_default() {
    let config = SocialConfig {
        walls: Some(WallAdaptation::default()),
        usage: UsageCurve::stepped(),
        usage_of: [("tv".to_owned(), UsageCurve::default())].into(),
        activity_in: [("kitchen".to_owned(), "cooking".to_owned())].into(),
        ..SocialConfig::default()
    };
    let mut expected = BTreeMap::new();
    keys(&serde_json::to_value(&config).unwrap(), "", &mut expected);
    let book = include_str!("../../../../docs/src/social-settings.md");
    let mut told = BTreeMap::new();
    for row in book.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = row
            .split('|')
            .map(|cell| cell.trim().trim_matches('`'))
            .collect();
        told.insert(cells[1], cells[2]);
    }
    let names: Vec<&str> = expected.keys().map(String::as_str).collect();
    assert_eq!(told.keys().copied().collect::<Vec<_>>(), names);
    for (key, default) in told.into_iter().filter(|(_, default)| !default.is_empty()) {
        let default: serde_json::Value = serde_json::from_str(default).unwrap();
        assert_eq!(default.as_f64(), expected[key].as_f64(), "{key}");
        assert!(default.is_number() || default == expected[key], "{key}");
    }
}
