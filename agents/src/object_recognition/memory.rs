//! Where an object may be: several places, each with a probability, after paper LL. This file owns the law
//! by which sightings, looks in vain and time revise them, and guarantees that the probabilities are
//! never negative and sum to at most one; what is missing to one is "somewhere else".
//!
//! With p the probabilities of the known places and e that of somewhere else:
//!
//! - **Time.** Objects are taken somewhere else once in `stay` seconds, and then to a known place as often
//!   as they have come to it, or to a new one: in t seconds each p becomes
//!   k p + (1 - k) v / (n + 1) with k = exp(-t / stay), v its visits and n those of all places; and e
//!   likewise with 1 in place of v. A visit is counted where the object is found at another place than before, or
//!   at the same after nobody saw it for a while: so v / n is how often it was found where.
//! - **How long it stays** is learned. An object last seen t seconds ago is found at the same place with
//!   probability k + (1 - k) v / (n + 1), at another with (1 - k) v / (n + 1); each visit moves the logarithm of `stay`
//!   by `stay_rate` times the slope of the logarithm of that, which is taken as -1 to 1.
//! - **A sighting** at a place multiplies its p by the probability of detecting what is there, and all
//!   others and e by that of detecting what is not there; then all are divided by their sum. A
//!   new place begins with a share of e.
//! - **A look in vain** multiplies the p of the places looked at by the probability of overlooking what
//!   is there; then all are divided by their sum.
//!
//! Before they are divided, none of them, nor e, counts as less than [`LEAST`]: what once was thought
//! of can become likely again in a few looks.

use super::config::{Config, MemoryConfig};
use dsr::Time;
use nalgebra::{Isometry2, Point2};

/// A place at which an object may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Where it would stand there, world frame.
    pub pose: Isometry2<f64>,
    /// Probability that it is there, in [0, 1].
    pub probability: f64,
    /// How often it was found there.
    pub visits: u32,
    /// When it was last seen there.
    pub last_seen: Time,
}

/// The places of one object.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Memory {
    places: Vec<Place>,
    /// Up to when time has been counted.
    time: Option<Time>,
    /// The place at which it last was for sure.
    at: Option<usize>,
    /// Up to when looks in vain have been counted.
    looked: Option<Time>,
    /// When it last was seen where it was for sure.
    seen: Option<Time>,
    /// How long it stays where it is, on average, as learned so far, s.
    stay: Option<f64>,
}

/// No look is so thorough, and no time so long, that less than this is left.
const LEAST: f64 = 1e-3;
/// What is learned of how long an object stays lies between these, s.
const SHORTEST_STAY: f64 = 60.0;
const LONGEST_STAY: f64 = 30.0 * 24.0 * 3600.0;

impl Memory {
    /// What was remembered at `time`, and how long the object stays, where that was learned.
    pub(super) fn resumed(mut places: Vec<Place>, time: Time, stay: Option<f64>) -> Self {
        places.retain(|place| {
            crate::perception::is_finite_pose(&place.pose)
                && (0.0..=1.0).contains(&place.probability)
        });
        let sum: f64 = places.iter().map(|place| place.probability).sum();
        if sum > 1.0 {
            for place in &mut places {
                place.probability /= sum;
            }
        }
        let likeliest = (0..places.len())
            .max_by(|&a, &b| places[a].probability.total_cmp(&places[b].probability));
        Self {
            time: Some(time),
            at: likeliest,
            looked: None,
            seen: likeliest.map(|index| places[index].last_seen),
            stay: stay.filter(|stay| (SHORTEST_STAY..=LONGEST_STAY).contains(stay)),
            places,
        }
    }

    /// The places, the likeliest first; of equal ones, the one seen last.
    pub(super) fn ranked(&self) -> Vec<Place> {
        let mut places = self.places.clone();
        places.sort_by(|a, b| {
            b.probability
                .total_cmp(&a.probability)
                .then(b.last_seen.cmp(&a.last_seen))
        });
        places
    }

    /// Up to when time has been counted.
    pub(super) fn time(&self) -> Option<Time> {
        self.time
    }

    /// Lets time pass up to `now`.
    pub(super) fn pass(&mut self, now: Time, config: &MemoryConfig) {
        let since = self.time.map_or(0.0, |time| now.since(time).max(0.0));
        self.time = Some(self.time.map_or(now, |time| time.max(now)));
        let keep = (-since / self.stay(config)).exp();
        let visits = self.visits();
        for place in &mut self.places {
            let usual = f64::from(place.visits) / f64::from(visits + 1);
            place.probability = keep * place.probability + (1.0 - keep) * usual;
        }
    }

    /// A camera saw it there.
    pub(super) fn saw(&mut self, time: Time, pose: Isometry2<f64>, config: &MemoryConfig) {
        self.pass(time, config);
        let index = self.near(pose, config).unwrap_or_else(|| {
            let new = Place {
                pose,
                probability: self.elsewhere() * config.new_place,
                visits: 0,
                last_seen: time,
            };
            self.remember(new, config)
        });
        let (there, not_there) = (config.detection_probability, config.false_probability);
        let elsewhere = self.elsewhere() * not_there;
        for (other, place) in self.places.iter_mut().enumerate() {
            place.probability *= if other == index { there } else { not_there };
        }
        self.normalise(elsewhere);
        let place = &mut self.places[index];
        let absent = time.since(place.last_seen);
        place.pose = pose;
        place.last_seen = time;
        if place.probability <= 0.5 {
            return;
        }
        let stayed = self.at == Some(index);
        if stayed && absent <= config.visit_gap {
            self.seen = Some(time);
            return;
        }
        self.learn(index, time, config);
        let place = &mut self.places[index];
        place.visits = place.visits.saturating_add(1);
        self.at = Some(index);
        self.seen = Some(time);
    }

    /// How long it stays where it is on average, s, where that was learned.
    pub(super) fn learned_stay(&self) -> Option<f64> {
        self.stay
    }

    fn stay(&self, config: &MemoryConfig) -> f64 {
        self.stay.unwrap_or(config.stay)
    }

    fn visits(&self) -> u32 {
        self.places.iter().map(|place| place.visits).sum()
    }

    /// Learns from where it is found at `time` how long it stays: a step up the slope of the logarithm of how likely
    /// it was to be found there, by the logarithm of `stay`.
    fn learn(&mut self, found: usize, time: Time, config: &MemoryConfig) {
        let (Some(at), Some(seen)) = (self.at, self.seen) else {
            return;
        };
        let stay = self.stay(config);
        let stays = time.since(seen).max(0.0) / stay;
        let keep = (-stays).exp();
        // A place that is new counts as one visit.
        let visits = self.places[found].visits.max(1);
        let usual = f64::from(visits) / f64::from(self.visits() + 1);
        let same = f64::from(found == at);
        let likelihood = keep * same + (1.0 - keep) * usual;
        let slope = stays * keep * (same - usual) / likelihood;
        if slope.is_finite() {
            let learned = stay * (config.stay_rate * slope.clamp(-1.0, 1.0)).exp();
            self.stay = Some(learned.clamp(SHORTEST_STAY, LONGEST_STAY));
        }
    }

    /// A camera looked and did not see it; `looked_at` tells of a position whether the camera had to
    /// see it there. Looks in quick succession fail for the same reason, so they count once.
    pub(super) fn looked_in_vain(
        &mut self,
        time: Time,
        looked_at: impl Fn(Point2<f64>) -> bool,
        config: &Config,
    ) {
        let early = |looked: Time| time.since(looked) < config.look_period;
        if self.looked.is_some_and(early) {
            return;
        }
        self.pass(time, &config.memory);
        let elsewhere = self.elsewhere();
        let mut any = false;
        for place in &mut self.places {
            if looked_at(Point2::from(place.pose.translation.vector)) {
                place.probability *= 1.0 - config.memory.detection_probability;
                any = true;
            }
        }
        if any {
            self.looked = Some(time);
            self.normalise(elsewhere);
        }
    }

    fn elsewhere(&self) -> f64 {
        let known: f64 = self.places.iter().map(|place| place.probability).sum();
        (1.0 - known).max(LEAST)
    }

    /// Divides by the sum, so that all and somewhere else are one.
    fn normalise(&mut self, elsewhere: f64) {
        for place in &mut self.places {
            place.probability = place.probability.max(LEAST);
        }
        let sum = elsewhere
            + self
                .places
                .iter()
                .map(|place| place.probability)
                .sum::<f64>();
        for place in &mut self.places {
            place.probability /= sum;
        }
    }

    /// The known place that a pose is of.
    fn near(&self, pose: Isometry2<f64>, config: &MemoryConfig) -> Option<usize> {
        let distance =
            |place: &Place| (place.pose.translation.vector - pose.translation.vector).norm();
        let places = self.places.iter().enumerate();
        let near = places.filter(|(_, place)| distance(place) <= config.same_place);
        near.min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))
            .map(|(index, _)| index)
    }

    /// Adds a place, where need be for the one that matters least.
    fn remember(&mut self, new: Place, config: &MemoryConfig) -> usize {
        if self.places.len() < config.most_places.max(1) {
            self.places.push(new);
            return self.places.len() - 1;
        }
        let worth = |place: &Place| (place.visits, place.last_seen);
        let least = (0..self.places.len()).min_by_key(|&index| worth(&self.places[index]));
        let index = least.unwrap_or(0);
        self.places[index] = new;
        if self.at == Some(index) {
            (self.at, self.seen) = (None, None);
        }
        index
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;
    use proptest::prelude::*;

    fn pose(x: f64) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(x, 0.0), 0.0)
    }

    fn at(seconds: f64) -> Time {
        Time::from_seconds(seconds)
    }

    /// Saw it so often at each of the places, one after the other, an hour apart.
    fn seen(places: &[(f64, u32)], config: &Config) -> (Memory, f64) {
        let (mut memory, mut clock) = (Memory::default(), 0.0);
        for &(x, times) in places {
            clock += 3600.0;
            for _ in 0..times {
                clock += 1.0;
                memory.saw(at(clock), pose(x), &config.memory);
            }
        }
        (memory, clock)
    }

    fn first(memory: &Memory) -> f64 {
        memory.ranked()[0].pose.translation.x
    }

    #[derive(Debug, Clone)]
    enum Event {
        Saw(f64),
        Vain(Vec<i32>),
        Wait(f64),
    }

    fn event() -> impl Strategy<Value = Event> {
        prop_oneof![
            (0..12i32).prop_map(|x| Event::Saw(f64::from(x))),
            prop::collection::vec(0..12i32, 0..5).prop_map(Event::Vain),
            (0.0..1e6f64).prop_map(Event::Wait),
        ]
    }

    proptest! {
        #[test]
        fn probabilities_are_none_below_zero_and_sum_to_at_most_one(
            events in prop::collection::vec(event(), 0..60)
        ) {
            let config = Config::default();
            let (mut memory, mut clock) = (Memory::default(), 0.0);
            for event in events {
                clock += 1.0;
                match event {
                    Event::Saw(x) => memory.saw(at(clock), pose(x), &config.memory),
                    Event::Vain(places) => memory.looked_in_vain(
                        at(clock),
                        |place| places.iter().any(|x| (f64::from(*x) - place.x).abs() < 0.5),
                        &config,
                    ),
                    Event::Wait(seconds) => {
                        clock += seconds;
                        memory.pass(at(clock), &config.memory);
                    }
                }
                let places = memory.ranked();
                prop_assert!(places.iter().all(|p| p.probability >= 0.0));
                let sum: f64 = places.iter().map(|place| place.probability).sum();
                prop_assert!(sum <= 1.0 + 1e-9, "{sum}");
                prop_assert!(places.len() <= config.memory.most_places);
            }
        }
    }

    #[test]
    fn what_is_seen_again_and_again_is_there() {
        let config = Config::default();
        let (memory, _) = seen(&[(2.0, 4)], &config);
        let places = memory.ranked();
        assert_eq!((places.len(), places[0].visits), (1, 1));
        assert!(places[0].probability > 0.9, "{places:?}");
    }

    #[test]
    fn a_look_in_vain_makes_the_other_usual_place_the_likeliest() {
        let config = Config::default();
        let (mut memory, clock) = seen(&[(1.0, 5), (5.0, 5), (1.0, 5)], &config);
        assert!((first(&memory) - 1.0).abs() < 1e-9);
        for look in 1..=12 {
            let time = at(clock + f64::from(look));
            memory.looked_in_vain(time, |place| place.x < 2.0, &config);
        }
        assert!((first(&memory) - 5.0).abs() < 1e-9, "{:?}", memory.ranked());
    }

    #[test]
    fn after_long_it_is_where_it_usually_is() {
        let config = Config::default();
        let (mut memory, clock) = seen(
            &[(1.0, 5), (5.0, 5), (1.0, 5), (7.0, 5), (1.0, 5), (5.0, 5)],
            &config,
        );
        assert!(
            (first(&memory) - 5.0).abs() < 1e-9,
            "where it was seen last"
        );
        memory.pass(at(clock + 30.0 * config.memory.stay), &config.memory);
        let places = memory.ranked();
        assert!((places[0].pose.translation.x - 1.0).abs() < 1e-9);
        // Three visits of six, and one for a place that nobody knows.
        assert!(
            (places[0].probability - 3.0 / 7.0).abs() < 1e-6,
            "{places:?}"
        );
    }

    /// What was learned of an object that is found every `gap` seconds, here and there in turn or where it was.
    fn learned(gap: f64, stays_put: bool, config: &Config) -> f64 {
        let mut memory = Memory::default();
        for visit in 0..200 {
            let x = if stays_put || visit % 2 == 0 {
                1.0
            } else {
                5.0
            };
            for look in 0..6 {
                let time = at(f64::from(visit) * gap + f64::from(look));
                memory.saw(time, pose(x), &config.memory);
            }
        }
        memory.stay(&config.memory)
    }

    #[test]
    fn how_long_it_stays_is_learned_of_what_moves_and_of_what_does_not() {
        let config = Config::default();
        let usual = config.memory.stay;
        assert!(learned(usual / 2.0, false, &config) < usual / 3.0);
        assert!(learned(usual / 2.0, true, &config) > usual);
        let mut fixed = Config::default();
        fixed.memory.stay_rate = 0.0;
        let stay = learned(usual / 2.0, false, &fixed);
        assert!((stay - usual).abs() < 1e-9, "{stay}");
    }

    #[test]
    fn found_again_after_a_while_is_one_more_visit_and_what_was_learned_is_taken_over() {
        let config = Config::default();
        let (mut memory, clock) = seen(&[(1.0, 3)], &config);
        memory.saw(at(clock + 60.0), pose(1.0), &config.memory);
        assert_eq!(memory.ranked()[0].visits, 1);
        let later = at(clock + 60.0 + 2.0 * config.memory.visit_gap);
        memory.saw(later, pose(1.0), &config.memory);
        assert_eq!(memory.ranked()[0].visits, 2);
        let stay = memory.learned_stay();
        assert!(stay.is_some());
        let resumed = Memory::resumed(memory.ranked(), later, stay);
        assert_eq!(resumed.learned_stay(), stay);
        let absurd = Memory::resumed(memory.ranked(), later, Some(f64::NAN));
        assert_eq!(absurd.learned_stay(), None);
    }

    #[test]
    fn one_stray_sighting_moves_nothing() {
        let config = Config::default();
        let (mut memory, clock) = seen(&[(1.0, 6)], &config);
        memory.saw(at(clock + 1.0), pose(8.0), &config.memory);
        assert!((first(&memory) - 1.0).abs() < 1e-9);
        for look in 2..6 {
            memory.saw(at(clock + f64::from(look)), pose(8.0), &config.memory);
        }
        assert!((first(&memory) - 8.0).abs() < 1e-9, "{:?}", memory.ranked());
    }
}
