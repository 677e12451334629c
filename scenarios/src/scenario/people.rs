//! The part of the main file that walks: people with a schedule, and crowds.

use super::diagnostic::ProblemKind;
use super::file::{Kind, Names, point, pose, time_of_day};
use super::reader::{Bound, Located, Table};
use super::space::{check_body, check_inside};
use super::value::Value;
use super::{Begin, Entry, Face, Object, Person, Place, Room, Stream, Wall};
use jiff::civil::Date;
use nalgebra::Point2;
use std::ops::Range;
use toml::de::DeValue;

/// The radius of a standing adult's body, seen from above, m.
const BODY_RADIUS: f64 = 0.2;

/// What a schedule may refer to.
pub(super) struct Scene<'a> {
    pub(super) day: Date,
    pub(super) rooms: &'a [Room],
    pub(super) walls: &'a [Wall],
    pub(super) places: &'a [Place],
    pub(super) objects: &'a [Object],
}

impl Scene<'_> {
    /// Notes that nobody can stand (or sit on a seat) here.
    fn check_standing(&self, table: &Table<'_>, at: Point2<f64>, what: &str, span: Range<usize>) {
        let solid = self.objects.iter().filter(|object| object.class != "seat");
        check_body(
            table,
            self.rooms,
            self.walls,
            solid,
            (at, BODY_RADIUS),
            what,
            span,
        );
    }
}

/// Where to go or to look, as written.
enum Target {
    Name(String),
    Point([f64; 2]),
    Heading(f64),
}

impl Value for Target {
    const EXPECTED: &'static str = "a name, a point [x, y] or, for `face`, a heading";
    fn read(value: &DeValue<'_>) -> Option<Self> {
        String::read(value)
            .map(Self::Name)
            .or_else(|| <[f64; 2]>::read(value).map(Self::Point))
            .or_else(|| f64::read(value).map(Self::Heading))
    }
}

pub(super) fn people(
    scenario: &Table<'_>,
    names: &mut Names<'_>,
    scene: &Scene<'_>,
) -> Vec<Person> {
    let tables = scenario.tables("person");
    // People may look at each other, so all are named before any schedule is read.
    let named: Vec<_> = tables
        .iter()
        .map(|table| names.take(table, Kind::Person))
        .collect();
    let order: Vec<String> = named.iter().flatten().cloned().collect();
    let mut people = Vec::new();
    for (table, name) in tables.into_iter().zip(named) {
        let pose = pose(&table);
        let mut schedule = Vec::new();
        for entry in table.tables("schedule") {
            schedule.extend(read_entry(&entry, names, scene, &order));
            entry.close();
        }
        let person = Person {
            name: name.clone().unwrap_or_default(),
            pose,
            speed: table.number("speed", Bound::Positive, 1.0),
            radius: table.number("radius", Bound::Positive, BODY_RADIUS),
            schedule,
            repeat: table.get("repeat").is_some_and(|repeat| repeat.value),
        };
        if let Some(name) = name {
            let at = pose.translation.vector.into();
            let what = format!("person `{name}`");
            scene.check_standing(&table, at, &what, table.span_of("pose"));
            people.push(person);
        }
        table.close();
    }
    people
}

fn read_entry(
    table: &Table<'_>,
    names: &Names<'_>,
    scene: &Scene<'_>,
    people: &[String],
) -> Option<Entry> {
    let bad = |message| {
        table
            .problems
            .add(ProblemKind::BadEntry { message }, table.span.clone());
    };
    let begin = match (table.has("at"), table.has("after")) {
        (true, true) => {
            bad("an entry begins `at` a time or `after` some seconds, not both");
            return None;
        }
        (true, false) => table
            .moment("at")
            .and_then(|clock| time_of_day(scene.day, clock))
            .map(Begin::At),
        (false, _) => Some(Begin::After(table.number("after", Bound::NotNegative, 0.0))),
    };
    table.allow("at");
    table.allow("after");
    let (go, arrival) = go(table, names, scene).unzip();
    if let Some(at) = go {
        scene.check_standing(table, at, "who goes here", table.span_of("go"));
    }
    let face = face(table, names, scene, people).or(arrival.flatten());
    let leave = table.get("leave").is_some_and(|leave| leave.value);
    if !["go", "face", "leave", "after"]
        .iter()
        .any(|key| table.has(key))
    {
        bad("an entry says where to `go`, what to `face`, or to `leave`");
    }
    Some(Entry {
        begin: begin?,
        go,
        face,
        leave,
    })
}

/// Where to go, and where to look on arrival if the goal says so.
fn go(
    table: &Table<'_>,
    names: &Names<'_>,
    scene: &Scene<'_>,
) -> Option<(Point2<f64>, Option<Face>)> {
    let target = table.get::<Target>("go")?;
    let name = match target.value {
        Target::Point([x, y]) => {
            return Some((Point2::new(x, y), None));
        }
        Target::Heading(_) => {
            let expected = "a name or a point [x, y]";
            let kind = ProblemKind::WrongType {
                key: "go".to_owned(),
                expected,
            };
            table.problems.add(kind, target.span);
            return None;
        }
        Target::Name(name) => name,
    };
    if let Some(place) = scene.places.iter().find(|place| place.name == name) {
        let heading = Face::Heading(place.pose.rotation.angle());
        return Some((place.pose.translation.vector.into(), Some(heading)));
    }
    if let Some(room) = scene.rooms.iter().find(|room| room.name == name) {
        return Some((room.centroid(), None));
    }
    if let Some(object) = scene.objects.iter().find(|object| object.name == name) {
        if object.class == "seat" {
            let heading = Face::Heading(object.pose.rotation.angle());
            return Some((object.pose.translation.vector.into(), Some(heading)));
        }
        let message = "only a seat can be gone to by name; give a place or a point beside this";
        table
            .problems
            .add(ProblemKind::BadEntry { message }, target.span);
        return None;
    }
    let kinds = [Kind::Place, Kind::Room, Kind::Object];
    let name = Located {
        value: name,
        span: target.span,
    };
    names.unknown(table.problems, "place, room or seat", &kinds, &name);
    None
}

fn face(
    table: &Table<'_>,
    names: &Names<'_>,
    scene: &Scene<'_>,
    people: &[String],
) -> Option<Face> {
    let target = table.get::<Target>("face")?;
    let name = match target.value {
        Target::Heading(heading) => return Some(Face::Heading(heading)),
        Target::Point([x, y]) => return Some(Face::Point(Point2::new(x, y))),
        Target::Name(name) => name,
    };
    if let Some(person) = people.iter().position(|person| *person == name) {
        return Some(Face::Person(person));
    }
    let object = scene
        .objects
        .iter()
        .find(|object| object.name == name)
        .map(|o| o.pose);
    let place = scene
        .places
        .iter()
        .find(|place| place.name == name)
        .map(|p| p.pose);
    if let Some(pose) = object.or(place) {
        return Some(Face::Point(pose.translation.vector.into()));
    }
    let kinds = [Kind::Person, Kind::Object, Kind::Place];
    let name = Located {
        value: name,
        span: target.span,
    };
    names.unknown(table.problems, "person, object or place", &kinds, &name);
    None
}

pub(super) fn streams(scenario: &Table<'_>, names: &mut Names<'_>, rooms: &[Room]) -> Vec<Stream> {
    let mut streams = Vec::new();
    for table in scenario.tables("stream") {
        let name = names.take(&table, Kind::Other);
        let (from, to) = (point(&table, "from"), point(&table, "to"));
        for (key, at) in [("from", from), ("to", to)] {
            let what = format!("`{key}`");
            check_inside(&table, rooms, at, what, table.span_of(key));
        }
        let width = table.number("width", Bound::NotNegative, 0.0);
        let people = table.get::<i64>("people").map_or(1, |people| {
            if people.value < 1 || people.value > 1000 {
                let allowed = "from 1 to 1000";
                let kind = ProblemKind::OutOfRange {
                    key: "people".to_owned(),
                    allowed,
                };
                table.problems.add(kind, people.span);
            }
            people.value.clamp(1, 1000) as usize
        });
        let speed = table.get::<[f64; 2]>("speed");
        if let Some(speed) = speed
            .as_ref()
            .filter(|s| !(0.0 < s.value[0] && s.value[0] <= s.value[1]))
        {
            let allowed = "[slowest, fastest], both more than 0";
            let kind = ProblemKind::OutOfRange {
                key: "speed".to_owned(),
                allowed,
            };
            table.problems.add(kind, speed.span.clone());
        }
        let speed = speed.map_or([0.9, 1.4], |speed| speed.value);
        let radius = table.number("radius", Bound::Positive, BODY_RADIUS);
        if let Some(name) = name {
            streams.push(Stream {
                name,
                from,
                to,
                width,
                people,
                speed,
                radius,
            });
        }
        table.close();
    }
    streams
}
