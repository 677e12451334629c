//! Critical pairs: which rules can disable which.
//!
//! Guarantee: every conflict was tried out: in its graph both rules match, and after the first was
//! applied the second does not match there any more.

use super::complete::{Draft, Link, Places, ways};
use crate::{
    Binding, Condition, Diagnostic, Effect, Expression, Grammar, PatternNode, Problem, Rule,
};
use dsr::{Graph, Schema, Time, Transaction};
use std::collections::BTreeSet;

/// How many ways of laying one rule over another are looked at.
pub const OVERLAY_LIMIT: usize = 2_000;
/// How many graphs are tried out for two rules.
const TRIALS: usize = 64;

/// Two rules of which the first can disable the second.
#[derive(Debug, Clone)]
pub struct Conflict {
    /// The rule that is applied.
    pub first: String,
    /// The rule that does not match any more; can be the same one, at another match.
    pub second: String,
    /// Makes the smallest graph where both match, in an empty one.
    pub graph: Transaction,
    /// The first rule's match in that graph.
    pub first_match: Binding,
    /// The second rule's.
    pub second_match: Binding,
    /// All of it in words, at the first rule.
    pub diagnostic: Diagnostic,
}

pub(super) fn conflicts(grammar: &Grammar) -> Vec<Conflict> {
    let mut awake = grammar.clone();
    for rule in &mut awake.rules {
        rule.dormant = false;
        rule.activates.clear();
    }
    let mut found = Vec::new();
    for first in &awake.rules {
        for second in &awake.rules {
            if may_disable(first, second) {
                found.extend(smallest(&awake, first, second));
            }
        }
    }
    found
}

/// What conditions and effects name.
#[derive(Default)]
struct Words {
    labels: BTreeSet<String>,
    attributes: BTreeSet<String>,
    quantified: bool,
}

impl Words {
    fn condition(&mut self, condition: &Condition) {
        match condition {
            Condition::Edge { label, .. } => {
                self.labels.insert(label.to_string());
            }
            Condition::Same(..) => {}
            Condition::Compare { left, right, .. } => {
                self.expression(left);
                self.expression(right);
            }
            Condition::Not(inner) => self.condition(inner),
            Condition::And(all) | Condition::Or(all) => all.iter().for_each(|c| self.condition(c)),
            Condition::Exists { body, .. } | Condition::Forall { body, .. } => {
                self.quantified = true;
                self.condition(body);
            }
            Condition::When {
                condition,
                consequence,
            } => {
                self.condition(condition);
                self.condition(consequence);
            }
        }
    }

    fn expression(&mut self, expression: &Expression) {
        match expression {
            Expression::Literal(_) => {}
            Expression::Attribute(path) => {
                use crate::AttributePath::{Edge, Node};
                let (Node { attribute, .. } | Edge { attribute, .. }) = path;
                self.attributes.insert(attribute.to_string());
                if let Edge { label, .. } = path {
                    self.labels.insert(label.to_string());
                }
            }
            Expression::Arithmetic { operands, .. } => {
                for operand in operands {
                    self.expression(operand);
                }
            }
        }
    }
}

/// What a rule may change.
#[derive(Default)]
struct Changes {
    added: BTreeSet<String>,
    removed: BTreeSet<String>,
    attributes: BTreeSet<String>,
    /// Nodes go or change their type.
    nodes: bool,
    created: bool,
}

impl Changes {
    fn of(rule: &Rule) -> Self {
        let mut changes = Self::default();
        for edge in &rule.left.edges {
            let kept = rule.right.edge(&edge.from, &edge.label, &edge.to);
            if !edge.negated && kept.is_none_or(|kept| kept.negated) {
                changes.removed.insert(edge.label.to_string());
            }
        }
        for edge in &rule.right.edges {
            let before = rule.left.edge(&edge.from, &edge.label, &edge.to);
            if edge.negated {
                changes.removed.insert(edge.label.to_string());
            } else if before.is_none_or(|before| before.negated) {
                changes.added.insert(edge.label.to_string());
            }
        }
        for node in &rule.left.nodes {
            let after = rule.right.node(&node.variable);
            changes.nodes |= after.is_none_or(|after| after.type_name != node.type_name);
        }
        for node in &rule.right.nodes {
            let bound = rule.bound_nodes().find(|b| b.variable == node.variable);
            changes.created |= bound.is_none();
            changes.nodes |= bound.is_some_and(|bound| bound.type_name != node.type_name);
        }
        changes.effects(&rule.effect);
        changes
    }

    fn effects(&mut self, effects: &[Effect]) {
        for effect in effects {
            match effect {
                Effect::Link { label, .. } => {
                    self.added.insert(label.to_string());
                }
                Effect::Unlink { label, .. } => {
                    self.removed.insert(label.to_string());
                }
                Effect::Assign { target, .. } => {
                    use crate::AttributePath::{Edge, Node};
                    let (Node { attribute, .. } | Edge { attribute, .. }) = target;
                    self.attributes.insert(attribute.to_string());
                }
                Effect::Create { .. } => self.created = true,
                Effect::Delete { .. } | Effect::Retype { .. } => self.nodes = true,
                Effect::Forall { body, .. } | Effect::When { body, .. } => self.effects(body),
            }
        }
    }
}

/// Whether anything that the first changes is of a kind that the second looks at.
fn may_disable(first: &Rule, second: &Rule) -> bool {
    let changes = Changes::of(first);
    let mut read = Words::default();
    second.precondition.iter().for_each(|c| read.condition(c));
    let left = |negated: bool| {
        second
            .left
            .edges
            .iter()
            .filter(move |e| e.negated == negated)
            .map(|e| e.label.to_string())
    };
    changes.nodes
        || (changes.created && read.quantified)
        || left(false).any(|label| changes.removed.contains(&label))
        || left(true).any(|label| changes.added.contains(&label))
        || read
            .labels
            .iter()
            .any(|l| changes.added.contains(l) || changes.removed.contains(l))
        || read
            .attributes
            .iter()
            .any(|a| changes.attributes.contains(a))
}

/// One rule laid over another.
struct Overlay {
    draft: Draft,
    first: Places,
    second: Places,
}

/// A type that is all of these.
fn common<'t>(grammar: &'t Grammar, types: &[&'t str]) -> Option<&'t str> {
    let all = |candidate: &&str| types.iter().all(|t| grammar.types.is_subtype(candidate, t));
    let declared = grammar.types.names().map(crate::Name::as_str);
    types.iter().copied().chain(declared).find(all)
}

/// Bound variables with the type that a node for them can have.
fn variables(grammar: &Grammar, rule: &Rule) -> Option<Vec<PatternNode>> {
    let narrowed = |node: &PatternNode| {
        let parameters = rule
            .parameters
            .iter()
            .filter(|p| p.variable == node.variable);
        let mut types = vec![node.type_name.as_str()];
        types.extend(parameters.map(|p| p.type_name.as_str()));
        Some(PatternNode::new(
            node.variable.clone(),
            common(grammar, &types)?,
        ))
    };
    rule.bound_nodes().map(narrowed).collect()
}

fn overlays(grammar: &Grammar, first: &Rule, second: &Rule) -> Vec<Overlay> {
    let (Some(firsts), Some(seconds)) = (variables(grammar, first), variables(grammar, second))
    else {
        return Vec::new();
    };
    let mut draft = Draft::default();
    let mut places = Places::new();
    for node in &firsts {
        places.insert(node.variable.to_string(), draft.nodes.len());
        draft
            .nodes
            .push((node.variable.to_string(), node.type_name.to_string()));
    }
    let start = Overlay {
        draft,
        first: places,
        second: Places::new(),
    };
    let mut found = Vec::new();
    lay(grammar, start, firsts.len(), &seconds, &mut found);
    // The identity is no second match.
    found.retain(|overlay| first.name != second.name || overlay.first != overlay.second);
    found.retain_mut(|overlay| {
        let Overlay {
            draft,
            first: one,
            second: two,
        } = overlay;
        [(first, &*one), (second, &*two)]
            .into_iter()
            .all(|(rule, places)| links(draft, rule, places))
    });
    found.sort_by_key(|overlay| (overlay.draft.nodes.len(), overlay.draft.links.len()));
    found
}

/// Puts the variables of the second rule on nodes of the first, or beside them.
fn lay(
    grammar: &Grammar,
    overlay: Overlay,
    shared: usize,
    rest: &[PatternNode],
    found: &mut Vec<Overlay>,
) {
    if found.len() >= OVERLAY_LIMIT {
        return;
    }
    let Some((node, rest)) = rest.split_first() else {
        found.push(overlay);
        return;
    };
    let put = |place: usize, draft: Draft| {
        let mut second = overlay.second.clone();
        second.insert(node.variable.to_string(), place);
        Overlay {
            draft,
            first: overlay.first.clone(),
            second,
        }
    };
    for place in 0..shared {
        let taken = overlay.second.values().any(|&other| other == place);
        let exact = overlay.draft.nodes[place].1.as_str();
        if let Some(both) = common(grammar, &[exact, &node.type_name]).filter(|_| !taken) {
            let mut draft = overlay.draft.clone();
            both.clone_into(&mut draft.nodes[place].1);
            lay(grammar, put(place, draft), shared, rest, found);
        }
    }
    let mut draft = overlay.draft.clone();
    let name = draft.fresh(&node.variable);
    draft.nodes.push((name, node.type_name.to_string()));
    lay(
        grammar,
        put(draft.nodes.len() - 1, draft),
        shared,
        rest,
        found,
    );
}

/// Draws the links of a left side; whether they go with what is drawn.
fn links(draft: &mut Draft, rule: &Rule, places: &Places) -> bool {
    rule.left.edges.iter().all(|edge| {
        let (Some(&from), Some(&to)) = (places.get(&*edge.from), places.get(&*edge.to)) else {
            return false;
        };
        let link: Link = (from, edge.label.to_string(), to);
        if edge.negated {
            draft.absent.insert(link.clone());
            !draft.links.contains(&link)
        } else {
            draft.links.insert(link.clone());
            !draft.absent.contains(&link)
        }
    })
}

fn smallest(grammar: &Grammar, first: &Rule, second: &Rule) -> Option<Conflict> {
    let mut best: Option<(Draft, Trial)> = None;
    let size = |draft: &Draft| (draft.nodes.len(), draft.links.len());
    let mut trials = 0;
    for overlay in overlays(grammar, first, second) {
        let smaller = |draft: &Draft| best.as_ref().is_none_or(|(b, _)| size(draft) < size(b));
        if !smaller(&overlay.draft) || trials >= TRIALS {
            break;
        }
        if !touches(grammar, first, second, &overlay) {
            continue;
        }
        for draft in completed(grammar, first, second, &overlay) {
            let smaller = best.as_ref().is_none_or(|(b, _)| size(&draft) < size(b));
            if smaller && trials < TRIALS {
                trials += 1;
                if let Some(trial) = tried(grammar, first, second, &draft, &overlay) {
                    best = Some((draft, trial));
                }
            }
        }
    }
    let (draft, trial) = best?;
    let span = first.name.span();
    let diagnostic = Diagnostic {
        problem: Problem::Conflict {
            first: first.name.to_string(),
            second: second.name.to_string(),
            reason: trial.reason,
            graph: draft.words(),
        },
        span,
        file: grammar.files.get(span.file as usize)?.clone(),
        related: (second.name.span().file == span.file && second.name != first.name)
            .then(|| (second.name.span(), "this rule".to_owned())),
    };
    Some(Conflict {
        first: first.name.to_string(),
        second: second.name.to_string(),
        graph: draft.transaction(),
        first_match: trial.first,
        second_match: trial.second,
        diagnostic,
    })
}

/// Drafts that meet both preconditions, as far as that can be drawn.
fn completed(grammar: &Grammar, first: &Rule, second: &Rule, overlay: &Overlay) -> Vec<Draft> {
    let mut drafts = vec![overlay.draft.clone()];
    for (rule, places) in [(first, &overlay.first), (second, &overlay.second)] {
        for condition in rule.precondition.as_slice() {
            drafts = drafts
                .into_iter()
                .flat_map(|draft| ways(&grammar.types, draft, places, condition, true))
                .collect();
        }
    }
    drafts.sort_by_key(|draft| (draft.nodes.len(), draft.links.len()));
    drafts
}

/// Whether the sides alone show that nothing the second rule needs is changed. Where there are
/// conditions or effects, that is left to be tried out.
fn touches(grammar: &Grammar, first: &Rule, second: &Rule, overlay: &Overlay) -> bool {
    if second.precondition.is_some() || !first.effect.is_empty() {
        return true;
    }
    let place = |name: &str| overlay.first.get(name).copied();
    let is_kept = |node: &&PatternNode| match first.right.node(&node.variable) {
        Some(after) => after.type_name == node.type_name,
        None => first.left.node(&node.variable).is_none(),
    };
    for node in first.bound_nodes().filter(|node| !is_kept(node)) {
        let after = first.right.node(&node.variable);
        let needed = second
            .bound_nodes()
            .find(|other| overlay.second.get(&*other.variable).copied() == place(&node.variable));
        let fits = |other: &PatternNode| {
            after.is_some_and(|a| grammar.types.is_subtype(&a.type_name, &other.type_name))
        };
        if needed.is_some_and(|other| !fits(other)) {
            return true;
        }
    }
    let at = |from: &str, label: &str, to: &str| Some((place(from)?, label.to_owned(), place(to)?));
    second.left.edges.iter().any(|edge| {
        let two = |name: &str| overlay.second.get(name).copied();
        let needed = two(&edge.from).zip(two(&edge.to));
        let needed = needed.map(|(from, to)| (from, edge.label.to_string(), to));
        let same = |other: &crate::PatternEdge| at(&other.from, &other.label, &other.to) == needed;
        let wanted = first.right.edges.iter().any(|e| !e.negated && same(e));
        let named = |e: &&crate::PatternEdge| same(e);
        if edge.negated {
            wanted
        } else {
            let gone = first
                .left
                .edges
                .iter()
                .chain(&first.right.edges)
                .any(|e| named(&e));
            gone && !wanted
        }
    })
}

/// What came of trying a draft out.
struct Trial {
    first: Binding,
    second: Binding,
    reason: String,
}

/// Tries both rules in the graph; `None` where the first does not disable the second.
fn tried(
    grammar: &Grammar,
    first: &Rule,
    second: &Rule,
    draft: &Draft,
    overlay: &Overlay,
) -> Option<Trial> {
    let mut graph = Graph::in_memory(Schema::open());
    graph
        .commit(&draft.transaction(), "analysis", Time::default())
        .ok()?;
    let snapshot = graph.snapshot();
    let bound = |rule: &Rule, places: &Places| -> Option<Binding> {
        let node = |node: &PatternNode| {
            let name = &draft.nodes[*places.get(&*node.variable)?].0;
            let found = snapshot.find_node_by_name(name).ok()??;
            Some((node.variable.clone(), found.id()))
        };
        rule.bound_nodes().map(node).collect()
    };
    let (one, two) = (
        bound(first, &overlay.first)?,
        bound(second, &overlay.second)?,
    );
    if grammar.obstacle(&snapshot, second, &two).ok()?.is_some() {
        return None;
    }
    let operations = grammar.apply(&snapshot, &first.name, &one).ok()?;
    let change = Transaction {
        operations,
        ..Transaction::new()
    };
    graph.commit(&change, "analysis", Time::default()).ok()?;
    let obstacle = grammar.obstacle(&graph.snapshot(), second, &two).ok()??;
    Some(Trial {
        first: one,
        second: two,
        reason: obstacle.to_string(),
    })
}
