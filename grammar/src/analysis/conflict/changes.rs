//! What a rule changes, each change with what it hinges on.
//!
//! Guarantee: it is all that the rule changes, but that links of deleted nodes go with them.

use crate::rename::Renaming;
use crate::{AttributePath, Condition, Effect, Expression, Name, PatternNode, Rule};
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

/// One thing that is changed, by variables.
#[derive(Debug, Clone)]
pub(super) enum What {
    Link(Name, Name, Name),
    Unlink(Name, Name, Name),
    Assign(Box<(AttributePath, Expression)>),
    Create(Name, Name),
    Delete(Name),
    Retype(Name, Name),
}

/// A change that happens for all nodes of which some conditions hold.
#[derive(Debug, Clone)]
pub(super) struct Change {
    pub(super) variables: Vec<PatternNode>,
    pub(super) conditions: Vec<Condition>,
    pub(super) what: What,
}

impl Change {
    /// Whether it hinges on nothing.
    pub(super) fn always(&self) -> bool {
        self.variables.is_empty() && self.conditions.is_empty()
    }
}

/// All that a rule changes where it is laid over another.
pub(super) struct Changes<'a> {
    all: Vec<Change>,
    /// By node of either match, the types that it has.
    bound: BTreeMap<Name, Vec<&'a Name>>,
    new: BTreeSet<Name>,
    /// Names that are used.
    taken: RefCell<BTreeSet<String>>,
}

impl<'a> Changes<'a> {
    /// Of a rule in which every variable has a name that nothing else has; `bound` are the nodes of both matches.
    pub(super) fn of(
        rule: &Rule,
        bound: BTreeMap<Name, Vec<&'a Name>>,
        taken: BTreeSet<String>,
    ) -> Self {
        let mut changes = Self {
            all: Vec::new(),
            bound,
            new: BTreeSet::new(),
            taken: RefCell::new(taken),
        };
        for node in &rule.right.nodes {
            let before = rule.bound_nodes().find(|b| b.variable == node.variable);
            let (name, becomes) = (node.variable.clone(), node.type_name.clone());
            match before {
                None => changes.always(What::Create(name, becomes)),
                Some(before) if before.type_name != becomes => {
                    changes.always(What::Retype(name, becomes));
                }
                Some(_) => {}
            }
        }
        for node in &rule.left.nodes {
            if rule.right.node(&node.variable).is_none() {
                changes.always(What::Delete(node.variable.clone()));
            }
        }
        let right = rule.right.edges.iter();
        let starred = right.clone().filter(|edge| edge.negated);
        let left = rule.left.edges.iter().filter(|edge| !edge.negated);
        for edge in left.chain(starred) {
            let (from, to) = (edge.from.clone(), edge.to.clone());
            changes.always(What::Unlink(from, edge.label.clone(), to));
        }
        for edge in right.filter(|edge| !edge.negated) {
            let (from, to) = (edge.from.clone(), edge.to.clone());
            changes.always(What::Link(from, edge.label.clone(), to));
        }
        changes.effects(&rule.effect, &[], &[]);
        changes.find_new();
        changes
    }

    pub(super) fn all(&self) -> &[Change] {
        &self.all
    }

    pub(super) fn types_of(&self, node: &Name) -> &[&'a Name] {
        self.bound.get(node).map_or(&[], Vec::as_slice)
    }

    pub(super) fn is_bound(&self, name: &Name) -> bool {
        self.bound.contains_key(name)
    }

    /// Whether it is a node that the rule makes.
    pub(super) fn is_new(&self, name: &Name) -> bool {
        self.new.contains(name)
    }

    /// The change with names put in for some of its variables and names that nothing else has for the others; and
    /// all of these.
    pub(super) fn apart(
        &self,
        change: &Change,
        put: &[(Name, Name)],
    ) -> (Change, Vec<(Name, Name)>) {
        let mut taken = self.taken.borrow_mut();
        let mut renaming = Renaming::new(put.to_vec(), &mut taken, "any");
        let is_put = |node: &&PatternNode| put.iter().any(|(name, _)| *name == node.variable);
        let rest = change.variables.iter().filter(|node| !is_put(node));
        let rest: Vec<PatternNode> = rest.cloned().collect();
        let variables = renaming.quantify(&rest);
        let change = Change {
            variables,
            conditions: change
                .conditions
                .iter()
                .map(|condition| renaming.condition(condition))
                .collect(),
            what: match &change.what {
                What::Assign(assigned) => {
                    let (path, value) = &**assigned;
                    What::Assign(Box::new((renaming.path(path), renaming.expression(value))))
                }
                other => other.clone(),
            },
        };
        (change, renaming.into_names())
    }

    fn always(&mut self, what: What) {
        self.all.push(Change {
            variables: Vec::new(),
            conditions: Vec::new(),
            what,
        });
    }

    fn effects(&mut self, effects: &[Effect], variables: &[PatternNode], conditions: &[Condition]) {
        for effect in effects {
            let what = match effect {
                Effect::Link { label, from, to } => {
                    What::Link(from.clone(), label.clone(), to.clone())
                }
                Effect::Unlink { label, from, to } => {
                    What::Unlink(from.clone(), label.clone(), to.clone())
                }
                Effect::Assign { target, value } => {
                    What::Assign(Box::new((target.clone(), value.clone())))
                }
                Effect::Create {
                    variable,
                    type_name,
                } => What::Create(variable.clone(), type_name.clone()),
                Effect::Delete { variable } => What::Delete(variable.clone()),
                Effect::Retype {
                    variable,
                    type_name,
                } => What::Retype(variable.clone(), type_name.clone()),
                Effect::Forall {
                    variables: more,
                    body,
                } => {
                    let variables = [variables, more].concat();
                    self.effects(body, &variables, conditions);
                    continue;
                }
                Effect::When { condition, body } => {
                    let condition = std::slice::from_ref(condition);
                    self.effects(body, variables, &[conditions, condition].concat());
                    continue;
                }
            };
            self.all.push(Change {
                variables: variables.to_vec(),
                conditions: conditions.to_vec(),
                what,
            });
        }
    }

    fn find_new(&mut self) {
        for change in &self.all {
            if let What::Create(node, _) = &change.what {
                self.new.insert(node.clone());
            }
        }
    }
}
