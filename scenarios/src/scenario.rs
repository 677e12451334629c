//! What a scenario says, checked. Whoever holds a [`Scenario`] may rely on it: names are unique,
//! references resolve, numbers are finite and in range, walls have their door gaps.
//!
//! SI units and radians throughout, headings counter-clockwise from +x, all in the world frame.

mod devices;
mod diagnostic;
mod file;
mod geometry;
mod load;
mod missions;
mod occupancy;
mod people;
mod reader;
mod schedule;
mod space;
#[cfg(test)]
mod tests;
mod value;

pub use diagnostic::{Invalid, LoadError, Problem, ProblemKind};
pub use file::parse_social;
pub use load::MAIN_FILE;
pub use missions::{Earlier, MissionFile, Present};
pub use occupancy::MapError;
pub use schedule::parse_schedule;
#[cfg(test)]
pub(crate) use space::CLASSES;

use agents::human_observer;
pub use agents::navigation::control::Base;
use agents::navigation::control::Limits;
use agents::social_mapping::SocialConfig;
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};
use std::path::PathBuf;

/// A straight wall without thickness, from one end to the other.
pub type Wall = [Point2<f64>; 2];

/// A world, who is in it, and what the robot shall do there.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// The scenario's name, as the reports print it.
    pub name: String,
    /// The folder it was read from.
    pub folder: PathBuf,
    /// When the simulated time starts: the local civil time of the file, counted as if it were UTC,
    /// so that a run does not depend on where it runs.
    pub start: Time,
    /// The run ends unsuccessfully after this many simulated seconds.
    pub duration: f64,
    /// xmin, ymin, xmax, ymax of all that matters.
    pub bounds: [f64; 4],
    /// The rooms, which together cover where the robot may be.
    pub rooms: Vec<Room>,
    /// The passages between rooms.
    pub doors: Vec<Door>,
    /// Outlines of rooms less the doors, the walls given one by one, and those around what the map shows.
    pub walls: Vec<Wall>,
    /// Named poses to go to.
    pub places: Vec<Place>,
    /// Furniture and other things of the simulated world.
    pub objects: Vec<Object>,
    /// The camera network.
    pub cameras: Vec<Camera>,
    /// The robot and its sensors.
    pub robot: Robot,
    /// People with a schedule.
    pub people: Vec<Person>,
    /// Crowds that cross the world.
    pub streams: Vec<Stream>,
    /// When which object is used.
    pub activities: Vec<Activity>,
    /// What the robot shall do, in this order where priorities are equal.
    pub missions: Vec<Mission>,
    /// Text of the scenario's grammar, `rules.aggl`.
    pub rules: String,
    /// How recorded pedestrians map into this world.
    pub tracks: TracksFrame,
    /// The figures of social mapping.
    pub social: SocialConfig,
    /// The figures of the human observer.
    pub human_observer: human_observer::Config,
}

/// A room.
#[derive(Debug, Clone, PartialEq)]
pub struct Room {
    /// Unique among everything named in the scenario.
    pub name: String,
    /// Corners in order, either way round; at least three, not crossing itself.
    pub polygon: Vec<Point2<f64>>,
    /// Whether the outline is a wall (but for the doors).
    pub walled: bool,
}

/// What the unknown cells of an occupancy map are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Unknown {
    /// As solid as what is occupied.
    #[default]
    Blocked,
    /// As free as what is known to be.
    Free,
}

/// A passage between two rooms.
#[derive(Debug, Clone, PartialEq)]
pub struct Door {
    /// Index of the rooms in [`Scenario::rooms`].
    pub rooms: [usize; 2],
    /// Its middle, on the outline of both rooms.
    pub position: Point2<f64>,
    /// Unit vector along the wall that it is in.
    pub along: Vector2<f64>,
    /// Clear width.
    pub width: f64,
}

/// A named pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// Unique name.
    pub name: String,
    /// Where it is, and where to look when there.
    pub pose: Isometry2<f64>,
}

/// The outline of a thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// `size` along its own x and y.
    Rectangle,
    /// The diameter is the size's x.
    Circle,
}

/// A thing that stands in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// Unique name.
    pub name: String,
    /// Type name in the schema, such as `table`.
    pub class: String,
    /// Its centre; its front looks along +x of its own frame.
    pub pose: Isometry2<f64>,
    /// Its outline.
    pub shape: Shape,
    /// Extent along its own x and y.
    pub size: Vector2<f64>,
    /// Whether a detector can read its name off a marker.
    pub marker: bool,
}

/// A camera of the network.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Unique name.
    pub name: String,
    /// Where it hangs; it looks along +x of its own frame.
    pub pose: Isometry2<f64>,
    /// Full horizontal opening angle, in (0, 2 pi].
    pub field_of_view: f64,
    /// How far it sees.
    pub range: f64,
    /// Images per second.
    pub rate: f64,
    /// Standard deviation of a position along each axis, m.
    pub position_noise: f64,
    /// Standard deviation of a heading, rad.
    pub heading_noise: f64,
    /// Probability that something in view is not found.
    pub miss_rate: f64,
    /// People found per second who are not there.
    pub false_rate: f64,
    /// From the taking of an image to the arrival of what was found in it, at least, s.
    pub delay: f64,
    /// It takes up to this much longer, evenly distributed, s.
    pub delay_jitter: f64,
}

/// The robot's body, drive and sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// Unique name.
    pub name: String,
    /// Where it starts.
    pub pose: Isometry2<f64>,
    /// Radius of its footprint.
    pub radius: f64,
    /// Which ways its base goes.
    pub base: Base,
    /// m/s, whichever way.
    pub max_speed: f64,
    /// rad/s.
    pub max_turn: f64,
    /// m/s^2, speeding up and braking.
    pub max_acceleration: f64,
    /// rad/s^2.
    pub max_turn_acceleration: f64,
    /// Its laser.
    pub laser: Laser,
    /// How well it knows where it is.
    pub localisation: Localisation,
}

/// A laser that turns once round.
#[derive(Debug, Clone, PartialEq)]
pub struct Laser {
    /// Beams per turn.
    pub beams: usize,
    /// Beams that meet nothing read this, m.
    pub range: f64,
    /// Standard deviation of a range, m.
    pub noise: f64,
    /// Probability that a beam reads as if it met nothing.
    pub dropout_rate: f64,
    /// Turns per second.
    pub rate: f64,
}

/// The error of wheel odometry corrected by the map: an Ornstein-Uhlenbeck process, cut at three
/// standard deviations.
#[derive(Debug, Clone, PartialEq)]
pub struct Localisation {
    /// Standard deviation of the position along each axis, m.
    pub position_noise: f64,
    /// Standard deviation of the heading, rad.
    pub heading_noise: f64,
    /// Time after which the error has forgotten itself to 1/e, s.
    pub correlation_time: f64,
    /// Measurements per second.
    pub rate: f64,
}

/// A person with a schedule.
#[derive(Debug, Clone, PartialEq)]
pub struct Person {
    /// Unique name.
    pub name: String,
    /// Where the person is at the start, and faces.
    pub pose: Isometry2<f64>,
    /// Walking speed, m/s.
    pub speed: f64,
    /// Radius of the body.
    pub radius: f64,
    /// What the person does, one entry after the other.
    pub schedule: Vec<Entry>,
    /// Whether the schedule begins again when it is through.
    pub repeat: bool,
}

/// One entry of a schedule: wait, go, face, leave; each only where given, in this order.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// When it begins.
    pub begin: Begin,
    /// Where to walk.
    pub go: Option<Point2<f64>>,
    /// Where to look once there.
    pub face: Option<Face>,
    /// Whether the person then leaves the world.
    pub leave: bool,
}

/// When an entry of a schedule begins; never before the one before it is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Begin {
    /// At this time.
    At(Time),
    /// This many seconds after the entry before it was done, or after the start.
    After(f64),
}

/// Where to look.
#[derive(Debug, Clone, PartialEq)]
pub enum Face {
    /// In this direction.
    Heading(f64),
    /// Towards this point.
    Point(Point2<f64>),
    /// Towards this person (an index in [`Scenario::people`]), wherever they are.
    Person(usize),
}

/// A crowd: `people` at a time walk from a line about `from` to a line about `to`; who arrives
/// leaves the world, and somebody new enters.
#[derive(Debug, Clone, PartialEq)]
pub struct Stream {
    /// Unique name; its people are called `NAME_1`, `NAME_2` ...
    pub name: String,
    /// Middle of where they enter.
    pub from: Point2<f64>,
    /// Middle of where they leave.
    pub to: Point2<f64>,
    /// Across the way, they spread over this width.
    pub width: f64,
    /// How many are under way at a time.
    pub people: usize,
    /// Slowest and fastest walking speed, m/s.
    pub speed: [f64; 2],
    /// Radius of a body.
    pub radius: f64,
}

/// A time during which an object is used.
#[derive(Debug, Clone, PartialEq)]
pub struct Activity {
    /// Unique name.
    pub name: String,
    /// Name of the object used.
    pub object: String,
    /// When it begins.
    pub start: Time,
    /// When it ends; later than `start`.
    pub end: Time,
    /// Whether it does not take place after all.
    pub cancelled: bool,
}

/// Something the robot shall do.
#[derive(Debug, Clone, PartialEq)]
pub struct Mission {
    /// Unique name.
    pub name: String,
    /// File of the goal, relative to the scenario's folder.
    pub file: String,
    /// Text of that file, in AGGL.
    pub goal: String,
    /// The larger, the sooner.
    pub priority: i64,
    /// It fails where its goal does not hold by then, seconds after the start.
    pub deadline: Option<f64>,
    /// When it gives way to one of higher priority: `at_once`, `between_steps` or `never`.
    pub preemption: String,
    /// It does not begin before this.
    pub begins: Option<Time>,
    /// It begins again so many seconds after it began, again and again.
    pub period: Option<f64>,
    /// It fails where its goal does not hold so many seconds after it began.
    pub within: Option<f64>,
    /// It does not begin before this mission has succeeded.
    pub after: Option<String>,
}

/// How recorded pedestrians map into the world, and where to begin.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TracksFrame {
    /// Where the recording's origin is in the world; where not given, the middle of all that was
    /// recorded comes to the middle of the bounds.
    pub translation: Option<Vector2<f64>>,
    /// Angle of the recording's x axis in the world.
    pub rotation: f64,
    /// Seconds of the recording that are skipped.
    pub offset: f64,
}

impl Robot {
    /// What its base can do.
    pub fn limits(&self) -> Limits {
        Limits {
            base: self.base,
            radius: self.radius,
            max_speed: self.max_speed,
            max_turn: self.max_turn,
            acceleration: self.max_acceleration,
            turn_acceleration: self.max_turn_acceleration,
        }
    }
}

impl Default for Robot {
    /// A small differential robot at the origin.
    fn default() -> Self {
        Self {
            name: "robot".to_owned(),
            pose: Isometry2::identity(),
            radius: 0.25,
            base: Base::Differential,
            max_speed: 0.7,
            max_turn: 1.2,
            max_acceleration: 0.8,
            max_turn_acceleration: 2.5,
            laser: Laser {
                beams: 360,
                range: 10.0,
                noise: 0.01,
                dropout_rate: 0.0,
                rate: 10.0,
            },
            localisation: Localisation {
                position_noise: 0.015,
                heading_noise: 0.5_f64.to_radians(),
                correlation_time: 5.0,
                rate: 10.0,
            },
        }
    }
}

impl Scenario {
    /// The room that `point` lies in, or on the outline of; of several the first of the file.
    pub fn find_room(&self, point: Point2<f64>) -> Option<&Room> {
        self.rooms.iter().find(|room| room.contains(point))
    }

    /// The object called `name`.
    pub fn find_object(&self, name: &str) -> Option<&Object> {
        self.objects.iter().find(|object| object.name == name)
    }
}

impl Object {
    /// Distance from `point` (world frame) to the outline; 0 inside.
    pub fn distance(&self, point: Point2<f64>) -> f64 {
        let local = self.pose.inverse_transform_point(&point);
        match self.shape {
            Shape::Circle => (local.coords.norm() - self.size.x / 2.0).max(0.0),
            Shape::Rectangle => {
                let outside = local.coords.abs() - self.size / 2.0;
                outside.map(|side| side.max(0.0)).norm()
            }
        }
    }

    /// The corners of a rectangle, counter-clockwise from the rear right, world frame; none for a
    /// circle.
    pub fn corners(&self) -> Option<[Point2<f64>; 4]> {
        let half = self.size / 2.0;
        (self.shape == Shape::Rectangle).then(|| {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(x, y)| self.pose * Point2::new(x * half.x, y * half.y))
        })
    }
}

impl Room {
    /// Whether `point` lies in the room or on its outline.
    pub fn contains(&self, point: Point2<f64>) -> bool {
        geometry::contains(&self.polygon, point)
    }

    /// The centre of the room's area.
    pub fn centroid(&self) -> Point2<f64> {
        geometry::centroid(&self.polygon)
    }
}
