//! The people: their ways over the whole run, and everybody with their zones at one moment.

use super::Moment;
use super::canvas::{INK, PEOPLE, ROBOT, View, number, simplified};
use super::label::{Labels, Look};
use crate::metrics::{is_finite, robot};
use crate::world::{Body, Truth};
use agents::social_mapping::{Proxemics, Zone};
use nalgebra::{Isometry2, Point2, Vector2};
use std::collections::BTreeMap;
use svg::node::element::Group;

/// With more people at the moment, only the closest is named.
const NAMED: usize = 8;
/// Somebody not there for longer has another trail when back, s.
const LONGEST_GAP: f64 = 1.0;
/// Points of a zone's outline.
const OUTLINE: usize = 48;

/// The way of everybody, fainter the more there are.
pub(super) fn trails(view: &View, samples: &[&Truth]) -> Group {
    let mut ways: BTreeMap<&str, Vec<Vec<Point2<f64>>>> = BTreeMap::new();
    let mut seen: BTreeMap<&str, f64> = BTreeMap::new();
    for sample in samples {
        let now = sample.time.since(samples[0].time);
        for body in sample
            .people
            .iter()
            .filter(|body| is_finite(&body.position))
        {
            let trails = ways.entry(&body.name).or_default();
            match (seen.insert(&body.name, now), trails.last_mut()) {
                (Some(before), Some(trail)) if now - before <= LONGEST_GAP => {
                    trail.push(body.position);
                }
                _ => trails.push(vec![body.position]),
            }
        }
    }
    let opacity = (2.2 / (ways.len().max(1) as f64).sqrt()).clamp(0.22, 0.6);
    let group = Group::new()
        .set("stroke", PEOPLE)
        .set("stroke-width", "1.2")
        .set("stroke-opacity", number(opacity));
    ways.into_values()
        .flatten()
        .filter(|trail| trail.len() > 1)
        .fold(group, |group, trail| {
            group.add(view.polyline(simplified(&trail)))
        })
}

/// The three zones of everybody at the moment.
pub(super) fn zones(view: &View, sample: &Truth) -> Group {
    let model = Proxemics::default();
    let looks = [
        (Zone::Social, "0.07", "0.8", "3 3"),
        (Zone::Personal, "0.15", "1", "none"),
        (Zone::Intimate, "0.4", "1.2", "none"),
    ];
    // Zone by zone, so that nobody's wide zone covers somebody else's narrow one.
    looks
        .into_iter()
        .fold(Group::new(), |group, (zone, opacity, width, dashes)| {
            let layer = Group::new()
                .set("fill", PEOPLE)
                .set("fill-opacity", opacity)
                .set("stroke", PEOPLE)
                .set("stroke-width", width)
                .set("stroke-dasharray", dashes);
            group.add(bodies(sample).fold(layer, |layer, body| {
                let pose = Isometry2::new(body.position.coords, body.heading);
                layer.add(view.polygon(model.contour(zone, &pose, OUTLINE)))
            }))
        })
}

/// The bodies of people and robot at the moment, and who is closest.
pub(super) fn moment(view: &View, moment: &Moment, radius: f64, labels: &mut Labels) -> Group {
    let mut group = Group::new();
    let sample = moment.sample;
    let here = robot(sample);
    let named = bodies(sample).count() <= NAMED;
    let closest = moment
        .encounter
        .as_ref()
        .map(|encounter| encounter.person.as_str());
    for body in bodies(sample) {
        labels.keep_off(view.page(body.position), view.px(body.radius));
    }
    labels.keep_off(view.page(here), view.px(radius));
    if let Some(body) = bodies(sample).find(|body| Some(body.name.as_str()) == closest) {
        let between = view.line(here, body.position);
        group = group.add(
            between
                .set("stroke", INK)
                .set("stroke-width", "1.4")
                .set("stroke-dasharray", "2 2"),
        );
    }
    for body in bodies(sample) {
        let is_closest = Some(body.name.as_str()) == closest;
        group = group.add(figure(
            view,
            body.position,
            body.heading,
            body.radius,
            PEOPLE,
        ));
        if named || is_closest {
            let look = Look {
                size: 12.0,
                colour: INK,
                bold: is_closest,
            };
            labels.beside(
                view.page(body.position),
                view.px(body.radius),
                &body.name,
                look,
            );
        }
    }
    let heading = sample.world_from_robot.rotation.angle();
    group.add(figure(view, here, heading, radius, ROBOT))
}

/// A body seen from above, with a stroke where it faces.
fn figure(
    view: &View,
    centre: Point2<f64>,
    heading: f64,
    radius: f64,
    colour: &'static str,
) -> Group {
    let ahead = centre + Isometry2::rotation(heading) * Vector2::new(1.0, 0.0) * radius;
    Group::new()
        .set("stroke", INK)
        .set("stroke-width", "1.4")
        .add(view.dot(centre, view.px(radius)).set("fill", colour))
        .add(view.line(centre, ahead).set("stroke-width", "2"))
}

/// Everybody who can be drawn.
fn bodies(sample: &Truth) -> impl Iterator<Item = &Body> {
    sample
        .people
        .iter()
        .filter(|body| is_finite(&body.position) && body.heading.is_finite())
}
