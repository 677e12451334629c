//! Rules that are matched again and again.
//!
//! Guarantee: finds what [`Grammar::matches`] finds; what is kept between calls only saves time.

use super::planned::Planned;
use super::{MatchError, Matches};
use crate::{Binding, Grammar};
use dsr::{Schema, Snapshot};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Finds matches of a grammar's rules in one snapshot after another.
///
/// Rules are compiled when they are first asked for, and again when the schema changes. Search
/// plans are kept, by rule and by which of its variables are given, until a count that they go by
/// has doubled or halved. So matches come in an order that depends on the graph and on when it
/// was asked before; sort them where that matters.
///
/// ```
/// # use dsr::{Graph, Schema, Time, Transaction};
/// # use grammar::{Binding, Matcher, parse_grammar};
/// # use std::sync::Arc;
/// # let mut graph = Graph::in_memory(Schema::open());
/// # let mut world = Transaction::new();
/// # world.create_node("robot", "shelly", vec![]);
/// # world.create_node("room", "hall", vec![]);
/// # world.create_edge("shelly", "in", "hall");
/// # graph.commit(&world, "world", Time::default())?;
/// let (grammar, _) = parse_grammar(
///     "name=doors\n===\nleave : active(1) { { r:robot a:room r->a(in) } => { r:robot a:room } }",
///     "doors.aggl",
/// );
/// let mut matcher = Matcher::new(Arc::new(grammar));
/// let snapshot = graph.snapshot();
/// let matches = matcher.matches(&snapshot, "leave", &Binding::new())?;
/// assert_eq!(matches.count_all()?, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Matcher {
    grammar: Arc<Grammar>,
    rules: BTreeMap<String, usize>,
    /// What the queries were compiled for.
    schema: Option<Arc<Schema>>,
    planned: BTreeMap<usize, Planned>,
}

impl Matcher {
    /// A matcher that has compiled nothing yet.
    pub fn new(grammar: Arc<Grammar>) -> Self {
        let rules = grammar.rules.iter().enumerate().rev();
        Self {
            // Of two rules of one name, the first is meant, as everywhere.
            rules: rules
                .map(|(index, rule)| (rule.name.to_string(), index))
                .collect(),
            grammar,
            schema: None,
            planned: BTreeMap::new(),
        }
    }

    /// The grammar whose rules are matched.
    pub fn grammar(&self) -> &Arc<Grammar> {
        &self.grammar
    }

    /// As [`Grammar::matches`], by the rule's name.
    ///
    /// # Errors
    /// [`MatchError`].
    pub fn matches<'a>(
        &mut self,
        snapshot: &'a Snapshot,
        rule: &str,
        partial: &Binding,
    ) -> Result<Matches<'a>, MatchError> {
        let Some(&index) = self.rules.get(rule) else {
            let known = self.rules.keys().map(String::as_str);
            return Err(MatchError::NoRule {
                rule: rule.to_owned(),
                suggestion: dsr::suggest(rule, known),
            });
        };
        let schema = snapshot.shared_schema();
        let same = |known: &Arc<Schema>| Arc::ptr_eq(known, schema) || known == schema;
        if !self.schema.as_ref().is_some_and(same) {
            self.planned.clear();
            self.schema = Some(Arc::clone(schema));
        }
        let planned = match self.planned.entry(index) {
            std::collections::btree_map::Entry::Occupied(known) => known.into_mut(),
            std::collections::btree_map::Entry::Vacant(entry) => {
                let query = self
                    .grammar
                    .rule_query(schema, &self.grammar.rules[index])?;
                entry.insert(Planned::new(query))
            }
        };
        let problem = planned.query().at(rule, partial)?;
        let plan = planned.plan(snapshot, &problem.given())?;
        Ok(Matches::by_plan(snapshot, problem, plan))
    }
}
