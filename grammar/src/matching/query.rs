//! A pattern with its conditions, compiled: what a search plan is made for.
//!
//! Guarantee: a query names nothing of a graph but ids of its schema, so that it serves for every
//! version of a graph whose schema has not changed.

use super::domain::Domain;
use super::environment::{Environment, SEARCH_LIMIT, node};
use super::program::{Compiler, Link, Slot, Term, Test};
use super::{MatchError, conjuncts};
use crate::{Binding, Comparison, Condition, Grammar, Name, PatternEdge, PatternNode, Rule};
use dsr::{AttributeId, Schema, ValueRange};
use std::sync::Arc;

/// A compiled pattern with its conditions.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Query {
    /// Variables by slot.
    pub(crate) variables: Vec<Name>,
    /// By slot.
    pub(crate) domains: Vec<Domain>,
    pub(crate) links: Vec<Link>,
    pub(crate) tests: Vec<Test>,
    /// By test, the variables' slots that it reads.
    pub(crate) reads: Vec<Vec<usize>>,
    /// What tests say of attributes that have an index.
    pub(crate) bounds: Vec<Bound>,
    /// At least one slot per variable, more for quantified ones.
    pub(crate) slots: usize,
}

/// An indexed attribute of a slot's node is in a range, or a test does not hold.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Bound {
    pub(crate) slot: usize,
    pub(crate) attribute: AttributeId,
    pub(crate) range: ValueRange,
}

/// A query, some of its slots bound.
#[derive(Debug, Clone)]
pub(crate) struct Problem {
    pub(crate) query: Arc<Query>,
    pub(crate) environment: Environment,
}

impl Problem {
    /// The slots that are bound from the start, ascending.
    pub(crate) fn given(&self) -> Vec<usize> {
        (0..self.query.variables.len())
            .filter(|&slot| node(&self.environment, slot).is_some())
            .collect()
    }
}

impl Query {
    /// Whether another query, whatever its variables are called, has the same matches.
    pub(crate) fn finds_the_same(&self, other: &Self) -> bool {
        self.domains == other.domains && self.links == other.links && self.tests == other.tests
    }

    /// The query at a binding of some of its variables.
    pub(crate) fn at(
        self: &Arc<Self>,
        rule: &str,
        binding: &Binding,
    ) -> Result<Problem, MatchError> {
        let mut environment = Environment::new(self.slots, SEARCH_LIMIT);
        for (variable, node) in binding.iter() {
            let Some(slot) = self.variables.iter().position(|known| known == variable) else {
                let known = self.variables.iter().map(Name::as_str);
                return Err(MatchError::NotOfRule {
                    rule: rule.to_owned(),
                    variable: variable.to_string(),
                    suggestion: dsr::suggest(variable, known),
                });
            };
            environment[slot] = Slot::Node(node);
        }
        Ok(Problem {
            query: Arc::clone(self),
            environment,
        })
    }
}

impl Grammar {
    pub(crate) fn find_rule(&self, name: &str) -> Result<&Rule, MatchError> {
        self.rule(name).ok_or_else(|| MatchError::NoRule {
            rule: name.to_owned(),
            suggestion: dsr::suggest(name, self.rules.iter().map(|rule| &*rule.name)),
        })
    }

    /// A rule's left side, parameters and precondition.
    pub(crate) fn rule_query(&self, schema: &Schema, rule: &Rule) -> Result<Query, MatchError> {
        let nodes: Vec<&PatternNode> = rule.bound_nodes().collect();
        let (edges, condition) = (&rule.left.edges, rule.precondition.as_ref());
        self.query(schema, &nodes, &rule.parameters, edges, condition)
    }

    /// Compiles nodes, links and a condition. Nodes that `narrowed` names, too, must be of both
    /// types.
    pub(crate) fn query(
        &self,
        schema: &Schema,
        nodes: &[&PatternNode],
        narrowed: &[PatternNode],
        edges: &[PatternEdge],
        condition: Option<&Condition>,
    ) -> Result<Query, MatchError> {
        let mut compiler = Compiler::new(&self.types, schema);
        let mut domains: Vec<Domain> = Vec::with_capacity(nodes.len());
        for (slot, node) in nodes.iter().enumerate() {
            compiler.declare(&node.variable);
            let like = nodes[..slot].iter();
            let mut like = like
                .zip(&domains)
                .filter(|(n, _)| n.type_name == node.type_name);
            let also = || {
                narrowed
                    .iter()
                    .filter(|also| also.variable == node.variable)
            };
            let mut domain = match like.next() {
                Some((_, known)) if narrowed.is_empty() => known.clone(),
                _ => compiler.domain(&node.type_name),
            };
            for also in also().filter(|also| also.type_name != node.type_name) {
                domain = domain.and(&compiler.domain(&also.type_name));
            }
            domains.push(domain);
        }
        let links = edges.iter().map(|edge| compiler.link(edge));
        let links = links.collect::<Result<_, _>>()?;
        let conditions = condition.into_iter().flat_map(conjuncts);
        let tests = conditions.map(|condition| compiler.test(condition));
        let tests: Vec<Test> = tests.collect::<Result<_, _>>()?;
        let reads = |test: &Test| (0..nodes.len()).filter(|&slot| test.reads(slot)).collect();
        Ok(Query {
            variables: nodes.iter().map(|node| node.variable.clone()).collect(),
            reads: tests.iter().map(reads).collect(),
            bounds: tests
                .iter()
                .filter_map(|test| bound(test, schema))
                .collect(),
            slots: compiler.slots(),
            domains,
            links,
            tests,
        })
    }
}

/// What a test says of an attribute with an index.
fn bound(test: &Test, schema: &Schema) -> Option<Bound> {
    let Test::Compare(operator, left, right) = test else {
        return None;
    };
    let (operator, attribute, constant) = match (left, right) {
        (Term::NodeAttribute { .. }, Term::Constant(constant)) => (*operator, left, constant),
        (Term::Constant(constant), Term::NodeAttribute { .. }) => {
            (operator.turned(), right, constant)
        }
        _ => return None,
    };
    let Term::NodeAttribute { node, attribute } = attribute else {
        return None;
    };
    let attribute = attribute.filter(|&attribute| schema.has_index(attribute))?;
    let number = || constant.as_f64().filter(|number| !number.is_nan());
    let range = match operator {
        Comparison::Equal => ValueRange::Equal(constant.clone()),
        Comparison::NotEqual => return None,
        Comparison::Less | Comparison::LessOrEqual => {
            ValueRange::Between(f64::NEG_INFINITY, number()?)
        }
        Comparison::Greater | Comparison::GreaterOrEqual => {
            ValueRange::Between(number()?, f64::INFINITY)
        }
    };
    Some(Bound {
        slot: *node,
        attribute,
        range,
    })
}

impl Comparison {
    /// The comparison that holds of `(b, a)` where this holds of `(a, b)`.
    const fn turned(self) -> Self {
        match self {
            Self::Equal | Self::NotEqual => self,
            Self::Less => Self::Greater,
            Self::LessOrEqual => Self::GreaterOrEqual,
            Self::Greater => Self::Less,
            Self::GreaterOrEqual => Self::LessOrEqual,
        }
    }
}
