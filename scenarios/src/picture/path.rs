//! The robot's way: the line, where it ran into something, and when it was where.

use super::Run;
use super::canvas::{View, cross, rectangle, simplified, style};
use super::label::{Labels, Look};
use crate::metrics::{in_order, robot};
use crate::world::Truth;
use nalgebra::{Point2, Vector2};
use svg::node::element::{Group, Polygon};

/// The robot's way, with arrows along it, a dot for every stretch of time and a cross for every
/// collision. Words keep off it.
pub(super) fn path(view: &View, run: Run, labels: &mut Labels) -> Group {
    let samples = in_order(run.samples);
    let way: Vec<_> = samples.iter().map(|sample| robot(sample)).collect();
    let (Some(start), Some(end)) = (way.first(), way.last()) else {
        return Group::new();
    };
    let (colour, dashes) = style(run.social);
    let drawn = simplified(&way);
    for place in beads(&drawn, 8.0 / view.px(1.0)) {
        labels.keep_off(view.page(place), 2.0);
    }
    let line = || view.polyline(drawn.iter().copied());
    let halo = line()
        .set("stroke", "#ffffff")
        .set("stroke-width", "5")
        .set("stroke-opacity", "0.7");
    let stroke = line().set("stroke", colour).set("stroke-width", "2.4");
    let mut group = Group::new()
        .add(halo)
        .add(stroke.set("stroke-dasharray", dashes));
    for (place, direction) in arrows(&way, view.px(1.0)) {
        group = group.add(arrow(view, place, direction).set("fill", colour));
    }
    for stop in stops(&samples) {
        labels.keep_off(view.page(stop.place), 3.0);
        let dot = view.dot(stop.place, 3.2).set("fill", "#ffffff");
        group = group.add(dot.set("stroke", colour).set("stroke-width", "1.5"));
    }
    for (place, fill) in [(start, "#ffffff"), (end, colour)] {
        let place = view.page(*place);
        labels.keep_off(place, 6.0);
        let square = rectangle(place.x - 5.5, place.y - 5.5, 11.0, 11.0).set("fill", fill);
        group = group.add(square.set("stroke", colour).set("stroke-width", "2"));
    }
    for place in collisions(&samples) {
        let place = view.page(place);
        group = group.add(cross(place.x, place.y, 5.0));
    }
    group
}

/// Names the times of the dots, and start and end, where there is room.
pub(super) fn label_times(view: &View, run: Run, with_start: bool, labels: &mut Labels) {
    let samples = in_order(run.samples);
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return;
    };
    let look = |bold| Look {
        size: 10.5,
        colour: style(run.social).0,
        bold,
    };
    if with_start {
        labels.beside(view.page(robot(first)), 6.0, "start", look(true));
    }
    let end = format!("end, {:.0} s", last.time.since(first.time));
    labels.beside(view.page(robot(last)), 6.0, &end, look(true));
    for stop in stops(&samples) {
        labels.beside(view.page(stop.place), 3.0, &stop.name(), look(false));
    }
}

/// Where the robot was when it ran into something.
fn collisions(samples: &[&Truth]) -> impl Iterator<Item = Point2<f64>> {
    samples
        .windows(2)
        .filter(|pair| pair[1].collisions.total() > pair[0].collisions.total())
        .map(|pair| robot(pair[1]))
}

/// Points along a way, at most `apart` metres from one to the next.
fn beads(way: &[Point2<f64>], apart: f64) -> impl Iterator<Item = Point2<f64>> {
    way.windows(2).flat_map(move |pair| {
        let step = pair[1] - pair[0];
        let count = (step.norm() / apart).ceil().max(1.0);
        (0..=count as usize).map(move |i| pair[0] + step * (i as f64 / count))
    })
}

/// Where the robot was at round times; times at one place are one stop.
struct Stop {
    place: Point2<f64>,
    from: f64,
    to: f64,
}

impl Stop {
    fn name(&self) -> String {
        if self.to > self.from {
            format!("{:.0}\u{2013}{:.0} s", self.from, self.to)
        } else {
            format!("{:.0} s", self.from)
        }
    }
}

/// Seconds from dot to dot on the path of a run of `duration`: at most about two dozen.
pub(super) fn dot_interval(duration: f64) -> f64 {
    [10.0, 30.0, 60.0, 300.0, 600.0]
        .into_iter()
        .find(|interval| duration / interval <= 24.0)
        .unwrap_or(3600.0)
}

fn stops(samples: &[&Truth]) -> Vec<Stop> {
    /// Closer places are one stop, m.
    const SAME: f64 = 0.15;
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return Vec::new();
    };
    let interval = dot_interval(last.time.since(first.time));
    let mut stops: Vec<Stop> = Vec::new();
    let mut next = interval;
    for sample in samples {
        let now = sample.time.since(first.time);
        // A dot stands where the robot was at the last round time that passed.
        if now + 1e-9 < next {
            continue;
        }
        let time = interval * ((now + 1e-9) / interval).floor();
        next = time + interval;
        let place = robot(sample);
        match stops.last_mut() {
            Some(stop) if (stop.place - place).norm() < SAME => stop.to = time,
            _ => stops.push(Stop {
                place,
                from: time,
                to: time,
            }),
        }
    }
    stops
}

/// Places and directions of arrows along a way, `scale` px a metre.
fn arrows(way: &[Point2<f64>], scale: f64) -> Vec<(Point2<f64>, Vector2<f64>)> {
    /// From arrow to arrow, px.
    const APART: f64 = 110.0;
    let mut found = Vec::new();
    let mut next = APART / 2.0;
    let mut travelled = 0.0;
    for pair in way.windows(2) {
        let step = pair[1] - pair[0];
        let length = step.norm() * scale;
        if length > 0.0 && travelled + length >= next {
            found.push((
                pair[0] + step * ((next - travelled) / length),
                step.normalize(),
            ));
            next = travelled + length + APART;
        }
        travelled += length;
    }
    found
}

fn arrow(view: &View, place: Point2<f64>, direction: Vector2<f64>) -> Polygon {
    let along = direction * (6.0 / view.px(1.0));
    let across = Vector2::new(-along.y, along.x) * 0.75;
    view.polygon([
        place + along,
        place - along + across,
        place - along * 0.5,
        place - along - across,
    ])
}
