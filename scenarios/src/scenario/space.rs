//! The part of the main file that stands still: rooms, doors, walls, places, objects.

use super::diagnostic::ProblemKind;
use super::file::Read;
use super::file::{Kind, Names, point, pose};
use super::geometry::{self, Fit, distance_to_wall};
use super::reader::{Bound, Located, Problems, Table};
use super::{Door, Object, Place, Room, Shape, Unknown, Wall, occupancy};
use agents::names::suggest;
use nalgebra::{Point2, Vector2};
use std::ops::Range;

/// The classes of object that the vocabulary knows.
pub(crate) const CLASSES: [&str; 10] = [
    "object",
    "bed",
    "board",
    "cupboard",
    "plant",
    "seat",
    "stretcher",
    "table",
    "toilet",
    "tv",
];

const SHAPES: [(&str, Shape); 2] = [("rectangle", Shape::Rectangle), ("circle", Shape::Circle)];
const UNKNOWN: [(&str, Unknown); 2] = [("blocked", Unknown::Blocked), ("free", Unknown::Free)];

pub(super) fn rooms(scenario: &Table<'_>, names: &mut Names<'_>) -> Vec<Room> {
    if !scenario.has("room") {
        scenario.missing("room");
    }
    let mut rooms = Vec::new();
    for table in scenario.tables("room") {
        let name = names.take(&table, Kind::Room);
        let corners = table.require::<Vec<[f64; 2]>>("polygon");
        let walled = table.get("walls").is_none_or(|walls| walls.value);
        if let (
            Some(room),
            Some(Located {
                value: corners,
                span,
            }),
        ) = (name, corners)
        {
            let polygon: Vec<_> = corners.iter().map(|&[x, y]| Point2::new(x, y)).collect();
            if polygon.len() < 3 {
                let kind = ProblemKind::TooFewCorners {
                    room: room.clone(),
                    corners: polygon.len(),
                };
                table.problems.add(kind, span);
            } else if !geometry::is_simple(&polygon) {
                table
                    .problems
                    .add(ProblemKind::CrossedOutline { room: room.clone() }, span);
            }
            rooms.push(Room {
                name: room,
                polygon,
                walled,
            });
        }
        table.close();
    }
    rooms
}

pub(super) fn doors(scenario: &Table<'_>, names: &Names<'_>, rooms: &[Room]) -> Vec<Door> {
    let mut doors = Vec::new();
    for table in scenario.tables("door") {
        let joined = table.require::<Vec<Located<String>>>("rooms");
        let position = point(&table, "position");
        let width = table.required_number("width", Bound::Positive);
        if let Some(joined) = joined {
            doors.extend(door(&table, names, rooms, &joined, position, width));
        }
        table.close();
    }
    doors
}

/// One door, where everything about it is right.
fn door(
    table: &Table<'_>,
    names: &Names<'_>,
    rooms: &[Room],
    joined: &Located<Vec<Located<String>>>,
    position: Point2<f64>,
    width: f64,
) -> Option<Door> {
    let [first, second] = joined.value.as_slice() else {
        let expected = "the names of the two rooms that the door joins";
        let kind = ProblemKind::WrongType {
            key: "rooms".to_owned(),
            expected,
        };
        table.problems.add(kind, joined.span.clone());
        return None;
    };
    if first.value == second.value {
        let kind = ProblemKind::DoorToItself {
            room: first.value.clone(),
        };
        table.problems.add(kind, joined.span.clone());
        return None;
    }
    let mut along = None;
    let mut ends = Vec::new();
    for name in [first, second] {
        if !names.is(&name.value, Kind::Room) {
            names.unknown(table.problems, "room", &[Kind::Room], name);
        }
        let Some(at) = rooms.iter().position(|room| room.name == name.value) else {
            continue;
        };
        ends.push(at);
        if rooms[at].polygon.len() < 3 || !table.has("position") {
            continue;
        }
        let room = name.value.clone();
        match geometry::fit(&rooms[at].polygon, position, width) {
            Fit::On(direction) => along = Some(direction),
            Fit::Off(distance) => {
                let kind = ProblemKind::DoorOffWall { room, distance };
                table.problems.add(kind, table.span_of("position"));
            }
            Fit::Narrow(space) => {
                let kind = ProblemKind::DoorTooWide { room, width, space };
                table.problems.add(kind, table.span_of("width"));
            }
        }
    }
    let rooms = ends.try_into().ok()?;
    Some(Door {
        rooms,
        position,
        along: along?,
        width,
    })
}

pub(super) fn walls(
    scenario: &Table<'_>,
    rooms: &[Room],
    doors: &[Door],
    read: Read<'_>,
) -> Vec<Wall> {
    let mut extra = Vec::new();
    for table in scenario.tables("wall") {
        extra.push([point(&table, "from"), point(&table, "to")]);
        table.close();
    }
    let mut walls = geometry::walls(rooms, doors, &extra);
    walls.extend(mapped(scenario, read));
    walls
}

/// The walls of the occupancy map, where there is one.
fn mapped(scenario: &Table<'_>, read: Read<'_>) -> Vec<Wall> {
    let unknown = word(
        scenario,
        "map_unknown",
        "meaning of unknown cells",
        &UNKNOWN,
    );
    let Some(map) = scenario.get::<String>("map") else {
        return Vec::new();
    };
    occupancy::walls(&map.value, unknown, read).unwrap_or_else(|error| {
        let kind = ProblemKind::Map {
            path: map.value,
            error,
        };
        scenario.problems.add(kind, map.span);
        Vec::new()
    })
}

pub(super) fn bounds(scenario: &Table<'_>, rooms: &[Room]) -> [f64; 4] {
    if let Some(given) = scenario.get::<[f64; 4]>("bounds") {
        let [left, bottom, right, top] = given.value;
        if left >= right || bottom >= top {
            let allowed = "[xmin, ymin, xmax, ymax] with xmin < xmax and ymin < ymax";
            let kind = ProblemKind::OutOfRange {
                key: "bounds".to_owned(),
                allowed,
            };
            scenario.problems.add(kind, given.span);
        }
        return given.value;
    }
    let start = [
        f64::INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NEG_INFINITY,
    ];
    rooms
        .iter()
        .flat_map(|room| &room.polygon)
        .fold(start, |b, p| {
            [b[0].min(p.x), b[1].min(p.y), b[2].max(p.x), b[3].max(p.y)]
        })
}

/// Notes that `what` is in no room, if so and if the rooms are all polygons.
pub(super) fn check_inside(
    table: &Table<'_>,
    rooms: &[Room],
    at: Point2<f64>,
    what: String,
    span: Range<usize>,
) {
    let drawn = rooms.iter().all(|room| room.polygon.len() > 2);
    if drawn && !rooms.iter().any(|room| room.contains(at)) {
        table.problems.add(ProblemKind::OutsideRooms { what }, span);
    }
}

pub(super) fn places(scenario: &Table<'_>, names: &mut Names<'_>, rooms: &[Room]) -> Vec<Place> {
    let mut places = Vec::new();
    for table in scenario.tables("place") {
        let name = names.take(&table, Kind::Place);
        let pose = pose(&table);
        if let Some(name) = name {
            let at = pose.translation.vector.into();
            check_inside(
                &table,
                rooms,
                at,
                format!("place `{name}`"),
                table.span_of("pose"),
            );
            places.push(Place { name, pose });
        }
        table.close();
    }
    places
}

/// Notes a class of objects that there is not.
pub(super) fn check_class(problems: &Problems, class: &Located<String>) {
    if !CLASSES.contains(&class.value.as_str()) {
        let kind = ProblemKind::UnknownName {
            kind: "class of object",
            name: class.value.clone(),
            help: suggest(&class.value, CLASSES),
        };
        problems.add(kind, class.span.clone());
    }
}

pub(super) fn objects(scenario: &Table<'_>, names: &mut Names<'_>, rooms: &[Room]) -> Vec<Object> {
    let mut objects = Vec::new();
    for table in scenario.tables("object") {
        let name = names.take(&table, Kind::Object);
        let class = table.require::<String>("class");
        if let Some(class) = &class {
            check_class(table.problems, class);
        }
        let shape = word(&table, "shape", "shape", &SHAPES);
        let size = table.require::<[f64; 2]>("size");
        let [x, y] = size.as_ref().map_or([1.0; 2], |size| size.value);
        if let Some(size) = size.filter(|size| size.value.iter().any(|side| *side <= 0.0)) {
            let kind = ProblemKind::OutOfRange {
                key: "size".to_owned(),
                allowed: "more than 0",
            };
            table.problems.add(kind, size.span);
        }
        let pose = pose(&table);
        let marker = table.get("marker").is_none_or(|marker| marker.value);
        if let (Some(name), Some(class)) = (name, class) {
            let at = pose.translation.vector.into();
            check_inside(
                &table,
                rooms,
                at,
                format!("object `{name}`"),
                table.span_of("pose"),
            );
            let size = Vector2::new(x, y);
            objects.push(Object {
                name,
                class: class.value,
                pose,
                shape,
                size,
                marker,
            });
        }
        table.close();
    }
    objects
}

/// What one of a few words means; the first where none is given.
fn word<T: Copy>(
    table: &Table<'_>,
    key: &'static str,
    kind: &'static str,
    words: &[(&str, T)],
) -> T {
    let given = table.get::<String>(key);
    let Some(given) = given else {
        return words[0].1;
    };
    let meaning = words.iter().find(|(word, _)| *word == given.value);
    meaning
        .unwrap_or_else(|| {
            let help = suggest(&given.value, words.iter().map(|(word, _)| *word));
            let kind = ProblemKind::UnknownName {
                kind,
                name: given.value,
                help,
            };
            table.problems.add(kind, given.span);
            &words[0]
        })
        .1
}

/// Notes that a body of this radius at `at` is in no room, or in a wall or one of the objects.
pub(super) fn check_body<'a>(
    table: &Table<'_>,
    rooms: &[Room],
    walls: &[Wall],
    mut objects: impl Iterator<Item = &'a Object>,
    body: (Point2<f64>, f64),
    what: &str,
    span: Range<usize>,
) {
    let (at, radius) = body;
    check_inside(table, rooms, at, what.to_owned(), span.clone());
    let object = objects.find(|object| object.distance(at) < radius);
    let wall = walls.iter().any(|wall| distance_to_wall(at, wall) < radius);
    let obstacle = object.map(|object| format!("`{}`", object.name));
    if let Some(obstacle) = obstacle.or(wall.then(|| "a wall".to_owned())) {
        let what = what.to_owned();
        table
            .problems
            .add(ProblemKind::NoSpace { what, obstacle }, span);
    }
}
