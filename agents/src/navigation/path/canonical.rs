//! Which neighbours of a node a search has to look at, where everything around the node costs the
//! same: those that it reaches no worse without the node are left to the others (canonical orders;
//! Harabor and Grastien, "Online Graph Pruning for Pathfinding on Grid Maps", 2011; Sturtevant and
//! Rabin, "Canonical Orderings on Grids", 2016). This file guarantees that a cheapest path to each
//! node remains.
//!
//! Why one remains: let a node n be cheapest by way of x, reached from p, and let n be left out there.
//! Then a way from p round x is as cheap, and since only a straight step before a diagonal one gives
//! way to an equal, that is the diagonal step first, to x', and then the straight one. At x' nothing
//! equal takes n away, for n lies straight ahead of it. So x' offers n at its least cost.

use super::lattice::{BESIDE, STEPS};
use std::f64::consts::SQRT_2;
use std::sync::LazyLock;

/// The direction of a node that was reached from nowhere.
pub(super) const START: u8 = 8;

/// Sets of directions, a bit for each of [`STEPS`]: by the direction in which a node was reached, and
/// the set of its free neighbours, those to look at.
pub(super) type Offers = [[u8; 256]; 9];

static OFFERS: LazyLock<Offers> = LazyLock::new(|| {
    let mut offers = [[0; 256]; 9];
    for (reached_by, offers) in offers.iter_mut().enumerate() {
        for (free, offer) in (0..=u8::MAX).zip(offers) {
            *offer = (0..STEPS.len())
                .filter(|&k| allowed(free, k) && !better_without(reached_by, free, k))
                .fold(0, |set, k| set | 1 << k);
        }
    }
    offers
});

/// The table, made when it is first asked for.
pub(super) fn offers() -> &'static Offers {
    &OFFERS
}

/// Whether a node whose free neighbours are `free` may be left in direction `k`.
fn allowed(free: u8, k: usize) -> bool {
    let is_free = |k: usize| free >> k & 1 == 1;
    is_free(k) && (k < 4 || BESIDE[k - 4].iter().all(|&side| is_free(side)))
}

fn length(step: (isize, isize)) -> f64 {
    if step.0 != 0 && step.1 != 0 {
        SQRT_2
    } else {
        1.0
    }
}

/// Whether the node before leads to neighbour `k` round the node no worse than over it, as the order
/// of directions wants it.
fn better_without(reached_by: usize, free: u8, k: usize) -> bool {
    let Some(&came) = STEPS.get(reached_by) else {
        return false;
    };
    let over = length(came) + length(STEPS[k]);
    let round = shortest_round((-came.0, -came.1), STEPS[k], free);
    round < over - 1e-9 || round < over + 1e-9 && reached_by < 4 && k >= 4
}

/// The shortest way between two neighbours of a node that stays among its neighbours.
fn shortest_round(from: (isize, isize), to: (isize, isize), free: u8) -> f64 {
    let is_free = |place: (isize, isize)| {
        let at = STEPS.iter().position(|&step| step == place);
        place == (0, 0) || at.is_some_and(|k| free >> k & 1 == 1)
    };
    let mut least = STEPS.map(|place| if place == from { 0.0 } else { f64::INFINITY });
    for _ in STEPS {
        for (a, &here) in STEPS.iter().enumerate() {
            for (b, &there) in STEPS.iter().enumerate() {
                let step = (there.0 - here.0, there.1 - here.1);
                let joins = step.0.abs() <= 1
                    && step.1.abs() <= 1
                    && [here, there, (there.0, here.1), (here.0, there.1)]
                        .into_iter()
                        .all(is_free);
                if joins {
                    least[b] = least[b].min(least[a] + length(step));
                }
            }
        }
    }
    let at = STEPS.iter().position(|&step| step == to);
    at.map_or(f64::INFINITY, |k| least[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a picture of a node's neighbours and its own place, how many are offered where it was
    /// reached by a step in direction `reached_by`.
    fn offered(reached_by: u8, free: u8) -> u32 {
        offers()[usize::from(reached_by)][usize::from(free)].count_ones()
    }

    #[test]
    fn in_the_open_a_straight_step_offers_one_neighbour_and_a_diagonal_one_three() {
        assert!((0..4).all(|step| offered(step, u8::MAX) == 1));
        assert!((4..8).all(|step| offered(step, u8::MAX) == 3));
        assert_eq!(offered(START, u8::MAX), 8);
    }

    #[test]
    fn beside_the_end_of_a_wall_what_lies_behind_it_is_offered() {
        // Eastwards, with a blocked neighbour to the south-west: south is reached over the node.
        let free = !(1u8 << 7);
        let south_and_ahead = 1 << 0 | 1 << 3 | 1 << 6;
        assert_eq!(offers()[0][usize::from(free)], south_and_ahead);
    }
}
