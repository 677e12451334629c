//! What stands still: rooms, walls, doors, objects and the spaces around them, at one moment's
//! R(t).

use super::canvas::{FAINT, INK, View, heat, text_width};
use super::label::{Labels, Look, WALL};
use crate::metrics::ObjectSpace;
use crate::scenario::{Object, Scenario};
use dsr::Time;
use nalgebra::Point2;
use svg::node::element::Group;

/// Rooms on the grey of what is outside.
pub(super) fn ground(view: &View, scenario: &Scenario) -> Group {
    let outside = view.frame().set("fill", "#e9e9e9");
    scenario
        .rooms
        .iter()
        .fold(Group::new().add(outside), |group, room| {
            let floor = view
                .polygon(room.polygon.iter().copied())
                .set("fill", "#ffffff");
            group.add(if room.walled {
                floor
            } else {
                floor
                    .set("stroke", "#bbbbbb")
                    .set("stroke-width", "1")
                    .set("stroke-dasharray", "2 4")
            })
        })
}

/// The spaces of objects, coloured by R(`now`).
pub(super) fn spaces(view: &View, spaces: &[ObjectSpace], now: Time) -> Group {
    spaces.iter().fold(Group::new(), |group, space| {
        let (least, most) = (space.curve.least, space.curve.most);
        let share = if most > least {
            (space.usage(now) - least) / (most - least)
        } else {
            0.0
        };
        let colour = heat(share);
        let area = view
            .polygon(space.outline())
            .set("fill", colour.as_str())
            .set("fill-opacity", "0.45")
            .set("stroke", colour.as_str())
            .set("stroke-width", "1.2");
        group.add(area)
    })
}

/// Walls, and a thin line in each door.
pub(super) fn walls(view: &View, scenario: &Scenario) -> Group {
    let mut group = Group::new();
    for door in &scenario.doors {
        let half = door.along * (door.width / 2.0);
        let gap = view.line(door.position - half, door.position + half);
        group = group.add(gap.set("stroke", "#aaaaaa").set("stroke-width", "1"));
    }
    for [from, to] in &scenario.walls {
        let wall = view.line(*from, *to);
        group = group.add(
            wall.set("stroke", INK)
                .set("stroke-width", "3")
                .set("stroke-linecap", "round"),
        );
    }
    group
}

/// What objects cover, with a stroke along the side where they face.
pub(super) fn objects(view: &View, scenario: &Scenario) -> Group {
    scenario.objects.iter().fold(Group::new(), |group, object| {
        let edge = ("stroke", "#5a5a5a");
        let body = Group::new().set(edge.0, edge.1).set("stroke-width", "1.2");
        let body = body.set("fill", "#c9c9c9");
        group.add(match object.corners() {
            Some(corners) => {
                let front = view.line(corners[1], corners[2]).set("stroke-width", "2.6");
                body.add(view.polygon(corners)).add(front)
            }
            None => body.add(view.dot(centre(object), view.px(object.size.x / 2.0))),
        })
    })
}

/// The names of objects and rooms, as far as there is room for them. Small furniture that has no
/// space of its own stays nameless.
pub(super) fn label_all(
    view: &View,
    scenario: &Scenario,
    spaces: &[ObjectSpace],
    labels: &mut Labels,
) {
    let plain = Look {
        size: 11.0,
        colour: INK,
        bold: false,
    };
    let bold = Look {
        size: 13.0,
        colour: FAINT,
        bold: true,
    };
    for [from, to] in &scenario.walls {
        labels.shun_line(view.page(*from), view.page(*to), WALL);
    }
    let (used, others): (Vec<_>, Vec<_>) = scenario
        .objects
        .iter()
        .partition(|object| spaces.iter().any(|space| space.name == object.name));
    let fits =
        |object: &&Object| text_width(&object.name, plain.size) < 2.0 * view.px(object.size.max());
    for object in used.into_iter().chain(others.into_iter().filter(fits)) {
        let place = view.page(centre(object));
        let reach = view.px(object.size.min() / 2.0);
        labels.on_thing((place, reach), place, &object.name, plain);
    }
    for object in &scenario.objects {
        let radius = view.px(object.size.min() / 2.0);
        labels.keep_off(view.page(centre(object)), radius);
    }
    for room in &scenario.rooms {
        let corners = corners(view, &room.polygon, text_width(&room.name, bold.size));
        let middle = view.page(room.centroid());
        if !corners
            .into_iter()
            .any(|corner| labels.at(corner, &room.name, bold))
        {
            labels.centred(middle, &room.name, bold);
        }
    }
}

fn centre(object: &Object) -> Point2<f64> {
    object.pose.translation.vector.into()
}

/// Where a word of `width` px may stand in the corners of a room, px.
fn corners(view: &View, polygon: &[Point2<f64>], width: f64) -> [Point2<f64>; 4] {
    let outline = polygon.iter().map(|point| view.page(*point));
    let (low, high) = outline.fold(
        (
            Point2::new(f64::INFINITY, f64::INFINITY),
            Point2::new(0.0, 0.0),
        ),
        |(low, high), point| (low.inf(&point), high.sup(&point)),
    );
    let (left, right) = (low.x + 8.0 + width / 2.0, high.x - 8.0 - width / 2.0);
    let (top, bottom) = (low.y + 15.0, high.y - 15.0);
    [(left, top), (left, bottom), (right, top), (right, bottom)].map(|(x, y)| Point2::new(x, y))
}
