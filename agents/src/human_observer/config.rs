//! The figures of the human observer. Every default says where it comes from.

use serde::{Deserialize, Serialize};

/// How people are tracked and related. Metres, radians, seconds.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Figures of the motion model and the association.
    pub tracking: Tracking,
    /// Figures of the relations between people, objects and the robot.
    pub relations: Thresholds,
}

impl Config {
    /// What the observer could not work with, in words; `None` where all is well.
    pub fn problem(&self) -> Option<&'static str> {
        let Tracking {
            position_noise,
            heading_noise,
            speed_spread,
            detection_probability,
            clutter_density,
            velocity_decay,
            greatest_spread,
            confirmation_looks,
            appearance: Appearances { spread, .. },
            ..
        } = self.tracking;
        let positive = [
            position_noise,
            heading_noise,
            speed_spread,
            clutter_density,
            velocity_decay,
            greatest_spread,
            spread,
        ];
        if !positive
            .iter()
            .all(|figure| figure.is_finite() && *figure > 0.0)
        {
            Some("noises, spreads, the decay and the clutter must be finite and greater than 0")
        } else if !(detection_probability > 0.0 && detection_probability < 1.0) {
            Some("the detection probability must be greater than 0 and less than 1")
        } else if !(1..=32).contains(&confirmation_looks) {
            Some("the looks considered for confirmation must be from 1 to 32")
        } else {
            None
        }
    }
}

/// How detections are given to people, and how long those are kept.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Association {
    /// The likeliest assignment of a whole frame, birth and death by evidence for and against, and
    /// identities handed on when somebody is lost and found.
    #[default]
    Evidence,
    /// As SORT does it (Bewley et al., ICIP 2016), with distances on the floor in place of
    /// overlapping boxes: the nearest detection to each prediction, a person after some hits, gone
    /// when unseen for a while. What [`Association::Evidence`] is measured against.
    Nearest,
}

/// The figures of [`Association::Nearest`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Nearest {
    /// A detection further from the prediction than this is of somebody else, m.
    pub gate: f64,
    /// Hits that make a person of a track.
    pub hits: u32,
    /// Who is unseen for so long is gone, s.
    pub greatest_age: f64,
}

impl Default for Nearest {
    fn default() -> Self {
        Self {
            gate: 0.6,
            hits: 3,
            greatest_age: 0.3,
        }
    }
}

/// Motion model, association, birth and death.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Tracking {
    /// How detections are given to people.
    pub association: Association,
    /// For [`Association::Nearest`]; of the other figures it uses those of the motion model, the
    /// score and the delay.
    pub nearest: Nearest,
    /// Standard deviation of a detected position along each axis, m.
    pub position_noise: f64,
    /// Standard deviation of a detected heading, rad.
    pub heading_noise: f64,
    /// Spectral density of the white acceleration people are moved by, m^2/s^3. 0.5 lets a person
    /// stop from walking speed within a second inside two standard deviations.
    pub acceleration_density: f64,
    /// How fast headings wander, rad^2/s.
    pub heading_density: f64,
    /// Standard deviation of the unknown velocity of somebody new, m/s.
    pub speed_spread: f64,
    /// Below this speed the direction of motion says nothing about the heading, m/s.
    pub walking_speed: f64,
    /// Detections with a smaller score are not looked at.
    pub least_score: f64,
    /// Greatest squared Mahalanobis distance of a detection from the track it may belong to; 13.8
    /// keeps 99.9 % of the true ones (chi-square with two degrees of freedom).
    pub gate: f64,
    /// Probability that a person in view is detected.
    pub detection_probability: f64,
    /// False detections and newcomers per square metre of view and frame. One false detection a
    /// second over 30 m^2 at 15 frames a second is 0.002.
    pub clutter_density: f64,
    /// Hits within `confirmation_looks` looks that make a person of a track.
    pub confirmation_hits: u32,
    /// Looks considered for confirmation, at most 32.
    pub confirmation_looks: u32,
    /// A track not yet confirmed dies when unseen for so long, s.
    pub tentative_time: f64,
    /// A person is gone when cameras looked at the place and saw nobody for so long, s, summed over
    /// the cameras: seven frames in a row at 10 frames a second, which 10 % of misses bring about once
    /// in ten million.
    pub lost_in_view: f64,
    /// Somebody gone is remembered for so long since last seen, s, and found again under the same
    /// number.
    pub remembered: f64,
    /// One look that sees nobody stands for at most so much of that time, s: what lies further back
    /// was not looked at.
    pub look_time: f64,
    /// A person nobody could have seen is kept for so long, s.
    pub lost_out_of_view: f64,
    /// Somebody unseen keeps the velocity for so long, s; after that it decays, and only a newcomer
    /// with evidence enough brings the person back.
    pub coast_time: f64,
    /// Time constant of that decay, s.
    pub velocity_decay: f64,
    /// The position's standard deviation grows no further, m.
    pub greatest_spread: f64,
    /// How far inside the border of a view a person must be to count as looked at, m.
    pub view_margin: f64,
    /// A nearer body within this distance of the line of sight hides a person, m.
    pub body_radius: f64,
    /// Two tracks closer than this are one person, m: less than two bodies side by side.
    pub merge_distance: f64,
    /// They must be so close for so long without ever being seen apart in one image, s.
    pub merge_time: f64,
    /// A newcomer takes the identity of somebody lost if reachable: so far at once, m ...
    pub handover_distance: f64,
    /// ... and so much more for every second since in which no camera looked, m/s ...
    pub handover_speed: f64,
    /// ... up to so far, m.
    pub handover_limit: f64,
    /// Frames older than the newest taken in by more than this are refused, s.
    pub greatest_delay: f64,
    /// What people look like, where detections tell.
    pub appearance: Appearances,
}

/// How looks tell people apart; `human_observer/appearance.rs` states the law. The defaults lie between what
/// networks for re-identification give for one person and for two.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Appearances {
    /// Similarity of two images of one person, on average ...
    pub same: f64,
    /// ... and of two people.
    pub other: f64,
    /// Standard deviation of both.
    pub spread: f64,
    /// Somebody whose track is over is found again by looks at least so similar ...
    pub at_least: f64,
    /// ... and by so much more similar than the second most similar.
    pub margin: f64,
    /// Looks are remembered for so long since last seen, s ...
    pub remembered: f64,
    /// ... and those of so many people.
    pub most_people: usize,
}

impl Default for Appearances {
    fn default() -> Self {
        Self {
            same: 0.75,
            other: 0.3,
            spread: 0.15,
            at_least: 0.65,
            margin: 0.1,
            remembered: 3600.0,
            most_people: 256,
        }
    }
}

impl Tracking {
    /// Twice the logarithm of how much likelier a person in view is detected than that a false
    /// detection lies there: costs beyond it are better explained by chance.
    pub(super) fn greatest_cost(&self) -> f64 {
        let missed = (1.0 - self.detection_probability) * std::f64::consts::TAU;
        2.0 * (self.detection_probability / (missed * self.clutter_density)).ln()
    }
}

impl Default for Tracking {
    fn default() -> Self {
        Self {
            association: Association::default(),
            nearest: Nearest::default(),
            position_noise: 0.1,
            heading_noise: 0.15,
            acceleration_density: 0.5,
            heading_density: 0.1,
            speed_spread: 1.2,
            walking_speed: 0.3,
            least_score: 0.1,
            gate: 13.8,
            detection_probability: 0.9,
            clutter_density: 0.002,
            confirmation_hits: 3,
            confirmation_looks: 6,
            tentative_time: 1.0,
            lost_in_view: 0.7,
            remembered: 3.0,
            look_time: 0.25,
            lost_out_of_view: 10.0,
            coast_time: 1.0,
            velocity_decay: 1.0,
            greatest_spread: 2.0,
            view_margin: 0.3,
            body_radius: 0.25,
            merge_distance: 0.35,
            merge_time: 0.6,
            handover_distance: 0.6,
            handover_speed: 1.0,
            handover_limit: 3.0,
            greatest_delay: 0.5,
            appearance: Appearances::default(),
        }
    }
}

/// When a relation begins and ends. Each begins inside its first figure and ends only outside the
/// second, so that noise at the border does not make an edge of the graph flicker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Thresholds {
    /// How far outside a room somebody in it must get to have left it, m.
    pub room_margin: f64,
    /// `is_near` begins, m (READING.md item 11: 2 m).
    pub near_enter: f64,
    /// `is_near` ends, m.
    pub near_leave: f64,
    /// Facing begins within this angle (READING.md item 11: 45 degrees).
    pub facing_enter: f64,
    /// Facing ends beyond this angle.
    pub facing_leave: f64,
    /// Two people facing each other interact below this distance, m (READING.md item 11: 3 m) ...
    pub pair_enter: f64,
    /// ... and cease to beyond this one, m.
    pub pair_leave: f64,
    /// An object is within reach this far from its footprint, m (READING.md item 11: 0.5 m) ...
    pub object_enter: f64,
    /// ... and out of reach beyond this, m.
    pub object_leave: f64,
    /// How far outside an object's affordance space somebody must get to have left it, m.
    pub space_margin: f64,
    /// An interaction must last so long to be believed, s: two people who pass each other face
    /// each other at under 3 m for about a second.
    pub interaction_begin: f64,
    /// And must have ceased for so long, s.
    pub interaction_end: f64,
    /// Somebody in front of the robot must have turned away or left for so long, s.
    pub front_end: f64,
}

impl Default for Thresholds {
    fn default() -> Self {
        Self {
            room_margin: 0.2,
            near_enter: 2.0,
            near_leave: 2.3,
            facing_enter: 45f64.to_radians(),
            facing_leave: 55f64.to_radians(),
            pair_enter: 3.0,
            pair_leave: 3.3,
            object_enter: 0.5,
            object_leave: 0.7,
            space_margin: 0.2,
            interaction_begin: 1.0,
            interaction_end: 0.5,
            front_end: 2.0,
        }
    }
}
