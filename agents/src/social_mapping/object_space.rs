//! The space people need to use an object, and how much it is claimed at a time (TD 4.2 and 5.2.2;
//! READING.md items 9 and 11). This file owns the shapes and R(t); both are closed form, and R(t)
//! stays within its bounds whatever the agenda.

use super::limits::{DURATIONS, MOST_COST, MOST_LENGTH, is_length};
use super::preset::{Named, Preset, named_or_table};
use dsr::Time;
use nalgebra::{Isometry2, Point2, Vector2};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::f64::consts::TAU;

/// Points on the outline of a round space.
const ROUND: usize = 32;

/// What an object covers on the floor, in its own frame (x where it faces, y left, metres).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outline {
    /// This long along x and y.
    Rectangle(Vector2<f64>),
    /// Of this radius.
    Circle(f64),
}

impl Outline {
    /// Whether its lengths are from 0 to [`MOST_LENGTH`].
    pub fn is_valid(&self) -> bool {
        match self {
            Self::Rectangle(size) => is_length(size.x) && is_length(size.y),
            Self::Circle(radius) => is_length(*radius),
        }
    }

    /// The outline grown by `margin` as a polygon in the object's frame: a rectangle keeps its
    /// corners (the authors' shape), a circle becomes a polygon of 32 points on it.
    fn grown(&self, margin: f64) -> Vec<Point2<f64>> {
        match self {
            Self::Rectangle(size) => {
                let (x, y) = (size.x / 2.0 + margin, size.y / 2.0 + margin);
                vec![
                    Point2::new(-x, -y),
                    Point2::new(x, -y),
                    Point2::new(x, y),
                    Point2::new(-x, y),
                ]
            }
            Self::Circle(radius) => (0..ROUND)
                .map(|i| {
                    let (sin, cos) = (TAU * i as f64 / ROUND as f64).sin_cos();
                    Point2::new((radius + margin) * cos, (radius + margin) * sin)
                })
                .collect(),
        }
    }
}

/// The shape of the space in which an object is used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Space {
    /// In front of a thing that is looked at: an isosceles trapezoid that starts at the object.
    Trapezoid {
        /// Along x from the object, metres.
        depth: f64,
        /// Angle between the two legs, radians, less than pi.
        opening: f64,
        /// Width at the object, metres.
        base: f64,
    },
    /// All around a thing that is used at its edge: the outline grown by this many metres.
    Margin(f64),
}

impl Space {
    /// The authors' trapezoid for a TV or a board (READING.md item 11).
    pub const VIEWED: Self = Self::Trapezoid {
        depth: 3.5,
        opening: 1.25,
        base: 2.0,
    };
    /// The authors' margin for a table, a bed or a stretcher, round or not (READING.md item 11).
    pub const USED_AROUND: Self = Self::Margin(0.5);

    /// Whether its lengths are above 0 and at most [`MOST_LENGTH`], and it does not open to the rear.
    pub fn is_valid(&self) -> bool {
        let valid = |length: f64| length > 0.0 && length <= MOST_LENGTH;
        match self {
            Self::Trapezoid {
                depth,
                opening,
                base,
            } => {
                valid(*depth)
                    && valid(*base)
                    && (0.0..std::f64::consts::PI - 0.01).contains(opening)
            }
            Self::Margin(margin) => valid(*margin),
        }
    }

    /// The space as a convex polygon, counter-clockwise, world frame, the first point not repeated.
    pub fn polygon(
        &self,
        outline: &Outline,
        world_from_object: &Isometry2<f64>,
    ) -> Vec<Point2<f64>> {
        let own = match *self {
            Self::Margin(margin) => outline.grown(margin),
            Self::Trapezoid {
                depth,
                opening,
                base,
            } => {
                let near = base / 2.0;
                let far = near + depth * (opening / 2.0).tan();
                vec![
                    Point2::new(0.0, -near),
                    Point2::new(depth, -far),
                    Point2::new(depth, far),
                    Point2::new(0.0, near),
                ]
            }
        };
        own.into_iter()
            .map(|point| world_from_object * point)
            .collect()
    }

    /// From where one looks for walls that cut the space off, world frame: a little in front of a
    /// viewed thing, which hangs on a wall; the middle of one that is used from around.
    pub(super) fn viewpoint(
        &self,
        outline: &Outline,
        world_from_object: &Isometry2<f64>,
    ) -> Point2<f64> {
        /// A detected TV may lie this far behind its wall and still face the right room, metres.
        const PLAY: f64 = 0.1;
        let ahead = match (self, outline) {
            (Self::Margin(_), _) => 0.0,
            (Self::Trapezoid { depth, .. }, Outline::Rectangle(size)) => {
                (size.x / 2.0 + PLAY).min(depth / 2.0)
            }
            (Self::Trapezoid { depth, .. }, Outline::Circle(radius)) => {
                (radius + PLAY).min(depth / 2.0)
            }
        };
        world_from_object * Point2::new(ahead, 0.0)
    }
}

/// An entry of an object's agenda: it is used from `start` to `end`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Agenda {
    start: Time,
    end: Time,
}

/// An activity that does not end after it starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoDuration {
    /// It ends before.
    #[error("it ends at {end}, before it starts at {start}")]
    Backward {
        /// When it starts.
        start: Time,
        /// When it ends.
        end: Time,
    },
    /// It ends at the same time.
    #[error("it ends when it starts, at {at}")]
    Momentary {
        /// When.
        at: Time,
    },
}

impl Agenda {
    /// The entry from `start` to `end`, both included.
    ///
    /// # Errors
    /// [`NoDuration`] where it does not end after it starts.
    pub fn new(start: Time, end: Time) -> Result<Self, NoDuration> {
        match end.cmp(&start) {
            Ordering::Less => Err(NoDuration::Backward { start, end }),
            Ordering::Equal => Err(NoDuration::Momentary { at: start }),
            Ordering::Greater => Ok(Self { start, end }),
        }
    }

    /// Seconds until it starts or since it ended; 0 meanwhile.
    fn gap(&self, now: Time) -> f64 {
        self.start.since(now).max(now.since(self.end)).max(0.0)
    }
}

/// R(t): what crossing an object's space costs as its activities approach and recede (TD Fig. 8). In configuration also
/// the name of a [`Preset`] (READING.md item 9).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct UsageCurve {
    /// With no activity near.
    pub least: f64,
    /// During an activity.
    pub most: f64,
    /// How long before the start it begins to rise, and how long after the end it has fallen,
    /// seconds.
    pub ramp: f64,
    /// Rise and fall in steps instead of linearly.
    pub steps: Option<Steps>,
}

#[derive(Deserialize)]
#[serde(remote = "UsageCurve", default, deny_unknown_fields)]
struct UsageTable {
    least: f64,
    most: f64,
    ramp: f64,
    steps: Option<Steps>,
}

impl Default for UsageTable {
    fn default() -> Self {
        let UsageCurve {
            least,
            most,
            ramp,
            steps,
        } = UsageCurve::default();
        Self {
            least,
            most,
            ramp,
            steps,
        }
    }
}

named_or_table!(UsageCurve, UsageTable);

impl Preset for UsageCurve {
    const WHAT: &'static str = "curves";
    const PRESETS: &'static [Named<Self>] = &[("linear", Self::default), ("steps", Self::stepped)];
}

/// Steps of R(t), instead of a line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Steps {
    /// Height of a step.
    pub rise: f64,
    /// Seconds from one step to the next; the first is where the ramp begins.
    pub every: f64,
}

impl Default for UsageCurve {
    fn default() -> Self {
        Self {
            least: 1.5,
            most: 3.5,
            ramp: 45.0 * 60.0,
            steps: None,
        }
    }
}

impl UsageCurve {
    /// The paper's option: 0.5 every 15 minutes (READING.md item 9).
    pub fn stepped() -> Self {
        Self {
            steps: Some(Steps {
                rise: 0.5,
                every: 15.0 * 60.0,
            }),
            ..Self::default()
        }
    }

    /// Whether it rises from a cost of at least 1 to one of at most [`MOST_COST`], in [`DURATIONS`].
    pub fn is_valid(&self) -> bool {
        let sound = |steps: Steps| {
            steps.rise > 0.0 && steps.rise <= MOST_COST && DURATIONS.contains(&steps.every)
        };
        self.least >= 1.0
            && self.most >= self.least
            && self.most <= MOST_COST
            && DURATIONS.contains(&self.ramp)
            && self.steps.is_none_or(sound)
    }

    /// R(`now`) of an object with this agenda. Where activities overlap or follow closely, the one
    /// that claims the object most decides.
    pub fn usage(&self, now: Time, agenda: &[Agenda]) -> f64 {
        agenda
            .iter()
            .map(|entry| self.after_gap(entry.gap(now)))
            .fold(self.least, f64::max)
    }

    /// R(t) at `gap` seconds from the nearer end of an activity.
    fn after_gap(&self, gap: f64) -> f64 {
        if gap <= 0.0 {
            return self.most;
        }
        if gap > self.ramp {
            return self.least;
        }
        match self.steps {
            None => self.most - (self.most - self.least) * gap / self.ramp,
            Some(Steps { rise, every }) => {
                let taken = ((self.ramp - gap) / every).floor() + 1.0;
                (self.least + rise * taken).min(self.most)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NINE: f64 = 1_800_000_000.0;

    fn at(minutes: f64) -> Time {
        Time::from_seconds(NINE + 60.0 * minutes)
    }

    fn entry(start: f64, end: f64) -> Agenda {
        Agenda::new(at(start), at(end)).unwrap()
    }

    #[test]
    fn usage_rises_for_45_minutes_and_falls_in_mirror_image() {
        let curve = UsageCurve::default();
        let agenda = [entry(60.0, 120.0)];
        let usage = |minutes| curve.usage(at(minutes), &agenda);
        for (minutes, expected) in [
            (0.0, 1.5),
            (15.0, 1.5),
            (37.5, 2.5),
            (60.0, 3.5),
            (90.0, 3.5),
            (120.0, 3.5),
            (142.5, 2.5),
            (165.0, 1.5),
            (1e6, 1.5),
        ] {
            assert!((usage(minutes) - expected).abs() < 1e-9, "at {minutes} min");
        }
        assert!((curve.usage(at(0.0), &[]) - 1.5).abs() < 1e-12);
    }

    #[test]
    fn the_stepped_curve_takes_half_a_unit_every_quarter_of_an_hour() {
        let curve = UsageCurve::stepped();
        let agenda = [entry(60.0, 120.0)];
        let usage = |minutes| curve.usage(at(minutes), &agenda);
        for (minutes, expected) in [
            (14.9, 1.5),
            (15.0, 2.0),
            (29.9, 2.0),
            (30.1, 2.5),
            (59.9, 3.0),
            (60.0, 3.5),
            (120.1, 3.0),
            (149.9, 2.5),
            (150.1, 2.0),
            (164.9, 2.0),
            (165.1, 1.5),
        ] {
            assert!((usage(minutes) - expected).abs() < 1e-9, "at {minutes} min");
        }
    }

    #[test]
    fn overlapping_activities_count_once_and_backward_ones_are_refused() {
        let curve = UsageCurve::default();
        let agenda = [entry(0.0, 30.0), entry(20.0, 60.0), entry(61.0, 70.0)];
        for minutes in [0.0, 25.0, 60.0] {
            assert!((curve.usage(at(minutes), &agenda) - 3.5).abs() < 1e-12);
        }
        let error = Agenda::new(at(10.0), at(9.0)).unwrap_err();
        let (start, end) = (at(10.0), at(9.0));
        assert_eq!(error, NoDuration::Backward { start, end });
        let error = Agenda::new(at(9.0), at(9.0)).unwrap_err();
        assert_eq!(error, NoDuration::Momentary { at: at(9.0) });
    }

    #[test]
    fn the_trapezoid_opens_from_the_object_by_the_full_angle() {
        let tv = Isometry2::new(Vector2::new(1.0, 2.0), 0.0);
        let polygon = Space::VIEWED.polygon(&Outline::Rectangle(Vector2::new(0.1, 1.2)), &tv);
        let far = 1.0 + 3.5 * 0.625f64.tan();
        let expected = [(1.0, 1.0), (4.5, 2.0 - far), (4.5, 2.0 + far), (1.0, 3.0)];
        for (point, (x, y)) in polygon.iter().zip(expected) {
            assert!((point - Point2::new(x, y)).norm() < 1e-12);
        }
    }

    #[test]
    fn margins_follow_the_outline() {
        let pose = Isometry2::new(Vector2::new(1.0, 0.0), std::f64::consts::FRAC_PI_2);
        let table = Outline::Rectangle(Vector2::new(2.0, 1.0));
        let polygon = Space::USED_AROUND.polygon(&table, &pose);
        assert!((polygon[0] - Point2::new(2.0, -1.5)).norm() < 1e-12);
        let round = Space::USED_AROUND.polygon(&Outline::Circle(0.6), &pose);
        assert_eq!(round.len(), ROUND);
        assert!(
            round
                .iter()
                .all(|p| ((p - Point2::new(1.0, 0.0)).norm() - 1.1).abs() < 1e-12)
        );
    }

    proptest! {
        #[test]
        fn usage_is_bounded_and_continuous(
            entries in prop::collection::vec((-200.0..200.0f64, 0.0..120.0f64), 0..5),
            minutes in -300.0..400.0f64,
            stepped in any::<bool>(),
        ) {
            let agenda: Vec<_> = entries.iter().map(|(start, len)| entry(*start, start + len)).collect();
            let curve = if stepped { UsageCurve::stepped() } else { UsageCurve::default() };
            let now = curve.usage(at(minutes), &agenda);
            prop_assert!((1.5..=3.5).contains(&now));
            let soon = curve.usage(at(minutes + 1.0 / 60.0), &agenda);
            if !stepped {
                // The ramp's slope is 2 in 2700 s, and nothing changes faster.
                prop_assert!((soon - now).abs() <= 2.0 / 2700.0 + 1e-9);
            }
        }
    }
}
