//! The robot and the cameras of the main file. What is not given has a stated default.

use super::file::{Kind, Names, pose};
use super::reader::{Bound, Table};
use super::{Base, Camera, Laser, Localisation, ProblemKind, Robot};
use agents::names::suggest;

pub(super) fn cameras(scenario: &Table<'_>, names: &mut Names<'_>) -> Vec<Camera> {
    let mut cameras = Vec::new();
    for table in scenario.tables("camera") {
        cameras.push(Camera {
            name: names.take(&table, Kind::Other).unwrap_or_default(),
            pose: pose(&table),
            field_of_view: table.required_number("field_of_view", Bound::FullTurn),
            range: table.required_number("range", Bound::Positive),
            rate: table.number("rate", Bound::Positive, 10.0),
            position_noise: table.number("position_noise", Bound::NotNegative, 0.05),
            heading_noise: table.number("heading_noise", Bound::NotNegative, 0.1),
            miss_rate: table.number("miss_rate", Bound::Probability, 0.05),
            false_rate: table.number("false_rate", Bound::NotNegative, 0.0),
            delay: table.number("delay", Bound::NotNegative, 0.0),
            delay_jitter: table.number("delay_jitter", Bound::NotNegative, 0.0),
        });
        table.close();
    }
    cameras
}

fn base(table: &Table<'_>) -> Base {
    let Some(name) = table.get::<String>("base") else {
        return Base::default();
    };
    Base::find(&name.value).unwrap_or_else(|| {
        let help = suggest(&name.value, Base::ALL.map(Base::name));
        let kind = ProblemKind::UnknownName {
            kind: "base",
            name: name.value,
            help,
        };
        table.problems.add(kind, name.span);
        Base::default()
    })
}

pub(super) fn robot(scenario: &Table<'_>, names: &mut Names<'_>) -> Robot {
    let Some(table) = scenario.table("robot") else {
        if !scenario.has("robot") {
            scenario.missing("robot");
        }
        return Robot::default();
    };
    let name = names.take_or(&table, "robot");
    let default = Robot::default();
    let laser = table.table("laser").map_or(default.laser.clone(), |laser| {
        let beams = laser.number("beams", Bound::Positive, default.laser.beams as f64);
        let read = Laser {
            beams: beams.clamp(1.0, 10_000.0) as usize,
            range: laser.number("range", Bound::Positive, default.laser.range),
            noise: laser.number("noise", Bound::NotNegative, default.laser.noise),
            dropout_rate: laser.number(
                "dropout_rate",
                Bound::Probability,
                default.laser.dropout_rate,
            ),
            rate: laser.number("rate", Bound::Positive, default.laser.rate),
        };
        laser.close();
        read
    });
    let standard = &default.localisation;
    let localisation = table
        .table("localisation")
        .map_or(standard.clone(), |error| {
            let read = Localisation {
                position_noise: error.number(
                    "position_noise",
                    Bound::NotNegative,
                    standard.position_noise,
                ),
                heading_noise: error.number(
                    "heading_noise",
                    Bound::NotNegative,
                    standard.heading_noise,
                ),
                correlation_time: error.number(
                    "correlation_time",
                    Bound::Positive,
                    standard.correlation_time,
                ),
                rate: error.number("rate", Bound::Positive, standard.rate),
            };
            error.close();
            read
        });
    let robot = Robot {
        name,
        pose: pose(&table),
        radius: table.number("radius", Bound::Positive, default.radius),
        base: base(&table),
        max_speed: table.number("max_speed", Bound::Positive, default.max_speed),
        max_turn: table.number("max_turn", Bound::Positive, default.max_turn),
        max_acceleration: table.number(
            "max_acceleration",
            Bound::Positive,
            default.max_acceleration,
        ),
        max_turn_acceleration: table.number(
            "max_turn_acceleration",
            Bound::Positive,
            default.max_turn_acceleration,
        ),
        laser,
        localisation,
    };
    table.close();
    robot
}
