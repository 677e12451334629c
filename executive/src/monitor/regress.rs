//! The rest of a plan regressed: of what its later steps and the goal need, that which no step
//! before them changes, and which must therefore hold already now. This file guarantees that what
//! it keeps is necessary for the plan; where it cannot tell whether a step changes something, that
//! is left out.

use dsr::{NodeId, ReadError, Snapshot};
use grammar::{
    AttributePath, Binding, Constant, Effect, Goal, Name, Pattern, PatternNode, Rule, Types,
};

mod condition;

/// Stands for every type.
const ANY: &str = "*";

/// What a number of steps may change between them. `None` stands for any node or label.
#[derive(Debug)]
pub(super) struct Touched<'a> {
    types: &'a Types,
    snapshot: &'a Snapshot,
    edges: Vec<(Option<NodeId>, Option<Name>, Option<NodeId>)>,
    /// Links that come about in any case.
    made: Vec<(NodeId, Name, NodeId)>,
    attributes: Vec<Name>,
    /// Deleted, or given another type.
    nodes: Vec<Option<NodeId>>,
    /// Types of which nodes come or go.
    population: Vec<Name>,
}

fn meets<T: PartialEq>(one: Option<&T>, other: Option<&T>) -> bool {
    one.is_none() || other.is_none() || one == other
}

impl<'a> Touched<'a> {
    /// Nothing yet.
    pub(super) fn new(types: &'a Types, snapshot: &'a Snapshot) -> Self {
        Self {
            types,
            snapshot,
            edges: Vec::new(),
            made: Vec::new(),
            attributes: Vec::new(),
            nodes: Vec::new(),
            population: Vec::new(),
        }
    }

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
            if known.is_some_and(|known| known.negated == edge.negated) {
                continue;
            }
            let (from, label, to) = (id(&edge.from), edge.label.clone(), id(&edge.to));
            if let (false, Some(from), Some(to)) = (edge.negated, from, to) {
                self.made.push((from, label.clone(), to));
            }
            self.edges.push((from, Some(label), to));
        }
        for node in &rule.left.nodes {
            let gone = match rule.right.node(&node.variable) {
                None => true,
                Some(kept) if kept.type_name == node.type_name => continue,
                Some(kept) => {
                    self.population.push(kept.type_name.clone());
                    false
                }
            };
            self.population.push(node.type_name.clone());
            self.displace(id(&node.variable), gone);
        }
        let new = |node: &&PatternNode| !rule.bound_nodes().any(|n| n.variable == node.variable);
        let new = rule.right.nodes.iter().filter(new);
        self.population
            .extend(new.map(|node| node.type_name.clone()));
        self.effects(&rule.effect, binding, &mut Vec::new());
    }

    /// A node goes, or changes its type.
    fn displace(&mut self, node: Option<NodeId>, gone: bool) {
        self.nodes.push(node);
        if gone {
            self.edges.push((node, None, None));
            self.edges.push((None, None, node));
        }
    }

    /// Whether nodes of that type or its kin may come or go.
    fn populates(&self, type_name: &str) -> bool {
        let schema = self.snapshot.schema();
        let below = |special: &str, general: &str| {
            let known = schema.find_type(special).zip(schema.find_type(general));
            self.types.is_subtype(special, general)
                || known.is_some_and(|(special, general)| schema.is_subtype(special, general))
        };
        self.population.iter().any(|changing| {
            *changing == ANY || below(changing, type_name) || below(type_name, changing)
        })
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
                Effect::Create {
                    variable,
                    type_name,
                } => {
                    scope.push(variable.clone());
                    self.population.push(type_name.clone());
                }
                Effect::Delete { variable } | Effect::Retype { variable, .. } => {
                    let gone = matches!(effect, Effect::Delete { .. });
                    let node = id(variable);
                    self.population.push(ANY.into());
                    self.displace(node, gone);
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

    /// Whether the node can stand for that variable of the goal, of which `aim` is known so far.
    fn fits(
        &self,
        goal: &Goal,
        aim: &Binding,
        variable: &Name,
        id: NodeId,
    ) -> Result<bool, ReadError> {
        if let Some(known) = aim.get(variable) {
            return Ok(known == id);
        }
        let (Some(wanted), Some(node)) =
            (goal.pattern.node(variable), self.snapshot.find_node(id)?)
        else {
            return Ok(false);
        };
        let schema = self.snapshot.schema();
        let wanted_id = schema.find_type(&wanted.type_name);
        let is_kin = wanted_id.is_some_and(|general| schema.is_subtype(node.type_id(), general))
            || self.types.is_subtype(node.type_name(), &wanted.type_name);
        Ok(is_kin && !aim.iter().any(|(_, taken)| taken == id))
    }

    /// The nodes that the plan makes the goal hold at: its constants, and each variable for which
    /// the steps make but one link of the goal's.
    fn aimed_at(&self, goal: &Goal, constants: &Binding) -> Result<Binding, ReadError> {
        let mut aim = constants.clone();
        for edge in goal.pattern.edges.iter().filter(|edge| !edge.negated) {
            let mut fitting: Vec<(NodeId, NodeId)> = Vec::new();
            for (from, label, to) in &self.made {
                if *label == edge.label
                    && self.fits(goal, &aim, &edge.from, *from)?
                    && self.fits(goal, &aim, &edge.to, *to)?
                {
                    fitting.push((*from, *to));
                }
            }
            fitting.sort_unstable();
            fitting.dedup();
            if let [(from, to)] = fitting[..] {
                aim.insert(edge.from.clone(), from);
                aim.insert(edge.to.clone(), to);
            }
        }
        Ok(aim)
    }

    /// The goal, at the nodes that the plan makes it hold at, with only those parts that hold now
    /// if they ever will.
    pub(super) fn needed_for(&self, goal: &Goal, constants: &Binding) -> Result<Goal, ReadError> {
        let constants = &self.aimed_at(goal, constants)?;
        let mut needed = goal.clone();
        for (variable, id) in constants.iter() {
            let name = variable.to_string();
            needed.constants.entry(name).or_insert(Constant::Id(id.0));
        }
        let free: Vec<Name> = (goal.pattern.nodes.iter())
            .map(|node| node.variable.clone())
            .filter(|variable| constants.get(variable).is_none())
            .collect();
        let populated = |variable: &Name| {
            let node = goal.pattern.node(variable);
            node.is_some_and(|node| self.populates(&node.type_name))
        };
        if free.iter().any(populated) {
            needed.pattern = Pattern::default();
            needed.precondition = None;
            return Ok(needed);
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
        Ok(needed)
    }
}
