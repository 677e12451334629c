//! Two rules laid over each other, in one set of names.
//!
//! Guarantee: a name stands for one node, or is declared once.

use super::after::After;
use super::changes::Changes;
use super::overlay::Laid;
use crate::analysis::contradiction::Together;
use crate::analysis::draft::Places;
use crate::formula::{any, negated, no};
use crate::rename::Renaming;
use crate::{Condition, Name, PatternNode, Rule, Types};
use dsr::Schema;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

/// Two rules in the names of the nodes of a draft.
pub(super) struct Joint<'a> {
    types: &'a Types,
    rules: [Rule; 2],
    /// The types that each node has.
    bound: BTreeMap<Name, Vec<&'a Name>>,
    taken: BTreeSet<String>,
    /// The names as places.
    pub(super) places: Places,
}

/// When the first rule disables the second.
pub(super) struct Disabled {
    /// One of these things must hold.
    pub(super) when: Condition,
    /// There are no others.
    pub(super) is_whole: bool,
    /// How many formulas were written.
    pub(super) cost: u64,
}

fn nodes(rule: &Rule) -> impl Iterator<Item = &PatternNode> {
    rule.left.nodes.iter().chain(&rule.parameters)
}

impl<'a> Joint<'a> {
    pub(super) fn new(types: &'a Types, rules: [&'a Rule; 2], laid: &Laid) -> Self {
        let mut taken: BTreeSet<String> = BTreeSet::new();
        let mut places = Places::default();
        for (node, (name, _)) in laid.draft.nodes.iter().enumerate() {
            taken.insert(name.to_string());
            places.insert(&Rc::clone(name), node);
        }
        let mut bound: BTreeMap<Name, Vec<&Name>> = BTreeMap::new();
        let mut renamed = |rule: &'a Rule, at: &Places| {
            let mut scope: Vec<(Name, Name)> = Vec::new();
            for node in nodes(rule) {
                if let Some(place) = at.get(&node.variable) {
                    let name = Name::from(&*laid.draft.nodes[place].0);
                    bound.entry(name.clone()).or_default().push(&node.type_name);
                    scope.push((node.variable.clone(), name));
                }
            }
            for node in &rule.right.nodes {
                if at.get(&node.variable).is_none() {
                    let mut name = format!("new_{}", node.variable);
                    while !taken.insert(name.clone()) {
                        name.push('_');
                    }
                    scope.push((node.variable.clone(), Name::from(name.as_str())));
                }
            }
            Renaming::new(scope, &mut taken, "any").rule(rule)
        };
        let [first, second] = rules;
        let rules = [renamed(first, &laid.first), renamed(second, &laid.second)];
        Self {
            types,
            rules,
            bound,
            taken,
            places,
        }
    }

    /// The second rule.
    pub(super) fn second(&self) -> &Rule {
        &self.rules[1]
    }

    /// The first rule.
    pub(super) fn first(&self) -> &Rule {
        &self.rules[0]
    }

    /// What must hold for both to match, beside their left sides.
    pub(super) fn preconditions(&self) -> impl Iterator<Item = &Condition> {
        self.rules.iter().flat_map(|rule| &rule.precondition)
    }

    pub(super) fn disabled(&self) -> Disabled {
        let [first, second] = &self.rules;
        let changes = Changes::of(first, self.bound.clone(), self.taken.clone());
        let after = After::new(self.types, &changes);
        let mut ways: Vec<Option<Condition>> = Vec::new();
        for node in second.bound_nodes() {
            let own = nodes(second).filter(|other| other.variable == node.variable);
            let types: Vec<&Name> = own.map(|node| &node.type_name).collect();
            ways.push(after.is_lost(&node.variable, &types));
        }
        for edge in &second.left.edges {
            let there = after.link(&edge.label, &edge.from, &edge.to);
            ways.push(if edge.negated {
                there
            } else {
                there.map(negated)
            });
        }
        let condition = second.precondition.as_ref();
        ways.extend(condition.map(|condition| after.condition(condition).map(negated)));
        let is_whole = ways.iter().all(Option::is_some);
        Disabled {
            when: any(ways.into_iter().flatten().collect()),
            is_whole,
            cost: after.written(),
        }
    }

    /// Whether it is known that in no graph both match and the first disables the second; and what it cost to find
    /// out.
    pub(super) fn is_impossible(
        &self,
        disabled: &Disabled,
        schema: Option<&Schema>,
    ) -> (bool, u64) {
        if disabled.is_whole && disabled.when == no() {
            return (true, 0);
        }
        let rules = self.rules.iter();
        let when = disabled.is_whole.then_some(&disabled.when);
        let together = Together {
            types: self.types,
            schema,
            nodes: self
                .bound
                .iter()
                .map(|(name, types)| (name, types.clone()))
                .collect(),
            links: rules.flat_map(|rule| &rule.left.edges).collect(),
            conditions: self.preconditions().chain(when).collect(),
        };
        let (reason, cost) = together.contradiction();
        (reason.is_some(), cost as u64)
    }
}
