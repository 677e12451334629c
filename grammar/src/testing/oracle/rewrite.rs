//! What a rule changes, naively: everything it says is collected, then done at once.

use super::{Assignment, Datum, LinkKey, Model, SCHEMA_SUBTYPES};
use crate::{AttributePath, Effect, Rule};
use std::collections::{BTreeMap, BTreeSet};

impl Model {
    /// The graph after the rule at a match, or `None` where it must be refused.
    pub(crate) fn applied(&self, rule: &Rule, at: &Assignment) -> Option<Self> {
        self.rewritten(rule, at).map(|(model, _)| model)
    }

    /// The graph after the rule, and its match with what its right side creates.
    pub(crate) fn rewritten(&self, rule: &Rule, at: &Assignment) -> Option<(Self, Assignment)> {
        let mut plan = Plan::default();
        let mut at = at.clone();
        for node in &rule.right.nodes {
            match rule
                .bound_nodes()
                .find(|left| left.variable == node.variable)
            {
                Some(left) if left.type_name == node.type_name => {}
                Some(_) => {
                    set(
                        &mut plan.retyped,
                        at[&*node.variable].clone(),
                        node.type_name.to_string(),
                    )?;
                }
                None => {
                    let name = plan.create(self, &node.type_name);
                    at.insert(node.variable.to_string(), name);
                }
            }
        }
        for node in &rule.left.nodes {
            if rule.right.node(&node.variable).is_none() {
                plan.deleted.insert(at[&*node.variable].clone());
            }
        }
        let key = |from: &str, label: &str, to: &str| {
            (at[from].clone(), label.to_owned(), at[to].clone())
        };
        for edge in rule.left.edges.iter().filter(|edge| !edge.negated) {
            plan.unwanted.insert(key(&edge.from, &edge.label, &edge.to));
        }
        for edge in &rule.right.edges {
            let side = if edge.negated {
                &mut plan.unwanted
            } else {
                &mut plan.wanted
            };
            side.insert(key(&edge.from, &edge.label, &edge.to));
        }
        self.effects(&rule.effect, &at, &mut plan)?;
        let touches = |link: &LinkKey, node: &String| link.0 == *node || link.2 == *node;
        let hangs = |node: &String| {
            self.links
                .iter()
                .any(|link| touches(link, node) && !plan.unlinked(rule, &at, link))
        };
        let dangling = plan.deleted.iter().any(hangs);
        (!(rule.strict && dangling)).then(|| (self.after(&plan), at))
    }

    fn effects(&self, effects: &[Effect], at: &Assignment, plan: &mut Plan) -> Option<()> {
        let mut at = at.clone();
        for effect in effects {
            match effect {
                Effect::Link { label, from, to } => {
                    let key = (at[&**from].clone(), label.to_string(), at[&**to].clone());
                    plan.wanted.insert(key);
                }
                Effect::Unlink { label, from, to } => {
                    let key = (at[&**from].clone(), label.to_string(), at[&**to].clone());
                    plan.unwanted.insert(key.clone());
                    plan.said.insert(key);
                }
                Effect::Assign { target, value } => {
                    let value = self.value(value, &at)?;
                    match target {
                        AttributePath::Node {
                            variable,
                            attribute,
                        } => {
                            let key = (at[&**variable].clone(), attribute.to_string());
                            set(&mut plan.assigned, key, value)?;
                        }
                        AttributePath::Edge {
                            from,
                            label,
                            to,
                            attribute,
                        } => {
                            let link = (at[&**from].clone(), label.to_string(), at[&**to].clone());
                            set(
                                &mut plan.link_assigned,
                                (link, attribute.to_string()),
                                value,
                            )?;
                        }
                    }
                }
                Effect::Create {
                    variable,
                    type_name,
                } => {
                    let name = plan.create(self, type_name);
                    at.insert(variable.to_string(), name);
                }
                Effect::Delete { variable } => {
                    plan.deleted.insert(at[&**variable].clone());
                }
                Effect::Retype {
                    variable,
                    type_name,
                } => {
                    set(
                        &mut plan.retyped,
                        at[&**variable].clone(),
                        type_name.to_string(),
                    )?;
                }
                Effect::Forall { variables, body } => {
                    for choice in self.choices(variables, &at) {
                        self.effects(body, &choice, plan)?;
                    }
                }
                Effect::When { condition, body } => {
                    if self.holds(condition, &at) {
                        self.effects(body, &at, plan)?;
                    }
                }
            }
        }
        Some(())
    }

    fn after(&self, plan: &Plan) -> Self {
        let mut model = self.clone();
        model
            .links
            .retain(|link| !plan.unwanted.contains(link) || plan.wanted.contains(link));
        model.links.extend(plan.wanted.iter().cloned());
        model.nodes.extend(plan.created.iter().cloned());
        for (node, type_name) in &plan.retyped {
            model.nodes.insert(node.clone(), type_name.clone());
        }
        for (key, value) in &plan.assigned {
            model.values.insert(key.clone(), value.clone());
        }
        for (key, value) in &plan.link_assigned {
            model.link_values.insert(key.clone(), value.clone());
        }
        for node in &plan.deleted {
            model.nodes.remove(node);
        }
        let Self {
            nodes,
            links,
            values,
            link_values,
        } = &mut model;
        links.retain(|(from, _, to)| nodes.contains_key(from) && nodes.contains_key(to));
        values.retain(|(node, _), _| nodes.contains_key(node));
        link_values.retain(|(link, _), _| links.contains(link));
        model
    }
}

/// Sets what may be set once, or again to the same.
fn set<K: Ord, V: PartialEq>(map: &mut BTreeMap<K, V>, key: K, value: V) -> Option<()> {
    match map.get(&key) {
        Some(before) => (*before == value).then_some(()),
        None => map.insert(key, value).is_none().then_some(()),
    }
}

#[derive(Debug, Default)]
struct Plan {
    created: Vec<(String, String)>,
    /// The number that the next node of a type tries.
    numbered: BTreeMap<String, usize>,
    deleted: BTreeSet<String>,
    retyped: BTreeMap<String, String>,
    wanted: BTreeSet<LinkKey>,
    unwanted: BTreeSet<LinkKey>,
    /// Links that effects unlink by name.
    said: BTreeSet<LinkKey>,
    assigned: BTreeMap<(String, String), Datum>,
    link_assigned: BTreeMap<(LinkKey, String), Datum>,
}

impl Plan {
    /// A node named after its type, by the first free number after the count of its kind.
    fn create(&mut self, model: &Model, type_name: &str) -> String {
        let subtypes = SCHEMA_SUBTYPES
            .iter()
            .find(|(general, _)| *general == type_name);
        let counted = |of: &String| {
            of == type_name || subtypes.is_some_and(|(_, special)| special.contains(&of.as_str()))
        };
        // Names are taken in turn, so that of those made before, the last of the type tells where to
        // go on: quantified effects make thousands.
        let first = model.nodes.values().filter(|of| counted(of)).count() + 1;
        let n = self.numbered.entry(type_name.to_owned()).or_insert(first);
        let name = loop {
            let name = format!("{type_name}_{n}");
            *n += 1;
            if !model.nodes.contains_key(&name) {
                break name;
            }
        };
        self.created.push((name.clone(), type_name.to_owned()));
        name
    }

    /// Whether the rule itself, and not the deletion of a node, takes the link away.
    fn unlinked(&self, rule: &Rule, at: &Assignment, link: &LinkKey) -> bool {
        let is = |edge: &crate::PatternEdge| {
            at[&*edge.from] == link.0 && *edge.label == *link.1 && at[&*edge.to] == link.2
        };
        let kept = rule
            .right
            .edges
            .iter()
            .any(|edge| !edge.negated && is(edge));
        let on_left = rule.left.edges.iter().any(|edge| !edge.negated && is(edge));
        let starred = rule.right.edges.iter().any(|edge| edge.negated && is(edge));
        (on_left && !kept) || starred || self.said.contains(link)
    }
}
