//! The main file, `scenario.toml`, as a whole: the order in which its tables are read, and the
//! names that they share. Names are unique over all tables, because they become node names.

use super::diagnostic::{Invalid, Problem, ProblemKind};
use super::reader::{Bound, Located, Problems, Table};
use super::{Scenario, TracksFrame};
use super::{devices, missions, people, schedule, space};
use agents::human_observer;
use agents::names::suggest;
use agents::social_mapping::SocialConfig;
use agents::social_mapping::scene::check_size;
use dsr::Time;
use jiff::Timestamp;
use jiff::civil::{Date, DateTime, Time as ClockTime};
use jiff::tz::TimeZone;
use nalgebra::{Isometry2, Point2, Vector2};
use std::ops::Range;
use std::path::PathBuf;
use toml::Spanned;
use toml::de::DeTable;

/// Gives what is in a file beside the main one.
pub(super) type Read<'a> = &'a dyn Fn(&str) -> std::io::Result<Vec<u8>>;

/// A file beside the main one.
pub(super) struct Beside {
    pub(super) path: String,
    pub(super) text: String,
}

/// What a name names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Room,
    Place,
    Object,
    Person,
    Other,
}

/// Every name of the file, in the order of reading.
pub(super) struct Names<'a> {
    text: &'a str,
    taken: Vec<(String, Kind, Range<usize>)>,
    /// Those of the file that this one belongs to.
    elsewhere: Vec<(String, Kind)>,
    any_object: bool,
}

impl<'a> Names<'a> {
    /// No names yet of the file with this text.
    pub(super) fn new(text: &'a str) -> Self {
        Self {
            text,
            taken: Vec::new(),
            elsewhere: Vec::new(),
            any_object: false,
        }
    }

    /// Takes the names of the file that this one belongs to.
    pub(super) fn take_elsewhere<'n>(&mut self, names: impl Iterator<Item = (&'n String, Kind)>) {
        self.elsewhere
            .extend(names.map(|(name, kind)| (name.clone(), kind)));
    }

    /// From now on every name may be an object's.
    pub(super) fn accept_objects(&mut self) {
        self.any_object = true;
    }

    /// The name of the table, noted as taken. A bad one is noted and taken all the same, so that what
    /// refers to it is not also reported.
    pub(super) fn take(&mut self, table: &Table<'_>, kind: Kind) -> Option<String> {
        let name = table.require::<String>("name")?;
        let value = name.value;
        let mut letters = value.chars();
        let good = letters.next().is_some_and(|c| c.is_ascii_alphabetic())
            && letters.all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !good {
            table.problems.add(
                ProblemKind::BadName {
                    name: value.clone(),
                },
                name.span.clone(),
            );
        }
        if let Some((_, _, first)) = self.taken.iter().find(|(taken, ..)| *taken == value) {
            let line = self.text[..first.start].matches('\n').count() + 1;
            let kind = ProblemKind::DuplicateName {
                name: value.clone(),
                line,
            };
            table.problems.add(kind, name.span.clone());
        }
        if self.elsewhere.iter().any(|(taken, _)| *taken == value) {
            let message = "the scenario's main file has something of this name already";
            table
                .problems
                .add(ProblemKind::BadEntry { message }, name.span.clone());
        }
        self.taken.push((value.clone(), kind, name.span));
        Some(value)
    }

    /// All that were taken here, and where.
    pub(super) fn all(&self) -> impl Iterator<Item = Located<String>> {
        self.taken.iter().map(|(name, _, span)| Located {
            value: name.clone(),
            span: span.clone(),
        })
    }

    /// The name of the table where it gives one, else `default`; noted as taken.
    pub(super) fn take_or(&mut self, table: &Table<'_>, default: &str) -> String {
        if table.has("name") {
            return self.take(table, Kind::Other).unwrap_or_default();
        }
        table.allow("name");
        self.taken
            .push((default.to_owned(), Kind::Other, table.span.clone()));
        default.to_owned()
    }

    /// Whether something of this kind has this name.
    pub(super) fn is(&self, name: &str, kind: Kind) -> bool {
        let here = self.taken.iter().map(|(taken, of, _)| (taken, of));
        let elsewhere = self.elsewhere.iter().map(|(taken, of)| (taken, of));
        self.any_object && kind == Kind::Object
            || here
                .chain(elsewhere)
                .any(|(taken, of)| taken == name && *of == kind)
    }

    /// Notes that there is no `what` called so.
    pub(super) fn unknown(
        &self,
        problems: &Problems,
        what: &'static str,
        kinds: &[Kind],
        name: &Located<String>,
    ) {
        let here = self.taken.iter().map(|(name, kind, _)| (name, kind));
        let elsewhere = self.elsewhere.iter().map(|(name, kind)| (name, kind));
        let known = here
            .chain(elsewhere)
            .filter(|(_, kind)| kinds.contains(kind));
        let help = suggest(&name.value, known.map(|(name, _)| name.as_str()));
        let kind = ProblemKind::UnknownName {
            kind: what,
            name: name.value.clone(),
            help,
        };
        problems.add(kind, name.span.clone());
    }
}

/// A civil time as if it were UTC.
pub(super) fn time(moment: DateTime) -> Option<Time> {
    let zoned = moment.to_zoned(TimeZone::UTC).ok()?;
    i64::try_from(zoned.timestamp().as_nanosecond())
        .ok()
        .map(Time::from_nanoseconds)
}

/// A clock time of the scenario's day.
pub(super) fn time_of_day(day: Date, clock: ClockTime) -> Option<Time> {
    time(day.to_datetime(clock))
}

/// A pose written [x, y, heading].
pub(super) fn pose(table: &Table<'_>) -> Isometry2<f64> {
    let [x, y, heading] = table.require("pose").map_or([0.0; 3], |pose| pose.value);
    Isometry2::new(Vector2::new(x, y), heading)
}

/// A point written [x, y].
pub(super) fn point(table: &Table<'_>, key: &'static str) -> Point2<f64> {
    let [x, y] = table.require(key).map_or([0.0; 2], |point| point.value);
    Point2::new(x, y)
}

/// The civil time that a time is, as if it were UTC.
pub(super) fn moment(time: Time) -> DateTime {
    let moment = Timestamp::from_nanosecond(time.nanoseconds().into()).unwrap_or_default();
    moment.to_zoned(TimeZone::UTC).datetime()
}

/// The text as TOML; all that is wrong with its syntax otherwise.
pub(super) fn document(text: &str) -> Result<Spanned<DeTable<'_>>, Vec<Problem>> {
    let (document, errors) = DeTable::parse_recoverable(text);
    if errors.is_empty() {
        return Ok(document);
    }
    let syntax = |error: &toml::de::Error| {
        let message = error.message().to_owned();
        Problem::new(
            ProblemKind::Syntax { message },
            error.span().unwrap_or(0..0),
        )
    };
    Err(errors.iter().map(syntax).collect())
}

/// Reads the main file. The schedule's own file, where there is one, is for [`schedule::extend`].
pub(super) fn scenario(
    text: &str,
    read: Read<'_>,
) -> Result<(Scenario, Option<Beside>), Vec<Problem>> {
    let document = document(text)?;
    let problems = Problems::default();
    let title = "the scenario".to_owned();
    let table = Table::new(document.get_ref(), 0..0, title, &problems);
    let scenario = whole(&table, text, read);
    let schedule = table.has("schedule").then(|| Beside {
        text: file(&table, "schedule", "", read),
        path: table
            .get::<String>("schedule")
            .map_or_else(String::new, |path| path.value),
    });
    table.close();
    let problems = problems.into_vec();
    if problems.is_empty() {
        Ok((scenario, schedule))
    } else {
        Err(problems)
    }
}

/// Reads every table. Where a value is wrong a stand-in takes its place, so that the rest is still
/// checked; the result then never leaves [`scenario`].
fn whole(table: &Table<'_>, text: &str, read: Read<'_>) -> Scenario {
    let mut names = Names::new(text);
    if !table.has("start") {
        table.missing("start");
    }
    let begin = table.moment::<DateTime>("start").unwrap_or_default();
    let start = time(begin).unwrap_or_default();
    let name = table
        .require::<String>("name")
        .map_or_else(String::new, |name| name.value);
    let duration = table.required_number("duration", Bound::Positive);
    let rooms = space::rooms(table, &mut names);
    let doors = space::doors(table, &names, &rooms);
    let walls = space::walls(table, &rooms, &doors, read);
    let bounds = space::bounds(table, &rooms);
    let places = space::places(table, &mut names, &rooms);
    let objects = space::objects(table, &mut names, &rooms);
    let cameras = devices::cameras(table, &mut names);
    let robot = devices::robot(table, &mut names);
    let body = (robot.pose.translation.vector.into(), robot.radius);
    let span = table.span_of("robot");
    space::check_body(
        table,
        &rooms,
        &walls,
        objects.iter(),
        body,
        "the robot",
        span,
    );
    let scene = people::Scene {
        day: begin.date(),
        rooms: &rooms,
        walls: &walls,
        places: &places,
        objects: &objects,
    };
    let people = people::people(table, &mut names, &scene);
    let streams = people::streams(table, &mut names, &rooms);
    let activities = schedule::activities(table, &mut names, begin.date());
    let missions = missions::missions(table, &mut names, begin, &[], read);
    let rules = file(table, "rules", "rules.aggl", read);
    let tracks = tracks(table);
    let social = social(table, Some(bounds));
    check_names(table, &names);
    check_classes(table);
    let human_observer = human_observer(table);
    Scenario {
        name,
        folder: PathBuf::new(),
        start,
        duration,
        bounds,
        rooms,
        doors,
        walls,
        places,
        objects,
        cameras,
        robot,
        people,
        streams,
        activities,
        missions,
        rules,
        tracks,
        social,
        human_observer,
    }
}

/// The text of a file that the key (or else the default) names.
pub(super) fn file(table: &Table<'_>, key: &'static str, default: &str, read: Read<'_>) -> String {
    let path = table
        .get::<String>(key)
        .map_or_else(|| default.to_owned(), |path| path.value);
    let text =
        read(&path).and_then(|bytes| String::from_utf8(bytes).map_err(std::io::Error::other));
    text.unwrap_or_else(|error| {
        let kind = ProblemKind::UnreadableFile {
            path,
            reason: error.to_string(),
        };
        table.problems.add(kind, table.span_of(key));
        String::new()
    })
}

fn tracks(scenario: &Table<'_>) -> TracksFrame {
    let Some(table) = scenario.table("tracks") else {
        return TracksFrame::default();
    };
    let tracks = TracksFrame {
        translation: table
            .get::<[f64; 2]>("translation")
            .map(|at| at.value.into()),
        rotation: table.number("rotation", Bound::Any, 0.0),
        offset: table.number("offset", Bound::NotNegative, 0.0),
    };
    table.close();
    tracks
}

/// The figures of social mapping by themselves: a file with the table `[social]` alone. Rooms and objects that it names are
/// those of `scenario`; without one there are none, and mapping reports what is without effect.
///
/// # Errors
/// Every problem found, each with its line and column.
pub fn parse_social(
    file: &str,
    text: &str,
    scenario: Option<&Scenario>,
) -> Result<SocialConfig, Box<Invalid>> {
    let read = || {
        let document = document(text)?;
        let problems = Problems::default();
        let title = "the settings".to_owned();
        let table = Table::new(document.get_ref(), 0..0, title, &problems);
        let config = social(&table, scenario.map(|scenario| scenario.bounds));
        check_classes(&table);
        if let Some(scenario) = scenario {
            let mut names = Names::new(text);
            let rooms = scenario.rooms.iter().map(|one| (&one.name, Kind::Room));
            let objects = scenario.objects.iter().map(|one| (&one.name, Kind::Object));
            names.take_elsewhere(rooms.chain(objects));
            check_names(&table, &names);
        }
        table.close();
        let problems = problems.into_vec();
        if problems.is_empty() {
            Ok(config)
        } else {
            Err(problems)
        }
    };
    read().map_err(|problems| Box::new(Invalid::new(file, text, problems)))
}

/// The figures of the human observer; those not given have their defaults.
fn human_observer(scenario: &Table<'_>) -> human_observer::Config {
    let config: human_observer::Config = scenario.deserialize("human_observer").unwrap_or_default();
    if let Some(problem) = config.problem() {
        let message = problem.to_owned();
        let span = scenario.span_of("human_observer");
        scenario.problems.add(ProblemKind::Figure { message }, span);
    }
    config
}

/// The figures of social mapping, for a world of these bounds; those not given have their defaults.
fn social(scenario: &Table<'_>, bounds: Option<[f64; 4]>) -> SocialConfig {
    let config: SocialConfig = scenario.deserialize("social").unwrap_or_default();
    let problems = config.problems();
    if problems.is_empty()
        && let Some(Err(error)) = bounds.map(|bounds| check_size(bounds, config.resolution))
    {
        let message = error.to_string();
        let given = ["bounds", "social.resolution"];
        let place = given[usize::from(!scenario.has("bounds"))];
        let kind = ProblemKind::Figure { message };
        scenario.problems.add(kind, scenario.span_of(place));
    }
    for problem in problems {
        let message = format!("{} {}", problem.field, problem.requirement);
        let kind = ProblemKind::Figure { message };
        let place = scenario.span_of(&format!("social.{}", problem.field));
        scenario.problems.add(kind, place);
    }
    config
}

/// Notes the names in `[social]` that nothing of the scenario has.
fn check_names(scenario: &Table<'_>, names: &Names<'_>) {
    let named = [
        ("usage_of", "object", Kind::Object),
        ("activity_in", "room", Kind::Room),
    ];
    for (key, what, kind) in named {
        for name in scenario.keys_of("social", key) {
            if !names.is(&name.value, kind) {
                names.unknown(scenario.problems, what, &[kind], &name);
            }
        }
    }
}

/// Notes the classes of objects in `[social]` that there are not.
fn check_classes(scenario: &Table<'_>) {
    for class in scenario.keys_of("social", "spaces") {
        space::check_class(scenario.problems, &class);
    }
}
