//! Rules carried out one after another, as one rule.
//!
//! Guarantee: what each step needs is said of the graph before the first one, and what they change
//! is said of the graph after the last; where one rule cannot say it, [`Impossible`] does.

use super::consistent::{consistent, contains, contradiction};
use super::regress::{Footprint, footprint};
use crate::{
    AttributePath, Condition, Effect, Expression, Name, PatternEdge, PatternNode, Rule, Types,
};

/// Formulas of unfolded rules may have so many parts: each node that a step creates doubles what a
/// quantified formula after it says.
const FORMULA_LIMIT: usize = 10_000;

/// Why steps cannot be one rule, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Impossible(pub(super) String);

pub(super) type Outcome<T> = Result<T, Impossible>;

pub(super) fn impossible<T>(reason: String) -> Outcome<T> {
    Err(Impossible(reason))
}

/// A node between two steps.
#[derive(Debug, Clone)]
pub(super) struct Node {
    pub(super) variable: Name,
    /// Its type on the left; `None` for one that a step creates.
    pub(super) before: Option<Name>,
    /// Further types that it must be of.
    pub(super) narrowed: Vec<Name>,
    /// Bound, but on no left side.
    pub(super) parameter: bool,
    /// Its type, as far as it is known: exact where `retyped` or created.
    pub(super) now: Name,
    pub(super) retyped: bool,
    pub(super) deleted: bool,
}

impl Node {
    pub(super) fn created(&self) -> bool {
        self.before.is_none()
    }
}

/// A link between two steps.
#[derive(Debug, Clone)]
pub(super) struct Link {
    pub(super) from: Name,
    pub(super) label: Name,
    pub(super) to: Name,
    /// What the first step that looked at it needs it to be.
    pub(super) needed: Option<bool>,
    /// What it is now.
    pub(super) now: bool,
    /// A step has said so, rather than found it so.
    pub(super) written: bool,
}

#[derive(Debug)]
pub(super) struct Composition<'a> {
    pub(super) types: &'a Types,
    pub(super) nodes: Vec<Node>,
    pub(super) links: Vec<Link>,
    pub(super) assigned: Vec<(AttributePath, Expression)>,
    pub(super) conditions: Vec<Condition>,
    /// Quantified and conditional effects.
    pub(super) effects: Vec<Effect>,
    /// What those may change.
    loose: Footprint,
    pub(super) durations: Vec<Expression>,
    /// Whether the steps that delete nodes are strict.
    pub(super) strict: Option<bool>,
    /// No step was carried out yet.
    first: bool,
    /// How many more parts of formulas may be looked at.
    pub(super) budget: std::cell::Cell<usize>,
}

impl<'a> Composition<'a> {
    pub(super) fn new(types: &'a Types) -> Self {
        Self {
            types,
            nodes: Vec::new(),
            links: Vec::new(),
            assigned: Vec::new(),
            conditions: Vec::new(),
            effects: Vec::new(),
            loose: Footprint::default(),
            durations: Vec::new(),
            strict: None,
            first: true,
            budget: std::cell::Cell::new(FORMULA_LIMIT),
        }
    }

    pub(super) fn node(&self, variable: &str) -> Option<&Node> {
        self.nodes.iter().find(|node| node.variable == *variable)
    }

    fn node_mut(&mut self, variable: &str) -> Option<&mut Node> {
        self.nodes
            .iter_mut()
            .find(|node| node.variable == *variable)
    }

    pub(super) fn link(&self, from: &str, label: &str, to: &str) -> Option<&Link> {
        self.links
            .iter()
            .find(|link| link.from == *from && link.label == *label && link.to == *to)
    }

    /// Whether nodes were created, deleted or retyped.
    pub(super) fn restructured(&self) -> bool {
        self.nodes
            .iter()
            .any(|node| node.created() || node.deleted || node.retyped)
    }

    /// Carries out one more step, whose variables are those of the whole.
    pub(super) fn step(&mut self, rule: &Rule, alias: &str, last: bool) -> Outcome<()> {
        let loose = footprint(rule);
        self.apart(rule, &loose, alias, last)?;
        for node in rule.bound_nodes() {
            self.bind(node, rule.left.node(&node.variable).is_none(), alias)?;
        }
        for node in &rule.parameters {
            self.narrow(&node.variable, &node.type_name, alias)?;
        }
        for edge in &rule.left.edges {
            self.need(edge, alias)?;
        }
        if let Some(condition) = &rule.precondition {
            let regressed = self.condition(condition)?;
            match regressed {
                Condition::And(all) => self.conditions.extend(all),
                other => self.conditions.push(other),
            }
        }
        if let Some(duration) = &rule.duration {
            let duration = self.defined(duration)?;
            self.durations.push(duration);
        }
        let mut assigned = Vec::new();
        let mut effects = Vec::new();
        for effect in &rule.effect {
            match effect {
                Effect::Assign { target, value } => {
                    let value = self.defined(value)?;
                    if assigned.iter().any(|(t, v)| t == target && *v != value) {
                        return contradiction(attribute(target), alias);
                    }
                    assigned.push((target.clone(), value));
                }
                Effect::Forall { .. } | Effect::When { .. } => effects.push(self.effect(effect)?),
                _ => {}
            }
        }
        consistent(rule, alias)?;
        self.change(rule, alias)?;
        for (target, value) in assigned {
            self.assign(target, value)?;
        }
        if loose.structure {
            self.delete_as(rule.strict)?;
        }
        self.first = false;
        self.effects.extend(effects);
        self.loose.extend(loose.changes_of());
        Ok(())
    }

    /// Refuses a step whose relation to earlier quantified effects, or whose own quantified
    /// effects' relation to what earlier steps did, one rule cannot say.
    fn apart(&self, rule: &Rule, loose: &Footprint, alias: &str, last: bool) -> Outcome<()> {
        let before = &self.loose;
        let changed = before.linked.iter().chain(&before.unlinked);
        if let Some(label) = changed.into_iter().find(|l| loose.reads.contains(*l)) {
            return impossible(format!(
                "step `{alias}` looks at `{label}`, which a conditional effect before it changes"
            ));
        }
        let attributes = loose.reads.iter().chain(&loose.assigned).chain(&loose.sets);
        if let Some(name) = attributes
            .into_iter()
            .find(|a| before.assigned.contains(*a))
        {
            return impossible(format!(
                "step `{alias}` uses `{name}`, which a conditional effect before it sets"
            ));
        }
        let cut = loose.unlinked.iter().chain(&loose.cuts);
        if let Some(label) = cut.into_iter().find(|l| before.linked.contains(*l)) {
            return impossible(format!(
                "step `{alias}` takes `{label}` away, which a conditional effect before it adds"
            ));
        }
        let wanted = |link: &Link| {
            link.now
                && loose.unlinked.contains(&*link.label)
                && rule
                    .right
                    .edge(&link.from, &link.label, &link.to)
                    .is_none_or(|e| e.negated)
        };
        if let Some(link) = self.links.iter().find(|link| wanted(link)) {
            return impossible(format!(
                "step `{alias}` may take `{}` away, which an earlier step keeps or adds",
                link.label
            ));
        }
        let set = |path: &AttributePath| loose.assigned.contains(attribute(path));
        if let Some((path, _)) = self.assigned.iter().find(|(path, _)| set(path)) {
            let name = attribute(path);
            return impossible(format!(
                "step `{alias}` may set `{name}`, which an earlier step sets"
            ));
        }
        if loose.structure && !last {
            return impossible(format!(
                "step `{alias}` creates, deletes or retypes nodes conditionally, and is not the last"
            ));
        }
        if loose.structure && self.nodes.iter().any(|node| node.retyped) {
            return impossible(format!(
                "step `{alias}` may retype or delete what an earlier step retypes"
            ));
        }
        if loose.structure && rule.strict && !self.first {
            return impossible(format!(
                "step `{alias}` deletes strictly and conditionally after other steps"
            ));
        }
        if loose.quantified && self.restructured() {
            return impossible(format!(
                "step `{alias}` has a quantified effect after nodes came, went or changed type"
            ));
        }
        Ok(())
    }

    /// A node that the step binds.
    fn bind(&mut self, node: &PatternNode, parameter: bool, alias: &str) -> Outcome<()> {
        match self.node(&node.variable) {
            None => {
                self.nodes.push(Node {
                    variable: node.variable.clone(),
                    before: Some(node.type_name.clone()),
                    narrowed: Vec::new(),
                    parameter,
                    now: node.type_name.clone(),
                    retyped: false,
                    deleted: false,
                });
                Ok(())
            }
            Some(known) if known.deleted => impossible(format!(
                "step `{alias}` uses `{}`, which an earlier step deletes",
                node.variable
            )),
            Some(_) => {
                if !parameter && let Some(known) = self.node_mut(&node.variable) {
                    known.parameter = false;
                }
                self.narrow(&node.variable, &node.type_name, alias)
            }
        }
    }

    fn narrow(&mut self, variable: &Name, type_name: &Name, alias: &str) -> Outcome<()> {
        let types = self.types;
        let Some(node) = self.node_mut(variable) else {
            return Ok(());
        };
        if types.is_subtype(&node.now, type_name) {
            return Ok(());
        }
        if node.created() || node.retyped {
            let now = &node.now;
            return impossible(format!(
                "step `{alias}` needs `{variable}` to be a `{type_name}`, but then it is a `{now}`"
            ));
        }
        if types.is_subtype(type_name, &node.now) {
            node.before = Some(type_name.clone());
            node.now = type_name.clone();
        } else if !node.narrowed.contains(type_name) {
            node.narrowed.push(type_name.clone());
        }
        Ok(())
    }

    /// A link of the step's left side.
    fn need(&mut self, edge: &PatternEdge, alias: &str) -> Outcome<()> {
        let wanted = !edge.negated;
        let made = |name: &Name| self.node(name).is_some_and(Node::created);
        let known = match self.link(&edge.from, &edge.label, &edge.to) {
            Some(link) => Some(link.now),
            None if made(&edge.from) || made(&edge.to) => Some(false),
            None => None,
        };
        match known {
            Some(now) if now == wanted => Ok(()),
            Some(now) => {
                let there = if now { "there" } else { "not there" };
                impossible(format!(
                    "step `{alias}` cannot follow: `{}->{}({})` is {there} then",
                    edge.from, edge.to, edge.label
                ))
            }
            None => {
                self.links.push(Link {
                    from: edge.from.clone(),
                    label: edge.label.clone(),
                    to: edge.to.clone(),
                    needed: Some(wanted),
                    now: wanted,
                    written: false,
                });
                Ok(())
            }
        }
    }

    fn write(&mut self, (from, label, to): (&Name, &Name, &Name), now: bool) -> Outcome<()> {
        let is_target = |path: &AttributePath| {
            matches!(path, AttributePath::Edge { from: f, label: l, to: t, .. }
                if f == from && l == label && t == to)
        };
        let was = self.link(from, label, to).map(|link| link.now);
        if !now {
            self.assigned.retain(|(path, _)| !is_target(path));
        } else if was != Some(true) && self.assigned.iter().any(|(path, _)| is_target(path)) {
            return impossible(format!(
                "an attribute of `{from}->{to}({label})` is set before it is made"
            ));
        }
        let same = |link: &&mut Link| link.from == *from && link.label == *label && link.to == *to;
        match self.links.iter_mut().find(same) {
            Some(link) => {
                link.written |= link.now != now || link.needed.is_none();
                link.now = now;
            }
            None => self.links.push(Link {
                from: from.clone(),
                label: label.clone(),
                to: to.clone(),
                needed: None,
                now,
                written: true,
            }),
        }
        Ok(())
    }

    /// What the step's sides and its unconditional effects change.
    fn change(&mut self, rule: &Rule, alias: &str) -> Outcome<()> {
        let mut wanted: Vec<(&Name, &Name, &Name)> = Vec::new();
        let mut unwanted: Vec<(&Name, &Name, &Name)> = Vec::new();
        let mut deleted: Vec<&Name> = Vec::new();
        for edge in rule.left.edges.iter().filter(|edge| !edge.negated) {
            if rule.right.edge(&edge.from, &edge.label, &edge.to).is_none() {
                unwanted.push((&edge.from, &edge.label, &edge.to));
            }
        }
        for edge in &rule.right.edges {
            let list = if edge.negated {
                &mut unwanted
            } else {
                &mut wanted
            };
            list.push((&edge.from, &edge.label, &edge.to));
        }
        for node in &rule.right.nodes {
            let bound = rule.bound_nodes().find(|b| b.variable == node.variable);
            match bound {
                None => self.create(&node.variable, &node.type_name, alias)?,
                Some(bound) if bound.type_name != node.type_name => {
                    self.retype(&node.variable, &node.type_name);
                }
                Some(_) => {}
            }
        }
        for node in &rule.left.nodes {
            if rule.right.node(&node.variable).is_none() {
                deleted.push(&node.variable);
            }
        }
        for effect in &rule.effect {
            match effect {
                Effect::Link { label, from, to } => wanted.push((from, label, to)),
                Effect::Unlink { label, from, to } => unwanted.push((from, label, to)),
                Effect::Create {
                    variable,
                    type_name,
                } => self.create(variable, type_name, alias)?,
                Effect::Delete { variable } => deleted.push(variable),
                Effect::Retype {
                    variable,
                    type_name,
                } => self.retype(variable, type_name),
                _ => {}
            }
        }
        let touches = |link: &Link| deleted.iter().any(|&d| link.from == *d || link.to == *d);
        let cut = |link: &Link| unwanted.contains(&(&link.from, &link.label, &link.to));
        if rule.strict
            && let Some(link) = self.links.iter().find(|l| l.now && touches(l) && !cut(l))
        {
            return impossible(format!(
                "step `{alias}` is strict and would leave a link `{}` hanging",
                link.label
            ));
        }
        for link in unwanted {
            if !wanted.contains(&link) {
                self.write(link, false)?;
            }
        }
        for link in wanted {
            self.write(link, true)?;
        }
        if !deleted.is_empty() {
            self.delete_as(rule.strict)?;
        }
        for variable in deleted {
            if let Some(node) = self.node_mut(variable) {
                node.deleted = true;
            }
        }
        Ok(())
    }

    fn delete_as(&mut self, strict: bool) -> Outcome<()> {
        if self
            .strict
            .replace(strict)
            .is_some_and(|before| before != strict)
        {
            return impossible("some of its steps delete strictly and others do not".to_owned());
        }
        Ok(())
    }

    fn create(&mut self, variable: &Name, type_name: &Name, alias: &str) -> Outcome<()> {
        if self.node(variable).is_some() {
            return impossible(format!(
                "step `{alias}` creates `{variable}`, which an earlier step has"
            ));
        }
        self.nodes.push(Node {
            variable: variable.clone(),
            before: None,
            narrowed: Vec::new(),
            parameter: false,
            now: type_name.clone(),
            retyped: false,
            deleted: false,
        });
        Ok(())
    }

    fn retype(&mut self, variable: &Name, type_name: &Name) {
        if let Some(node) = self.node_mut(variable) {
            node.now = type_name.clone();
            node.retyped |= !node.created();
        }
    }

    /// A later value takes the place of an earlier one, unless that might have had none.
    fn assign(&mut self, target: AttributePath, value: Expression) -> Outcome<()> {
        let known = self.assigned.iter_mut().find(|(path, _)| *path == target);
        let Some((_, before)) = known else {
            self.assigned.push((target, value));
            return Ok(());
        };
        let sure = |before: &Expression| match before {
            Expression::Literal(_) => true,
            other => contains(&value, other),
        };
        if !sure(before) {
            let name = attribute(&target);
            return impossible(format!(
                "`{name}` is set twice, from values that may be missing"
            ));
        }
        *before = value;
        Ok(())
    }
}

/// The attribute that a path names.
pub(super) fn attribute(path: &AttributePath) -> &str {
    match path {
        AttributePath::Node { attribute, .. } | AttributePath::Edge { attribute, .. } => attribute,
    }
}
