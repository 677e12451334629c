//! Matches that are kept up to date.
//!
//! Guarantee: after every change up to a version was taken in, the matches are those that a fresh
//! search in that version finds; the cost of that follows what the change touches.

mod explain;
mod make;
mod pattern;
mod set;
mod shared;
mod trigger;

use super::MatchError;
use super::environment::Interrupt;
use super::planned::Planned;
use crate::{Binding, Grammar, Name, Rule};
use dsr::{
    Change, EdgeChange, Epoch, LabelId, NodeChange, NodeId, ReadError, Schema, Snapshot, Touch,
    TypeId, Version,
};
pub use explain::SharedSteps;
use pattern::Pattern;
use set::{MatchSet, Row, Seed};
use shared::Shared;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use trigger::{Anchor, Can, EdgeTrigger, NodeTrigger, Seeds, Triggers, When};

/// The matches of some rules, kept up to date from the changes of a graph.
///
/// Rules whose left sides and conditions are the same but for the names of variables share one set
/// of matches, and what a change touches is looked up once for all rules. Where the searches of several
/// rules from a changed link or node begin with the same steps, these are taken once for all of them.
///
/// A change costs as much as the partial matches that bind what it touches. There is one
/// exception: where a condition quantifies over nodes that no link joins to the match (`(exists
/// r:robot (< r.battery 5))`), a change of such a node makes the rule be matched afresh.
///
/// ```
/// # use dsr::{Graph, Schema, Time, Transaction};
/// # use grammar::{Watch, parse_grammar};
/// # use std::sync::Arc;
/// # let mut graph = Graph::in_memory(Schema::open());
/// # let mut world = Transaction::new();
/// # world.create_node("robot", "shelly", vec![]);
/// # world.create_node("room", "hall", vec![]);
/// # graph.commit(&world, "world", Time::default())?;
/// let (grammar, _) = parse_grammar(
///     "name=doors\n===\nleave : active(1) { { r:robot a:room r->a(in) } => { r:robot a:room } }",
///     "doors.aggl",
/// );
/// let mut watch = Watch::new(Arc::new(grammar), &["leave"], &graph.snapshot())?;
/// let mut enter = Transaction::new();
/// enter.create_edge("shelly", "in", "hall");
/// let (_, change) = graph.commit(&enter, "navigation", Time::default())?;
/// let delta = watch.update(&change, &graph.snapshot())?;
/// assert_eq!(delta.added.len(), 1);
/// assert_eq!(watch.count("leave"), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Watch {
    grammar: Arc<Grammar>,
    /// Each rule with the number of its pattern.
    rules: Vec<(Name, usize)>,
    schema: Arc<Schema>,
    patterns: Vec<Pattern>,
    edges: BTreeMap<LabelId, Vec<(usize, EdgeTrigger)>>,
    nodes: Vec<(usize, NodeTrigger)>,
    /// Searches that were made together, by patterns and their given slots.
    shared: BTreeMap<Vec<(usize, Vec<usize>)>, Shared>,
    epoch: Option<Epoch>,
    version: Version,
    /// A change was taken in halfway: an error came in between.
    torn: bool,
}

/// A match of a rule.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct RuleMatch {
    /// The rule.
    pub rule: Name,
    /// What it matches.
    pub binding: Binding,
}

/// How matches changed: by rule in the order given to [`Watch::new`], then by nodes.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MatchDelta {
    /// Matches that are new.
    pub added: Vec<RuleMatch>,
    /// Matches that are gone.
    pub removed: Vec<RuleMatch>,
}

/// What a change can do to partial matches.
type Touched = BTreeMap<(usize, Seed), Can>;

/// By the nodes that are given, the patterns in which to look for matches with them, and their slots there.
type Makes = BTreeMap<Vec<NodeId>, Vec<(usize, Vec<usize>)>>;

/// By pattern, new and gone matches.
type Rows = BTreeMap<usize, [Vec<Row>; 2]>;

impl Watch {
    /// Finds all matches of the rules in a snapshot.
    ///
    /// # Errors
    /// [`MatchError`].
    pub fn new(
        grammar: Arc<Grammar>,
        rules: &[&str],
        snapshot: &Snapshot,
    ) -> Result<Self, MatchError> {
        let mut watch = Self {
            grammar,
            rules: Vec::new(),
            schema: Arc::clone(snapshot.shared_schema()),
            patterns: Vec::new(),
            edges: BTreeMap::new(),
            nodes: Vec::new(),
            shared: BTreeMap::new(),
            epoch: None,
            version: snapshot.version(),
            torn: false,
        };
        watch.compile(rules, snapshot)?;
        for pattern in &mut watch.patterns {
            for row in pattern.search(snapshot, &Vec::new())? {
                pattern.set.insert(&row);
            }
        }
        Ok(watch)
    }

    fn compile(&mut self, rules: &[&str], snapshot: &Snapshot) -> Result<(), MatchError> {
        self.schema = Arc::clone(snapshot.shared_schema());
        self.patterns.clear();
        self.edges.clear();
        self.nodes.clear();
        self.shared.clear();
        self.rules.clear();
        for &name in rules {
            let rule = self.grammar.find_rule(name)?;
            let query = self.grammar.rule_query(&self.schema, rule)?;
            let like = |pattern: &Pattern| pattern.planned.query().finds_the_same(&query);
            let index = self.patterns.iter().position(like);
            let index = index.unwrap_or(self.patterns.len());
            self.rules.push((rule.name.clone(), index));
            if index < self.patterns.len() {
                continue;
            }
            let triggers = Triggers::of(&query);
            for trigger in triggers.edges {
                let same_label = self.edges.entry(trigger.label).or_default();
                same_label.push((index, trigger));
            }
            let nodes = triggers.nodes.into_iter();
            self.nodes.extend(nodes.map(|trigger| (index, trigger)));
            self.patterns.push(Pattern {
                planned: Planned::new(query),
                changes: 0,
                set: MatchSet::default(),
            });
        }
        Ok(())
    }

    /// The version up to which changes were taken in.
    pub fn version(&self) -> Version {
        self.version
    }

    /// How many matches a rule has; none if it is not watched.
    pub fn count(&self, rule: &str) -> usize {
        self.set_of(rule).map_or(0, |(_, set)| set.len())
    }

    /// The matches of a rule, by ascending nodes; none if it is not watched.
    pub fn matches(&self, rule: &str) -> impl Iterator<Item = Binding> {
        let found = self.set_of(rule);
        found.into_iter().flat_map(|(index, set)| {
            let variables = self.variables(&self.rules[index].0);
            let rows = set.rows().into_iter();
            rows.map(move |row| binding(&variables, row))
        })
    }

    fn set_of(&self, rule: &str) -> Option<(usize, &MatchSet)> {
        let index = self.rules.iter().position(|(name, _)| *name == *rule)?;
        Some((index, &self.patterns[self.rules[index].1].set))
    }

    /// What a rule binds, by slot.
    fn variables(&self, rule: &Name) -> Vec<Name> {
        let nodes = self.grammar.rule(rule).into_iter();
        let nodes = nodes.flat_map(Rule::bound_nodes);
        nodes.map(|node| node.variable.clone()).collect()
    }

    /// Takes in a change. `snapshot` is of the change's version or a later one; an earlier one
    /// leaves all as it is, and the next update makes up for it. Changes that were taken in
    /// already say nothing new; where some were missed, or a store came back, or the schema
    /// changed, all rules are matched afresh.
    ///
    /// # Errors
    /// [`MatchError`]; the next update then matches afresh.
    pub fn update(
        &mut self,
        change: &Change,
        snapshot: &Snapshot,
    ) -> Result<MatchDelta, MatchError> {
        let known = *self.epoch.get_or_insert(change.epoch) == change.epoch;
        if known && change.version <= self.version && !self.torn
            || snapshot.version() < change.version
        {
            return Ok(MatchDelta::default());
        }
        self.epoch = Some(change.epoch);
        let schema = snapshot.shared_schema();
        let renamed = !Arc::ptr_eq(schema, &self.schema) && *schema != self.schema;
        if !known || self.torn || renamed || change.version.0 != self.version.0 + 1 {
            return self.refresh(snapshot);
        }
        self.torn = true;
        let mut rows = self.take_in(change, snapshot)?;
        rows.values_mut()
            .flatten()
            .for_each(|rows| rows.sort_unstable());
        self.torn = false;
        self.version = change.version;
        Ok(self.delta(&rows))
    }

    /// Matches all rules afresh.
    ///
    /// # Errors
    /// [`MatchError`]; the next update then matches afresh, too.
    pub fn refresh(&mut self, snapshot: &Snapshot) -> Result<MatchDelta, MatchError> {
        self.torn = true;
        let names: Vec<Name> = self.rules.iter().map(|(name, _)| name.clone()).collect();
        let before: Vec<BTreeSet<Row>> = names
            .iter()
            .map(|name| {
                self.set_of(name)
                    .map(|(_, set)| set.rows().into_iter().cloned().collect())
            })
            .map(Option::unwrap_or_default)
            .collect();
        let names: Vec<&str> = names.iter().map(Name::as_str).collect();
        let fresh = Self::new(Arc::clone(&self.grammar), &names, snapshot)?;
        *self = Self {
            epoch: self.epoch,
            ..fresh
        };
        let mut delta = MatchDelta::default();
        for (name, before) in names.iter().zip(before) {
            let Some((index, set)) = self.set_of(name) else {
                continue;
            };
            let now: BTreeSet<Row> = set.rows().into_iter().cloned().collect();
            let name = &self.rules[index].0;
            delta.added.extend(self.told(name, now.difference(&before)));
            delta
                .removed
                .extend(self.told(name, before.difference(&now)));
        }
        Ok(delta)
    }

    fn told<'a>(&self, rule: &Name, rows: impl Iterator<Item = &'a Row>) -> Vec<RuleMatch> {
        let mut rows = rows.peekable();
        if rows.peek().is_none() {
            return Vec::new();
        }
        let variables = self.variables(rule);
        let told = rows.map(|row| RuleMatch {
            rule: rule.clone(),
            binding: binding(&variables, row),
        });
        told.collect()
    }

    fn delta(&self, rows: &Rows) -> MatchDelta {
        let mut delta = MatchDelta::default();
        for (name, pattern) in &self.rules {
            if let Some([added, removed]) = rows.get(pattern) {
                delta.added.extend(self.told(name, added.iter()));
                delta.removed.extend(self.told(name, removed.iter()));
            }
        }
        delta
    }

    fn take_in(&mut self, change: &Change, snapshot: &Snapshot) -> Result<Rows, Interrupt> {
        let count = (change.edges.len() + change.nodes.len()) as u64;
        for pattern in &mut self.patterns {
            pattern.changes = pattern.changes.saturating_add(count);
        }
        let mut touched = Touched::new();
        let mut afresh = BTreeSet::new();
        for edge in &change.edges {
            self.edge_touches(edge, snapshot, &mut touched, &mut afresh)?;
        }
        for node in &change.nodes {
            self.node_touches(node, snapshot, &mut touched, &mut afresh)?;
        }
        let mut rows = Rows::new();
        for index in &afresh {
            touched.insert((*index, Seed::new()), Can::EITHER);
        }
        let mut makes: Makes = Makes::new();
        for ((index, seed), can) in touched {
            if afresh.contains(&index) && !seed.is_empty() {
                continue;
            }
            let pattern = &mut self.patterns[index];
            let [_, removed] = rows.entry(index).or_default();
            if can.break_some || can.break_all {
                for row in pattern.set.extending(&seed) {
                    if can.break_all || !pattern.holds(snapshot, &row)? {
                        pattern.set.remove(&row);
                        removed.push(row);
                    }
                }
            }
            if can.make {
                let mut seed = seed;
                seed.sort_unstable_by_key(|&(_, node)| node);
                let (slots, nodes) = seed.into_iter().unzip();
                makes.entry(nodes).or_default().push((index, slots));
            }
        }
        for (nodes, wanted) in makes {
            self.make(snapshot, &nodes, wanted, &mut rows)?;
        }
        Ok(rows)
    }

    fn edge_touches(
        &self,
        edge: &EdgeChange,
        snapshot: &Snapshot,
        touched: &mut Touched,
        afresh: &mut BTreeSet<usize>,
    ) -> Result<(), ReadError> {
        let key = edge.edge;
        let Some(triggers) = self.edges.get(&key.label) else {
            return Ok(());
        };
        let type_of = |id| Ok(snapshot.find_node(id)?.map(|node| node.type_id()));
        let (from, to) = (type_of(key.from)?, type_of(key.to)?);
        for (index, trigger) in triggers {
            let (makes, breaks) = match edge.touch {
                Touch::Created => (trigger.makes, trigger.breaks),
                Touch::Deleted => (trigger.breaks, trigger.makes),
                Touch::Updated => {
                    let named = trigger.attribute.as_ref();
                    let named = named.is_some_and(|name| edge.attributes.contains(name));
                    (named, named)
                }
                Touch::Replaced => (trigger.attribute.is_some(), trigger.attribute.is_some()),
            };
            let gone = edge.touch == Touch::Deleted && trigger.is_link();
            let fits = |anchor: &Anchor, exact: Option<TypeId>| match anchor {
                Anchor::Slot(slot) => {
                    let domain = &self.patterns[*index].planned.query().domains[*slot];
                    exact.is_some_and(|exact| domain.contains(exact))
                }
                _ => true,
            };
            let makes = makes && fits(&trigger.from, from) && fits(&trigger.to, to);
            if makes || breaks {
                let seeds = trigger.seeds(snapshot, key.from, key.to)?;
                let can = Can {
                    make: makes,
                    break_some: breaks && !gone,
                    break_all: breaks && gone,
                };
                note(*index, seeds, can, touched, afresh);
            }
        }
        Ok(())
    }

    fn node_touches(
        &self,
        node: &NodeChange,
        snapshot: &Snapshot,
        touched: &mut Touched,
        afresh: &mut BTreeSet<usize>,
    ) -> Result<(), ReadError> {
        let gone = node.touch == Touch::Deleted;
        for (index, trigger) in &self.nodes {
            let slot = match &trigger.anchor {
                Anchor::Slot(slot) => Some(*slot),
                _ => None,
            };
            if gone && let Some(slot) = slot {
                // Once per slot: each has one trigger of another sort than attributes.
                if !matches!(trigger.when, When::Attribute(_)) {
                    let seeds = Seeds::These(vec![vec![(slot, node.node)]]);
                    let can = Can {
                        break_all: true,
                        ..Can::default()
                    };
                    note(*index, seeds, can, touched, afresh);
                }
                continue;
            }
            let fires = match (&trigger.when, node.touch) {
                (When::Attribute(name), Touch::Updated) => node.attributes.contains(name),
                (When::Came(domain), Touch::Created)
                | (When::Membership(domain), Touch::Created | Touch::Deleted) => {
                    domain.contains(node.type_id)
                }
                (_, Touch::Replaced) => true,
                _ => false,
            };
            if fires {
                let seeds = trigger.anchor.seeds(snapshot, node.node)?;
                note(*index, seeds, Can::EITHER, touched, afresh);
            }
        }
        Ok(())
    }
}

fn binding(variables: &[Name], row: &Row) -> Binding {
    Binding::of_distinct(variables.iter().cloned().zip(row.iter().copied()))
}

fn note(index: usize, seeds: Seeds, can: Can, touched: &mut Touched, afresh: &mut BTreeSet<usize>) {
    let Seeds::These(seeds) = seeds else {
        afresh.insert(index);
        return;
    };
    for seed in seeds {
        touched.entry((index, seed)).or_default().add(can);
    }
}

#[cfg(test)]
mod tests;
