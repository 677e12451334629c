//! Attributes that are assigned to links which need not be there afterwards.
//!
//! Guarantee: where nothing is told, the rule makes the link or asks for it and does not take it away.

use super::at;
use crate::matching::conjuncts;
use crate::parser::Finding;
use crate::{AttributePath, Condition, Effect, Name, Problem, Rule};

type Link<'r> = (&'r Name, &'r Name, &'r Name);

/// Links that are there after the rule.
#[derive(Clone)]
struct Known<'r> {
    links: Vec<Link<'r>>,
    /// Those of the right side.
    wanted: Vec<Link<'r>>,
    /// Those that it takes away.
    gone: Vec<Link<'r>>,
}

impl<'r> Known<'r> {
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
        if !self.gone.contains(&link) {
            self.links.push(link);
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

    fn effects(&self, effects: &'r [Effect], findings: &mut Vec<Finding>) {
        let mut known = self.clone();
        let unlinked = effects.iter().filter_map(|effect| match effect {
            Effect::Unlink { label, from, to } => Some((from, label, to)),
            _ => None,
        });
        // What the right side wants is there whatever effects say.
        known
            .gone
            .extend(unlinked.filter(|link| !self.wanted.contains(link)));
        for effect in effects {
            match effect {
                Effect::Link { label, from, to } => {
                    known.gone.retain(|gone| *gone != (from, label, to));
                    known.links.push((from, label, to));
                }
                // A value that is not there would keep the rule from being applied.
                Effect::Assign { value, .. } => {
                    for path in value.paths() {
                        known.add_path(path);
                    }
                }
                _ => {}
            }
        }
        for effect in effects {
            match effect {
                Effect::Assign { target, .. } => known.assigned(target, findings),
                Effect::Forall { body, .. } => known.effects(body, findings),
                Effect::When { condition, body } => {
                    let mut inner = known.clone();
                    inner.ask(condition);
                    inner.effects(body, findings);
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
            if self.gone.contains(&(from, label, to)) {
                findings.push(at(label, Problem::LinkTaken { link }));
            } else if !self.links.contains(&(from, label, to)) {
                findings.push(at(label, Problem::MaybeNoLink { link }));
            }
        }
    }
}

/// Reports what is assigned to links that the rule neither makes nor asks for.
pub(super) fn links(rule: &Rule, findings: &mut Vec<Finding>) {
    let (left, right) = (&rule.left.edges, &rule.right.edges);
    let stays = |from, label, to| rule.right.edge(from, label, to).is_some_and(|e| !e.negated);
    let goes = left.iter().chain(right).filter(|edge| {
        let starred = rule.right.edge(&edge.from, &edge.label, &edge.to);
        starred.is_some_and(|edge| edge.negated)
            || !edge.negated && !stays(&edge.from, &edge.label, &edge.to)
    });
    let wanted = right.iter().filter(|edge| !edge.negated);
    let wanted: Vec<Link<'_>> = wanted
        .map(|edge| (&edge.from, &edge.label, &edge.to))
        .collect();
    let mut known = Known {
        links: wanted.clone(),
        wanted,
        gone: goes
            .map(|edge| (&edge.from, &edge.label, &edge.to))
            .collect(),
    };
    rule.precondition
        .iter()
        .for_each(|condition| known.ask(condition));
    known.effects(&rule.effect, findings);
}
