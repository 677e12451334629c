//! Rules applied again and again in memory.
//!
//! Guarantee: a step makes of the working graph what a commit of the same rule at the same match
//! makes of the shared one; rules for which that cannot be said are refused from the start.

mod working;

pub use working::WorkingGraph;

use crate::matching::{Ahead, Compiler, Environment, Frame, Link, Plan, Planned, Slot, Slots};
use crate::{Grammar, MatchError, PatternEdge, Rule, SEARCH_LIMIT};
use dsr::{EdgeKey, NodeId, Schema, Snapshot, TypeId};
use std::sync::Arc;

/// Why a rule cannot be applied in memory.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RewriteError {
    /// It cannot be matched.
    #[error(transparent)]
    Match(#[from] MatchError),
    /// It does more than its two sides say.
    #[error("rule `{rule}` {does}, which is not done in memory")]
    Beyond {
        /// The rule.
        rule: String,
        /// What it does besides.
        does: &'static str,
    },
    /// The schema has no such type or label.
    #[error("the schema has no `{name}`, which rule `{rule}` makes")]
    Unknown {
        /// The rule.
        rule: String,
        /// The type or label.
        name: String,
    },
}

/// A rule, ready to be applied to a [`WorkingGraph`] millions of times a second.
///
/// ```
/// # use dsr::{Graph, Schema, Time, Transaction};
/// # use grammar::{Rewriter, WorkingGraph, parse_grammar};
/// # let mut graph = Graph::in_memory(Schema::open());
/// # let mut world = Transaction::new();
/// # world.create_node("robot", "shelly", vec![]);
/// # world.create_node("room", "hall", vec![]);
/// # world.create_edge("shelly", "in", "hall");
/// # graph.commit(&world, "world", Time::default())?;
/// # let snapshot = graph.snapshot();
/// let (grammar, _) = parse_grammar(
///     "name=doors\n===\nleave : active(1) { { r:robot a:room r->a(in) } => { r:robot a:room } }",
///     "doors.aggl",
/// );
/// let mut graph = WorkingGraph::of(&snapshot)?;
/// let mut leave = Rewriter::new(&grammar, "leave", &snapshot)?;
/// assert!(leave.rewrite(&mut graph, &[])?);
/// assert!(!leave.rewrite(&mut graph, &[])?, "nobody is left");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Rewriter {
    planned: Planned,
    /// The slots that were given last, and the plan for them.
    plan: Option<Arc<Plan>>,
    environment: Environment,
    /// What the search reads ahead, by step: kept only to be filled again.
    ahead: Vec<Ahead>,
    unlinks: Vec<Link>,
    deletes: Vec<usize>,
    retypes: Vec<(usize, TypeId)>,
    /// The slots and types of new nodes.
    creates: Vec<(usize, TypeId)>,
    links: Vec<Link>,
}

impl Rewriter {
    /// Compiles a rule for graphs with the snapshot's schema.
    ///
    /// # Errors
    /// [`RewriteError`] where the rule is not there, has an effect block, is `strict`, or makes
    /// what the schema does not have.
    pub fn new(grammar: &Grammar, rule: &str, snapshot: &Snapshot) -> Result<Self, RewriteError> {
        let rule = grammar.find_rule(rule)?;
        let beyond = |does| RewriteError::Beyond {
            rule: rule.name.to_string(),
            does,
        };
        if !rule.effect.is_empty() {
            return Err(beyond("has an effect block"));
        }
        if rule.strict {
            return Err(beyond("is strict"));
        }
        let schema = snapshot.schema();
        let query = grammar.rule_query(schema, rule)?;
        let mut compiler = Compiler::new(&grammar.types, schema);
        for node in rule.bound_nodes() {
            compiler.declare(&node.variable);
        }
        let mut rewriter = Self {
            environment: Environment::new(0, SEARCH_LIMIT),
            // A plan has no more steps than variables.
            ahead: vec![Ahead::default(); query.variables.len()],
            planned: Planned::new(query),
            plan: None,
            unlinks: Vec::new(),
            deletes: Vec::new(),
            retypes: Vec::new(),
            creates: Vec::new(),
            links: Vec::new(),
        };
        for node in &rule.right.nodes {
            let left = rule
                .bound_nodes()
                .find(|left| left.variable == node.variable);
            if left.is_some_and(|left| left.type_name == node.type_name) {
                continue;
            }
            let exact = type_of(schema, rule, &node.type_name)?;
            if left.is_some() {
                rewriter
                    .retypes
                    .push((compiler.slot(&node.variable)?, exact));
            } else {
                rewriter
                    .creates
                    .push((compiler.declare(&node.variable), exact));
            }
        }
        for node in &rule.left.nodes {
            if rule.right.node(&node.variable).is_none() {
                rewriter.deletes.push(compiler.slot(&node.variable)?);
            }
        }
        let slots = compiler.slots().max(rewriter.planned.query().slots);
        rewriter.environment.extend_to(slots);
        for edge in rule.right.edges.iter().filter(|edge| !edge.negated) {
            let link = compiler.link(edge)?;
            if link.label.is_none() {
                return Err(RewriteError::Unknown {
                    rule: rule.name.to_string(),
                    name: edge.label.to_string(),
                });
            }
            rewriter.links.push(link);
        }
        let stays = |edge: &&PatternEdge| {
            let right = rule.right.edge(&edge.from, &edge.label, &edge.to);
            right.is_some_and(|right| !right.negated)
        };
        let gone = rule
            .left
            .edges
            .iter()
            .filter(|edge| !edge.negated && !stays(edge));
        let starred = rule.right.edges.iter().filter(|edge| edge.negated);
        for edge in gone.chain(starred) {
            rewriter.unlinks.push(compiler.link(edge)?);
        }
        Ok(rewriter)
    }

    /// The slot of a variable, for [`Self::rewrite`] and [`Self::node`].
    pub fn slot(&self, variable: &str) -> Option<usize> {
        let variables = &self.planned.query().variables;
        variables.iter().position(|known| *known == *variable)
    }

    /// The node of a slot in the last match that was rewritten.
    pub fn node(&self, slot: usize) -> Option<NodeId> {
        match self.environment.get(slot) {
            Some(Slot::Node(node)) => Some(*node),
            _ => None,
        }
    }

    /// Rewrites the first match that has these nodes in these slots (by ascending slot); `false`
    /// if there is none.
    ///
    /// # Errors
    /// [`MatchError`] where a condition reads an attribute and the snapshot that the graph was made
    /// of is too old, or where too many nodes had to be tried.
    pub fn rewrite(
        &mut self,
        graph: &mut WorkingGraph,
        given: &[(usize, NodeId)],
    ) -> Result<bool, MatchError> {
        let slots = || given.iter().map(|(slot, _)| *slot);
        let plan = match &self.plan {
            Some(plan) if plan.given.iter().copied().eq(slots()) => plan,
            _ => {
                let plan = self.planned.plan(graph, &slots().collect::<Vec<_>>())?;
                self.plan.insert(plan)
            }
        };
        self.environment.fill(Slot::Unbound);
        self.environment.renew();
        for &(slot, node) in given {
            self.environment[slot] = Slot::Node(node);
        }
        let frame = Frame {
            host: graph,
            query: self.planned.query(),
            plan,
        };
        let found = frame.first(&mut Slots {
            environment: &mut self.environment,
            ahead: &mut self.ahead,
        });
        if !found? {
            return Ok(false);
        }
        // Quantified variables had the slots of nodes that are yet to be made.
        for &(slot, _) in &self.creates {
            self.environment[slot] = Slot::Unbound;
        }
        for link in &self.unlinks {
            if let Some(key) = self.key(link) {
                graph.unlink(key);
            }
        }
        for &slot in &self.deletes {
            if let Some(node) = self.node(slot) {
                graph.delete(node);
            }
        }
        for &(slot, exact) in &self.retypes {
            if let Some(node) = self.node(slot) {
                graph.retype(node, exact);
            }
        }
        for index in 0..self.creates.len() {
            let (slot, exact) = self.creates[index];
            self.environment[slot] = Slot::Node(graph.create(exact));
        }
        for link in &self.links {
            if let Some(key) = self.key(link) {
                graph.link(key);
            }
        }
        Ok(true)
    }

    fn key(&self, link: &Link) -> Option<EdgeKey> {
        Some(EdgeKey {
            from: self.node(link.from)?,
            label: link.label?,
            to: self.node(link.to)?,
        })
    }
}

fn type_of(schema: &Schema, rule: &Rule, name: &str) -> Result<TypeId, RewriteError> {
    schema.find_type(name).ok_or_else(|| RewriteError::Unknown {
        rule: rule.name.to_string(),
        name: name.to_owned(),
    })
}

#[cfg(test)]
mod tests;
