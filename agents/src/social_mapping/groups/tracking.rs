//! Groups over time: who leaves and joins changes a group's members, not its name. This file
//! guarantees that no name is given twice, and that names depend on what was seen alone.

use std::collections::{BTreeMap, BTreeSet};

/// Groups that last.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupTracker {
    patience: f64,
    next: u64,
    known: BTreeMap<u64, Known>,
}

#[derive(Debug, Clone, PartialEq)]
struct Known {
    members: BTreeSet<String>,
    seen: f64,
}

impl GroupTracker {
    /// Nobody seen yet. A group that is not found for `patience` seconds is over.
    pub fn new(patience: f64) -> Self {
        Self {
            patience,
            next: 1,
            known: BTreeMap::new(),
        }
    }

    /// Goes on from groups that another tracker had named, seen at `now` seconds.
    pub fn resume(&mut self, now: f64, groups: impl IntoIterator<Item = (u64, BTreeSet<String>)>) {
        for (number, members) in groups {
            self.next = self.next.max(number.saturating_add(1));
            self.known.insert(number, Known { members, seen: now });
        }
    }

    /// The groups that last at `now` (seconds, any epoch), by number, given those found in this
    /// moment.
    ///
    /// A group found is the known one with which it shares most members, at least half of the
    /// smaller of the two; of equals the elder. What matches none has a new number. A known group
    /// that was not found lasts for the patience with the members it had, less those who are in
    /// another group now, as long as two are left.
    pub fn update(
        &mut self,
        now: f64,
        found: &[BTreeSet<String>],
    ) -> BTreeMap<u64, BTreeSet<String>> {
        let mut pairs: Vec<(usize, u64, usize)> = Vec::new();
        for (at, group) in found.iter().enumerate() {
            for (number, known) in &self.known {
                let common = group.intersection(&known.members).count();
                if common > 0 && 2 * common >= group.len().min(known.members.len()) {
                    pairs.push((common, *number, at));
                }
            }
        }
        pairs.sort_by_key(|(common, number, at)| (usize::MAX - common, *number, *at));
        let mut named: BTreeMap<usize, u64> = BTreeMap::new();
        let mut used: BTreeSet<u64> = BTreeSet::new();
        for (_, number, at) in pairs {
            if !used.contains(&number) && !named.contains_key(&at) {
                named.insert(at, number);
                used.insert(number);
            }
        }
        let taken: BTreeSet<&String> = found.iter().flatten().collect();
        let patience = self.patience;
        self.known.retain(|number, known| {
            if used.contains(number) {
                return true;
            }
            known.members.retain(|member| !taken.contains(member));
            // A time before the last is another epoch, in which nothing lasts.
            known.members.len() > 1 && (0.0..=patience).contains(&(now - known.seen))
        });
        for (at, members) in found.iter().enumerate() {
            let number = named.get(&at).copied().unwrap_or_else(|| {
                self.next += 1;
                self.next - 1
            });
            let members = members.clone();
            self.known.insert(number, Known { members, seen: now });
        }
        self.known
            .iter()
            .map(|(number, known)| (*number, known.members.clone()))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(names: &str) -> BTreeSet<String> {
        names.chars().map(String::from).collect()
    }

    fn show(groups: &BTreeMap<u64, BTreeSet<String>>) -> String {
        let one = |(number, members): (&u64, &BTreeSet<String>)| {
            let members: String = members.iter().map(String::as_str).collect();
            format!("{number}:{members}")
        };
        groups.iter().map(one).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn a_group_keeps_its_number_while_people_come_and_go() {
        let mut tracker = GroupTracker::new(2.0);
        let mut step = |now, found: &[&str]| {
            let found: Vec<_> = found.iter().map(|names| set(names)).collect();
            show(&tracker.update(now, &found))
        };
        assert_eq!(step(0.0, &["abc", "de"]), "1:abc 2:de");
        assert_eq!(step(1.0, &["bcf", "de"]), "1:bcf 2:de");
        // Where it splits, the larger part is the group.
        assert_eq!(step(2.0, &["de", "bc", "fg"]), "1:bc 2:de 3:fg");
        // Where two merge, of equal parts the elder goes on.
        assert_eq!(step(3.0, &["bcde"]), "1:bcde 3:fg");
        // Not seen for a moment is not over; for longer it is.
        assert_eq!(step(4.0, &[]), "1:bcde 3:fg");
        assert_eq!(step(5.5, &[]), "");
        assert_eq!(step(6.0, &["bc"]), "4:bc");
    }

    #[test]
    fn a_tracker_goes_on_where_another_ended() {
        let mut tracker = GroupTracker::new(2.0);
        tracker.resume(10.0, [(7, set("ab"))]);
        assert_eq!(show(&tracker.update(10.5, &[set("abc")])), "7:abc");
        assert_eq!(show(&tracker.update(0.0, &[set("xy")])), "8:xy");
    }
}
