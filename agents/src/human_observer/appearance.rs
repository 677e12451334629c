//! What people look like, as a detector's network writes it: who looks alike, and who is remembered by looks alone
//! after the track is over. This file guarantees that vectors of different lengths, of different detectors that is,
//! are never compared.
//!
//! Similarity is the cosine of two vectors. That of two images of one person is taken to be distributed as
//! N(`same`, `spread`), that of two people as N(`other`, `spread`), so twice the logarithm of how much likelier two
//! people are than one is ((s - same)^2 - (s - other)^2) / spread^2.

use super::config::Appearances;
use dsr::Time;
use nalgebra::Point2;
use std::collections::BTreeMap;

/// Looks count no further than this, as headings: light and clothes change.
const LIMIT: f64 = 18.0;
/// So many images are averaged, the newer ones ever after with the weight of the last.
const AVERAGED: f32 = 20.0;
/// People get no further than this in a second, m.
pub(super) const RUNNING: f64 = 4.0;
/// Looks that are a hundred times likelier to be of one person than of two tell by themselves: 2 ln 100.
pub(super) const SURE: f64 = 9.2;

/// A direction, and of how many images it is the mean.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Appearance {
    direction: Vec<f32>,
    images: f32,
}

impl Appearance {
    /// Of one image; `None` where the figures give no direction.
    pub(super) fn of(figures: &[f32]) -> Option<Self> {
        Some(Self {
            direction: unit(figures.to_vec())?,
            images: 1.0,
        })
    }

    /// The cosine of two of them; `None` where they cannot be compared.
    fn similarity(&self, other: &Self) -> Option<f64> {
        let pairs = self.direction.iter().zip(&other.direction);
        let dot: f64 = pairs.map(|(a, b)| f64::from(a * b)).sum();
        (self.direction.len() == other.direction.len()).then_some(dot)
    }

    /// Takes in another image of the same person.
    pub(super) fn take_in(&mut self, image: &Self) {
        if self.direction.len() != image.direction.len() {
            return;
        }
        self.images = (self.images + 1.0).min(AVERAGED);
        let share = 1.0 / self.images;
        let pairs = self.direction.iter().zip(&image.direction);
        let mean = pairs.map(|(old, new)| old + share * (new - old)).collect();
        if let Some(direction) = unit(mean) {
            self.direction = direction;
        }
    }
}

fn unit(mut figures: Vec<f32>) -> Option<Vec<f32>> {
    let length = figures.iter().map(|x| x * x).sum::<f32>().sqrt();
    if !(length.is_finite() && length > 1e-6) {
        return None;
    }
    for figure in &mut figures {
        *figure /= length;
    }
    Some(figures)
}

/// What speaks against two looks being of one person, in the units of
/// [`Innovation::cost`](super::track::Innovation::cost); nothing where one is not known.
pub(super) fn cost(
    one: Option<&Appearance>,
    other: Option<&Appearance>,
    config: &Appearances,
) -> f64 {
    let similarity = one
        .zip(other)
        .and_then(|(one, other)| one.similarity(other));
    similarity.map_or(0.0, |s| {
        let against = (s - config.same).powi(2) - (s - config.other).powi(2);
        (against / config.spread.powi(2)).clamp(-LIMIT, LIMIT)
    })
}

/// Somebody whose track is over.
#[derive(Debug, Clone)]
struct Gone {
    appearance: Appearance,
    last_seen: Time,
    place: Point2<f64>,
}

/// Those who are remembered by their looks, by number.
#[derive(Debug, Default)]
pub(super) struct Gallery(BTreeMap<u64, Gone>);

impl Gallery {
    /// Remembers somebody who was seen last at a time and a place; of too many, the one unseen for longest goes.
    pub(super) fn remember(
        &mut self,
        id: u64,
        appearance: Appearance,
        last_seen: Time,
        place: Point2<f64>,
        config: &Appearances,
    ) {
        let gone = Gone {
            appearance,
            last_seen,
            place,
        };
        self.0.insert(id, gone);
        while self.0.len() > config.most_people {
            let oldest = self
                .0
                .iter()
                .min_by_key(|(id, gone)| (gone.last_seen, **id));
            let Some(oldest) = oldest.map(|(id, _)| *id) else {
                return;
            };
            self.0.remove(&oldest);
        }
    }

    /// Who of them somebody new that appeared at a time and a place must be, if the looks tell: alike enough,
    /// more so than anybody else, and not further than people run. Whoever is found is remembered no more.
    pub(super) fn find(
        &mut self,
        new: &Appearance,
        time: Time,
        place: Point2<f64>,
        config: &Appearances,
    ) -> Option<u64> {
        self.0
            .retain(|_, gone| time.since(gone.last_seen) <= config.remembered);
        let mut alike: Vec<(f64, u64)> = self
            .0
            .iter()
            .filter(|(_, gone)| {
                let gap = time.since(gone.last_seen);
                gap > 0.0 && (gone.place - place).norm() <= RUNNING * gap
            })
            .filter_map(|(id, gone)| Some((gone.appearance.similarity(new)?, *id)))
            .collect();
        alike.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let (best, id) = *alike.first()?;
        let second = alike.get(1).map_or(-1.0, |(similarity, _)| *similarity);
        let sure = best >= config.at_least && best - second >= config.margin;
        if sure {
            self.0.remove(&id);
        }
        sure.then_some(id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(figures: &[f32]) -> Appearance {
        Appearance::of(figures).unwrap()
    }

    #[test]
    fn what_gives_no_direction_is_no_look_and_others_are_compared_by_it_alone() {
        for none in [&[][..], &[0.0, 0.0], &[f32::NAN, 1.0], &[f32::INFINITY]] {
            assert_eq!(Appearance::of(none), None, "{none:?}");
        }
        let config = Appearances::default();
        let [a, same, other, short] = [&[1.0, 0.0][..], &[7.0, 0.1], &[0.0, 2.0], &[1.0]].map(look);
        assert!(cost(Some(&a), Some(&same), &config) < -5.0);
        assert!(cost(Some(&a), Some(&other), &config) > 5.0);
        for unknown in [None, Some(&short)] {
            assert!(cost(Some(&a), unknown, &config).abs() < 1e-12);
        }
    }

    #[test]
    fn somebody_gone_is_found_by_looks_where_they_tell_and_legs_reach() {
        let config = Appearances::default();
        let (at, origin) = (Time::from_seconds, Point2::origin());
        let gallery = || {
            let mut gallery = Gallery::default();
            gallery.remember(3, look(&[1.0, 0.0, 0.0]), at(10.0), origin, &config);
            gallery.remember(5, look(&[0.9, 0.44, 0.0]), at(10.0), origin, &config);
            gallery.remember(7, look(&[0.0, 0.0, 1.0]), at(10.0), origin, &config);
            gallery
        };
        let find = |look: Appearance, time: f64, x: f64| {
            gallery().find(&look, at(time), Point2::new(x, 0.0), &config)
        };
        let seventh = look(&[0.1, 0.1, 1.0]);
        assert_eq!(find(seventh.clone(), 60.0, 20.0), Some(7));
        assert_eq!(find(seventh.clone(), 12.0, 20.0), None, "too far to run");
        assert_eq!(find(seventh.clone(), 1e6, 20.0), None, "forgotten");
        assert_eq!(
            find(look(&[0.97, 0.24, 0.0]), 60.0, 20.0),
            None,
            "one of two"
        );
        let mut once = gallery();
        assert_eq!(once.find(&seventh, at(60.0), origin, &config), Some(7));
        assert_eq!(once.find(&seventh, at(60.0), origin, &config), None);
    }

    #[test]
    fn of_too_many_the_one_unseen_for_longest_is_forgotten() {
        let config = Appearances {
            most_people: 2,
            ..Appearances::default()
        };
        let mut gallery = Gallery::default();
        for (id, x) in [(1, 1.0), (2, -1.0), (3, 0.1)] {
            let time = Time::from_seconds(id as f64);
            gallery.remember(
                id,
                look(&[x, 1.0 - x.abs()]),
                time,
                Point2::origin(),
                &config,
            );
        }
        let ids: Vec<u64> = gallery.0.keys().copied().collect();
        assert_eq!(ids, [2, 3]);
    }
}
