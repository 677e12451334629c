//! What a step of a plan is for. This file guarantees that a link it names is one that the step makes
//! and that the step or goal it names asks for.

use crate::MissionStep as Step;
use crate::monitor::ground;
use dsr::{ReadError, Snapshot};
use grammar::{Constant, Effect, Goal, Grammar, MatchError, PatternEdge, Rule};

/// A link that a step brings about, and for what.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Purpose {
    /// The link, as `from -label-> to`.
    pub link: String,
    /// The name of the step that needs it; `None` where the goal asks for it.
    pub step: Option<String>,
}

/// A link by the names of its ends.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Named<'a> {
    from: &'a str,
    label: &'a str,
    to: &'a str,
}

/// What the step is for: each link that it makes with the first later step of `steps` that needs it
/// before another makes it again, else the goal, if that asks for it.
pub fn purposes(
    grammar: &Grammar,
    goal: Option<&Goal>,
    steps: &[Step],
    step: &Step,
) -> Vec<Purpose> {
    let made = links(grammar, step, made_by);
    let later = steps.iter().filter(|other| other.index > step.index);
    let later: Vec<&Step> = later.collect();
    let mut found = Vec::new();
    for link in made {
        let words = || format!("{} -{}-> {}", link.from, link.label, link.to);
        let mut needing = None;
        let mut made_again = false;
        for other in &later {
            if links(grammar, other, needed_by).contains(&link) {
                needing = Some(other.name.clone());
                break;
            }
            if links(grammar, other, made_by).contains(&link) {
                made_again = true;
                break;
            }
        }
        let asked = || goal.is_some_and(|goal| asks_for(goal, &link));
        if needing.is_some() || !made_again && asked() {
            found.push(Purpose {
                link: words(),
                step: needing,
            });
        }
    }
    found
}

/// Some links of a step's rule, at its nodes.
fn links<'a>(
    grammar: &'a Grammar,
    step: &'a Step,
    of: fn(&'a Rule) -> Vec<(&'a str, &'a str, &'a str)>,
) -> Vec<Named<'a>> {
    let node = |variable: &str| step.binding.get(variable).map(String::as_str);
    let links = grammar.rule(&step.rule).map(of).unwrap_or_default();
    let named = links.into_iter().filter_map(|(from, label, to)| {
        Some(Named {
            from: node(from)?,
            label,
            to: node(to)?,
        })
    });
    named.collect()
}

fn parts(edge: &PatternEdge) -> (&str, &str, &str) {
    (&edge.from, &edge.label, &edge.to)
}

fn made_by(rule: &Rule) -> Vec<(&str, &str, &str)> {
    let new = |edge: &&PatternEdge| {
        let before = rule.left.edge(&edge.from, &edge.label, &edge.to);
        !edge.negated && before.is_none_or(|before| before.negated)
    };
    let effects = rule.effect.iter().filter_map(|effect| match effect {
        Effect::Link { label, from, to } => Some((&**from, &**label, &**to)),
        _ => None,
    });
    let right = rule.right.edges.iter().filter(new).map(parts);
    right.chain(effects).collect()
}

fn needed_by(rule: &Rule) -> Vec<(&str, &str, &str)> {
    let positive = rule.left.edges.iter().filter(|edge| !edge.negated);
    positive.map(parts).collect()
}

/// Whether the goal has such a link; its variables may be any node.
fn asks_for(goal: &Goal, link: &Named) -> bool {
    let is = |variable: &str, node: &str| match goal.constants.get(variable) {
        Some(Constant::Name(name)) => name == node,
        Some(Constant::Id(_)) | None => true,
    };
    goal.pattern.edges.iter().any(|edge| {
        let same = *edge.label == *link.label && !edge.negated;
        same && is(&edge.from, link.from) && is(&edge.to, link.to)
    })
}

/// What keeps a step from being taken now, in words; `None` where nothing does.
///
/// # Errors
/// [`ReadError`].
pub fn obstacle(
    grammar: &Grammar,
    snapshot: &Snapshot,
    step: &Step,
) -> Result<Option<String>, ReadError> {
    let Some(ground) = ground(grammar, snapshot, step)? else {
        return Ok(Some(format!("the grammar has no rule `{}`", step.rule)));
    };
    if let Some(variable) = ground.missing.first() {
        let name = step.binding.get(*variable).map_or("", String::as_str);
        return Ok(Some(format!("{variable} ({name}) is not in the graph")));
    }
    if ground.binding.len() < ground.rule.bound_nodes().count() {
        return Ok(Some("an earlier step makes a node of it".to_owned()));
    }
    match grammar.obstacle(snapshot, ground.rule, &ground.binding) {
        Ok(obstacle) => Ok(obstacle.map(|obstacle| obstacle.to_string())),
        Err(MatchError::Read(error)) => Err(error),
        Err(other) => Ok(Some(other.to_string())),
    }
}
