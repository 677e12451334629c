//! How far the robot trusts a map of some age. Social mapping says again and again as of when its map holds; where it
//! died or hangs, the map grows old. This file owns the rule, and guarantees that nobody drives at full speed
//! by a map of which it is not known that it still holds.

/// The least share of its speed at which a robot still goes by an old map.
const LEAST_SHARE: f64 = 0.2;

/// From which ages on the robot goes slower, and stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapPatience {
    /// By a map that is older it drives slower the older that is, seconds.
    pub slow_after: f64,
    /// By a map that is older it does not drive, seconds.
    pub hold_after: f64,
}

impl Default for MapPatience {
    fn default() -> Self {
        Self {
            slow_after: 3.0,
            hold_after: 10.0,
        }
    }
}

/// How much a map is worth at its age.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum MapState {
    /// It holds.
    #[default]
    Current,
    /// It held a while ago: the robot drives at this share of its speed.
    Old {
        /// Below 1.
        share: f64,
    },
    /// It held so long ago that the robot stands.
    Lost,
}

impl MapState {
    /// Its name in the graph and in the log.
    pub fn name(self) -> &'static str {
        match self {
            Self::Current => "current",
            Self::Old { .. } => "old",
            Self::Lost => "lost",
        }
    }

    /// What of its speed the robot may drive at.
    pub fn share(self) -> f64 {
        match self {
            Self::Current => 1.0,
            Self::Old { share } => share,
            Self::Lost => 0.0,
        }
    }
}

impl MapPatience {
    /// What a map is worth that held `age` seconds ago. From full speed at `slow_after` the share falls in a line towards
    /// `hold_after`, and ends at a fifth. A map from the future is as strange as one of the past.
    pub fn judge(&self, age: f64) -> MapState {
        let age = age.abs();
        if age.is_nan() || age > self.hold_after {
            return MapState::Lost;
        }
        if age <= self.slow_after {
            return MapState::Current;
        }
        let left = (self.hold_after - age) / (self.hold_after - self.slow_after);
        MapState::Old {
            share: LEAST_SHARE + (1.0 - LEAST_SHARE) * left,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_older_the_map_the_slower_the_robot() {
        let patience = MapPatience::default();
        for (age, name, share) in [
            (0.0, "current", 1.0),
            (3.0, "current", 1.0),
            (-2.0, "current", 1.0),
            (6.5, "old", 0.6),
            (10.0, "old", 0.2),
            (10.1, "lost", 0.0),
            (-11.0, "lost", 0.0),
            (f64::INFINITY, "lost", 0.0),
            (f64::NAN, "lost", 0.0),
        ] {
            let state = patience.judge(age);
            assert_eq!(state.name(), name, "{age}");
            assert!((state.share() - share).abs() < 1e-12, "{age}: {state:?}");
        }
        // Without a time in which to go slower it stands at once.
        let strict = MapPatience {
            slow_after: 5.0,
            hold_after: 2.0,
        };
        assert_eq!(strict.judge(2.0), MapState::Current);
        assert_eq!(strict.judge(2.1), MapState::Lost);
    }
}
