//! Why a rule cannot be applied at a binding, in words.
//!
//! Guarantee: an obstacle is given exactly where the rule does not match.

use super::environment::{CHOICE_LIMIT, Environment, node};
use super::evaluate::is_there;
use super::host::Way;
use super::program::Compiler;
use super::values::values;
use super::{MatchDomain, MatchError, Problem, conjuncts};
use crate::{Binding, Condition, Grammar, Name, PatternEdge, PatternNode, Rule};
use dsr::{LabelId, NodeId, ReadError, Snapshot};
use std::fmt;

/// A variable and the node that it is bound to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct End {
    /// The variable.
    pub variable: String,
    /// The node.
    pub node: NodeId,
    /// The node's name; empty if the graph does not have it.
    pub name: String,
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let variable = &self.variable;
        match &*self.name {
            "" => write!(f, "{variable} (node {})", self.node),
            name if *name == **variable || format!("\"{name}\"") == **variable => {
                f.write_str(variable)
            }
            name => write!(f, "{variable} ({name})"),
        }
    }
}

/// What keeps a rule from being applied, or a goal from holding.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Obstacle {
    /// A variable is not bound.
    #[error("{variable} is not bound to a node")]
    Unbound {
        /// The variable.
        variable: String,
    },
    /// A node is not in the graph.
    #[error("{node} is not in the graph")]
    NoNode {
        /// The node.
        node: End,
    },
    /// A constant of a goal names a node that is not in the graph.
    #[error("there is no node {constant}")]
    NoConstant {
        /// As the goal names it.
        constant: String,
    },
    /// A node that should be gone is in the graph.
    #[error("{node} is still there")]
    StillThere {
        /// The node.
        node: End,
    },
    /// A node is of a type that does not fit.
    #[error("{node} is a {found}, not a {expected}")]
    WrongType {
        /// The node.
        node: End,
        /// Its type.
        found: String,
        /// The pattern's type.
        expected: String,
    },
    /// Two variables are bound to one node.
    #[error("{first} and {second} are the same node")]
    Shared {
        /// One of them.
        first: End,
        /// The other.
        second: End,
    },
    /// A link of the pattern is not there.
    #[error("{from} has no link `{label}` to {to}")]
    MissingLink {
        /// The node it should leave.
        from: End,
        /// The label.
        label: String,
        /// The node it should enter.
        to: End,
    },
    /// A node has no link of a label to any node of the type, or from any.
    #[error("{node} has no link `{label}` {way} a {expected}")]
    NoneLinked {
        /// The node.
        node: End,
        /// The label.
        label: String,
        /// `to` or `from`.
        way: &'static str,
        /// The pattern's type at the other end.
        expected: String,
    },
    /// A starred link of the pattern is there.
    #[error("{from} has a link `{label}` to {to}, which must not be")]
    StarredLink {
        /// The node it leaves.
        from: End,
        /// The label.
        label: String,
        /// The node it enters.
        to: End,
    },
    /// The condition does not hold.
    #[error("{reason}")]
    Condition {
        /// The innermost formula that explains it.
        formula: String,
        /// In words.
        reason: String,
    },
    /// Nothing in the graph fits.
    #[error("nothing in the graph matches the {of}")]
    NoMatch {
        /// Which pattern.
        of: String,
    },
}

/// A variable with its node's name.
pub(crate) fn end(snapshot: &Snapshot, variable: &str, id: NodeId) -> Result<End, ReadError> {
    let name = match snapshot.find_node(id)? {
        Some(node) => node.name()?,
        None => String::new(),
    };
    Ok(End {
        variable: variable.to_owned(),
        node: id,
        name,
    })
}

impl Grammar {
    /// What the nodes of a partial binding alone keep from matching, in the order of the rule: that they
    /// are of other types, the same, or not linked as they should be, to each other or to any node of a
    /// type. `None` where each of that is as it should be, though perhaps not all at once.
    ///
    /// # Errors
    /// [`MatchError`], as for [`Self::matches`].
    pub fn partial_obstacle(
        &self,
        snapshot: &Snapshot,
        rule: &Rule,
        partial: &Binding,
    ) -> Result<Option<Obstacle>, MatchError> {
        let problem = self.rule_problem(snapshot, rule, partial)?;
        let nodes: Vec<&PatternNode> = rule.bound_nodes().collect();
        for (slot, pattern) in nodes.iter().enumerate() {
            if node(&problem.environment, slot).is_some()
                && let Some(obstacle) = wrong_node(snapshot, &problem, &nodes, (slot, pattern))?
            {
                return Ok(Some(obstacle));
            }
        }
        let Problem { query, environment } = &problem;
        for (edge, link) in rule.left.edges.iter().zip(&query.links) {
            let ends = [link.from, link.to].map(|slot| node(environment, slot));
            if let [Some(from), Some(to)] = ends {
                if is_there(snapshot, link, environment)? == link.negated {
                    let ends = [
                        end(snapshot, &edge.from, from)?,
                        end(snapshot, &edge.to, to)?,
                    ];
                    return Ok(Some(wrong_link(edge, ends)));
                }
                continue;
            }
            let (way, bound, variable, other, slot) = match ends {
                [Some(from), None] => (Way::Out, from, &edge.from, &edge.to, link.to),
                [None, Some(to)] => (Way::In, to, &edge.to, &edge.from, link.from),
                _ => continue,
            };
            if link.negated || is_linked(snapshot, (way, bound), link.label, &query.domains[slot])?
            {
                continue;
            }
            let expected = nodes.iter().find(|node| node.variable == *other);
            return Ok(Some(Obstacle::NoneLinked {
                node: end(snapshot, variable, bound)?,
                label: edge.label.to_string(),
                way: match way {
                    Way::Out => "to",
                    Way::In => "from",
                },
                expected: expected.map_or_else(String::new, |node| node.type_name.to_string()),
            }));
        }
        Ok(None)
    }

    /// The first thing of a fully bound problem that does not hold.
    pub(crate) fn explain(
        &self,
        snapshot: &Snapshot,
        mut problem: Problem,
        nodes: &[&PatternNode],
        edges: &[PatternEdge],
        condition: Option<&Condition>,
    ) -> Result<Option<Obstacle>, MatchError> {
        if let Some(obstacle) = bound_nodes(snapshot, &problem, nodes)? {
            return Ok(Some(obstacle));
        }
        let Problem { query, environment } = &mut problem;
        environment.set_limit(CHOICE_LIMIT);
        for (edge, link) in edges.iter().zip(&query.links) {
            if is_there(snapshot, link, environment)? != link.negated {
                continue;
            }
            let (Some(from), Some(to)) = (node(environment, link.from), node(environment, link.to))
            else {
                continue;
            };
            let ends = [
                end(snapshot, &edge.from, from)?,
                end(snapshot, &edge.to, to)?,
            ];
            return Ok(Some(wrong_link(edge, ends)));
        }
        let conditions = condition.into_iter().flat_map(conjuncts);
        for (condition, test) in conditions.zip(&query.tests) {
            if !test.holds(snapshot, environment)? {
                let mut compiler = Compiler::new(&self.types, snapshot.schema());
                for variable in &query.variables {
                    compiler.declare(variable);
                }
                let mut words = Words {
                    snapshot,
                    compiler,
                    environment,
                };
                let (formula, reason) = words.why_not(condition)?;
                return Ok(Some(Obstacle::Condition { formula, reason }));
            }
        }
        Ok(None)
    }
}

/// A link that should be there, or should not, between two nodes.
fn wrong_link(edge: &PatternEdge, [from, to]: [End; 2]) -> Obstacle {
    let label = edge.label.to_string();
    if edge.negated {
        Obstacle::StarredLink { from, label, to }
    } else {
        Obstacle::MissingLink { from, label, to }
    }
}

/// Whether a node has a link of the label to, or from, some node of these types.
fn is_linked(
    snapshot: &Snapshot,
    (way, node): (Way, NodeId),
    label: Option<LabelId>,
    domain: &MatchDomain,
) -> Result<bool, ReadError> {
    let (Some(label), Some(node)) = (label, snapshot.find_node(node)?) else {
        return Ok(false);
    };
    let ends = match way {
        Way::Out => node.typed_targets_of(label),
        Way::In => node.typed_sources_of(label),
    };
    for end in ends {
        if domain.contains(end?.1) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// What is wrong with the bound nodes themselves.
fn bound_nodes(
    snapshot: &Snapshot,
    problem: &Problem,
    nodes: &[&PatternNode],
) -> Result<Option<Obstacle>, MatchError> {
    for (slot, pattern) in nodes.iter().enumerate() {
        if let Some(obstacle) = wrong_node(snapshot, problem, nodes, (slot, pattern))? {
            return Ok(Some(obstacle));
        }
    }
    Ok(None)
}

/// What is wrong with the node of one slot, beside those of the slots before it.
fn wrong_node(
    snapshot: &Snapshot,
    problem: &Problem,
    nodes: &[&PatternNode],
    (slot, pattern): (usize, &PatternNode),
) -> Result<Option<Obstacle>, MatchError> {
    let variable = &pattern.variable;
    let Some(id) = node(&problem.environment, slot) else {
        return Ok(Some(Obstacle::Unbound {
            variable: variable.to_string(),
        }));
    };
    let this = end(snapshot, variable, id)?;
    let Some(found) = snapshot.find_node(id)? else {
        return Ok(Some(Obstacle::NoNode { node: this }));
    };
    if !problem.query.domains[slot].contains(found.type_id()) {
        let (found, expected) = (found.type_name().to_owned(), pattern.type_name.to_string());
        return Ok(Some(Obstacle::WrongType {
            node: this,
            found,
            expected,
        }));
    }
    for (other, earlier) in nodes.iter().enumerate().take(slot) {
        if node(&problem.environment, other) == Some(id) {
            let first = end(snapshot, &earlier.variable, id)?;
            return Ok(Some(Obstacle::Shared {
                first,
                second: this,
            }));
        }
    }
    Ok(None)
}

struct Words<'a, 'e> {
    snapshot: &'a Snapshot,
    compiler: Compiler<'a>,
    environment: &'e mut Environment,
}

impl Words<'_, '_> {
    fn holds(&mut self, condition: &Condition) -> Result<bool, MatchError> {
        let test = self.compiler.test(condition)?;
        self.environment.extend_to(self.compiler.slots());
        Ok(test.holds(self.snapshot, self.environment)?)
    }

    fn end(&self, variable: &Name) -> Result<String, MatchError> {
        let slot = self.compiler.slot(variable)?;
        Ok(match node(self.environment, slot) {
            Some(id) => end(self.snapshot, variable, id)?.to_string(),
            None => variable.to_string(),
        })
    }

    /// The innermost formula that explains why the condition does not hold, and how.
    fn why_not(&mut self, condition: &Condition) -> Result<(String, String), MatchError> {
        let formula = condition.to_string();
        let reason = match condition {
            Condition::Edge { label, from, to } => {
                format!(
                    "{} has no link `{label}` to {}",
                    self.end(from)?,
                    self.end(to)?
                )
            }
            Condition::Same(first, second) => {
                format!("{} is not {}", self.end(first)?, self.end(second)?)
            }
            Condition::Compare { left, right, .. } => {
                let operands = [&**left, &**right];
                let known = values(self.snapshot, &self.compiler, self.environment, &operands)?;
                match &*known {
                    "" => format!("{formula} does not hold"),
                    known => format!("{formula} does not hold: {known}"),
                }
            }
            Condition::Not(inner) => match &**inner {
                Condition::Edge { label, from, to } => format!(
                    "{} has a link `{label}` to {}, which must not be",
                    self.end(from)?,
                    self.end(to)?
                ),
                Condition::Same(first, second) => {
                    format!(
                        "{} and {} are the same node",
                        self.end(first)?,
                        self.end(second)?
                    )
                }
                inner => format!("{inner} holds, which must not be"),
            },
            Condition::And(all) => {
                for inner in all {
                    if !self.holds(inner)? {
                        return self.why_not(inner);
                    }
                }
                format!("{formula} does not hold")
            }
            Condition::Or(_) => format!("nothing of {formula} holds"),
            Condition::Exists { .. } => format!("{formula} does not hold"),
            Condition::Forall { variables, body } => {
                let outer = self.compiler.scope();
                let choices = self.compiler.quantify(variables);
                let test = self.compiler.test(body)?;
                self.environment.extend_to(self.compiler.slots());
                let snapshot = self.snapshot;
                let mut fails = |environment: &mut Environment| {
                    let holds = test.holds(snapshot, environment)?;
                    Ok::<_, MatchError>((!holds).then_some(()))
                };
                let counterexample = choices.each(snapshot, self.environment, &mut fails)?;
                let explained = match counterexample {
                    Some(()) => {
                        let who: Vec<String> = variables
                            .iter()
                            .map(|variable| self.end(&variable.variable))
                            .collect::<Result<_, _>>()?;
                        let (inner, why) = self.why_not(body)?;
                        Some((inner, format!("for {}: {why}", who.join(", "))))
                    }
                    None => None,
                };
                self.compiler.leave(outer);
                match explained {
                    Some(explained) => return Ok(explained),
                    None => format!("{formula} does not hold"),
                }
            }
            Condition::When {
                condition,
                consequence,
            } => {
                let (inner, why) = self.why_not(consequence)?;
                return Ok((inner, format!("{why}, although {condition}")));
            }
        };
        Ok((formula, reason))
    }
}
