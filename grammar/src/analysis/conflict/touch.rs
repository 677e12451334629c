//! What a rule changes and what it looks at, by type, label and attribute.
//!
//! Guarantee: a rule that touches nothing of what another looks at cannot disable it.

use super::overlay::Shared;
use crate::analysis::kinds::{Kind, Kinds};
use crate::{AttributePath, Condition, Effect, Expression, Name, PatternNode, Rule};
use std::collections::{BTreeMap, BTreeSet};

/// How a rule comes by a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum How {
    /// It is part of the match.
    Bound,
    /// The rule makes it.
    Made,
    /// A quantifier goes over it.
    Quantified,
}

/// A node of a rule.
#[derive(Debug, Clone, Copy)]
struct End {
    kind: Kind,
    how: How,
    /// Its place among the nodes of the match, if it is one of them.
    place: usize,
}

#[derive(Debug, Clone, Copy)]
enum Thing<'g> {
    /// A link, which comes or is looked for (`true`), goes or must not be there (`false`).
    Link([End; 2], &'g str, Option<bool>),
    /// A value of a node, or of a link with this label.
    Value(&'g str, Result<End, &'g str>),
    /// A node that goes or changes its type, or that is looked at.
    Node(End, Option<Kind>),
    /// A node that comes.
    New(Kind),
}

/// What a rule changes, and what it looks at.
#[derive(Default)]
pub(super) struct Touched<'g> {
    changes: Vec<Thing<'g>>,
    looks: Vec<Thing<'g>>,
    /// How many variables are quantified over within each other at most.
    pub(super) depth: u32,
}

/// The variables of a formula, beside those of what stands around it.
#[derive(Default)]
struct Scope<'s, 'g> {
    around: Option<&'s Scope<'s, 'g>>,
    own: BTreeMap<&'g str, End>,
}

impl<'g> Scope<'_, 'g> {
    fn get(&self, name: &str) -> Option<&End> {
        let mut scopes = std::iter::successors(Some(self), |scope| scope.around);
        scopes.find_map(|scope| scope.own.get(name))
    }

    fn inside(&self) -> Scope<'_, 'g> {
        Scope {
            around: Some(self),
            own: BTreeMap::new(),
        }
    }
}

struct Reader<'a, 'g> {
    kinds: &'a Kinds<'g>,
    touched: Touched<'g>,
}

impl<'g> Touched<'g> {
    /// Of a rule of which all types are known.
    pub(super) fn of(kinds: &Kinds<'g>, rule: &'g Rule) -> Self {
        let mut reader = Reader {
            kinds,
            touched: Touched::default(),
        };
        let (left, right) = (rule.left.index(), rule.right.index());
        let mut scope = Scope::default();
        for (place, node) in rule.bound_nodes().enumerate() {
            if let Some(end) = reader.declare(&mut scope, node, How::Bound) {
                let end = End { place, ..end };
                scope.own.insert(&node.variable, end);
                reader.touched.looks.push(Thing::Node(end, None));
                let after = right.node(&node.variable);
                let becomes = after.and_then(|after| kinds.find(&after.type_name));
                let is_parameter = left.node(&node.variable).is_none();
                if becomes != Some(end.kind) && (after.is_some() || !is_parameter) {
                    reader.touched.changes.push(Thing::Node(end, becomes));
                }
            }
        }
        for node in &rule.right.nodes {
            if scope.get(&node.variable).is_none()
                && let Some(end) = reader.declare(&mut scope, node, How::Made)
            {
                reader.touched.changes.push(Thing::New(end.kind));
            }
        }
        for edge in &rule.left.edges {
            let names = (&edge.from, &edge.label, &edge.to);
            reader.look_at(&scope, names, Some(!edge.negated));
            let kept = right.edge(&edge.from, &edge.label, &edge.to);
            if !edge.negated && kept.is_none_or(|kept| kept.negated) {
                reader.change(&scope, names, false);
            }
        }
        for edge in &rule.right.edges {
            let before = left.edge(&edge.from, &edge.label, &edge.to);
            if edge.negated || before.is_none_or(|before| before.negated) {
                reader.change(&scope, (&edge.from, &edge.label, &edge.to), !edge.negated);
            }
        }
        for condition in rule.precondition.as_slice() {
            reader.condition(&scope, condition, 0);
        }
        reader.effects(&mut scope, &rule.effect, 0);
        reader.touched
    }

    /// What [`Self::needs`] costs.
    pub(super) fn checks(&self, other: &Self) -> u64 {
        (self.changes.len() * other.looks.len()) as u64
    }

    /// Whether anything that is changed here is of a kind that the other looks at.
    pub(super) fn touches(&self, kinds: &Kinds<'g>, other: &Self) -> bool {
        let mut changes = self.changes.iter();
        changes.any(|change| other.looks.iter().any(|look| touches(kinds, change, look)))
    }

    /// Of these sets of nodes one must be shared for a change here to be of what the other looks at; none where
    /// nothing that is changed here is of a kind that it looks at.
    pub(super) fn needs(&self, kinds: &Kinds<'g>, other: &Self) -> BTreeSet<Vec<Shared>> {
        let looks = || other.looks.iter();
        let pairs = self
            .changes
            .iter()
            .flat_map(|one| looks().map(move |two| (one, two)));
        let touching = pairs.filter(|(change, look)| touches(kinds, change, look));
        let needs: BTreeSet<Vec<Shared>> = touching.map(|(a, b)| shared(a, b)).collect();
        if needs.contains(&Vec::new()) {
            return BTreeSet::from([Vec::new()]);
        }
        needs
    }

    /// Under which words [`Index`] finds who looks at what is changed here.
    fn words(things: &[Thing<'g>]) -> BTreeSet<Word<'g>> {
        things.iter().map(Thing::word).collect()
    }
}

impl<'g> Reader<'_, 'g> {
    fn declare(&self, scope: &mut Scope<'_, 'g>, node: &'g PatternNode, how: How) -> Option<End> {
        let kind = self.kinds.find(&node.type_name)?;
        let place = 0;
        let end = End { kind, how, place };
        scope.own.insert(&node.variable, end);
        Some(end)
    }

    fn link(
        scope: &Scope<'_, 'g>,
        (from, label, to): (&'g Name, &'g Name, &'g Name),
        there: Option<bool>,
    ) -> Option<Thing<'g>> {
        let ends = [*scope.get(from)?, *scope.get(to)?];
        Some(Thing::Link(ends, label, there))
    }

    fn change(&mut self, scope: &Scope<'_, 'g>, link: (&'g Name, &'g Name, &'g Name), there: bool) {
        self.touched
            .changes
            .extend(Self::link(scope, link, Some(there)));
    }

    fn look_at(
        &mut self,
        scope: &Scope<'_, 'g>,
        link: (&'g Name, &'g Name, &'g Name),
        there: Option<bool>,
    ) {
        self.touched.looks.extend(Self::link(scope, link, there));
    }

    fn condition(&mut self, scope: &Scope<'_, 'g>, condition: &'g Condition, depth: u32) {
        self.touched.depth = self.touched.depth.max(depth);
        match condition {
            Condition::Edge { label, from, to } => self.look_at(scope, (from, label, to), None),
            Condition::Same(..) => {}
            Condition::Compare { left, right, .. } => {
                self.expression(scope, left);
                self.expression(scope, right);
            }
            Condition::Not(inner) => self.condition(scope, inner, depth),
            Condition::And(all) | Condition::Or(all) => {
                for inner in all {
                    self.condition(scope, inner, depth);
                }
            }
            Condition::Exists { variables, body } | Condition::Forall { variables, body } => {
                let mut scope = scope.inside();
                for node in variables {
                    let end = self.declare(&mut scope, node, How::Quantified);
                    let look = end.map(|end| Thing::Node(end, None));
                    self.touched.looks.extend(look);
                }
                let depth = depth.saturating_add(variables.len() as u32);
                self.condition(&scope, body, depth);
            }
            Condition::When {
                condition,
                consequence,
            } => {
                self.condition(scope, condition, depth);
                self.condition(scope, consequence, depth);
            }
        }
    }

    fn value(scope: &Scope<'_, 'g>, path: &'g AttributePath) -> Option<Thing<'g>> {
        Some(match path {
            AttributePath::Node {
                variable,
                attribute,
            } => Thing::Value(attribute, Ok(*scope.get(variable)?)),
            AttributePath::Edge {
                label, attribute, ..
            } => Thing::Value(attribute, Err(label)),
        })
    }

    fn expression(&mut self, scope: &Scope<'_, 'g>, expression: &'g Expression) {
        match expression {
            Expression::Literal(_) => {}
            Expression::Attribute(path) => {
                self.touched.looks.extend(Self::value(scope, path));
                if let AttributePath::Edge {
                    from, label, to, ..
                } = path
                {
                    self.look_at(scope, (from, label, to), None);
                }
            }
            Expression::Arithmetic { operands, .. } => {
                for operand in operands {
                    self.expression(scope, operand);
                }
            }
        }
    }

    fn effects(&mut self, scope: &mut Scope<'_, 'g>, effects: &'g [Effect], depth: u32) {
        self.touched.depth = self.touched.depth.max(depth);
        for effect in effects {
            match effect {
                Effect::Link { label, from, to } => self.change(scope, (from, label, to), true),
                Effect::Unlink { label, from, to } => self.change(scope, (from, label, to), false),
                Effect::Assign { target, .. } => {
                    self.touched.changes.extend(Self::value(scope, target));
                }
                Effect::Create {
                    variable,
                    type_name,
                } => {
                    if let Some(kind) = self.kinds.find(type_name) {
                        let (how, place) = (How::Made, 0);
                        scope.own.insert(variable, End { kind, how, place });
                        self.touched.changes.push(Thing::New(kind));
                    }
                }
                Effect::Delete { variable } => {
                    let gone = scope.get(variable).map(|end| Thing::Node(*end, None));
                    self.touched.changes.extend(gone);
                }
                Effect::Retype {
                    variable,
                    type_name,
                } => {
                    let becomes = self.kinds.find(type_name);
                    let end = scope.get(variable);
                    let change = end.map(|end| Thing::Node(*end, becomes));
                    self.touched.changes.extend(change);
                }
                Effect::Forall { variables, body } => {
                    let mut scope = scope.inside();
                    for node in variables {
                        self.declare(&mut scope, node, How::Quantified);
                    }
                    let depth = depth.saturating_add(variables.len() as u32);
                    self.effects(&mut scope, body, depth);
                }
                Effect::When { condition, body } => {
                    // What a condition of an effect looks at decides nothing about the match.
                    let looks = self.touched.looks.len();
                    self.condition(scope, condition, depth);
                    self.touched.looks.truncate(looks);
                    self.effects(&mut scope.inside(), body, depth);
                }
            }
        }
    }
}

/// What things must have in common to touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Word<'g> {
    Label(&'g str),
    Attribute(&'g str),
    Node,
}

impl<'g> Thing<'g> {
    fn word(&self) -> Word<'g> {
        match self {
            Thing::Link(_, label, _) => Word::Label(label),
            Thing::Value(attribute, _) => Word::Attribute(attribute),
            Thing::Node(..) | Thing::New(_) => Word::Node,
        }
    }
}

/// Whether a node that one changes can be one that the other looks at.
fn meet(kinds: &Kinds, changed: End, looked_at: End) -> bool {
    match (changed.how, looked_at.how) {
        (How::Made, How::Bound) => false,
        (How::Made, _) => kinds.is_subtype(changed.kind, looked_at.kind),
        _ => kinds.common(changed.kind, looked_at.kind).is_some(),
    }
}

fn touches(kinds: &Kinds, change: &Thing, look: &Thing) -> bool {
    match (change, look) {
        (Thing::Link(ends, label, comes), Thing::Link(others, other, wanted)) => {
            let pairs = ends.iter().zip(others);
            label == other
                && (wanted.is_none() || comes != wanted)
                && pairs.into_iter().all(|(a, b)| meet(kinds, *a, *b))
        }
        (Thing::Value(attribute, owner), Thing::Value(other, others)) => {
            attribute == other
                && match (owner, others) {
                    (Ok(node), Ok(other)) => meet(kinds, *node, *other),
                    (Err(label), Err(other)) => label == other,
                    _ => false,
                }
        }
        (Thing::Node(end, becomes), Thing::Node(other, _)) => {
            let is = |kind: &Kind| kinds.is_subtype(*kind, other.kind);
            match other.how {
                How::Bound => meet(kinds, *end, *other) && !becomes.as_ref().is_some_and(is),
                _ => meet(kinds, *end, *other) || becomes.as_ref().is_some_and(is),
            }
        }
        (Thing::New(kind), Thing::Node(other, _)) => {
            other.how == How::Quantified && kinds.is_subtype(*kind, other.kind)
        }
        _ => false,
    }
}

/// Which nodes of the matches must be the same for a change to be of what is looked at. A node that a quantifier
/// goes over can be any.
fn shared(change: &Thing, look: &Thing) -> Vec<Shared> {
    let ends: Vec<(End, End)> = match (change, look) {
        (Thing::Link(ends, ..), Thing::Link(others, ..)) => {
            ends.iter().copied().zip(others.iter().copied()).collect()
        }
        (Thing::Value(_, Ok(node)), Thing::Value(_, Ok(other)))
        | (Thing::Node(node, _), Thing::Node(other, _)) => vec![(*node, *other)],
        _ => Vec::new(),
    };
    let bound = |end: &End| end.how == How::Bound;
    let both = ends.iter().filter(|(one, two)| bound(one) && bound(two));
    both.map(|(one, two)| (two.place, one.place)).collect()
}

/// Which rules look at something under a word.
#[derive(Default)]
pub(super) struct Index<'g>(BTreeMap<Word<'g>, Vec<usize>>);

impl<'g> Index<'g> {
    pub(super) fn new(all: &[Touched<'g>]) -> Self {
        let mut index = BTreeMap::<Word, Vec<usize>>::new();
        for (rule, touched) in all.iter().enumerate() {
            for word in Touched::words(&touched.looks) {
                index.entry(word).or_default().push(rule);
            }
        }
        Self(index)
    }

    /// At least so many rules look at something of what is changed.
    pub(super) fn at_least(&self, changer: &Touched<'g>) -> usize {
        let words = Touched::words(&changer.changes).into_iter();
        let lists = words.filter_map(|word| self.0.get(&word));
        lists.map(Vec::len).max().unwrap_or(0)
    }

    /// The rules that look at something of what is changed, in their order.
    pub(super) fn of(&self, changer: &Touched<'g>) -> Vec<usize> {
        let words = Touched::words(&changer.changes).into_iter();
        let mut lists = words.filter_map(|word| self.0.get(&word));
        let mut rules = lists.next().cloned().unwrap_or_default();
        for list in lists {
            rules.extend(list);
            rules.sort_unstable();
            rules.dedup();
        }
        rules
    }
}
