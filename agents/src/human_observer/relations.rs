//! Relations between people, objects and the robot, with hysteresis in space and time. A relation
//! that holds and does not hold within noise of its border keeps the state it had.

use super::config::Thresholds;
use super::scene::{Object, Scene, Surroundings, TrackedPerson};
use crate::perception::{distance_to_polygon, polygon};
use dsr::Time;
use std::collections::{BTreeMap, BTreeSet};

/// Whether the condition to begin holds, and whether the weaker one to go on does.
#[derive(Debug, Clone, Copy)]
struct Condition {
    begins: bool,
    goes_on: bool,
}

impl Condition {
    fn and(self, other: Self) -> Self {
        Self {
            begins: self.begins && other.begins,
            goes_on: self.goes_on && other.goes_on,
        }
    }
}

/// One kind of relation over keys of type K.
#[derive(Debug)]
struct Relation<K> {
    /// How long the condition must hold before the relation begins, s.
    begin_time: f64,
    /// How long it must fail before the relation ends, s.
    end_time: f64,
    /// For each key that holds or may soon: whether it holds, and since when its condition says
    /// otherwise.
    states: BTreeMap<K, (bool, Option<Time>)>,
}

impl<K: Ord + Clone> Relation<K> {
    fn new(begin_time: f64, end_time: f64) -> Self {
        Self {
            begin_time,
            end_time,
            states: BTreeMap::new(),
        }
    }

    /// Brings the relation to `now`; keys not in `conditions` fail theirs.
    fn update(&mut self, now: Time, conditions: &BTreeMap<K, Condition>) {
        for key in conditions.keys() {
            if !self.states.contains_key(key) {
                self.states.insert(key.clone(), (false, None));
            }
        }
        let (begin_time, end_time) = (self.begin_time, self.end_time);
        self.states.retain(|key, (holds, since)| {
            let condition = conditions.get(key).copied().unwrap_or(Condition {
                begins: false,
                goes_on: false,
            });
            let says = if *holds {
                condition.goes_on
            } else {
                condition.begins
            };
            if says == *holds {
                *since = None;
            } else {
                let start = *since.get_or_insert(now);
                if now.since(start) >= if *holds { end_time } else { begin_time } {
                    (*holds, *since) = (!*holds, None);
                }
            }
            *holds || since.is_some()
        });
    }

    /// Forgets the keys for which `keep` is false.
    fn retain(&mut self, keep: impl Fn(&K) -> bool) {
        self.states.retain(|key, _| keep(key));
    }

    fn holding(&self) -> Vec<K> {
        self.states
            .iter()
            .filter(|(_, s)| s.0)
            .map(|(key, _)| key.clone())
            .collect()
    }
}

/// All relations of people, and what they were.
#[derive(Debug)]
pub(super) struct Relations {
    thresholds: Thresholds,
    rooms: BTreeMap<u64, String>,
    near: Relation<u64>,
    front: Relation<u64>,
    pairs: Relation<(u64, u64)>,
    objects: Relation<(u64, String)>,
}

impl Relations {
    pub(super) fn new(thresholds: Thresholds) -> Self {
        Self {
            rooms: BTreeMap::new(),
            near: Relation::new(0.0, 0.0),
            front: Relation::new(0.0, thresholds.front_end),
            pairs: Relation::new(thresholds.interaction_begin, thresholds.interaction_end),
            objects: Relation::new(thresholds.interaction_begin, thresholds.interaction_end),
            thresholds,
        }
    }

    /// The scene of `people` (in order of id) at `now`.
    pub(super) fn relate(
        &mut self,
        now: Time,
        people: Vec<TrackedPerson>,
        surroundings: &Surroundings,
    ) -> Scene {
        let ids: BTreeSet<u64> = people.iter().map(|p| p.id).collect();
        self.rooms = people
            .iter()
            .filter_map(|person| {
                let current = self.rooms.get(&person.id).map(String::as_str);
                let margin = self.thresholds.room_margin;
                let room = surroundings
                    .plan
                    .room_after(current, person.position(), margin)?;
                Some((person.id, room.to_owned()))
            })
            .collect();
        let (near, front) = self.robot_conditions(&people, surroundings);
        self.near.update(now, &near);
        self.front.update(now, &front);
        let pairs = self.pair_conditions(&people);
        self.pairs.update(now, &pairs);
        let objects = self.object_conditions(&people, surroundings);
        self.objects.update(now, &objects);

        // Whoever is gone ends every relation at once: an edge needs both its ends.
        self.near.retain(|id| ids.contains(id));
        self.front.retain(|id| ids.contains(id));
        self.pairs
            .retain(|(a, b)| ids.contains(a) && ids.contains(b));
        self.objects.retain(|(id, object)| {
            ids.contains(id) && surroundings.objects.iter().any(|o| o.name == *object)
        });
        Scene {
            in_room: self.rooms.clone(),
            near_robot: self.near.holding(),
            interacting: self.pairs.holding(),
            interacting_with: self.objects.holding(),
            front: self.front.holding(),
            people,
        }
    }

    fn robot_conditions(
        &self,
        people: &[TrackedPerson],
        surroundings: &Surroundings,
    ) -> (BTreeMap<u64, Condition>, BTreeMap<u64, Condition>) {
        let (mut near, mut front) = (BTreeMap::new(), BTreeMap::new());
        let Some(robot) = &surroundings.world_from_robot else {
            return (near, front);
        };
        let robot = nalgebra::Point2::from(robot.translation.vector);
        let limits = &self.thresholds;
        for person in people {
            let distance = (robot - person.position()).norm();
            let is_near = within(distance, limits.near_enter, limits.near_leave);
            if is_near.goes_on {
                near.insert(person.id, is_near);
                front.insert(person.id, is_near.and(self.facing(person.angle_to(robot))));
            }
        }
        (near, front)
    }

    fn pair_conditions(&self, people: &[TrackedPerson]) -> BTreeMap<(u64, u64), Condition> {
        let limits = &self.thresholds;
        let mut conditions = BTreeMap::new();
        for (a, b) in close_pairs(people, limits.pair_leave) {
            let distance = (a.position() - b.position()).norm();
            let condition = within(distance, limits.pair_enter, limits.pair_leave)
                .and(self.facing(a.angle_to(b.position())))
                .and(self.facing(b.angle_to(a.position())));
            if condition.goes_on {
                conditions.insert((a.id.min(b.id), a.id.max(b.id)), condition);
            }
        }
        conditions
    }

    fn object_conditions(
        &self,
        people: &[TrackedPerson],
        surroundings: &Surroundings,
    ) -> BTreeMap<(u64, String), Condition> {
        let mut conditions = BTreeMap::new();
        for object in &surroundings.objects {
            let space = polygon(&object.space);
            for person in people {
                let condition = self
                    .reach(person, object, space.as_ref())
                    .and(self.facing(angle_to_object(person, object)));
                if condition.goes_on {
                    conditions.insert((person.id, object.name.clone()), condition);
                }
            }
        }
        conditions
    }

    /// Whether the person is in the object's affordance space or near its footprint.
    fn reach(
        &self,
        person: &TrackedPerson,
        object: &Object,
        space: Option<&geo::Polygon<f64>>,
    ) -> Condition {
        let limits = &self.thresholds;
        let position = person.position();
        let distance = (object.nearest(position) - position).norm();
        let near = within(distance, limits.object_enter, limits.object_leave);
        let Some(space) = space else { return near };
        let outside = distance_to_polygon(position, space);
        Condition {
            begins: near.begins || outside <= 0.0,
            goes_on: near.goes_on || outside <= limits.space_margin,
        }
    }

    fn facing(&self, angle: f64) -> Condition {
        within(
            angle,
            self.thresholds.facing_enter,
            self.thresholds.facing_leave,
        )
    }
}

fn within(value: f64, enter: f64, leave: f64) -> Condition {
    Condition {
        begins: value < enter,
        goes_on: value <= leave.max(enter),
    }
}

/// How far the person's heading is from the object: from its centre or the nearest point of its
/// footprint, whichever is less, because nobody looks at the middle of a long table. 0 for somebody
/// on it, who sits or lies there.
fn angle_to_object(person: &TrackedPerson, object: &Object) -> f64 {
    let centre = nalgebra::Point2::from(object.world_from_object.translation.vector);
    let nearest = object.nearest(person.position());
    person.angle_to(centre).min(person.angle_to(nearest))
}

/// Every pair of people at most `distance` apart along x, by sweeping over x: n log n plus the pairs.
fn close_pairs(
    people: &[TrackedPerson],
    distance: f64,
) -> impl Iterator<Item = (&TrackedPerson, &TrackedPerson)> {
    let mut ordered: Vec<&TrackedPerson> = people.iter().collect();
    ordered.sort_by(|a, b| {
        a.position()
            .x
            .total_cmp(&b.position().x)
            .then(a.id.cmp(&b.id))
    });
    (0..ordered.len()).flat_map(move |i| {
        let first = ordered[i];
        let limit = first.position().x + distance;
        ordered[i + 1..]
            .iter()
            .take_while(|p| p.position().x <= limit)
            .map(|&second| (first, second))
            .collect::<Vec<_>>()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_relation_keeps_its_state_between_the_thresholds_and_waits_its_time() {
        let mut relation = Relation::new(1.0, 0.5);
        let mut at = |t: f64, value: f64| {
            let condition = within(value, 2.0, 2.3);
            relation.update(Time::from_seconds(t), &BTreeMap::from([(7u64, condition)]));
            relation.holding() == [7]
        };
        assert!(!at(0.0, 1.9) && !at(0.9, 1.9), "not for long enough yet");
        assert!(
            !at(0.95, 2.1) && !at(1.0, 1.9),
            "interrupted: the wait starts again"
        );
        assert!(!at(1.9, 1.9) && at(2.0, 1.9));
        assert!(
            at(2.1, 2.2) && at(9.0, 2.2),
            "between the thresholds it stays"
        );
        assert!(at(9.1, 2.4) && at(9.5, 2.4) && !at(9.6, 2.4));
        assert!(!at(9.7, 2.2), "between the thresholds it stays away");
    }

    #[test]
    fn a_key_that_is_no_longer_mentioned_fails_its_condition() {
        let mut relation = Relation::new(0.0, 0.0);
        relation.update(
            Time::default(),
            &BTreeMap::from([(1u64, within(0.0, 1.0, 1.0))]),
        );
        assert_eq!(relation.holding(), [1]);
        relation.update(Time::default(), &BTreeMap::new());
        assert!(relation.holding().is_empty());
    }
}
