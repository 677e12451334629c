//! Drafts that meet conditions.
//!
//! Guarantee: what is said to be known of a condition in a draft stays so however much is drawn yet.

use super::draft::{Draft, Places, owner};
use crate::{AttributePath, Comparison, Condition, Expression, PatternNode, Types};
use dsr::Value;
use std::cell::Cell;
use std::rc::Rc;

/// How many ways to meet a condition are followed.
const WAYS: usize = 16;
/// How many formulas are looked at for one graph, each as often as there are ways to come to it.
const FORMULAS: usize = 500;

/// Finds ways to make conditions come out one way or the other, and so that little would change it.
pub(super) struct Ways<'t> {
    types: &'t Types,
    /// So many formulas are still looked at.
    left: Cell<usize>,
}

impl<'t> Ways<'t> {
    pub(super) fn new(types: &'t Types) -> Self {
        Self {
            types,
            left: Cell::new(FORMULAS),
        }
    }

    /// How many formulas were looked at until now.
    pub(super) fn looked_at(&self) -> u64 {
        (FORMULAS - self.left.get()) as u64
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
                if holds {
                    return compared(draft, places, *operator, left, right);
                }
                // A missing attribute will do, too.
                let mut found = vec![draft.clone()];
                found.extend(compared(draft, places, operator.negated(), left, right));
                found
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
                for both in [true, false] {
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

    /// Whether a condition holds in the draft, as far as it is drawn; where `whole`, what is not drawn is not there. What
    /// is known of a part stays so however much is drawn yet.
    pub(super) fn known(
        &self,
        draft: &Draft,
        places: &Places,
        condition: &Condition,
        whole: bool,
    ) -> Option<bool> {
        let known = |condition| self.known(draft, places, condition, whole);
        match condition {
            Condition::Edge { label, from, to } => {
                let link = (places.get(from)?, Rc::from(&**label), places.get(to)?);
                if draft.links.contains(&link) {
                    return Some(true);
                }
                (whole || draft.absent.contains(&link)).then_some(false)
            }
            Condition::Same(a, b) => Some(places.get(a)? == places.get(b)?),
            Condition::Compare {
                operator,
                left,
                right,
            } => {
                let value = |expression: &Expression| match expression {
                    Expression::Literal(literal) => Ok(literal.value()),
                    Expression::Attribute(path) => {
                        let value = owner(path, places).and_then(|at| draft.values.get(&at));
                        value.cloned().ok_or(whole)
                    }
                    Expression::Arithmetic { .. } => Err(false),
                };
                match (value(left), value(right)) {
                    (Ok(left), Ok(right)) => Some(operator.holds(&left, &right)),
                    // A comparison with what is not there does not hold.
                    (Err(true), _) | (_, Err(true)) => Some(false),
                    _ => None,
                }
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
                    let holds = self.known(draft, places, body, whole)?;
                    Some(holds != exists)
                });
                match every(each) {
                    Some(false) => Some(exists),
                    // There may be more nodes, or more of these than were looked at.
                    Some(true) if whole && all.len() < WAYS * WAYS => Some(!exists),
                    _ => None,
                }
            }
        }
    }

    /// The draft with nodes for quantified variables: those that are there and, if `more`, new ones.
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
                for (index, (_, exact)) in draft.nodes.iter().enumerate() {
                    if self.types.is_subtype(exact, &variable.type_name) {
                        next.push((draft.clone(), choose(index)));
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

/// Values that meet a comparison of attributes with each other or with a constant.
fn compared(
    draft: Draft,
    places: &Places,
    operator: Comparison,
    left: &Expression,
    right: &Expression,
) -> Vec<Draft> {
    let value = |expression: &Expression| match expression {
        Expression::Attribute(path) => {
            owner(path, places).and_then(|owner| draft.values.get(&owner).cloned())
        }
        Expression::Literal(literal) => Some(literal.value()),
        Expression::Arithmetic { .. } => None,
    };
    let known = (value(left), value(right));
    let tries = |other: &Value| -> Vec<Value> {
        match other.as_f64() {
            Some(x) => vec![other.clone(), (x - 1.0).into(), (x + 1.0).into()],
            None => vec![other.clone(), "other".into()],
        }
    };
    let (path, tried): (&AttributePath, Vec<Value>) = match (left, right, &known) {
        (_, _, (Some(a), Some(b))) => {
            return if operator.holds(a, b) {
                vec![draft]
            } else {
                Vec::new()
            };
        }
        (Expression::Attribute(path), _, (None, Some(b))) => {
            let fits = |a: &Value| operator.holds(a, b);
            (path, tries(b).into_iter().filter(fits).collect())
        }
        (_, Expression::Attribute(path), (Some(a), None)) => {
            let fits = |b: &Value| operator.holds(a, b);
            (path, tries(a).into_iter().filter(fits).collect())
        }
        (Expression::Attribute(first), Expression::Attribute(_), (None, None)) => {
            let Some(first) = owner(first, places) else {
                return vec![draft];
            };
            return draft
                .with_value(first, Value::I64(1))
                .into_iter()
                .flat_map(|draft| compared(draft, places, operator, left, right))
                .collect();
        }
        // What arithmetic comes to is left to be seen.
        _ => return vec![draft],
    };
    let Some(owner) = owner(path, places) else {
        return vec![draft];
    };
    tried
        .into_iter()
        .flat_map(|value| draft.clone().with_value(owner.clone(), value))
        .collect()
}
