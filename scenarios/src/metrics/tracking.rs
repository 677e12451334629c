//! How well people were tracked, held against the truth: CLEAR-MOT (Bernardin and Stiefelhagen,
//! EURASIP Journal on Image and Video Processing 2008) and IDF1 (Ristani et al., ECCV Workshops 2016).
//! This file guarantees that both count the same moments within the same distance.
//!
//! - MOTA = 1 - (misses + false people + switches) / true people, each summed over all moments. At each
//!   moment a person keeps the track it had, where that is still near enough; the others are matched so
//!   that as many as possible are, and then as closely as possible. A switch is a person matched with
//!   another track than the last one it had.
//! - IDF1 = 2 x identified / (true people + tracked people), summed over all moments, where each whole
//!   trajectory of a person goes with at most one whole trajectory of a track, and those are
//!   chosen so that the moments at which the two are near enough are most.

use crate::world::wrap;
use agents::perception::{Pair, assign};
use nalgebra::{Isometry2, Vector2};
use std::collections::BTreeMap;

/// A track further than this from a person is not of that person, m.
pub const NEAR_ENOUGH: f64 = 0.5;
/// What matching one more pair is worth beside how near the pair is: more than any nearness.
const MATCHED: f64 = 1000.0;

/// Truth and tracks, moment by moment.
#[derive(Debug, Clone, Default)]
pub struct TrackingScore {
    /// True people, and tracked ones, by the order in which they first appear.
    people: BTreeMap<String, usize>,
    tracks: BTreeMap<u64, usize>,
    /// The track that each person last had.
    last: BTreeMap<usize, usize>,
    /// The tracks of the moment before, by person.
    current: BTreeMap<usize, usize>,
    /// At how many moments a person and a track were near enough.
    together: BTreeMap<(usize, usize), u64>,
    truths: u64,
    tracked: u64,
    matched: u64,
    switches: u64,
    squared_error: f64,
    turned: f64,
}

/// The figures of a whole recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackingFigures {
    /// Multiple object tracking accuracy: at most 1, and below 0 where more is wrong than there is.
    pub mota: f64,
    /// How well whole identities are kept, in [0, 1].
    pub idf1: f64,
    /// How many true people were not tracked, summed over the moments.
    pub misses: u64,
    /// How many tracked people were not there, summed over the moments.
    pub false_people: u64,
    /// How often a person went on under another track.
    pub id_switches: u64,
    /// Of the matched, root mean square of the distance, m.
    pub position_rmse: f64,
    /// Of the matched, mean of the absolute difference of headings, rad.
    pub heading_error: f64,
}

impl TrackingScore {
    /// Takes in a moment: everybody who is there, and everybody who is tracked.
    pub fn add<'a>(
        &mut self,
        truth: impl IntoIterator<Item = (&'a str, Isometry2<f64>)>,
        tracked: impl IntoIterator<Item = (u64, Isometry2<f64>)>,
    ) {
        let mut truth: Vec<(usize, Isometry2<f64>)> = truth
            .into_iter()
            .map(|(name, pose)| (index(&mut self.people, name.to_owned()), pose))
            .collect();
        let mut tracked: Vec<(usize, Isometry2<f64>)> = tracked
            .into_iter()
            .map(|(id, pose)| (index(&mut self.tracks, id), pose))
            .collect();
        truth.sort_by_key(|(person, _)| *person);
        tracked.sort_by_key(|(track, _)| *track);
        self.truths += truth.len() as u64;
        self.tracked += tracked.len() as u64;
        let mut pairs = Vec::new();
        for (row, (person, at)) in truth.iter().enumerate() {
            for (column, (track, other)) in tracked.iter().enumerate() {
                let distance = apart(at, other).norm();
                if distance > NEAR_ENOUGH {
                    continue;
                }
                *self.together.entry((*person, *track)).or_default() += 1;
                // What goes on is worth more than what two new pairs are.
                let kept = self.current.get(person) == Some(track);
                let worth = if kept { 3.0 * MATCHED } else { MATCHED };
                pairs.push(Pair {
                    row,
                    column,
                    benefit: worth + NEAR_ENOUGH - distance,
                });
            }
        }
        self.current.clear();
        for (row, column) in assign(truth.len(), tracked.len(), &pairs) {
            let ((person, at), (track, other)) = (truth[row], tracked[column]);
            self.matched += 1;
            self.squared_error += apart(&at, &other).norm_squared();
            self.turned += wrap(at.rotation.angle() - other.rotation.angle()).abs();
            self.current.insert(person, track);
            if self
                .last
                .insert(person, track)
                .is_some_and(|last| last != track)
            {
                self.switches += 1;
            }
        }
    }

    /// The figures of all moments; `None` where nobody was ever there.
    pub fn figures(&self) -> Option<TrackingFigures> {
        if self.truths == 0 {
            return None;
        }
        let misses = self.truths - self.matched;
        let false_people = self.tracked - self.matched;
        let wrong = misses + false_people + self.switches;
        let pairs: Vec<Pair> = self
            .together
            .iter()
            .map(|(&(row, column), &moments)| Pair {
                row,
                column,
                benefit: moments as f64,
            })
            .collect();
        let identified: u64 = assign(self.people.len(), self.tracks.len(), &pairs)
            .iter()
            .map(|pair| self.together[pair])
            .sum();
        let matched = self.matched.max(1) as f64;
        Some(TrackingFigures {
            mota: 1.0 - wrong as f64 / self.truths as f64,
            idf1: 2.0 * identified as f64 / (self.truths + self.tracked) as f64,
            misses,
            false_people,
            id_switches: self.switches,
            position_rmse: (self.squared_error / matched).sqrt(),
            heading_error: self.turned / matched,
        })
    }
}

fn apart(one: &Isometry2<f64>, other: &Isometry2<f64>) -> Vector2<f64> {
    one.translation.vector - other.translation.vector
}

/// The number of `name`, given in the order of first appearance.
fn index<K: Ord>(numbers: &mut BTreeMap<K, usize>, name: K) -> usize {
    let next = numbers.len();
    *numbers.entry(name).or_insert(next)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(x, 0.0), 0.0)
    }

    /// Who is where, and which track.
    type Moment<'a> = (&'a [(&'a str, f64)], &'a [(u64, f64)]);

    fn figures(moments: &[Moment<'_>]) -> TrackingFigures {
        let mut score = TrackingScore::default();
        for (truth, tracked) in moments {
            score.add(
                truth.iter().map(|&(name, x)| (name, at(x))),
                tracked.iter().map(|&(id, x)| (id, at(x))),
            );
        }
        score.figures().expect("people")
    }

    #[track_caller]
    fn close(value: f64, expected: f64) {
        assert!((value - expected).abs() < 1e-12, "{value}, not {expected}");
    }

    #[test]
    fn misses_false_people_and_switches_count_against_accuracy() {
        let perfect = figures(&[(&[("a", 0.0)], &[(1, 0.3)]), (&[("a", 0.0)], &[(1, -0.3)])]);
        close(perfect.mota, 1.0);
        close(perfect.idf1, 1.0);
        close(perfect.position_rmse, 0.3);
        // Ten moments: one missed, one with a false person, and from the sixth on another track.
        let moment: &[(&str, f64)] = &[("a", 0.0)];
        let mut moments: Vec<Moment<'_>> = vec![(moment, &[(1, 0.0)]); 5];
        moments.resize(10, (moment, &[(2, 0.0)]));
        moments[1].1 = &[];
        moments[8].1 = &[(2, 0.0), (3, 4.0)];
        let figures = figures(&moments);
        assert_eq!(figures.id_switches, 1);
        close(figures.mota, 1.0 - 3.0 / 10.0);
        // The longer track is the person's: five of ten true and ten tracked moments.
        close(figures.idf1, 2.0 * 5.0 / 20.0);
    }

    #[test]
    fn a_person_keeps_the_track_it_had_while_that_is_near_enough() {
        // Track 2 comes nearer than track 1, which is still near: no switch, one false person.
        let figures = figures(&[
            (&[("a", 0.0)], &[(1, 0.1)]),
            (&[("a", 0.0)], &[(1, 0.4), (2, 0.0)]),
        ]);
        assert_eq!(figures.id_switches, 0);
        close(figures.mota, 0.5);
        close(figures.position_rmse, f64::midpoint(0.01, 0.16).sqrt());
    }

    #[test]
    fn people_who_change_their_tracks_are_two_switches_and_lose_their_identities() {
        let figures = figures(&[
            (&[("a", 0.0), ("b", 2.0)], &[(1, 0.0), (2, 2.0)]),
            (&[("a", 0.0), ("b", 2.0)], &[(2, 0.0), (1, 2.0)]),
        ]);
        assert_eq!(figures.id_switches, 2);
        close(figures.mota, 0.5);
        close(figures.idf1, 0.5);
    }

    #[test]
    fn a_switch_after_a_gap_counts_and_the_same_track_after_a_gap_does_not() {
        let gap: Moment<'_> = (&[("a", 0.0)], &[]);
        let before: Moment<'_> = (&[("a", 0.0)], &[(1, 0.0)]);
        let other: Moment<'_> = (&[("a", 0.0)], &[(2, 0.0)]);
        assert_eq!(figures(&[before, gap, before]).id_switches, 0);
        assert_eq!(figures(&[before, gap, other]).id_switches, 1);
    }

    #[test]
    fn nobody_has_no_figures() {
        assert_eq!(TrackingScore::default().figures(), None);
    }
}
