//! Our own way to find groups: near and facing each other, weighed pair by pair, on the Delaunay
//! mesh. It sees pairs, which TG's triangles cannot, and it expects people to stand closer where it
//! is crowded, so one set of figures serves a sparse street and a full coffee break.

use super::super::limits::MOST_FIGURE;
use super::crowd::Crowd;
use super::mesh::Mesh;
use nalgebra::{Isometry2, Point2, Vector2};
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::collections::BTreeSet;

/// What speaks for and against two being in one group.
///
/// With the distance d in metres, the cosines c and c' of the angles between each one's heading and
/// the way to the other, and the crowd n, the bond of a pair is
///
/// `bond + facing (c + c') + turned_away max(0, -min(c, c')) - d^2 (spread + crowding n)`.
///
/// The crowd is the sum over everybody else of `exp(-r^2 / (2 crowd_radius^2))`, r being the distance
/// from the middle between the two. Groups are the partition into which the bonds within groups add
/// up to the most that joining and moving people one by one finds. Of a group of two, the bond must
/// also exceed `abreast n max(0, cos h)`, h being the angle between their headings: two in a crowd
/// who look the same way may be waiting for something, or just be there; where nobody else is, they are
/// together. With three or more, somebody faces the others.
///
/// The figures below serve all of the literature's recordings alike. They were chosen on three of
/// them (a synthetic one, a coffee break, a vending machine) and are sharp to about 3 % there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Facing {
    /// The bond of two at one spot, side by side.
    pub bond: f64,
    /// For facing: 2 of it for two face to face.
    pub facing: f64,
    /// Given back to a pair of which one looks away: headings are noisy, and who is turned away
    /// is not farther than away.
    pub turned_away: f64,
    /// Against two alone in a crowd who look the same way.
    pub abreast: f64,
    /// Against distance, 1/m^2.
    pub spread: f64,
    /// Against distance for each other person around, 1/m^2.
    pub crowding: f64,
    /// Who is around, m.
    pub crowd_radius: f64,
}

impl Facing {
    pub(super) fn is_valid(&self) -> bool {
        let not_negative = |x: f64| (0.0..=MOST_FIGURE).contains(&x);
        self.bond.abs() <= MOST_FIGURE
            && [
                self.facing,
                self.turned_away,
                self.abreast,
                self.spread,
                self.crowding,
            ]
            .into_iter()
            .all(not_negative)
            && CROWD_RADII.contains(&self.crowd_radius)
    }

    /// The bond of two, given how crowded it is around them.
    fn pair(&self, one: &Isometry2<f64>, other: &Isometry2<f64>, crowd: f64) -> f64 {
        let way = other.translation.vector - one.translation.vector;
        let squared = way.norm_squared();
        // Two on one spot face each other as they like.
        let ahead = way
            .try_normalize(1e-9)
            .unwrap_or_else(|| one.rotation * Vector2::x());
        let cosine = (one.rotation * Vector2::x()).dot(&ahead);
        let back = -(other.rotation * Vector2::x()).dot(&ahead);
        self.bond + self.facing * (cosine + back) + self.turned_away * (-cosine.min(back)).max(0.0)
            - squared * (self.spread + self.crowding * crowd)
    }

    /// The groups of people with finite poses, as indices in order.
    pub(super) fn groups(&self, people: &[Isometry2<f64>]) -> Vec<Vec<usize>> {
        let places: Vec<Point2<f64>> = people
            .iter()
            .map(|pose| pose.translation.vector.into())
            .collect();
        let mut beside = vec![Vec::new(); people.len()];
        for (a, b) in Mesh::new(&places).edges {
            beside[a].push(b);
            beside[b].push(a);
        }
        let scene = Scene {
            rules: self,
            people,
            places: &places,
            crowd: Crowd::new(&places, self.crowd_radius),
            bonds: RefCell::new(vec![Vec::new(); people.len()]),
            beside,
        };
        let mut partition = Partition::alone(people.len());
        // Each round raises the sum of the bonds, so there is an end; the count is a safeguard.
        for _ in 0..MOST_ROUNDS {
            let joined = partition.join(&scene);
            let moved = partition.move_people(&scene);
            if !joined && !moved {
                break;
            }
        }
        let mut groups = partition.groups();
        groups.retain(|group| match group[..] {
            [a, b] => {
                let same =
                    (people[a].rotation * Vector2::x()).dot(&(people[b].rotation * Vector2::x()));
                scene.bond(a, b) > self.abreast * scene.crowd(a, b) * same.max(0.0)
            }
            _ => true,
        });
        groups
    }
}

const MOST_ROUNDS: usize = 50;
/// Who is around is asked for each pair, metres.
const CROWD_RADII: std::ops::RangeInclusive<f64> = 1e-3..=10.0;
/// A gain below this is rounding.
const LEAST_GAIN: f64 = 1e-9;

/// The people, and who stands beside whom.
struct Scene<'a> {
    rules: &'a Facing,
    people: &'a [Isometry2<f64>],
    places: &'a [Point2<f64>],
    crowd: Crowd,
    /// Of the pairs asked for so far, by the smaller index: the greater ones in order, each with the bond.
    bonds: RefCell<Vec<Vec<(usize, f64)>>>,
    beside: Vec<Vec<usize>>,
}

impl Scene<'_> {
    fn bond(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (a.min(b), a.max(b));
        let mut known = self.bonds.borrow_mut();
        let known = &mut known[a];
        let place = match known.binary_search_by_key(&b, |(other, _)| *other) {
            Ok(place) => return known[place].1,
            Err(place) => place,
        };
        let crowd = self.crowd(a, b);
        let bond = self.rules.pair(&self.people[a], &self.people[b], crowd);
        known.insert(place, (b, bond));
        bond
    }

    /// How many others are around two people, the near ones counting for more.
    fn crowd(&self, a: usize, b: usize) -> f64 {
        let (from, to) = (self.places[a], self.places[b]);
        // Both are as far from the middle between them.
        let own = self.crowd.weight((to - from).norm_squared() / 4.0);
        let all = self.crowd.around(nalgebra::center(&from, &to));
        // All is a sum of which theirs are a part, but for rounding.
        (all - 2.0 * own).max(0.0)
    }

    /// The sum of the bonds between two sets.
    fn link(&self, some: &[usize], others: &[usize]) -> f64 {
        let pairs = some.iter().flat_map(|a| others.iter().map(|b| (*a, *b)));
        pairs
            .filter(|(a, b)| a != b)
            .map(|(a, b)| self.bond(a, b))
            .sum()
    }
}

/// Everybody in one set; sets are called after a number below the count of people.
struct Partition {
    set_of: Vec<usize>,
    sets: Vec<Vec<usize>>,
}

impl Partition {
    fn alone(count: usize) -> Self {
        Self {
            set_of: (0..count).collect(),
            sets: (0..count).map(|person| vec![person]).collect(),
        }
    }

    /// Joins neighbouring sets as long as that pays, the pair that it pays most for first.
    fn join(&mut self, scene: &Scene) -> bool {
        let mut joined = false;
        let mut beside: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); self.sets.len()];
        for (person, others) in scene.beside.iter().enumerate() {
            let set = self.set_of[person];
            let sets = others.iter().map(|other| self.set_of[*other]);
            beside[set].extend(sets.filter(|other| *other != set));
        }
        let mut offers: BTreeSet<Offer> = BTreeSet::new();
        let mut open: Vec<BTreeSet<Offer>> = vec![BTreeSet::new(); self.sets.len()];
        let pairs = |set: usize, others: &BTreeSet<usize>| -> Vec<(usize, usize)> {
            others.iter().map(|b| (set.min(*b), set.max(*b))).collect()
        };
        let mut fresh: Vec<(usize, usize)> = (0..self.sets.len())
            .flat_map(|set| pairs(set, &beside[set]))
            .collect();
        fresh.sort_unstable();
        fresh.dedup();
        loop {
            for (a, b) in fresh.drain(..) {
                let gain = scene.link(&self.sets[a], &self.sets[b]);
                if gain > LEAST_GAIN {
                    let offer = Offer::new(gain, a, b);
                    offers.insert(offer);
                    open[a].insert(offer);
                    open[b].insert(offer);
                }
            }
            let Some(Offer { a, b, .. }) = offers.pop_first() else {
                return joined;
            };
            joined = true;
            for offer in std::mem::take(&mut open[a])
                .into_iter()
                .chain(std::mem::take(&mut open[b]))
            {
                offers.remove(&offer);
                open[offer.a].remove(&offer);
                open[offer.b].remove(&offer);
            }
            let members = std::mem::take(&mut self.sets[b]);
            for member in &members {
                self.set_of[*member] = a;
            }
            self.sets[a].extend(members);
            for other in std::mem::take(&mut beside[b]) {
                beside[other].remove(&b);
                if other != a {
                    beside[other].insert(a);
                    beside[a].insert(other);
                }
            }
            fresh = pairs(a, &beside[a]);
        }
    }

    /// Moves people one by one to a neighbour's set, or away, where that pays.
    fn move_people(&mut self, scene: &Scene) -> bool {
        let mut moved = false;
        let empty = |set: &usize| self.sets[*set].is_empty();
        let mut free: BTreeSet<usize> = (0..self.sets.len()).filter(empty).collect();
        for person in 0..self.set_of.len() {
            let own = self.set_of[person];
            if self.sets[own].len() < 2 {
                continue;
            }
            let stay = scene.link(&[person], &self.sets[own]);
            let others: BTreeSet<usize> = scene.beside[person]
                .iter()
                .map(|other| self.set_of[*other])
                .filter(|other| *other != own)
                .collect();
            let mut best = (0.0, None);
            for other in others {
                let link = scene.link(&[person], &self.sets[other]);
                if link > best.0 {
                    best = (link, Some(other));
                }
            }
            if best.0 - stay <= LEAST_GAIN {
                continue;
            }
            // Of a set of two or more, whoever leaves finds some set empty: there are as many as people.
            let Some(target) = best.1.or_else(|| free.first().copied()) else {
                continue;
            };
            free.remove(&target);
            self.sets[own].retain(|member| *member != person);
            self.sets[target].push(person);
            self.set_of[person] = target;
            moved = true;
        }
        moved
    }

    fn groups(self) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = self
            .sets
            .into_iter()
            .filter(|set| set.len() > 1)
            .map(|mut set| {
                set.sort_unstable();
                set
            })
            .collect();
        groups.sort_unstable();
        groups
    }
}

/// Two sets that would gain by joining; the greatest gain comes first, then the smallest numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Offer {
    rank: std::cmp::Reverse<u64>,
    a: usize,
    b: usize,
}

impl Offer {
    fn new(gain: f64, a: usize, b: usize) -> Self {
        // The bits of positive numbers are in the order of the numbers.
        let rank = std::cmp::Reverse(gain.to_bits());
        Self { rank, a, b }
    }
}

impl Default for Facing {
    fn default() -> Self {
        Self {
            bond: 1.491,
            facing: 0.985,
            turned_away: 0.921,
            abreast: 0.29,
            spread: 0.366,
            crowding: 0.424,
            crowd_radius: 2.0,
        }
    }
}
