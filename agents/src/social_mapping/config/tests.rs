//! Figures that make no map are refused, and all others make one.

use super::*;
use crate::grid::{BLOCKED, FREE};
use crate::social_mapping::map::SocialMapper;
use crate::social_mapping::object_space::Outline;
use crate::social_mapping::rejection::Rejection;
use crate::social_mapping::scene::{Activity, Manner, Object, Person, SocialScene};
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};
use serde_json::Value;

#[test]
fn adaptive_proxemics_has_its_zones_at_the_papers_distances() {
    let config = SocialConfig::adaptive_proxemics();
    assert!(config.problems().is_empty());
    let Proxemics { shape, levels } = config.proxemics;
    for (far, level) in [(0.4, levels.intimate), (1.2, levels.personal)] {
        let density = (-0.5 * (far / shape.side).powi(2)).exp();
        assert!((density - level).abs() < 1e-12);
    }
}

#[test]
fn figures_that_make_no_map_are_all_named() {
    let mut config = SocialConfig {
        resolution: 1e-9,
        contour_points: 20_000_000,
        ..SocialConfig::default()
    };
    config.proxemics.levels.personal = 0.95;
    config.spaces.insert("bath".into(), Space::Margin(f64::NAN));
    config.activity_in.insert("hall".into(), "dancing".into());
    let problems = config.problems();
    let fields: Vec<_> = problems.iter().map(|p| p.field.as_str()).collect();
    let expected = [
        "resolution",
        "contour_points",
        "proxemics.levels",
        "spaces.bath",
        "activity_in.hall",
    ];
    assert_eq!(fields, expected);
    assert_eq!(SocialMapper::new(config).unwrap_err(), problems);
}

/// Each number of the configuration, by the path to it.
fn numbers(value: &Value, path: &str, found: &mut Vec<String>) {
    let below = |key: &str| format!("{path}/{key}");
    match value {
        Value::Number(_) => found.push(path.to_owned()),
        Value::Array(items) => {
            for (at, item) in items.iter().enumerate() {
                numbers(item, &below(&at.to_string()), found);
            }
        }
        Value::Object(fields) => {
            for (key, field) in fields {
                numbers(field, &below(key), found);
            }
        }
        Value::Null | Value::Bool(_) | Value::String(_) => {}
    }
}

/// Somebody in a corridor with a table, a walking pair who talk, and a meeting at a board.
fn scene() -> SocialScene {
    let person = |name: &str, x: f64, heading: f64| Person {
        name: name.into(),
        world_from_person: Isometry2::new(Vector2::new(x, 1.0), heading),
        velocity: Vector2::new(heading.cos(), 0.0),
        radius: 0.25,
        manner: Manner {
            activity: Some("cooking".into()),
            task: Some("escort".into()),
            features: [("role".to_owned(), 0.5)].into(),
            ..Manner::default()
        },
    };
    let object = |class: &str, x: f64| Object {
        name: class.into(),
        class: class.into(),
        world_from_object: Isometry2::new(Vector2::new(x, 2.5), -1.5),
        outline: Outline::Rectangle(Vector2::new(0.2, 0.8)),
    };
    let start = Time::from_seconds(1e9);
    SocialScene {
        bounds: [0.0, 0.0, 6.0, 3.0],
        walls: vec![[Point2::new(0.0, 0.1), Point2::new(6.0, 0.1)]],
        robot_radius: 0.25,
        social: true,
        people: vec![person("one", 2.0, 0.0), person("two", 3.0, 3.1)],
        interactions: vec![("one".into(), "two".into())],
        objects: vec![object("board", 4.5), object("table", 1.0)],
        activities: vec![Activity {
            name: "feast".into(),
            object: "board".into(),
            start,
            end: start + 60.0,
        }],
        rejected: Vec::new(),
    }
}

#[test]
fn whatever_a_figure_is_it_is_refused_or_makes_a_map() {
    let full = SocialConfig {
        usage: UsageCurve::stepped(),
        usage_of: [("board".to_owned(), UsageCurve::stepped())].into(),
        walls: Some(WallAdaptation::default()),
        group_space: true,
        ..SocialConfig::default()
    };
    let now = Time::from_seconds(1e9 - 600.0);
    let written = serde_json::to_value(&full).unwrap();
    let mut paths = Vec::new();
    numbers(&written, "", &mut paths);
    assert!(paths.len() > 80, "{paths:?}");
    for path in &paths {
        for figure in [1e308_f64, -1e308, -1.0, 0.0, 1e-308, 1e-3, 1.0, 1e3] {
            let mut changed = written.clone();
            *changed.pointer_mut(path).unwrap() = figure.into();
            // A count is no fraction, so some of these cannot even be read.
            let Ok(config) = serde_json::from_value::<SocialConfig>(changed) else {
                continue;
            };
            let Ok(mut mapper) = SocialMapper::new(config) else {
                continue;
            };
            assert!(figure.abs() < 1e300, "{path} may be {figure}");
            let update = mapper.update(now, &scene()).unwrap();
            let apart = |one: &Rejection| matches!(one, Rejection::InteractionTooFar { .. });
            assert!(update.rejected.iter().all(apart), "{path} {figure}");
            let most = MOST_COST as f32 + FREE;
            let sound = |cost: &f32| (FREE..=most).contains(cost) || *cost == BLOCKED;
            assert!(update.grid.costs.iter().all(sound), "{path} {figure}");
        }
    }
}

#[test]
fn no_figure_is_no_number() {
    let nan = f64::NAN;
    let mut config = SocialConfig {
        clearance_cost: nan,
        between_reach: nan,
        ..SocialConfig::default()
    };
    config.usage.most = nan;
    config.proxemics.levels.personal = nan;
    config.grouping.facing.bond = nan;
    config.walls = Some(WallAdaptation {
        margin: nan,
        ..WallAdaptation::default()
    });
    let problems = config.problems();
    let fields: Vec<_> = problems.iter().map(|p| p.field.as_str()).collect();
    let expected = [
        "proxemics.levels",
        "clearance_cost",
        "between_reach",
        "usage",
        "walls",
        "grouping",
    ];
    assert_eq!(fields, expected);
    assert_eq!(
        problems[1].to_string(),
        "social mapping: clearance_cost must be from 0 to 1000"
    );
}
