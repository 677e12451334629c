//! Attributes that are assigned to links which need not be there afterwards.
//!
//! Guarantee: where nothing is told, the rule makes the link or asks for it and does not take it away.

use super::at;
use crate::matching::conjuncts;
use crate::parser::Finding;
use crate::rule::PatternIndex;
use crate::{AttributePath, Condition, Effect, Name, Problem, Rule};
use std::collections::BTreeSet;

type Link<'r> = (&'r Name, &'r Name, &'r Name);

/// Links that are there after the rule, and those that it takes away, as one list of effects says beside what stands
/// around it.
#[derive(Default)]
struct Known<'k, 'r> {
    around: Option<&'k Known<'k, 'r>>,
    links: BTreeSet<Link<'r>>,
    gone: BTreeSet<Link<'r>>,
}

impl<'r> Known<'_, 'r> {
    /// Whether the link is there afterwards, if that is known.
    fn stays(&self, link: &Link<'r>) -> Option<bool> {
        let layers = std::iter::successors(Some(self), |known| known.around);
        let mut known = layers.filter_map(|layer| {
            let is_gone = layer.gone.contains(link);
            (is_gone || layer.links.contains(link)).then_some(!is_gone)
        });
        known.next()
    }

    /// What a condition that holds before the rule says of the links after it.
    fn ask(&mut self, condition: &'r Condition) {
        for part in conjuncts(condition) {
            match part {
                Condition::Edge { label, from, to } => self.add((from, label, to)),
                // A comparison with an attribute that is not there does not hold.
                Condition::Compare { left, right, .. } => {
                    for path in left.paths().into_iter().chain(right.paths()) {
                        self.add_path(path);
                    }
                }
                _ => {}
            }
        }
    }

    fn add(&mut self, link: Link<'r>) {
        if self.stays(&link).is_none() {
            self.links.insert(link);
        }
    }

    fn add_path(&mut self, path: &'r AttributePath) {
        if let AttributePath::Edge {
            from, label, to, ..
        } = path
        {
            self.add((from, label, to));
        }
    }

    fn inside(&self) -> Known<'_, 'r> {
        Known {
            around: Some(self),
            ..Known::default()
        }
    }

    fn effects(&mut self, right: &PatternIndex, effects: &'r [Effect], found: &mut Vec<Finding>) {
        for effect in effects {
            match effect {
                Effect::Link { label, from, to } => {
                    self.links.insert((from, label, to));
                }
                // What the right side wants is there whatever effects say.
                Effect::Unlink { label, from, to }
                    if right.edge(from, label, to).is_none_or(|edge| edge.negated) =>
                {
                    self.gone.insert((from, label, to));
                }
                _ => {}
            }
        }
        for effect in effects {
            match effect {
                Effect::Link { label, from, to } => {
                    self.gone.remove(&(from, label, to));
                }
                // A value that is not there would keep the rule from being applied.
                Effect::Assign { value, .. } => {
                    for path in value.paths() {
                        self.add_path(path);
                    }
                }
                _ => {}
            }
        }
        for effect in effects {
            match effect {
                Effect::Assign { target, .. } => self.assigned(target, found),
                Effect::Forall { body, .. } => self.inside().effects(right, body, found),
                Effect::When { condition, body } => {
                    let mut inner = self.inside();
                    inner.ask(condition);
                    inner.effects(right, body, found);
                }
                _ => {}
            }
        }
    }

    fn assigned(&self, target: &'r AttributePath, findings: &mut Vec<Finding>) {
        if let AttributePath::Edge {
            from, label, to, ..
        } = target
        {
            let link = format!("{from}->{to}({label})");
            let problem = match self.stays(&(from, label, to)) {
                Some(true) => return,
                Some(false) => Problem::LinkTaken { link },
                None => Problem::MaybeNoLink { link },
            };
            findings.push(at(label, problem));
        }
    }
}

/// Reports what is assigned to links that the rule neither makes nor asks for, or takes away.
pub(super) fn links(rule: &Rule, findings: &mut Vec<Finding>) {
    let right = rule.right.index();
    let mut known = Known::default();
    for edge in rule.left.edges.iter().chain(&rule.right.edges) {
        let link = (&edge.from, &edge.label, &edge.to);
        match right.edge(&edge.from, &edge.label, &edge.to) {
            Some(after) if !after.negated => known.links.insert(link),
            None if edge.negated => continue,
            _ => known.gone.insert(link),
        };
    }
    for condition in rule.precondition.as_slice() {
        known.ask(condition);
    }
    known.inside().effects(&right, &rule.effect, findings);
}
