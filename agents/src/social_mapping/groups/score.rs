//! How well groups were found: precision, recall and F1 against the truth, as the literature on
//! conversational groups counts them.
//!
//! A true group G is found where some group D that was found, not yet taken by another, has at
//! least `T |G|` of its members (rounded up) and of D's own members at most the rest are wrong, a
//! share of `1 - T`: `|G and D| >= T max(|G|, |D|)`. T = 2/3 lets one of three be wrong, T = 1
//! none. Precision and recall are taken per frame and averaged over the frames (a frame without
//! groups in which none was found counts as right in both), and F1 is their harmonic mean. That is how
//! the figures of GCFF (Setti et al. 2015) were taken.

use serde::Serialize;
use std::collections::BTreeSet;

/// The tolerances of the literature.
pub const TOLERANCES: [f64; 2] = [2.0 / 3.0, 1.0];

/// The figures at one tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Score {
    /// Mean share of the groups found that are true.
    pub precision: f64,
    /// Mean share of the true groups that were found.
    pub recall: f64,
    /// Their harmonic mean.
    pub f1: f64,
    /// F1 with all frames thrown together, where crowded frames count for more.
    pub pooled_f1: f64,
}

/// The groups of one frame by their members' names: those found, and the truth.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a, T> {
    /// What was found.
    pub found: &'a [BTreeSet<T>],
    /// What is true.
    pub truth: &'a [BTreeSet<T>],
}

/// The figures over frames at the tolerance T, in (0, 1]; all 1 without frames.
pub fn score<T: Ord>(frames: &[Frame<'_, T>], tolerance: f64) -> Score {
    let (mut precision, mut recall) = (0.0, 0.0);
    let (mut matched, mut groups) = (0, 0);
    for frame in frames {
        let hits = hits(frame, tolerance);
        matched += hits;
        groups += frame.found.len() + frame.truth.len();
        let share = |of: usize| f64::from(hits) / of as f64;
        // With nothing found nothing found is wrong, with nothing to find nothing is missed.
        precision += match (frame.found.len(), frame.truth.len()) {
            (0, _) => 1.0,
            (found, _) => share(found),
        };
        recall += match frame.truth.len() {
            0 => 1.0,
            truth => share(truth),
        };
    }
    let mean = |sum: f64| match frames.len() {
        0 => 1.0,
        count => sum / count as f64,
    };
    let (precision, recall) = (mean(precision), mean(recall));
    let f1 = if precision + recall > 0.0 {
        2.0 * precision * recall / (precision + recall)
    } else {
        0.0
    };
    let pooled_f1 = match groups {
        0 => 1.0,
        groups => 2.0 * f64::from(matched) / groups as f64,
    };
    Score {
        precision,
        recall,
        f1,
        pooled_f1,
    }
}

fn hits<T: Ord>(frame: &Frame<'_, T>, tolerance: f64) -> u32 {
    let mut taken = vec![false; frame.found.len()];
    let mut hits = 0;
    for group in frame.truth {
        let found = (0..frame.found.len()).find(|at| {
            let candidate = &frame.found[*at];
            let common = group.intersection(candidate).count() as f64;
            let least = tolerance * group.len().max(candidate.len()) as f64;
            !taken[*at] && common >= least - 1e-9
        });
        if let Some(at) = found {
            taken[at] = true;
            hits += 1;
        }
    }
    hits
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sets(groups: &[&[u32]]) -> Vec<BTreeSet<u32>> {
        groups.iter().map(|g| g.iter().copied().collect()).collect()
    }

    fn f1(found: &[&[u32]], truth: &[&[u32]], tolerance: f64) -> f64 {
        let (found, truth) = (sets(found), sets(truth));
        let frame = Frame {
            found: &found,
            truth: &truth,
        };
        score(&[frame], tolerance).f1
    }

    #[test]
    fn one_of_three_may_be_wrong_at_two_thirds_and_none_at_one() {
        for (found, loose, strict) in [
            (&[1, 2, 3][..], 1.0, 1.0),
            (&[1, 2], 1.0, 0.0),
            (&[1, 2, 3, 4], 1.0, 0.0),
            (&[1, 2, 4], 1.0, 0.0),
            (&[1, 4, 5], 0.0, 0.0),
            (&[1, 2, 3, 4, 5], 0.0, 0.0),
        ] {
            assert!((f1(&[found], &[&[1, 2, 3]], 2.0 / 3.0) - loose).abs() < 1e-12);
            assert!((f1(&[found], &[&[1, 2, 3]], 1.0) - strict).abs() < 1e-12);
        }
    }

    #[test]
    fn frames_are_averaged_and_empty_ones_are_right_when_nothing_is_found() {
        let (none, one, other) = (sets(&[]), sets(&[&[1, 2]]), sets(&[&[3, 4]]));
        let frame = |found, truth| Frame { found, truth };
        let all = score(&[frame(&none, &none), frame(&one, &one)], 1.0);
        assert!((all.f1 - 1.0).abs() < 1e-12 && (all.pooled_f1 - 1.0).abs() < 1e-12);
        let half = score(&[frame(&none, &none), frame(&one, &other)], 1.0);
        assert!((half.precision - 0.5).abs() < 1e-12 && half.pooled_f1.abs() < 1e-12);
        let missed = score(&[frame(&none, &one)], 1.0);
        assert!((missed.precision - 1.0).abs() < 1e-12 && missed.recall.abs() < 1e-12);
        assert!((score::<u32>(&[], 1.0).f1 - 1.0).abs() < 1e-12);
    }
}
