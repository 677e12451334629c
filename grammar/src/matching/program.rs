//! Patterns, conditions and expressions, compiled against one snapshot's schema.
//!
//! Guarantee: what compiles names only variables in its scope; a label, type or attribute that
//! the schema does not have is no error, but is never found in the graph.

use super::MatchError;
use super::choice::Choices;
use super::domain::Domain;
use super::query::Bound;
use crate::{
    Arithmetic, AttributePath, Comparison, Condition, Expression, Name, PatternEdge, PatternNode,
    Types,
};
use dsr::{AttributeId, LabelId, NodeId, Schema, Value};

/// What a variable stands for while a rule is matched or applied.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Slot {
    Unbound,
    Node(NodeId),
    /// A node that the rule creates: the graph does not have it yet.
    New(usize),
}

/// Names to slots, and what names mean in the schema.
#[derive(Debug)]
pub(crate) struct Compiler<'a> {
    types: &'a Types,
    schema: &'a Schema,
    names: Vec<Name>,
    /// The most slots that were in scope at once.
    most: usize,
}

/// A compiled link of a pattern.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Link {
    pub(crate) from: usize,
    pub(crate) label: Option<LabelId>,
    pub(crate) to: usize,
    pub(crate) negated: bool,
}

/// A compiled condition.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Test {
    Link(Link),
    Same(usize, usize),
    Compare(Comparison, Term, Term),
    Not(Box<Test>),
    All(Vec<Test>),
    Any(Vec<Test>),
    Exists(Choices, Box<Test>),
    Forall(Choices, Box<Test>),
}

/// A compiled expression.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Term {
    Constant(Value),
    NodeAttribute {
        node: usize,
        attribute: Option<AttributeId>,
    },
    EdgeAttribute {
        link: Link,
        attribute: Option<AttributeId>,
    },
    Arithmetic(Arithmetic, Vec<Term>),
}

impl<'a> Compiler<'a> {
    pub(crate) fn new(types: &'a Types, schema: &'a Schema) -> Self {
        Self {
            types,
            schema,
            names: Vec::new(),
            most: 0,
        }
    }

    /// Brings a variable into scope, in the next slot.
    pub(crate) fn declare(&mut self, name: &Name) -> usize {
        self.names.push(name.clone());
        self.most = self.most.max(self.names.len());
        self.names.len() - 1
    }

    /// How many slots an environment needs.
    pub(crate) fn slots(&self) -> usize {
        self.most
    }

    pub(crate) fn scope(&self) -> usize {
        self.names.len()
    }

    /// Leaves scopes until only the first `size` variables are left.
    pub(crate) fn leave(&mut self, size: usize) {
        self.names.truncate(size);
    }

    pub(crate) fn slot(&self, name: &Name) -> Result<usize, MatchError> {
        self.names
            .iter()
            .rposition(|known| known == name)
            .ok_or_else(|| MatchError::UnknownVariable {
                variable: name.to_string(),
            })
    }

    pub(crate) fn domain(&self, type_name: &str) -> Domain {
        Domain::new(self.types, self.schema, type_name)
    }

    pub(crate) fn link(&self, edge: &PatternEdge) -> Result<Link, MatchError> {
        Ok(Link {
            negated: edge.negated,
            ..self.ends(&edge.label, &edge.from, &edge.to)?
        })
    }

    pub(crate) fn ends(&self, label: &str, from: &Name, to: &Name) -> Result<Link, MatchError> {
        Ok(Link {
            from: self.slot(from)?,
            label: self.schema.find_label(label),
            to: self.slot(to)?,
            negated: false,
        })
    }

    /// Declares quantified variables.
    pub(crate) fn quantify(&mut self, variables: &[PatternNode]) -> Choices {
        let first = self.names.len();
        let domains: Vec<Domain> = variables
            .iter()
            .map(|variable| {
                self.declare(&variable.variable);
                self.domain(&variable.type_name)
            })
            .collect();
        Choices::new(first, domains)
    }

    pub(crate) fn test(&mut self, condition: &Condition) -> Result<Test, MatchError> {
        Ok(match condition {
            Condition::Edge { label, from, to } => Test::Link(self.ends(label, from, to)?),
            Condition::Same(first, second) => Test::Same(self.slot(first)?, self.slot(second)?),
            Condition::Compare {
                operator,
                left,
                right,
            } => Test::Compare(*operator, self.term(left)?, self.term(right)?),
            Condition::Not(inner) => Test::Not(Box::new(self.test(inner)?)),
            Condition::And(all) => Test::All(self.tests(all)?),
            Condition::Or(any) => Test::Any(self.tests(any)?),
            Condition::Exists { variables, body } => {
                let (choices, body) = self.quantified(variables, body, true)?;
                Test::Exists(choices, Box::new(body))
            }
            Condition::Forall { variables, body } => {
                let (choices, body) = self.quantified(variables, body, false)?;
                Test::Forall(choices, Box::new(body))
            }
            Condition::When {
                condition,
                consequence,
            } => {
                let unless = Test::Not(Box::new(self.test(condition)?));
                Test::Any(vec![unless, self.test(consequence)?])
            }
        })
    }

    /// A quantified formula, and the choices at which it can come out as `outcome`.
    fn quantified(
        &mut self,
        variables: &[PatternNode],
        body: &Condition,
        outcome: bool,
    ) -> Result<(Choices, Test), MatchError> {
        let outer = self.scope();
        let mut choices = self.quantify(variables);
        let body = self.test(body);
        self.leave(outer);
        let body = body?;
        choices.narrow(&body, outcome);
        Ok((choices, body))
    }

    fn tests(&mut self, conditions: &[Condition]) -> Result<Vec<Test>, MatchError> {
        conditions
            .iter()
            .map(|condition| self.test(condition))
            .collect()
    }

    pub(crate) fn term(&self, expression: &Expression) -> Result<Term, MatchError> {
        Ok(match expression {
            Expression::Literal(literal) => Term::Constant(literal.value()),
            Expression::Attribute(AttributePath::Node {
                variable,
                attribute,
            }) => Term::NodeAttribute {
                node: self.slot(variable)?,
                attribute: self.schema.find_attribute(attribute),
            },
            Expression::Attribute(AttributePath::Edge {
                from,
                label,
                to,
                attribute,
            }) => Term::EdgeAttribute {
                link: self.ends(label, from, to)?,
                attribute: self.schema.find_attribute(attribute),
            },
            Expression::Arithmetic { operator, operands } => {
                let operands = operands.iter().map(|operand| self.term(operand));
                Term::Arithmetic(*operator, operands.collect::<Result<_, _>>()?)
            }
        })
    }
}

impl Link {
    /// The same with other slots.
    pub(crate) fn moved(self, to: &impl Fn(usize) -> usize) -> Self {
        Self {
            from: to(self.from),
            to: to(self.to),
            ..self
        }
    }
}

impl Test {
    /// The same with other slots.
    pub(crate) fn moved(&self, to: &impl Fn(usize) -> usize) -> Self {
        let inner = |test: &Self| Box::new(test.moved(to));
        let all = |tests: &[Self]| tests.iter().map(|test| test.moved(to)).collect();
        match self {
            Self::Link(link) => Self::Link(link.moved(to)),
            Self::Same(first, second) => Self::Same(to(*first), to(*second)),
            Self::Compare(operator, left, right) => {
                Self::Compare(*operator, left.moved(to), right.moved(to))
            }
            Self::Not(test) => Self::Not(inner(test)),
            Self::All(tests) => Self::All(all(tests)),
            Self::Any(tests) => Self::Any(all(tests)),
            Self::Exists(choices, test) => Self::Exists(choices.moved(to), inner(test)),
            Self::Forall(choices, test) => Self::Forall(choices.moved(to), inner(test)),
        }
    }

    /// Whether its outcome depends on the slot.
    pub(crate) fn reads(&self, slot: usize) -> bool {
        match self {
            Self::Link(link) => link.from == slot || link.to == slot,
            Self::Same(first, second) => *first == slot || *second == slot,
            Self::Compare(_, left, right) => left.reads(slot) || right.reads(slot),
            Self::Not(inner) => inner.reads(slot),
            Self::All(tests) | Self::Any(tests) => tests.iter().any(|test| test.reads(slot)),
            Self::Exists(_, body) | Self::Forall(_, body) => body.reads(slot),
        }
    }
}

impl Term {
    fn moved(&self, to: &impl Fn(usize) -> usize) -> Self {
        match self {
            Self::Constant(value) => Self::Constant(value.clone()),
            Self::NodeAttribute { node, attribute } => Self::NodeAttribute {
                node: to(*node),
                attribute: *attribute,
            },
            Self::EdgeAttribute { link, attribute } => Self::EdgeAttribute {
                link: link.moved(to),
                attribute: *attribute,
            },
            Self::Arithmetic(operator, operands) => {
                let operands = operands.iter().map(|operand| operand.moved(to));
                Self::Arithmetic(*operator, operands.collect())
            }
        }
    }

    fn reads(&self, slot: usize) -> bool {
        match self {
            Self::Constant(_) => false,
            Self::NodeAttribute { node, .. } => *node == slot,
            Self::EdgeAttribute { link, .. } => link.from == slot || link.to == slot,
            Self::Arithmetic(_, operands) => operands.iter().any(|operand| operand.reads(slot)),
        }
    }
}

impl Term {
    /// Whether it is the attribute that a bound is about.
    pub(crate) fn is_attribute_of(&self, bound: &Bound) -> bool {
        matches!(self, Self::NodeAttribute { node, attribute }
            if *node == bound.slot && *attribute == Some(bound.attribute))
    }
}
