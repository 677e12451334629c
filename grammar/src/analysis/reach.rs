//! Which rules can come to be applicable from a graph, if nothing that held ever ceased to.
//!
//! Guarantee: a rule that is reported cannot be applied after any sequence of rules; that is said
//! by types and labels alone, so that not every such rule is found.

use super::at;
use crate::matching::MatchDomain;
use crate::parser::Finding;
use crate::{Effect, Grammar, Name, PatternNode, Problem, Rule};
use dsr::{ReadError, Snapshot};
use std::collections::{BTreeMap, BTreeSet};

/// What there may be: exact types, and links between them.
#[derive(Debug, Default, PartialEq, Eq, Clone)]
struct World {
    types: BTreeSet<String>,
    links: BTreeSet<(String, String, String)>,
    awake: BTreeSet<String>,
}

type Candidates = BTreeMap<String, BTreeSet<String>>;

struct Reach<'a> {
    grammar: &'a Grammar,
    snapshot: &'a Snapshot,
    world: World,
}

pub(super) fn unreachable(
    grammar: &Grammar,
    snapshot: &Snapshot,
) -> Result<Vec<Finding>, ReadError> {
    let mut reach = Reach {
        grammar,
        snapshot,
        world: World {
            awake: grammar.awake(snapshot)?,
            ..World::default()
        },
    };
    reach.read()?;
    loop {
        let before = reach.world.clone();
        for rule in &grammar.rules {
            if let Ok(candidates) = reach.applicable(rule) {
                reach.apply(rule, candidates);
            }
        }
        if reach.world == before {
            break;
        }
    }
    let findings = grammar.rules.iter().filter_map(|rule| {
        let reason = reach.applicable(rule).err()?;
        Some(at(&rule.name, Problem::Unreachable { reason }))
    });
    Ok(findings.collect())
}

impl Reach<'_> {
    fn read(&mut self) -> Result<(), ReadError> {
        let schema = self.snapshot.schema();
        for node in self.snapshot.nodes() {
            let node = node?;
            let from = node.type_name().to_owned();
            for key in node.out_edges() {
                let key = key?;
                if let Some(to) = self.snapshot.find_node(key.to)? {
                    let label = schema.label_name(key.label).to_owned();
                    let to = to.type_name().to_owned();
                    self.world.links.insert((from.clone(), label, to));
                }
            }
            self.world.types.insert(from);
        }
        Ok(())
    }

    fn is_a(&self, exact: &str, general: &str) -> bool {
        let schema = self.snapshot.schema();
        let by_schema = || {
            let domain = MatchDomain::new(&self.grammar.types, schema, general);
            schema
                .find_type(exact)
                .is_some_and(|id| domain.contains(id))
        };
        self.grammar.types.is_subtype(exact, general) || by_schema()
    }

    fn of_type(&self, general: &str) -> BTreeSet<String> {
        let types = self.world.types.iter();
        types
            .filter(|exact| self.is_a(exact, general))
            .cloned()
            .collect()
    }

    /// The exact types that each variable may have; or what is missing.
    fn applicable(&self, rule: &Rule) -> Result<Candidates, String> {
        if rule.dormant && !self.world.awake.contains(&*rule.name) {
            return Err("no rule that can be applied activates it".to_owned());
        }
        let mut candidates = Candidates::new();
        for node in rule.bound_nodes().chain(&rule.parameters) {
            let of_type = self.of_type(&node.type_name);
            if of_type.is_empty() {
                return Err(format!("there is never a `{}`", node.type_name));
            }
            let known = candidates.entry(node.variable.to_string());
            let known = known.or_insert_with(|| of_type.clone());
            known.retain(|exact| of_type.contains(exact));
        }
        loop {
            let before = candidates.clone();
            for edge in rule.left.edges.iter().filter(|edge| !edge.negated) {
                let fits = |(from, label, to): &&(String, String, String)| {
                    let may = |variable: &Name, exact: &String| {
                        candidates
                            .get(&**variable)
                            .is_some_and(|c| c.contains(exact))
                    };
                    *edge.label == **label && may(&edge.from, from) && may(&edge.to, to)
                };
                let fitting: Vec<_> = self.world.links.iter().filter(fits).collect();
                if fitting.is_empty() {
                    return Err(format!(
                        "there is never a link `{}` like `{}->{}`",
                        edge.label, edge.from, edge.to
                    ));
                }
                let ends = |end: fn(&(String, String, String)) -> &String| -> BTreeSet<String> {
                    fitting.iter().map(|link| end(link).clone()).collect()
                };
                let (sources, targets) = (ends(|l| &l.0), ends(|l| &l.2));
                candidates.insert(edge.from.to_string(), sources);
                let known = candidates.get(&*edge.to).cloned().unwrap_or_default();
                let both = known.intersection(&targets).cloned().collect();
                candidates.insert(edge.to.to_string(), both);
            }
            if candidates == before {
                return Ok(candidates);
            }
        }
    }

    fn apply(&mut self, rule: &Rule, mut candidates: Candidates) {
        let woken = rule.activates.iter().map(ToString::to_string);
        self.world.awake.extend(woken);
        for node in &rule.right.nodes {
            let before = rule.bound_nodes().find(|b| b.variable == node.variable);
            if before.is_none_or(|before| before.type_name != node.type_name) {
                self.becomes(&node.variable, &node.type_name, &mut candidates);
            }
        }
        for edge in rule.right.edges.iter().filter(|edge| !edge.negated) {
            self.link(&edge.from, &edge.label, &edge.to, &candidates);
        }
        self.effects(&rule.effect, &mut candidates);
    }

    /// A node that is new, or of a new type: it may be joined as those it comes from are.
    fn becomes(&mut self, variable: &Name, type_name: &Name, candidates: &mut Candidates) {
        let new = type_name.to_string();
        self.world.types.insert(new.clone());
        let before = candidates.entry(variable.to_string()).or_default();
        let links: Vec<_> = self.world.links.iter().cloned().collect();
        for (from, label, to) in links {
            let sources = if before.contains(&from) {
                vec![from.clone(), new.clone()]
            } else {
                vec![from]
            };
            let targets = if before.contains(&to) {
                vec![to.clone(), new.clone()]
            } else {
                vec![to]
            };
            for from in &sources {
                for to in &targets {
                    self.world
                        .links
                        .insert((from.clone(), label.clone(), to.clone()));
                }
            }
        }
        before.insert(new);
    }

    fn link(&mut self, from: &Name, label: &Name, to: &Name, candidates: &Candidates) {
        let none = BTreeSet::new();
        let types = |name: &Name| candidates.get(&**name).unwrap_or(&none);
        for source in types(from) {
            for target in types(to) {
                let link = (source.clone(), label.to_string(), target.clone());
                self.world.links.insert(link);
            }
        }
    }

    fn effects(&mut self, effects: &[Effect], candidates: &mut Candidates) {
        for effect in effects {
            match effect {
                Effect::Link { label, from, to } => self.link(from, label, to, candidates),
                Effect::Create {
                    variable,
                    type_name,
                }
                | Effect::Retype {
                    variable,
                    type_name,
                } => self.becomes(variable, type_name, candidates),
                Effect::Forall { variables, body } => {
                    let mut inner = candidates.clone();
                    for PatternNode {
                        variable,
                        type_name,
                        ..
                    } in variables
                    {
                        inner.insert(variable.to_string(), self.of_type(type_name));
                    }
                    self.effects(body, &mut inner);
                }
                Effect::When { body, .. } => self.effects(body, &mut candidates.clone()),
                Effect::Unlink { .. } | Effect::Assign { .. } | Effect::Delete { .. } => {}
            }
        }
    }
}
