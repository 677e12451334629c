//! Critical pairs: which rules can disable which.
//!
//! Guarantee: every conflict was tried out: in its graph both rules match, and after the first was
//! applied the second does not match there any more.

mod after;
mod changes;
mod joint;
mod overlay;
mod pair;
mod touch;

use super::contradiction::contradiction;
use super::kinds::{Kinds, types_of};
use crate::{Binding, Diagnostic, Grammar, Rule};
use dsr::{Graph, Schema, Time, Transaction};
use pair::Pair;
use std::borrow::Cow;
use touch::{Index, Touched};

/// How many ways of laying one rule over another are looked at.
pub const OVERLAY_LIMIT: usize = 10_000;
/// No more conflicts than this are given, and no more pairs named of which it was not found out.
pub const CONFLICT_LIMIT: usize = 1_000;
/// How much is done for all conflicts of a grammar: about as much as looking at so many nodes.
pub const EFFORT_LIMIT: u64 = 10_000_000_000;
/// Two rules get at least so much of it, as long as there is any: with less, hardly any two are decided.
const SHARE: u64 = 5_000_000;
/// So many pairs of rules are looked into.
const PAIR_LIMIT: usize = 1_000_000;

/// Two rules of which the first can disable the second.
#[derive(Debug, Clone)]
pub struct Conflict {
    /// The rule that is applied.
    pub first: String,
    /// The rule that does not match any more; can be the same one, at another match.
    pub second: String,
    /// Makes the smallest graph where both match, in an empty one.
    pub graph: Transaction,
    /// The first rule's match in that graph.
    pub first_match: Binding,
    /// The second rule's.
    pub second_match: Binding,
    /// All of it in words, at the first rule.
    pub diagnostic: Diagnostic,
}

/// Why it was not found out whether one rule can disable another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
#[non_exhaustive]
pub enum Undecided {
    /// There are more ways to lay one over the other, and to meet their conditions, than were tried.
    #[error("there was more to try than the effort allowed")]
    Effort,
    /// They have too many nodes, or quantifiers within each other.
    #[error("the rules are too large to be compared")]
    Size,
    /// No graph was found where the first disables the second, and it was not shown that there is none.
    #[error("no graph was found that shows it, and no proof that there is none")]
    Conditions,
    /// There were [`CONFLICT_LIMIT`] conflicts before.
    #[error("as many conflicts as are given had been found")]
    Conflicts,
}

/// The conflicts of a grammar.
#[derive(Debug, Clone, Default)]
pub struct Conflicts {
    /// In the order of the rules.
    pub found: Vec<Conflict>,
    /// Pairs of rules of which it was not found out, and why, in the order of the rules; no more than
    /// [`CONFLICT_LIMIT`].
    pub undecided: Vec<(String, String, Undecided)>,
    /// How many pairs there are of which it was not found out: at least so many where not even that could be
    /// looked at.
    pub left: usize,
}

/// What may still be done for two rules, and where.
struct Effort {
    left: u64,
    /// An empty graph to try rules in: making a new one takes longer than trying them.
    ground: Graph,
}

impl Effort {
    fn spend(&mut self, amount: u64) -> Result<(), Undecided> {
        let enough = self.left >= amount;
        self.left = self.left.saturating_sub(amount);
        if enough {
            Ok(())
        } else {
            Err(Undecided::Effort)
        }
    }

    /// Makes the graph empty again.
    fn clear(&mut self) {
        let snapshot = self.ground.snapshot();
        let mut all = Transaction::new();
        for node in snapshot.nodes().flatten() {
            all.delete_node(node.id());
        }
        if self
            .ground
            .commit(&all, "analysis", Time::default())
            .is_err()
        {
            self.ground = Graph::in_memory(Schema::open());
        }
    }
}

/// The conflicts that are found with so much effort.
pub(super) fn conflicts(grammar: &Grammar, schema: Option<&Schema>, effort: u64) -> Conflicts {
    let sleeps = |rule: &Rule| rule.dormant || !rule.activates.is_empty();
    let mut awake = Cow::Borrowed(grammar);
    if grammar.rules.iter().any(sleeps) {
        for rule in &mut awake.to_mut().rules {
            rule.dormant = false;
            rule.activates.clear();
        }
    }
    let kinds = Kinds::new(&awake, awake.rules.iter().flat_map(types_of));
    let mut effort = Effort {
        left: effort,
        ground: Graph::in_memory(Schema::open()),
    };
    let pairs = Pairs::new(&awake, schema, &kinds, &mut effort);
    let mut results = Results::of(&pairs);
    let mut open: Vec<usize> = (0..pairs.all.len()).collect();
    let mut given = 0;
    // What pairs leave of their shares is for the others, and then for those that are not decided yet.
    while results.found < CONFLICT_LIMIT && !open.is_empty() {
        let share = effort.left / open.len() as u64;
        if share / 2 < given {
            break;
        }
        given = share.max(1);
        let count = open.len();
        let mut next = Vec::new();
        for (place, pair) in open.into_iter().enumerate() {
            if results.found >= CONFLICT_LIMIT {
                results.all[pair] = Err(Undecided::Conflicts);
                continue;
            }
            let (all, rest) = (effort.left, (count - place) as u64);
            effort.left = (all / rest).max(SHARE).min(all);
            let share = effort.left;
            let result = pairs.pair(pair).smallest(&kinds, &mut effort);
            effort.left += all - share;
            if matches!(result, Err(Undecided::Effort)) {
                next.push(pair);
            }
            results.found += usize::from(matches!(result, Ok(Some(_))));
            results.all[pair] = result.map(|found| found.map(Box::new));
        }
        open = next;
    }
    if results.found >= CONFLICT_LIMIT {
        for pair in open {
            results.all[pair] = Err(Undecided::Conflicts);
        }
    }
    results.told(&pairs)
}

/// Pairs of rules of which the first changes something like what the second looks at.
struct Pairs<'a> {
    grammar: &'a Grammar,
    schema: Option<&'a Schema>,
    touched: Vec<Touched<'a>>,
    all: Vec<[u32; 2]>,
    /// How many more there are at least.
    left: usize,
}

impl<'a> Pairs<'a> {
    fn new(
        grammar: &'a Grammar,
        schema: Option<&'a Schema>,
        kinds: &'a Kinds<'a>,
        effort: &mut Effort,
    ) -> Self {
        let of = |rule: &'a Rule| match contradiction(grammar, rule, &[], schema) {
            // What never matches disables nothing, and nothing disables it.
            Some(_) => Touched::default(),
            None => Touched::of(kinds, rule),
        };
        let mut pairs = Self {
            grammar,
            schema,
            touched: grammar.rules.iter().map(of).collect(),
            all: Vec::new(),
            left: 0,
        };
        let index = Index::new(&pairs.touched);
        for (one, changes) in pairs.touched.iter().enumerate() {
            if pairs.all.len() >= PAIR_LIMIT || effort.left == 0 {
                pairs.left += index.at_least(changes);
                continue;
            }
            for two in index.of(changes) {
                let looks = &pairs.touched[two];
                if effort.spend(changes.checks(looks) * kinds.words()).is_err() {
                    pairs.left += 1;
                } else if changes.touches(kinds, looks) {
                    pairs.all.push([one as u32, two as u32]);
                }
            }
        }
        pairs
    }

    fn rules(&self, place: usize) -> [&'a Rule; 2] {
        self.all[place].map(|rule| &self.grammar.rules[rule as usize])
    }

    /// What is needed to compare two of them, of which there may be too many to keep that for all.
    fn pair(&self, place: usize) -> Pair<'_, 'a> {
        let [first, second] = self.rules(place);
        let [changes, looks] = self.all[place].map(|rule| &self.touched[rule as usize]);
        Pair {
            grammar: self.grammar,
            schema: self.schema,
            first,
            second,
            changes,
            looks,
        }
    }
}

/// What was found out, pair by pair.
struct Results {
    all: Vec<Result<Option<Box<Conflict>>, Undecided>>,
    found: usize,
    left: usize,
}

impl Results {
    fn of(pairs: &Pairs) -> Self {
        Self {
            all: pairs.all.iter().map(|_| Err(Undecided::Effort)).collect(),
            found: 0,
            left: pairs.left,
        }
    }

    fn told(self, pairs: &Pairs) -> Conflicts {
        let mut told = Conflicts {
            left: self.left,
            ..Conflicts::default()
        };
        for (place, result) in self.all.into_iter().enumerate() {
            match result {
                Ok(conflict) => told.found.extend(conflict.map(|conflict| *conflict)),
                Err(why) => {
                    told.left += 1;
                    if told.undecided.len() < CONFLICT_LIMIT {
                        let names = pairs.rules(place).map(|rule| rule.name.to_string());
                        let [first, second] = names;
                        told.undecided.push((first, second, why));
                    }
                }
            }
        }
        told
    }
}

#[cfg(test)]
mod tests;
