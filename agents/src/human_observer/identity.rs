//! Who is who: when a track becomes a person, when somebody lost is found again, and when two people
//! are one. A number is handed on or dropped here, never given a second time.

use super::appearance::{RUNNING, SURE};
use super::{Observer, Track};
use crate::perception::FloorPlan;
use dsr::Time;
use std::collections::BTreeMap;

/// That two people may be one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Suspicion {
    /// Since when they are too close.
    since: Time,
    /// How many images showed one of them, and never both.
    looks: u32,
}

impl Observer {
    /// Makes people of the tracks with evidence enough. Somebody lost nearby is taken to be found
    /// again, the nearest first; else it is somebody new.
    pub(super) fn confirm(&mut self, plan: &FloorPlan) {
        let ready: Vec<usize> = (0..self.tracks.len())
            .filter(|&i| self.tracks[i].id.is_none() && self.tracks[i].is_confirmable(&self.config))
            .collect();
        let mut found = Vec::new();
        for newcomer in ready {
            let lost = self.lost_near(newcomer, plan);
            if let Some(lost) = lost {
                let other = self.tracks[lost].clone();
                self.tracks[newcomer].take_identity(&other);
                self.tracks[lost].id = None;
                found.push(lost);
            } else if let Some(id) = self.known_by_looks(newcomer) {
                self.tracks[newcomer].id = Some(id);
            } else {
                self.tracks[newcomer].id = Some(self.next_id);
                self.next_id += 1;
            }
        }
        found.sort_unstable();
        for index in found.into_iter().rev() {
            self.tracks.remove(index);
        }
    }

    /// Somebody whose track is over and whose looks are the newcomer's.
    fn known_by_looks(&mut self, newcomer: usize) -> Option<u64> {
        let new = &self.tracks[newcomer];
        let (looks, place) = (new.appearance.as_ref()?, new.position());
        self.gallery
            .find(looks, new.born, place, &self.config.appearance)
    }

    /// Somebody not seen since the newcomer was first seen, who can have got there.
    fn lost_near(&self, newcomer: usize, plan: &FloorPlan) -> Option<usize> {
        let config = &self.config;
        let new = &self.tracks[newcomer];
        let candidates = self.tracks.iter().enumerate().filter_map(|(index, track)| {
            let lost = track.id.is_some() && track.last_seen < new.born;
            let gap = new.born.since(track.last_seen);
            // Whoever cameras look for in vain did not get far in their views.
            let unwatched = (gap - track.watched()).max(0.0);
            let reach = config.handover_distance + config.handover_speed * unwatched;
            let distance = track.distance_to(new.position());
            // Where one leaves and another comes by the same door, they face opposite ways.
            let turned = gap < config.remembered && track.faces_away_from(new);
            let near = distance <= reach.min(config.handover_limit)
                && !turned
                && !plan.wall_between(track.position(), new.position());
            let unlike = track.unlike(new.appearance.as_ref(), config);
            // Who looks so much like it may have gone round the corner.
            let known = unlike <= -SURE && distance <= RUNNING * gap;
            let found = lost && unlike <= 0.0 && (near || known);
            found.then_some((unlike, distance, track.id, index))
        });
        // The likest, without looks the nearest.
        let best = candidates.min_by(|a, b| {
            let by_place = a.1.total_cmp(&b.1).then(a.2.cmp(&b.2));
            a.0.total_cmp(&b.0).then(by_place)
        });
        best.map(|(.., index)| index)
    }

    /// Merges people who stay closer than bodies can and are never seen apart in one image: the
    /// same person under two numbers. The older number stays.
    pub(super) fn merge(&mut self, clock: Time) {
        self.suspects = self.close_people(clock);
        let (time, looks) = (self.config.merge_time, self.config.confirmation_hits);
        let same: Vec<(u64, u64)> = self
            .suspects
            .iter()
            .filter(|(_, s)| clock.since(s.since) >= time && s.looks >= looks)
            .map(|(pair, _)| *pair)
            .collect();
        for (older, younger) in same {
            let index = |id| self.tracks.iter().position(|t| t.id == Some(id));
            let (Some(a), Some(b)) = (index(older), index(younger)) else {
                continue;
            };
            // The state seen last is the better one.
            let newer = self.tracks[a].last_seen >= self.tracks[b].last_seen;
            let (kept, dropped) = if newer { (a, b) } else { (b, a) };
            let other = self.tracks[dropped].clone();
            self.tracks[kept].take_identity(&other);
            self.tracks[kept].id = Some(older);
            self.tracks.remove(dropped);
        }
    }

    /// The pairs of people that are too close, by the smaller number first. A pair that one image
    /// showed apart is beyond suspicion, and while nobody is seen nothing is learnt.
    fn close_people(&self, clock: Time) -> BTreeMap<(u64, u64), Suspicion> {
        let mut people: Vec<(u64, &Track)> = self
            .tracks
            .iter()
            .filter(|t| t.is_present(&self.config))
            .filter_map(|t| Some((t.id?, t)))
            .collect();
        people.sort_by(|a, b| {
            a.1.position()
                .x
                .total_cmp(&b.1.position().x)
                .then(a.0.cmp(&b.0))
        });
        let limit = self.config.merge_distance;
        let mut close = BTreeMap::new();
        for (i, (first, a)) in people.iter().enumerate() {
            let reach = a.position().x + limit;
            for (second, b) in people[i + 1..]
                .iter()
                .take_while(|p| p.1.position().x <= reach)
            {
                let seen = [a, b]
                    .into_iter()
                    .filter(|t| t.last_frame == self.frame)
                    .count();
                let unlike = a.unlike(b.appearance.as_ref(), &self.config) > 0.0;
                if seen == 2 || unlike || (a.position() - b.position()).norm() > limit {
                    continue;
                }
                let pair = (*first.min(second), *first.max(second));
                let mut suspicion = self.suspects.get(&pair).copied().unwrap_or(Suspicion {
                    since: clock,
                    looks: 0,
                });
                suspicion.looks += u32::from(seen == 1);
                if suspicion.looks > 0 {
                    close.insert(pair, suspicion);
                }
            }
        }
        close
    }
}
