//! One rule's left side laid over another's.
//!
//! Guarantee: every way to do so comes once, those with the fewest nodes first, up to
//! [`OVERLAY_LIMIT`](super::OVERLAY_LIMIT); ways where the sides alone show that nothing is disabled are left out.

use super::OVERLAY_LIMIT;
use crate::Rule;
use crate::analysis::draft::{Draft, Places};
use crate::analysis::kinds::{Kind, Kinds};
use std::collections::BTreeSet;
use std::rc::Rc;

/// So often a variable is laid on another for two rules.
const STEPS: u64 = 1_000_000;

/// A bound variable, and the type that a node for it can have.
type Variable<'g> = (&'g str, Kind);

/// A variable of the second rule on one of the first.
pub(super) type Shared = (usize, usize);

/// Two rules to be laid over each other.
pub(super) struct Sides<'g> {
    pub(super) first: Vec<Variable<'g>>,
    pub(super) second: Vec<Variable<'g>>,
    rules: [&'g Rule; 2],
    kinds: &'g Kinds<'g>,
    /// Of these sets of variables one must be shared.
    needed: &'g BTreeSet<Vec<Shared>>,
}

/// Bound variables with the type that a node for them can have.
fn variables<'g>(kinds: &Kinds<'g>, rule: &'g Rule) -> Option<Vec<Variable<'g>>> {
    let narrowed = |node: &'g crate::PatternNode| {
        let parameters = rule.parameters.iter();
        let same = parameters.filter(|p| p.variable == node.variable);
        let mut kind = kinds.find(&node.type_name)?;
        for parameter in same {
            kind = kinds.common(kind, kinds.find(&parameter.type_name)?)?;
        }
        Some((&*node.variable, kind))
    };
    rule.bound_nodes().map(narrowed).collect()
}

impl<'g> Sides<'g> {
    pub(super) fn new(
        kinds: &'g Kinds<'g>,
        rules: [&'g Rule; 2],
        needed: &'g BTreeSet<Vec<Shared>>,
    ) -> Option<Self> {
        Some(Self {
            first: variables(kinds, rules[0])?,
            second: variables(kinds, rules[1])?,
            rules,
            kinds,
            needed,
        })
    }

    pub(super) fn nodes(&self) -> usize {
        self.first.len() + self.second.len()
    }
}

/// One rule laid over another.
pub(super) struct Laid {
    pub(super) draft: Draft,
    pub(super) first: Places,
    pub(super) second: Places,
}

/// The ways to lay one rule over another.
pub(super) struct Overlays<'a, 'g> {
    sides: &'a Sides<'g>,
    found: usize,
    /// How often a variable was laid on another until now.
    pub(super) steps: u64,
}

/// By variable of the second rule, the variable of the first that is the same node.
pub(super) type Choice = Vec<Option<usize>>;

impl<'a, 'g> Overlays<'a, 'g> {
    pub(super) fn new(sides: &'a Sides<'g>) -> Self {
        Self {
            sides,
            found: 0,
            steps: 0,
        }
    }

    /// Those where so many variables of the second rule are beside the first.
    pub(super) fn with_beside(&mut self, beside: usize) -> Vec<Choice> {
        let mut choices = Vec::new();
        self.lay(beside, &mut Vec::new(), &mut choices);
        choices
    }

    /// Whether there are more ways than were looked at.
    pub(super) fn are_cut(&self) -> bool {
        self.found >= OVERLAY_LIMIT || self.steps >= STEPS
    }

    fn lay(&mut self, beside: usize, choice: &mut Choice, found: &mut Vec<Choice>) {
        self.steps += 1;
        if self.are_cut() {
            return;
        }
        let sides = self.sides;
        let may_share = |(two, one): &Shared| {
            let laid = choice.get(*two);
            laid.is_none_or(|laid| *laid == Some(*one))
        };
        let mut needed = sides.needed.iter();
        if !needed.any(|all| all.iter().all(may_share)) {
            return;
        }
        let Some((_, kind)) = sides.second.get(choice.len()) else {
            // The identity is no second match.
            let [first, second] = sides.rules;
            let identity = first.name == second.name
                && choice
                    .iter()
                    .enumerate()
                    .all(|(two, one)| *one == Some(two));
            if !identity {
                self.found += 1;
                found.push(choice.clone());
            }
            return;
        };
        let rest = sides.second.len() - choice.len();
        if rest > beside {
            for (index, (_, exact)) in sides.first.iter().enumerate() {
                if !choice.contains(&Some(index)) && sides.kinds.common(*exact, *kind).is_some() {
                    choice.push(Some(index));
                    self.lay(beside, choice, found);
                    choice.pop();
                }
            }
        }
        if beside > 0 {
            choice.push(None);
            self.lay(beside - 1, choice, found);
            choice.pop();
        }
    }

    /// Both left sides as one graph, unless one has a link that the other forbids.
    pub(super) fn drawn(&self, choice: &Choice) -> Option<Laid> {
        let sides = self.sides;
        let mut laid = Laid {
            draft: Draft::default(),
            first: Places::default(),
            second: Places::default(),
        };
        let Laid {
            draft,
            first: firsts,
            second: seconds,
        } = &mut laid;
        for (index, (name, kind)) in sides.first.iter().enumerate() {
            firsts.insert(&Rc::from(*name), index);
            let other = choice.iter().position(|shared| *shared == Some(index));
            let other = other.map(|other| sides.second[other].1);
            let both = other.map_or(Some(*kind), |other| sides.kinds.common(*kind, other))?;
            draft.add_node(name, sides.kinds.name(both));
        }
        for ((name, kind), shared) in sides.second.iter().zip(choice) {
            let place = shared.unwrap_or_else(|| {
                let fresh = draft.fresh(name);
                draft.add_node(&fresh, sides.kinds.name(*kind))
            });
            seconds.insert(&Rc::from(*name), place);
        }
        let [first, second] = sides.rules;
        let goes = links(draft, first, firsts) && links(draft, second, seconds);
        goes.then_some(laid)
    }
}

/// Draws the links of a left side; whether they go with what is drawn.
fn links(draft: &mut Draft, rule: &Rule, places: &Places) -> bool {
    rule.left.edges.iter().all(|edge| {
        let (Some(from), Some(to)) = (places.get(&edge.from), places.get(&edge.to)) else {
            return false;
        };
        draft.add_link((from, Rc::from(&*edge.label), to), !edge.negated)
    })
}
