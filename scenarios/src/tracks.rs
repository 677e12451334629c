//! Recorded pedestrians. Reads `obsmat.txt` (frame, id, x, z, y, vx, vz, vy) and plain text (frame,
//! id, x, y), one observation a line, metres and metres a second; `#` begins a comment.
//!
//! Between observations people move on a cubic Hermite curve through them, so that position and
//! velocity are continuous.

use crate::scenario::{Invalid, Problem, ProblemKind, TracksFrame};
use crate::world::{Body, wrap};
use nalgebra::{Isometry2, Point2, Vector2};
use std::collections::BTreeMap;
use std::path::Path;

/// Frames a second where the file does not tell: that of the UCY and ETH recordings.
pub const DEFAULT_RATE: f64 = 25.0;
/// Somebody not observed for longer than this has left and come back, s.
const LONGEST_GAP: f64 = 2.5;
/// Slower than this, m/s, the velocity does not say where somebody faces.
const STANDING: f64 = 0.15;
/// The radius of a recorded body, m.
const BODY_RADIUS: f64 = 0.2;

/// People recorded somewhere, in the frame and on the clock of the recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracks {
    /// Frames a second that the times were made with.
    pub rate: f64,
    people: Vec<Track>,
    /// Seconds of the recording before the run begins.
    offset: f64,
}

/// One person, uninterrupted.
#[derive(Debug, Clone, PartialEq)]
struct Track {
    name: String,
    samples: Vec<Sample>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Sample {
    time: f64,
    position: Point2<f64>,
    velocity: Vector2<f64>,
    heading: f64,
}

/// One line of a file.
struct Observation {
    frame: f64,
    id: i64,
    position: Point2<f64>,
    velocity: Option<Vector2<f64>>,
}

/// Why a recording could not be loaded.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum TracksError {
    /// The file could not be read.
    #[error("cannot read {}", path.display())]
    Unreadable {
        /// The file.
        path: std::path::PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Some of its lines are wrong.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Invalid(#[from] Box<Invalid>),
}

impl Tracks {
    /// Reads a recording from a file.
    ///
    /// # Errors
    /// [`TracksError::Unreadable`], or [`TracksError::Invalid`] with every broken line.
    pub fn load(path: &Path) -> Result<Self, TracksError> {
        let text = std::fs::read_to_string(path).map_err(|source| TracksError::Unreadable {
            path: path.to_path_buf(),
            source,
        })?;
        Ok(Self::parse(&path.display().to_string(), &text)?)
    }

    /// Reads a recording from `text`; `file` is how diagnostics call it.
    ///
    /// Neither format says how long a frame takes. Where lines carry velocities, the rate is the
    /// median of frames x speed / distance over all steps, rounded to a whole number; else it is
    /// [`DEFAULT_RATE`].
    ///
    /// # Errors
    /// Every broken line, with its number.
    pub fn parse(file: &str, text: &str) -> Result<Self, Box<Invalid>> {
        let mut problems = Vec::new();
        let mut people: BTreeMap<i64, Vec<Observation>> = BTreeMap::new();
        let mut start = 0;
        for line in text.split_inclusive('\n') {
            match observation(line) {
                Ok(None) => {}
                Ok(Some(seen)) => people.entry(seen.id).or_default().push(seen),
                Err((message, from, to)) => {
                    let kind = ProblemKind::Syntax { message };
                    problems.push(Problem::new(kind, start + from..start + to));
                }
            }
            start += line.len();
        }
        if problems.is_empty() && people.is_empty() {
            let message = "this recording has no observations".to_owned();
            problems.push(Problem::new(
                ProblemKind::Syntax { message },
                0..text.len().min(1),
            ));
        }
        if !problems.is_empty() {
            return Err(Box::new(Invalid::new(file, text, problems)));
        }
        for track in people.values_mut() {
            track.sort_by(|a, b| a.frame.total_cmp(&b.frame));
            track.dedup_by(|b, a| b.frame <= a.frame);
        }
        let rate = infer_rate(&people).unwrap_or(DEFAULT_RATE);
        let first = people
            .values()
            .map(|track| track[0].frame)
            .fold(f64::INFINITY, f64::min);
        let people = people
            .into_iter()
            .flat_map(|(id, track)| split(id, &track, first, rate));
        Ok(Self {
            rate,
            people: people.collect(),
            offset: 0.0,
        })
    }

    /// The same people in a scenario's world.
    pub(crate) fn placed(mut self, frame: &TracksFrame) -> Self {
        let Isometry2 { rotation, .. } = frame.world_from_recording;
        for sample in self.people.iter_mut().flat_map(|track| &mut track.samples) {
            sample.position = frame.world_from_recording * sample.position;
            sample.velocity = rotation * sample.velocity;
            sample.heading = wrap(sample.heading + rotation.angle());
        }
        self.offset += frame.offset;
        self
    }

    /// When the last person leaves, in seconds after the run begins.
    pub fn duration(&self) -> f64 {
        let ends = self.people.iter().filter_map(|track| track.samples.last());
        ends.map(|sample| sample.time).fold(0.0, f64::max) - self.offset
    }

    /// How many people it shows; somebody who leaves and comes back counts again.
    pub fn len(&self) -> usize {
        self.people.len()
    }

    /// Whether it shows nobody.
    pub fn is_empty(&self) -> bool {
        self.people.is_empty()
    }

    /// Everybody who is there `seconds` after the run begins.
    pub(crate) fn people_at(&self, seconds: f64) -> Vec<Body> {
        let time = seconds + self.offset;
        self.people
            .iter()
            .filter_map(|track| track.at(time))
            .collect()
    }
}

impl Track {
    fn at(&self, time: f64) -> Option<Body> {
        let after = self.samples.partition_point(|sample| sample.time < time);
        let to = self.samples.get(after)?;
        let from = &self.samples[after.saturating_sub(1)];
        if time < from.time {
            return None;
        }
        let step = to.time - from.time;
        // At the first observation both are the same.
        let s = if step > 0.0 {
            (time - from.time) / step
        } else {
            0.0
        };
        let step = step.max(1e-9);
        let (s2, s3) = (s * s, s * s * s);
        let position = from.position.coords * (2.0 * s3 - 3.0 * s2 + 1.0)
            + from.velocity * (s3 - 2.0 * s2 + s) * step
            + to.position.coords * (3.0 * s2 - 2.0 * s3)
            + to.velocity * (s3 - s2) * step;
        let slope = (to.position - from.position) * (6.0 * (s - s2) / step)
            + from.velocity * (3.0 * s2 - 4.0 * s + 1.0)
            + to.velocity * (3.0 * s2 - 2.0 * s);
        Some(Body {
            name: self.name.clone(),
            position: position.into(),
            heading: wrap(from.heading + wrap(to.heading - from.heading) * s),
            velocity: slope,
            radius: BODY_RADIUS,
        })
    }
}

/// What a line says; nothing where it is empty. An error is a message and the bytes it is about.
fn observation(line: &str) -> Result<Option<Observation>, (String, usize, usize)> {
    let content = line.split('#').next().unwrap_or_default();
    let mut numbers = Vec::new();
    for word in content
        .split([' ', '\t', ',', '\r', '\n'])
        .filter(|word| !word.is_empty())
    {
        let from = word.as_ptr() as usize - line.as_ptr() as usize;
        match word.parse::<f64>() {
            Ok(number) if number.is_finite() => numbers.push(number),
            _ => {
                let message = format!("`{word}` is not a finite number");
                return Err((message, from, from + word.len()));
            }
        }
    }
    let whole = |number: f64, what: &str| {
        let good = number.fract() == 0.0 && number.abs() < 1e15;
        let message = || format!("the {what} must be a whole number, this is {number}");
        if good {
            Ok(number)
        } else {
            Err((message(), 0, content.trim_end().len()))
        }
    };
    let (x, y, velocity) = match *numbers.as_slice() {
        [] => return Ok(None),
        [_, _, x, y] => (x, y, None),
        [_, _, x, _, y, vx, _, vy] => (x, y, Some(Vector2::new(vx, vy))),
        _ => {
            let message = format!(
                "this line has {} numbers; `frame id x y` has 4, `frame id x z y vx vz vy` has 8",
                numbers.len()
            );
            return Err((message, 0, content.trim_end().len()));
        }
    };
    Ok(Some(Observation {
        frame: whole(numbers[0], "frame")?,
        id: whole(numbers[1], "id")? as i64,
        position: Point2::new(x, y),
        velocity,
    }))
}

/// Frames a second, from how far people get at the speeds that the file states.
fn infer_rate(people: &BTreeMap<i64, Vec<Observation>>) -> Option<f64> {
    let mut rates: Vec<f64> = people
        .values()
        .flat_map(|track| track.windows(2))
        .filter_map(|pair| {
            let distance = (pair[1].position - pair[0].position).norm();
            let [from, to] = [pair[0].velocity?.norm(), pair[1].velocity?.norm()];
            let speed = f64::midpoint(from, to);
            let frames = pair[1].frame - pair[0].frame;
            (distance > 0.05 && speed > 0.3).then(|| frames * speed / distance)
        })
        .collect();
    rates.sort_by(f64::total_cmp);
    rates.get(rates.len() / 2).map(|rate| rate.round().max(1.0))
}

/// The tracks of one person: one, or more where it was away in between.
fn split(id: i64, seen: &[Observation], first: f64, rate: f64) -> Vec<Track> {
    let longest = LONGEST_GAP * rate;
    let stretches = seen.chunk_by(|a, b| b.frame - a.frame <= longest);
    stretches
        .enumerate()
        .map(|(part, stretch)| {
            let again = if part == 0 {
                String::new()
            } else {
                format!("_{}", part + 1)
            };
            Track {
                name: format!("person_{id}{again}"),
                samples: samples(stretch, first, rate),
            }
        })
        .collect()
}

/// Observations with their time, a velocity by central difference and a heading.
fn samples(stretch: &[Observation], first: f64, rate: f64) -> Vec<Sample> {
    let mut samples: Vec<Sample> = stretch
        .iter()
        .enumerate()
        .map(|(at, seen)| {
            let before = &stretch[at.saturating_sub(1)];
            let after = stretch.get(at + 1).unwrap_or(seen);
            let seconds = (after.frame - before.frame) / rate;
            let moved = after.position - before.position;
            let velocity = if seconds > 0.0 {
                moved / seconds
            } else {
                Vector2::zeros()
            };
            let time = (seen.frame - first) / rate;
            Sample {
                time,
                position: seen.position,
                velocity,
                heading: f64::NAN,
            }
        })
        .collect();
    // Who stands still faces where they last went, or where they will go first.
    let direction = |sample: &Sample| {
        let moves = sample.velocity.norm() > STANDING;
        moves.then(|| sample.velocity.y.atan2(sample.velocity.x))
    };
    let mut heading = samples.iter().find_map(direction).unwrap_or(0.0);
    for sample in &mut samples {
        heading = direction(sample).unwrap_or(heading);
        sample.heading = heading;
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Somebody who walks 1.2 m/s along +y at 15 frames a second, observed every 6th frame.
    fn walking_obsmat() -> String {
        let line = |step: i32| {
            let y = 0.48 * f64::from(step);
            format!("{}.0e+00 7.0 2.5 0.0 {y} 0.0 0.0 1.2", 1 + 6 * step)
        };
        (0..10).map(line).collect::<Vec<_>>().join(
            "
",
        )
    }

    #[test]
    fn the_rate_of_an_obsmat_follows_from_its_velocities() {
        let tracks = Tracks::parse("obsmat.txt", &walking_obsmat()).expect("good lines");
        assert!((tracks.rate - 15.0).abs() < 1e-12);
        let person = &tracks.people_at(1.0)[0];
        assert_eq!(person.name, "person_7");
        assert!(
            (person.position - Point2::new(2.5, 1.2)).norm() < 1e-9,
            "{}",
            person.position
        );
        assert!((person.velocity - Vector2::new(0.0, 1.2)).norm() < 1e-9);
        assert!((person.heading - std::f64::consts::PI / 2.0).abs() < 1e-9);
    }

    #[test]
    fn people_appear_stand_vanish_and_come_back() {
        let text = "# frame id x y\n0 1 0 0\n10 1 0 0\n20 1 1 0\n\n200 1 5 5\n210 1 5 5\n";
        let tracks = Tracks::parse("plain.txt", text).expect("good lines");
        assert_eq!(tracks.len(), 2);
        let names = |seconds| -> Vec<String> {
            tracks
                .people_at(seconds)
                .into_iter()
                .map(|person| person.name)
                .collect()
        };
        assert_eq!(names(0.0), ["person_1"]);
        assert_eq!(names(0.8), ["person_1"]);
        assert!(names(0.9).is_empty() && names(7.9).is_empty());
        assert_eq!(names(8.0), ["person_1_2"]);
        assert!(
            names(9.0).is_empty(),
            "the recording is over and the world goes on"
        );
        assert!((tracks.duration() - 8.4).abs() < 1e-9);
    }

    #[test]
    fn position_and_velocity_are_continuous_and_pass_through_the_observations() {
        let text = "0 1 0 0\n10 1 1 0\n20 1 1.5 0.7\n30 1 1.5 1.5\n";
        let tracks = Tracks::parse("plain.txt", text).expect("good lines");
        let at = |time: f64| tracks.people_at(time).remove(0);
        assert!((at(0.8).position - Point2::new(1.5, 0.7)).norm() < 1e-9);
        let mut time = 0.0;
        while time < 1.19 {
            let (now, next) = (at(time), at(time + 0.001));
            let rate = (next.position - now.position) / 0.001;
            assert!(
                (rate - now.velocity).norm() < 0.05,
                "at {time}: {rate} {}",
                now.velocity
            );
            assert!(
                (next.velocity - now.velocity).norm() < 0.05,
                "a jump at {time}"
            );
            time += 0.001;
        }
    }

    #[test]
    fn a_scenario_turns_moves_and_skips() {
        let tracks = Tracks::parse("obsmat.txt", &walking_obsmat()).expect("good lines");
        let pose = Isometry2::new(Vector2::new(10.0, 0.0), std::f64::consts::PI / 2.0);
        let placed = tracks.placed(&TracksFrame {
            world_from_recording: pose,
            offset: 1.0,
        });
        let person = &placed.people_at(0.0)[0];
        assert!(
            (person.position - Point2::new(8.8, 2.5)).norm() < 1e-9,
            "{}",
            person.position
        );
        assert!((person.velocity - Vector2::new(-1.2, 0.0)).norm() < 1e-9);
        assert!((wrap(person.heading - std::f64::consts::PI)).abs() < 1e-9);
    }

    #[test]
    fn every_broken_line_is_reported_with_its_number() {
        let text = "0 1 0 0\n0 2 oops 0\n1 2 3\n2.5 1 0 0\n3 1 nan 0\n";
        let invalid = Tracks::parse("bad.txt", text).expect_err("four bad lines");
        let lines: Vec<_> = invalid
            .problems
            .iter()
            .map(|p| (p.line, p.column))
            .collect();
        assert_eq!(lines, [(2, 5), (3, 1), (4, 1), (5, 5)]);
        assert!(Tracks::parse("empty.txt", "# nothing\n").is_err());
    }
}
