//! Recorded pedestrians. Reads `obsmat.txt` (frame, id, x, z, y, vx, vz, vy) and plain text (frame,
//! id, x, y), one observation a line, metres and metres a second; `#` begins a comment.
//!
//! Between observations people move on a cubic Hermite curve through them, so that position and
//! velocity are continuous.

#[cfg(test)]
mod tests;

use crate::scenario::{Invalid, Problem, ProblemKind, TracksFrame};
use crate::world::{Body, wrap};
use nalgebra::{Point2, Rotation2, Vector2};
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

    /// The same people in a world with these bounds.
    pub(crate) fn placed(mut self, frame: &TracksFrame, bounds: [f64; 4]) -> Self {
        let turn = Rotation2::new(frame.rotation);
        let mut least = Vector2::repeat(f64::INFINITY);
        let mut most = Vector2::repeat(f64::NEG_INFINITY);
        for sample in self.people.iter_mut().flat_map(|track| &mut track.samples) {
            sample.position = turn * sample.position;
            sample.velocity = turn * sample.velocity;
            sample.heading = wrap(sample.heading + frame.rotation);
            least = least.inf(&sample.position.coords);
            most = most.sup(&sample.position.coords);
        }
        let [left, bottom, right, top] = bounds;
        let middle = Vector2::new(left + right, bottom + top) / 2.0;
        let translation = frame.translation.unwrap_or(middle - (least + most) / 2.0);
        for sample in self.people.iter_mut().flat_map(|track| &mut track.samples) {
            sample.position += translation;
        }
        self.offset += frame.offset;
        self
    }

    /// xmin, ymin, xmax, ymax of everywhere that somebody was observed.
    pub fn extent(&self) -> [f64; 4] {
        let samples = self.people.iter().flat_map(|track| &track.samples);
        let none = [
            f64::INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NEG_INFINITY,
        ];
        samples.fold(none, |[left, bottom, right, top], sample| {
            let at = sample.position;
            [
                left.min(at.x),
                bottom.min(at.y),
                right.max(at.x),
                top.max(at.y),
            ]
        })
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
