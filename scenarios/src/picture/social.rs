//! Pictures of one situation: people's density with contours, headings, groups and the spaces of
//! objects; and the grid of costs. This file owns what is drawn over what; the text of a picture is a
//! function of the situation, to the byte.

mod cells;
mod key;
mod known;
mod passing;

use super::canvas::{self, INK, PEOPLE, View, heat, number, text};
use super::label::{Labels, Look, WALL};
use super::legend;
use crate::situation::Situation;
use agents::social_mapping::object_space::Outline;
use agents::social_mapping::{Layer, ObjectUse, SocialConfig, Update, UsageCurve, Zone};
use cells::is_crowd;
use nalgebra::{Isometry2, Point2, Vector2};
use svg::Document;
use svg::node::element::{Group, Rectangle};

/// Room for the map, px.
const MAP: [f64; 2] = [820.0, 720.0];
const TITLE: f64 = 46.0;
const BORDER: f64 = 20.0;
/// Least width of the legend, px.
const WIDTH: f64 = 216.0;
/// Points of an outline.
const OUTLINE: usize = 72;
/// A tenth of density for each band.
const BANDS: u32 = 9;
/// Groups: Okabe and Ito's reddish purple.
const GROUP: &str = "#aa3377";
/// Half the width of what is kept free of words along an arrow, px.
const ARROW: f64 = 5.0;
/// With more people than this, nobody is named.
const NAMED: usize = 40;

/// What a picture shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Show {
    /// How much places belong to people.
    Density,
    /// What places cost the robot, as far as a layer knows.
    Costs(Layer),
}

/// Draws a situation as SVG 1.1, with the grid that the update carries; see [`super::png`] for pixels.
pub fn social(situation: &Situation, update: &Update, config: &SocialConfig, show: Show) -> String {
    let view = View::new(situation.scene.bounds, 0.0, [BORDER, TITLE + BORDER], MAP);
    let [map_width, map_height] = view.size();
    let left = BORDER + map_width + BORDER;
    let (column, [column_width, column_height]) =
        key::column([left, TITLE + BORDER], situation, update, config, show);
    let whole = left + column_width.max(WIDTH) + BORDER;
    let width = number(whole);
    let below = column_height.max(map_height + canvas::SCALE_BAR);
    let height = number(TITLE + BORDER + below + BORDER);
    let clip = svg::node::element::ClipPath::new()
        .set("id", "map")
        .add(view.frame());
    let page = Rectangle::new()
        .set("width", "100%")
        .set("height", "100%")
        .set("fill", "#ffffff");
    let letters = (whole - 2.0 * BORDER) / canvas::text_width("m", 22.0);
    let name = known::short(&situation.name, letters as usize);
    let heading = text(BORDER, BORDER + 16.0, &name, 20.0)
        .set("font-weight", "bold")
        .set("fill", INK);
    let what = match show {
        Show::Density => "people's density".to_owned(),
        Show::Costs(Layer::Master) => "what a place costs the robot".to_owned(),
        Show::Costs(layer) => format!("what a place costs the robot, layer {}", layer.name()),
    };
    let line = match situation.moment.as_str() {
        "" => what,
        moment => format!("{what}, {moment}"),
    };
    let subtitle = text(BORDER, BORDER + 36.0, &line, 13.0).set("fill", INK);
    let document = Document::new()
        .set("viewBox", format!("0 0 {width} {height}"))
        .set("width", width)
        .set("height", height)
        .set("font-family", canvas::FONT)
        .add(
            svg::node::element::Definitions::new()
                .add(clip)
                .add(legend::gradient()),
        )
        .add(page)
        .add(heading)
        .add(subtitle)
        .add(map(&view, situation, update, config, show))
        .add(view.frame().set("fill", "none").set("stroke", "#999999"))
        .add(view.scale_bar())
        .add(column);
    format!("{document}\n")
}

fn map(
    view: &View,
    situation: &Situation,
    update: &Update,
    config: &SocialConfig,
    show: Show,
) -> Group {
    let mut labels = Labels::new(view);
    // On a grid of costs, a wall is as wide as what it blocks.
    let wall = match show {
        Show::Costs(_) => WALL + view.px(situation.scene.robot_radius),
        Show::Density => WALL,
    };
    for [from, to] in &situation.scene.walls {
        labels.shun_line(view.page(*from), view.page(*to), wall);
    }
    let floor = if situation.rooms.is_empty() {
        "#ffffff"
    } else {
        "#e9e9e9"
    };
    let mut group = Group::new()
        .set("clip-path", "url(#map)")
        .add(view.frame().set("fill", floor));
    for room in &situation.rooms {
        group = group.add(view.polygon(room.iter().copied()).set("fill", "#ffffff"));
    }
    group = match show {
        Show::Costs(_) => group.add(cells::costs(view, &update.grid)),
        Show::Density => group
            .add(spaces(view, update, config))
            .add(if is_crowd(update) {
                cells::density(view, update)
            } else {
                bands(view, update)
            }),
    };
    if !is_crowd(update) {
        group = group
            .add(contours(view, update, config))
            .add(passing::passing(view, update, &config.proxemics.levels))
            .add(groups(view, update, config));
    }
    group = group
        .add(space_edges(view, update, config))
        .add(walls(view, situation));
    if is_crowd(update) {
        label_objects(view, update, &mut labels, |_| true);
    } else {
        group = group.add(people(view, update, situation, config, &mut labels));
        let least = |one: &ObjectUse| curve(config, one).least;
        label_objects(view, update, &mut labels, |one| one.usage > least(one));
        label_groups(view, update, &mut labels);
        label_objects(view, update, &mut labels, |one| one.usage <= least(one));
    }
    group.add(labels.draw())
}

/// Names and R(t) of the objects that are `wanted`: on the object, or beside it.
fn label_objects(
    view: &View,
    update: &Update,
    labels: &mut Labels,
    wanted: impl Fn(&ObjectUse) -> bool,
) {
    for one in update.objects.iter().filter(|one| wanted(one)) {
        let look = Look {
            size: 11.0,
            colour: INK,
            bold: false,
        };
        let words = format!("{} R = {:.2}", known::short(&one.name, 34), one.usage);
        let centre = view.page(one.world_from_object.translation.vector.into());
        let corners = one.space.iter().map(|corner| corner.coords);
        let middle = corners.sum::<Vector2<f64>>() / one.space.len().max(1) as f64;
        let thing = (centre, view.px(0.5));
        labels.on_thing(thing, view.page(middle.into()), &words, look);
    }
}

fn curve<'a>(config: &'a SocialConfig, one: &ObjectUse) -> &'a UsageCurve {
    config.usage_of.get(&one.name).unwrap_or(&config.usage)
}

/// The edges of objects' spaces, over people's, which may cover a small one whole.
fn space_edges(view: &View, update: &Update, config: &SocialConfig) -> Group {
    let layer = Group::new().set("fill", "none").set("stroke-width", "1.6");
    update.objects.iter().fold(layer, |group, one| {
        let edge = view.polygon(one.space.iter().copied());
        group.add(edge.set("stroke", usage_colour(config, one)))
    })
}

/// The dearest cost that is not blocked (personal space).
const DEAREST: f32 = 4.0;

fn cost_colour(cost: f32) -> Option<String> {
    if cost <= 1.0 {
        None
    } else if cost.is_finite() {
        Some(heat(f64::from((cost - 1.0) / (DEAREST - 1.0))))
    } else {
        Some("#4d4d4d".to_owned())
    }
}

fn spaces(view: &View, update: &Update, config: &SocialConfig) -> Group {
    let objects = &update.objects;
    objects.iter().fold(Group::new(), |group, one| {
        group.add(
            view.polygon(one.space.iter().copied())
                .set("fill", usage_colour(config, one))
                .set("fill-opacity", "0.45"),
        )
    })
}

fn usage_colour(config: &SocialConfig, one: &ObjectUse) -> String {
    let curve = curve(config, one);
    let share = if curve.most > curve.least {
        (one.usage - curve.least) / (curve.most - curve.least)
    } else {
        0.0
    };
    heat(share)
}

/// Bands of density: everybody's outlines of one level lie under everybody's of the next, so that
/// what shows is the greatest density of all.
fn bands(view: &View, update: &Update) -> Group {
    (1..=BANDS).fold(Group::new(), |group, band| {
        let level = f64::from(band) / f64::from(BANDS + 1);
        let layer = Group::new()
            .set("fill", density_colour(level))
            .set("fill-opacity", if band == 1 { "0.75" } else { "0.85" });
        group.add(update.people.iter().fold(layer, |layer, person| {
            let outline = person
                .shape
                .contour(&person.world_from_person, level, OUTLINE);
            layer.add(view.polygon(outline))
        }))
    })
}

/// Pale to dark blue (Brewer's `Blues`, whose lightness falls all the way).
fn density_colour(level: f64) -> String {
    const BLUES: [[u8; 3]; 5] = [
        [0xef, 0xf5, 0xfc],
        [0xc6, 0xdb, 0xef],
        [0x9e, 0xca, 0xe1],
        [0x4a, 0x98, 0xc9],
        [0x08, 0x45, 0x94],
    ];
    canvas::mix(&BLUES, level)
}

/// The zones' edges, the closest drawn strongest.
fn contours(view: &View, update: &Update, config: &SocialConfig) -> Group {
    let edges = [
        (Zone::Social, "0.8", "4 3"),
        (Zone::Personal, "1.1", "none"),
        (Zone::Intimate, "1.8", "none"),
    ];
    edges
        .into_iter()
        .fold(Group::new(), |group, (zone, width, dashes)| {
            let layer = Group::new()
                .set("fill", "none")
                .set("stroke", "#0b2f5b")
                .set("stroke-width", width)
                .set("stroke-dasharray", dashes);
            let Some(level) = config.proxemics.levels.level(zone) else {
                return group;
            };
            group.add(update.people.iter().fold(layer, |layer, person| {
                let pose = &person.world_from_person;
                layer.add(view.polygon(person.shape.contour(pose, level, OUTLINE)))
            }))
        })
}

/// Groups: their members joined to their middle, which way they face, and the space of the whole.
fn groups(view: &View, update: &Update, config: &SocialConfig) -> Group {
    let level = config.proxemics.levels.personal;
    let place = |name: &String| {
        let member = update.people.iter().find(|person| person.name == *name)?;
        Some(Point2::from(member.world_from_person.translation.vector))
    };
    let mut all = Group::new().set("stroke", GROUP).set("fill", "none");
    for found in update.groups.iter() {
        let pose = &found.entity.world_from_group;
        let centre = Point2::from(pose.translation.vector);
        let outline = found.widths.contour(pose, level, OUTLINE);
        let mut group = Group::new().add(
            view.polygon(outline)
                .set("stroke-width", "1.4")
                .set("stroke-dasharray", "7 4"),
        );
        for member in found.members.iter().filter_map(place) {
            group = group.add(view.line(centre, member).set("stroke-width", "2.2"));
        }
        let ahead = ahead_of_group(pose);
        group = group
            .add(arrow(view, centre, ahead).set("fill", GROUP))
            .add(
                view.dot(centre, 4.5)
                    .set("fill", "#ffffff")
                    .set("stroke-width", "2"),
            );
        all = all.add(group);
    }
    all
}

/// Where the arrow ends that shows which way a group faces.
fn ahead_of_group(world_from_group: &Isometry2<f64>) -> Point2<f64> {
    world_from_group * Point2::new(0.45, 0.0)
}

/// The groups' numbers, after the names of people.
fn label_groups(view: &View, update: &Update, labels: &mut Labels) {
    for (index, found) in update.groups.iter().enumerate() {
        let centre = view.page(found.entity.world_from_group.translation.vector.into());
        let look = Look {
            size: 12.0,
            colour: GROUP,
            bold: true,
        };
        let words = format!("group {}", index + 1);
        if !labels.beside(centre, 6.0, &words, look) {
            labels.beside(centre, view.px(0.9), &words, look);
        }
    }
}

fn walls(view: &View, situation: &Situation) -> Group {
    let mut group = Group::new();
    for object in &situation.scene.objects {
        let pose = &object.world_from_object;
        let body = Group::new()
            .set("stroke", "#5a5a5a")
            .set("stroke-width", "1.2")
            .set("fill", "#c9c9c9");
        group = group.add(match object.outline {
            Outline::Circle(radius) => {
                body.add(view.dot(pose.translation.vector.into(), view.px(radius)))
            }
            Outline::Rectangle(size) => {
                let half = size / 2.0;
                let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
                body.add(
                    view.polygon(corners.map(|(x, y)| pose * Point2::new(x * half.x, y * half.y))),
                )
            }
        });
    }
    for [from, to] in &situation.scene.walls {
        let wall = view.line(*from, *to);
        group = group.add(
            wall.set("stroke", INK)
                .set("stroke-width", "3")
                .set("stroke-linecap", "round"),
        );
    }
    group
}

/// Bodies with an arrow where they face.
fn people(
    view: &View,
    update: &Update,
    situation: &Situation,
    config: &SocialConfig,
    labels: &mut Labels,
) -> Group {
    let spaces = &update.people;
    let mut group = Group::new();
    for found in update.groups.iter() {
        let pose = &found.entity.world_from_group;
        let (centre, ahead) = (pose.translation.vector.into(), ahead_of_group(pose));
        labels.keep_off_line(view.page(centre), view.page(ahead), ARROW);
    }
    for person in spaces {
        let radius = situation
            .scene
            .people
            .iter()
            .find(|one| one.name == person.name)
            .map_or(0.17, |one| one.radius.clamp(0.1, 0.17));
        let pose = &person.world_from_person;
        let centre = Point2::from(pose.translation.vector);
        let ahead = pose * Point2::new(2.2 * radius, 0.0);
        let body = view
            .dot(centre, view.px(radius))
            .set("fill", PEOPLE)
            .set("stroke", INK)
            .set("stroke-width", "1.2");
        group = group.add(body).add(
            arrow(view, centre, ahead)
                .set("stroke", INK)
                .set("fill", INK),
        );
        labels.keep_off(view.page(centre), view.px(radius));
        labels.keep_off_line(view.page(centre), view.page(ahead), ARROW);
    }
    if spaces.len() <= NAMED {
        for person in spaces {
            let look = Look {
                size: 12.0,
                colour: INK,
                bold: false,
            };
            let centre = Point2::from(person.world_from_person.translation.vector);
            let (centre, radius) = (view.page(centre), view.px(0.25));
            let words = known::label(&person.name, situation, config);
            if !labels.beside(centre, radius, &words, look) {
                labels.beside(centre, radius, &person.name, look);
            }
        }
    }
    group
}

fn arrow(view: &View, from: Point2<f64>, to: Point2<f64>) -> Group {
    let along = (to - from).try_normalize(1e-9).unwrap_or_default();
    let across = Vector2::new(-along.y, along.x);
    let head = 8.0 / view.px(1.0);
    let neck = to - along * head;
    Group::new()
        .add(view.line(from, neck).set("stroke-width", "2"))
        .add(
            view.polygon([to, neck + across * head * 0.45, neck - across * head * 0.45])
                .set("stroke", "none"),
        )
}
