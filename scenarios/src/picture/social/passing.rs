//! Where a person wants the robot and where it does not pass: cooperation zones, and the sides towards a
//! wall that leaves no room.

use super::super::canvas::View;
use super::OUTLINE;
use agents::social_mapping::adaptation::Passage;
use agents::social_mapping::{Levels, PersonSpaces, Update};
use nalgebra::{Point2, Vector2};
use std::f64::consts::{FRAC_PI_2, TAU};
use svg::node::element::Group;

/// Cooperation zones: Okabe and Ito's bluish green.
pub(super) const WANTED: &str = "#009e73";
/// Sides without room: their vermilion.
pub(super) const SHUT: &str = "#d55e00";
/// Half the length of the bar that shuts a side, metres.
const BAR: f64 = 0.3;

/// Whether anybody wants the robot anywhere.
pub(super) fn is_wanted(update: &Update) -> bool {
    update.people.iter().any(|person| !person.open.is_empty())
}

/// Whether somebody cannot be passed on some side.
pub(super) fn is_shut(update: &Update) -> bool {
    let shut = |person: &PersonSpaces| {
        person
            .passages
            .is_some_and(|all| all.contains(&Passage::Blocked))
    };
    update.people.iter().any(|person| shut(person))
}

/// All zones and bars.
pub(super) fn passing(view: &View, update: &Update, levels: &Levels) -> Group {
    let wanted = Group::new()
        .set("fill", WANTED)
        .set("fill-opacity", "0.45")
        .set("stroke", WANTED)
        .set("stroke-width", "1.2");
    let wanted = update.people.iter().fold(wanted, |group, person| {
        let sectors = person.open.iter().map(|zone| {
            let steps = (OUTLINE as f64 * zone.opening / TAU).ceil().max(2.0) as usize;
            let along = |level: f64| {
                (0..=steps).filter_map(move |step| {
                    let share = step as f64 / steps as f64 - 0.5;
                    let direction = zone.direction + zone.opening * share;
                    let distance = person.shape.distance_at(direction, level)?;
                    let (sin, cos) = direction.sin_cos();
                    Some(person.world_from_person * Point2::new(distance * cos, distance * sin))
                })
            };
            let inner: Vec<Point2<f64>> = along(levels.intimate).collect();
            along(levels.personal)
                .chain(inner.into_iter().rev())
                .collect::<Vec<_>>()
        });
        sectors.fold(group, |group, sector| group.add(view.polygon(sector)))
    });
    let shut = Group::new().set("stroke", SHUT).set("stroke-width", "4");
    let shut = update.people.iter().fold(shut, |group, person| {
        let passages = person.passages.into_iter().flatten().enumerate();
        let blocked = passages.filter(|(_, passage)| !passage.is_passable());
        blocked.fold(group, |group, (side, _)| {
            let direction = side as f64 * FRAC_PI_2;
            let reach = person
                .shape
                .distance_at(direction, levels.personal)
                .unwrap_or_default();
            let (sin, cos) = direction.sin_cos();
            let (ahead, across) = (Vector2::new(cos, sin), Vector2::new(-sin, cos));
            let end = |sign: f64| {
                person.world_from_person * Point2::from(ahead * reach + across * BAR * sign)
            };
            group.add(view.line(end(-1.0), end(1.0)))
        })
    });
    Group::new().add(wanted).add(shut)
}
