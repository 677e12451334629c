//! By what law things are carried about in a home, and what somebody who knows the law can know of where
//! one is. This file guarantees that both are of one law: the probabilities by which a thing is moved are
//! those by which a belief goes on.

use crate::bench::Chance;

/// How a thing is carried from one to another of its usual places, which are numbered from 0. It stays at
/// each for a time of which each second is the last as likely as any other.
#[derive(Debug, Clone, Copy)]
pub(super) enum Law {
    /// To any of the others, the more usual the oftener; it stays equally long everywhere.
    Habits { stay: f64, shares: [f64; 4] },
    /// Place 0 is its own. From there it comes to one of the others, and is put back from each with this probability,
    /// else comes to another.
    Tidy {
        at_home: f64,
        away: f64,
        elsewhere: usize,
        put_back: f64,
    },
}

impl Law {
    pub(super) fn places(&self) -> usize {
        match self {
            Law::Habits { shares, .. } => shares.len(),
            Law::Tidy { elsewhere, .. } => elsewhere + 1,
        }
    }

    /// How long it stays at a place on average, s.
    fn mean_stay(&self, at: usize) -> f64 {
        match *self {
            Law::Habits { stay, .. } => stay,
            Law::Tidy { at_home, away, .. } => [away, at_home][usize::from(at == 0)],
        }
    }

    /// With which probability it comes from one place to another.
    fn step(&self, from: usize, to: usize) -> f64 {
        if from == to {
            return 0.0;
        }
        match self {
            Law::Habits { shares, .. } => shares[to] / (1.0 - shares[from]),
            Law::Tidy { elsewhere, .. } if from == 0 => 1.0 / *elsewhere as f64,
            Law::Tidy { put_back, .. } if to == 0 => *put_back,
            Law::Tidy {
                elsewhere,
                put_back,
                ..
            } => (1.0 - put_back) / (elsewhere - 1) as f64,
        }
    }

    /// A time for which it stays at a place.
    pub(super) fn stay(&self, at: usize, chance: &mut Chance) -> f64 {
        -self.mean_stay(at) * (1.0 - chance.share()).ln()
    }

    /// To which place it comes from another.
    pub(super) fn next(&self, from: usize, chance: &mut Chance) -> usize {
        let mut draw = chance.share();
        let mut next = from;
        for to in (0..self.places()).filter(|to| *to != from) {
            next = to;
            draw -= self.step(from, to);
            if draw < 0.0 {
                break;
            }
        }
        next
    }
}

/// The probability of each place, after all looks so far.
#[derive(Debug, Clone)]
pub(super) struct Belief {
    law: Law,
    probabilities: Vec<f64>,
    clock: f64,
}

impl Belief {
    /// At first a thing is at its place 0.
    pub(super) fn new(law: Law) -> Self {
        let mut probabilities = vec![0.0; law.places()];
        probabilities[0] = 1.0;
        Self {
            law,
            probabilities,
            clock: 0.0,
        }
    }

    pub(super) fn likeliest(&self) -> usize {
        let p = &self.probabilities;
        (0..p.len())
            .max_by(|&a, &b| p[a].total_cmp(&p[b]))
            .unwrap_or(0)
    }

    /// Lets time pass up to `clock`, in steps of a twentieth of the shortest stay at the most.
    pub(super) fn pass(&mut self, clock: f64) {
        let places = 0..self.probabilities.len();
        let shortest = places
            .clone()
            .map(|at| self.law.mean_stay(at))
            .fold(f64::INFINITY, f64::min);
        let since = clock - self.clock;
        let steps = (20.0 * since / shortest).ceil().max(1.0);
        for _ in 0..steps as usize {
            let before = self.probabilities.clone();
            let leaves = |at: usize| before[at] * since / steps / self.law.mean_stay(at);
            for to in places.clone() {
                let comes: f64 = places
                    .clone()
                    .map(|from| leaves(from) * self.law.step(from, to))
                    .sum();
                self.probabilities[to] += comes - leaves(to);
            }
        }
        self.clock = clock;
    }

    /// Somebody looked at the places that `looked_at` tells of, and saw it at one of them or at none, which
    /// happens with probability `overlooked` where it is there.
    pub(super) fn look(
        &mut self,
        looked_at: impl Fn(usize) -> bool,
        seen: Option<usize>,
        overlooked: f64,
    ) {
        for (at, probability) in self.probabilities.iter_mut().enumerate() {
            match seen {
                Some(place) => *probability = f64::from(at == place),
                None if looked_at(at) => *probability *= overlooked,
                None => {}
            }
        }
        let sum: f64 = self.probabilities.iter().sum();
        self.probabilities.iter_mut().for_each(|p| *p /= sum);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{BUSY, TIDY};
    use super::*;

    #[test]
    fn a_belief_without_looks_comes_to_how_often_a_thing_is_where() {
        for home in [TIDY, BUSY] {
            let law = home.law;
            let mut chance = Chance::new(3);
            let (mut at, mut clock) = (0, 0.0);
            let mut spent = vec![0.0; law.places()];
            for _ in 0..200_000 {
                let stay = law.stay(at, &mut chance);
                spent[at] += stay;
                clock += stay;
                at = law.next(at, &mut chance);
            }
            let mut belief = Belief::new(law);
            belief.pass(1e6);
            for (probability, spent) in belief.probabilities.iter().zip(spent) {
                assert!((probability - spent / clock).abs() < 0.01, "{belief:?}");
            }
        }
    }

    #[test]
    fn a_look_rules_out_or_settles() {
        let mut belief = Belief::new(TIDY.law);
        belief.pass(1e6);
        let before = belief.probabilities[0];
        belief.look(|at| at == 0, None, 0.2);
        let after = 0.2 * before / (0.2 * before + 1.0 - before);
        assert!((belief.probabilities[0] - after).abs() < 1e-9);
        belief.look(|_| true, Some(3), 0.2);
        assert_eq!((belief.likeliest(), belief.probabilities[3]), (3, 1.0));
    }
}
