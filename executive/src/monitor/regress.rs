//! The rest of a plan regressed: of what its later steps and the goal need, that which no step
//! before them changes, and which must therefore hold already now. This file guarantees that what
//! it keeps is necessary for the plan; where it cannot tell whether a step changes something, that
//! is left out.

use dsr::NodeId;
use grammar::{
    AttributePath, Binding, Condition, Effect, Expression, Goal, Name, Pattern, PatternNode, Rule,
};

/// What a number of steps may change between them. `None` stands for any node or label.
#[derive(Debug, Clone, Default)]
pub(super) struct Touched {
    edges: Vec<(Option<NodeId>, Option<Name>, Option<NodeId>)>,
    attributes: Vec<Name>,
    /// Deleted, or given another type.
    nodes: Vec<Option<NodeId>>,
    /// Whether nodes come, go or change their type.
    population: bool,
}

fn meets<T: PartialEq>(one: Option<&T>, other: Option<&T>) -> bool {
    one.is_none() || other.is_none() || one == other
}

impl Touched {
    /// Adds what applying `rule` at `binding` may change.
    pub(super) fn add(&mut self, rule: &Rule, binding: &Binding) {
        let id = |variable: &Name| binding.get(variable);
        for edge in &rule.left.edges {
            let kept = rule.right.edge(&edge.from, &edge.label, &edge.to);
            if !edge.negated && kept.is_none_or(|kept| kept.negated) {
                self.edges
                    .push((id(&edge.from), Some(edge.label.clone()), id(&edge.to)));
            }
        }
        for edge in &rule.right.edges {
            let known = rule.left.edge(&edge.from, &edge.label, &edge.to);
            if known.is_none_or(|known| known.negated != edge.negated) {
                self.edges
                    .push((id(&edge.from), Some(edge.label.clone()), id(&edge.to)));
            }
        }
        for node in &rule.left.nodes {
            match rule.right.node(&node.variable) {
                None => self.delete(id(&node.variable)),
                Some(kept) if kept.type_name != node.type_name => self.retype(id(&node.variable)),
                Some(_) => {}
            }
        }
        let known = |node: &PatternNode| rule.bound_nodes().any(|n| n.variable == node.variable);
        self.population |= !rule.right.nodes.iter().all(known);
        self.effects(&rule.effect, binding, &mut Vec::new());
    }

    fn delete(&mut self, node: Option<NodeId>) {
        self.edges.push((node, None, None));
        self.edges.push((None, None, node));
        self.retype(node);
    }

    fn retype(&mut self, node: Option<NodeId>) {
        self.nodes.push(node);
        self.population = true;
    }

    fn effects(&mut self, effects: &[Effect], binding: &Binding, scope: &mut Vec<Name>) {
        let depth = scope.len();
        for effect in effects {
            let id = |variable: &Name| {
                let quantified = scope.contains(variable);
                if quantified {
                    None
                } else {
                    binding.get(variable)
                }
            };
            match effect {
                Effect::Link { label, from, to } | Effect::Unlink { label, from, to } => {
                    self.edges.push((id(from), Some(label.clone()), id(to)));
                }
                Effect::Assign { target, .. } => {
                    let (AttributePath::Node { attribute, .. }
                    | AttributePath::Edge { attribute, .. }) = target;
                    self.attributes.push(attribute.clone());
                }
                Effect::Create { variable, .. } => {
                    scope.push(variable.clone());
                    self.population = true;
                }
                Effect::Delete { variable } => {
                    let node = id(variable);
                    self.delete(node);
                }
                Effect::Retype { variable, .. } => {
                    let node = id(variable);
                    self.retype(node);
                }
                Effect::Forall { variables, body } => {
                    scope.extend(variables.iter().map(|node| node.variable.clone()));
                    self.effects(body, binding, scope);
                }
                Effect::When { body, .. } => self.effects(body, binding, scope),
            }
        }
        scope.truncate(depth);
    }

    fn edge(&self, from: Option<NodeId>, label: &Name, to: Option<NodeId>) -> bool {
        self.edges
            .iter()
            .any(|(touched_from, touched_label, touched_to)| {
                meets(touched_from.as_ref(), from.as_ref())
                    && meets(touched_label.as_ref(), Some(label))
                    && meets(touched_to.as_ref(), to.as_ref())
            })
    }

    fn node(&self, id: NodeId) -> bool {
        self.nodes
            .iter()
            .any(|touched| meets(touched.as_ref(), Some(&id)))
    }

    /// The rule with only those needs that hold at `binding` now if they ever will, and the
    /// binding of the variables left in it.
    pub(super) fn needed_by(&self, rule: &Rule, binding: &Binding) -> (Rule, Binding) {
        let kept: Binding = binding
            .iter()
            .filter(|(_, id)| !self.node(*id))
            .map(|(variable, id)| (variable.clone(), id))
            .collect();
        let known = |node: &PatternNode| kept.get(&node.variable).is_some();
        let mut needed = rule.clone();
        needed.left.nodes.retain(known);
        needed.parameters.retain(known);
        needed.left.edges.retain(|edge| {
            let ends = kept.get(&edge.from).zip(kept.get(&edge.to));
            ends.is_some_and(|(from, to)| !self.edge(Some(from), &edge.label, Some(to)))
        });
        needed.precondition = self.conjuncts(rule.precondition.as_ref(), &kept, &[]);
        (needed, kept)
    }

    /// The goal with only those parts that hold now if they ever will.
    pub(super) fn needed_for(&self, goal: &Goal, constants: &Binding) -> Goal {
        let mut needed = goal.clone();
        let free: Vec<Name> = (goal.pattern.nodes.iter())
            .map(|node| node.variable.clone())
            .filter(|variable| constants.get(variable).is_none())
            .collect();
        if self.population && !free.is_empty() {
            needed.pattern = Pattern::default();
            needed.precondition = None;
            return needed;
        }
        let gone = |node: &PatternNode| constants.get(&node.variable).is_some_and(|c| self.node(c));
        let gone: Vec<Name> = (goal.pattern.nodes.iter())
            .filter(|node| gone(node))
            .map(|node| node.variable.clone())
            .collect();
        needed
            .pattern
            .nodes
            .retain(|node| !gone.contains(&node.variable));
        needed.pattern.edges.retain(|edge| {
            let (from, to) = (constants.get(&edge.from), constants.get(&edge.to));
            let stays = !gone.contains(&edge.from) && !gone.contains(&edge.to);
            stays && !self.edge(from, &edge.label, to)
        });
        let kept: Binding = constants
            .iter()
            .filter(|(variable, _)| !gone.contains(variable))
            .map(|(variable, id)| (variable.clone(), id))
            .collect();
        needed.precondition = self.conjuncts(goal.precondition.as_ref(), &kept, &free);
        needed
    }

    fn conjuncts(
        &self,
        condition: Option<&Condition>,
        binding: &Binding,
        free: &[Name],
    ) -> Option<Condition> {
        let all = match condition? {
            Condition::And(all) => all.as_slice(),
            one => std::slice::from_ref(one),
        };
        let settled = |part: &&Condition| !self.unsettles(part, binding, &mut free.to_vec());
        let kept: Vec<Condition> = all.iter().filter(settled).cloned().collect();
        (!kept.is_empty()).then_some(Condition::And(kept))
    }

    /// Whether the steps may change the condition's truth, or it is about nodes not there yet.
    /// Variables in `scope` may be any node.
    fn unsettles(&self, condition: &Condition, binding: &Binding, scope: &mut Vec<Name>) -> bool {
        match condition {
            Condition::Edge { label, from, to } => {
                self.unsettles_edge([from, to], label, binding, scope)
            }
            Condition::Same(one, other) => [one, other]
                .into_iter()
                .any(|variable| end(variable, binding, scope).is_err()),
            Condition::Compare { left, right, .. } => [left, right]
                .into_iter()
                .any(|side| self.unsettles_value(side, binding, scope)),
            Condition::Not(inner) => self.unsettles(inner, binding, scope),
            Condition::And(parts) | Condition::Or(parts) => parts
                .iter()
                .any(|part| self.unsettles(part, binding, scope)),
            Condition::Exists { variables, body } | Condition::Forall { variables, body } => {
                let depth = scope.len();
                scope.extend(variables.iter().map(|node| node.variable.clone()));
                let unsettled = self.population || self.unsettles(body, binding, scope);
                scope.truncate(depth);
                unsettled
            }
            Condition::When {
                condition,
                consequence,
            } => {
                self.unsettles(condition, binding, scope)
                    || self.unsettles(consequence, binding, scope)
            }
        }
    }

    fn unsettles_edge(
        &self,
        ends: [&Name; 2],
        label: &Name,
        binding: &Binding,
        scope: &[Name],
    ) -> bool {
        match ends.map(|variable| end(variable, binding, scope)) {
            [Ok(from), Ok(to)] => self.edge(from, label, to),
            _ => true,
        }
    }

    fn unsettles_value(&self, value: &Expression, binding: &Binding, scope: &[Name]) -> bool {
        match value {
            Expression::Literal(_) => false,
            Expression::Attribute(AttributePath::Node {
                variable,
                attribute,
            }) => self.attributes.contains(attribute) || end(variable, binding, scope).is_err(),
            Expression::Attribute(AttributePath::Edge {
                from,
                label,
                to,
                attribute,
            }) => {
                self.attributes.contains(attribute)
                    || self.unsettles_edge([from, to], label, binding, scope)
            }
            Expression::Arithmetic { operands, .. } => operands
                .iter()
                .any(|operand| self.unsettles_value(operand, binding, scope)),
        }
    }
}

/// The node that a variable stands for: `Err` if it is not there, `Ok(None)` if it may be any.
fn end(variable: &Name, binding: &Binding, scope: &[Name]) -> Result<Option<NodeId>, ()> {
    if scope.contains(variable) {
        return Ok(None);
    }
    binding.get(variable).map(Some).ok_or(())
}
