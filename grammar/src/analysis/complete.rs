//! Drafts that meet conditions.
//!
//! Guarantee: what is said to be known of a condition in a draft stays so however much is drawn yet.

use super::draft::{Draft, Places};
use super::values::{Asked, Term, Unknown};
use crate::{Condition, PatternNode, Types};
use std::cell::Cell;
use std::rc::Rc;

/// How many ways to meet a condition are followed.
const WAYS: usize = 16;
/// How many formulas are looked at for one graph, each as often as there are ways to come to it.
const FORMULAS: usize = 500;
/// How many parts of formulas are held against a draft for one graph; what is asked after that is not known.
const PARTS: usize = 20_000;

/// How much of a draft is taken as it is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Drawn {
    /// What is drawn.
    Parts,
    /// The nodes and links are all that there are.
    Links,
    /// There is nothing else, and no other values.
    Whole,
}

/// Finds ways to make conditions come out one way or the other.
pub(super) struct Ways<'t> {
    types: &'t Types,
    /// What makes a formula come out should be its only reason, so that little would change it.
    fragile: bool,
    /// So many formulas are still looked at.
    left: Cell<usize>,
    /// So many parts are still held against drafts.
    parts: Cell<usize>,
}

impl<'t> Ways<'t> {
    pub(super) fn new(types: &'t Types, fragile: bool) -> Self {
        Self {
            types,
            fragile,
            left: Cell::new(FORMULAS),
            parts: Cell::new(PARTS),
        }
    }

    /// How many formulas were looked at until now, those that were held against drafts counted by their parts.
    pub(super) fn looked_at(&self) -> u64 {
        let parts = (PARTS - self.parts.get()) / (PARTS / FORMULAS);
        (FORMULAS - self.left.get() + parts) as u64
    }

    /// Ways to make a condition come out as `holds`, the smallest first.
    pub(super) fn to(
        &self,
        draft: Draft,
        places: &Places,
        condition: &Condition,
        holds: bool,
    ) -> Vec<Draft> {
        let Some(left) = self.left.get().checked_sub(1) else {
            return vec![draft];
        };
        self.left.set(left);
        if !self.fragile
            && let Some(known) = self.known(&draft, places, condition, Drawn::Parts)
        {
            return Vec::from_iter((known == holds).then_some(draft));
        }
        let mut found = self.all(draft, places, condition, holds);
        found.sort_by_key(|draft| (draft.nodes.len(), draft.links.len()));
        found.dedup();
        found.truncate(WAYS);
        found
    }

    fn all(&self, draft: Draft, places: &Places, condition: &Condition, holds: bool) -> Vec<Draft> {
        match (condition, holds) {
            (Condition::Edge { label, from, to }, _) => {
                let (Some(from), Some(to)) = (places.get(from), places.get(to)) else {
                    return vec![draft];
                };
                draft.with_link((from, Rc::from(&**label), to), holds)
            }
            (Condition::Same(a, b), _) => {
                let same = places.get(a) == places.get(b);
                if same == holds {
                    vec![draft]
                } else {
                    Vec::new()
                }
            }
            (
                Condition::Compare {
                    operator,
                    left,
                    right,
                },
                _,
            ) => {
                let sides = [left, right].map(|side| Term::of(side, places));
                let [Some(left), Some(right)] = sides else {
                    return vec![draft];
                };
                let with = draft.with_asked(*operator, [left, right], holds);
                with.into_iter().collect()
            }
            (Condition::Not(inner), _) => self.to(draft, places, inner, !holds),
            (Condition::And(all), true) | (Condition::Or(all), false) => {
                let all = all.iter().map(|condition| (condition, holds));
                self.every(draft, places, all)
            }
            (Condition::Or(any), true) | (Condition::And(any), false) => {
                let mut found = Vec::new();
                for one in any {
                    found.extend(self.to(draft.clone(), places, one, holds));
                    if !self.fragile {
                        continue;
                    }
                    // As the only one: so that without it the whole comes out the other way.
                    let only = any.iter().map(|c| (c, (c == one) == holds));
                    found.extend(self.every(draft.clone(), places, only));
                }
                found
            }
            (
                Condition::When {
                    condition,
                    consequence,
                },
                true,
            ) => {
                let (condition, consequence) = (&**condition, &**consequence);
                let mut found = self.to(draft.clone(), places, condition, false);
                found.extend(self.to(draft.clone(), places, consequence, true));
                for both in [true, false].into_iter().filter(|_| self.fragile) {
                    let both = [(condition, both), (consequence, both)];
                    found.extend(self.every(draft.clone(), places, both.into_iter()));
                }
                found
            }
            (
                Condition::When {
                    condition,
                    consequence,
                },
                false,
            ) => {
                let broken = [(&**condition, true), (&**consequence, false)];
                self.every(draft, places, broken.into_iter())
            }
            (Condition::Exists { variables, body }, true)
            | (Condition::Forall { variables, body }, false) => {
                self.by_some(draft, places, (variables, body), holds)
            }
            (Condition::Exists { variables, body }, false)
            | (Condition::Forall { variables, body }, true) => {
                self.by_each(draft, places, (variables, body), holds)
            }
        }
    }

    /// A formula holds for some nodes; and for these alone, so that without them it comes out the other way.
    fn by_some(
        &self,
        draft: Draft,
        places: &Places,
        (variables, body): (&[PatternNode], &Condition),
        holds: bool,
    ) -> Vec<Draft> {
        let mut found = Vec::new();
        for (draft, chosen) in self.chosen(draft, places, variables, true) {
            for draft in self.to(draft, &chosen, body, holds) {
                found.push(draft.clone());
                if !self.fragile {
                    continue;
                }
                let mut only = vec![draft.clone()];
                for (_, other) in self.chosen(draft, places, variables, false) {
                    if !other.nodes().eq(chosen.nodes()) {
                        let more = only.into_iter();
                        let more = more.flat_map(|d| self.to(d, &other, body, !holds));
                        only = more.take(WAYS).collect();
                    }
                }
                found.extend(only);
            }
        }
        found
    }

    /// A formula holds for all nodes: as it is, by all that are there, and so that it hinges on some of them.
    fn by_each(
        &self,
        draft: Draft,
        places: &Places,
        (variables, body): (&[PatternNode], &Condition),
        holds: bool,
    ) -> Vec<Draft> {
        let mut found = vec![draft.clone()];
        // As little as can be is changed for those of which it does not come out so.
        let mut mended = vec![draft.clone()];
        for (_, places) in self.chosen(draft.clone(), places, variables, false) {
            let more = mended.into_iter().flat_map(|draft| {
                if self.known(&draft, &places, body, Drawn::Links) == Some(holds) {
                    vec![draft]
                } else {
                    self.to(draft, &places, body, holds)
                }
            });
            mended = more.take(WAYS).collect();
        }
        found.extend(mended);
        if !self.fragile {
            return found;
        }
        let mut by_all = vec![draft.clone()];
        for (_, places) in self.chosen(draft.clone(), places, variables, false) {
            let more = by_all.into_iter();
            let more = more.flat_map(|draft| self.to(draft, &places, body, holds));
            by_all = more.take(WAYS).collect();
        }
        found.extend(by_all);
        for (draft, places) in self.chosen(draft, places, variables, true) {
            found.extend(self.to(draft, &places, body, holds));
        }
        found
    }

    fn every<'c>(
        &self,
        draft: Draft,
        places: &Places,
        all: impl Iterator<Item = (&'c Condition, bool)>,
    ) -> Vec<Draft> {
        let mut drafts = vec![draft];
        for (condition, holds) in all {
            drafts = drafts
                .into_iter()
                .flat_map(|draft| self.to(draft, places, condition, holds))
                .take(WAYS)
                .collect();
        }
        drafts
    }

    /// Whether a condition holds in the draft, as far as that can be said. What is known of a part stays so however
    /// much is drawn yet.
    pub(super) fn known(
        &self,
        draft: &Draft,
        places: &Places,
        condition: &Condition,
        drawn: Drawn,
    ) -> Option<bool> {
        self.parts.set(self.parts.get().checked_sub(1)?);
        let known = |condition| self.known(draft, places, condition, drawn);
        let are_all = drawn != Drawn::Parts;
        match condition {
            Condition::Edge { label, from, to } => {
                let link = (places.get(from)?, Rc::from(&**label), places.get(to)?);
                if draft.links.contains(&link) {
                    return Some(true);
                }
                (are_all || draft.absent.contains(&link)).then_some(false)
            }
            Condition::Same(a, b) => Some(places.get(a)? == places.get(b)?),
            Condition::Compare {
                operator,
                left,
                right,
            } => {
                let sides = [Term::of(left, places)?, Term::of(right, places)?];
                let asked = Asked {
                    operator: *operator,
                    sides,
                    holds: true,
                };
                asked.is_met(&|key| match draft.values.get(key) {
                    Some(value) => Ok(Some(value.clone())),
                    None if drawn == Drawn::Whole => Ok(None),
                    None => Err(Unknown),
                })
            }
            Condition::Not(inner) => known(inner).map(|holds| !holds),
            Condition::And(all) => every(all.iter().map(known)),
            Condition::Or(any) => {
                every(any.iter().map(|one| known(one).map(|holds| !holds))).map(|none| !none)
            }
            Condition::When {
                condition,
                consequence,
            } => match (known(condition), known(consequence)) {
                (Some(false), _) | (_, Some(true)) => Some(true),
                (Some(true), Some(false)) => Some(false),
                _ => None,
            },
            Condition::Exists { variables, body } | Condition::Forall { variables, body } => {
                let exists = matches!(condition, Condition::Exists { .. });
                let all = self.chosen(draft.clone(), places, variables, false);
                let each = all.iter().map(|(draft, places)| {
                    let holds = self.known(draft, places, body, drawn)?;
                    Some(holds != exists)
                });
                match every(each) {
                    Some(false) => Some(exists),
                    // There may be more nodes, or more of these than were looked at.
                    Some(true) if are_all && all.len() < WAYS * WAYS => Some(!exists),
                    _ => None,
                }
            }
        }
    }

    /// The draft with nodes for quantified variables: those that are there and, if `more`, new ones and those that may
    /// be of the type.
    fn chosen(
        &self,
        draft: Draft,
        places: &Places,
        variables: &[PatternNode],
        more: bool,
    ) -> Vec<(Draft, Places)> {
        let mut drafts = vec![(draft, places.clone())];
        for variable in variables {
            let name: Rc<str> = Rc::from(&*variable.variable);
            let mut next = Vec::new();
            for (draft, places) in drafts {
                let choose = |node: usize| {
                    let mut places = places.clone();
                    places.insert(&name, node);
                    places
                };
                let asked = &*variable.type_name;
                for (index, (_, exact)) in draft.nodes.iter().enumerate() {
                    if self.types.is_subtype(exact, asked) {
                        next.push((draft.clone(), choose(index)));
                    } else if more && self.types.is_subtype(asked, exact) {
                        // It may be of the narrower type.
                        let mut narrower = draft.clone();
                        narrower.narrow(index, asked);
                        next.push((narrower, choose(index)));
                    }
                }
                if more {
                    let mut wider = draft.clone();
                    let fresh = wider.fresh(&variable.variable);
                    let node = wider.add_node(&fresh, &variable.type_name);
                    next.push((wider, choose(node)));
                }
            }
            next.truncate(WAYS * WAYS);
            drafts = next;
        }
        drafts
    }
}

/// Whether all hold: not where one is known not to, nor to be said where one is not known.
fn every(all: impl Iterator<Item = Option<bool>>) -> Option<bool> {
    let mut known = Some(true);
    for one in all {
        match one {
            Some(false) => return Some(false),
            Some(true) => {}
            None => known = None,
        }
    }
    known
}
