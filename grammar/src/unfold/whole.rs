//! The rule that steps come to.
//!
//! Guarantee: it says what the [`Composition`] knows, in the words of rules.

use super::compose::{Composition, Node, Outcome, attribute, impossible};
use crate::{
    Arithmetic, AttributePath, Condition, Effect, Expression, Kind, Literal, Name, Pattern,
    PatternEdge, PatternNode, Rule,
};

impl Composition<'_> {
    /// The whole; without what a combo's header says.
    pub(super) fn finish(self) -> Outcome<Rule> {
        let mut rule = Rule {
            name: Name::default(),
            kind: Kind::Active,
            cost: Expression::Literal(Literal::Integer(1)),
            duration: None,
            agent: None,
            success: 1.0,
            dormant: false,
            hierarchical: false,
            strict: self.strict == Some(true),
            activates: Vec::new(),
            left: Pattern::default(),
            right: Pattern::default(),
            parameters: Vec::new(),
            precondition: None,
            effect: Vec::new(),
            comments: Vec::new(),
        };
        for node in &self.nodes {
            draw_node(node, &mut rule);
        }
        self.draw_links(&mut rule);
        self.draw_values(&mut rule)?;
        rule.effect.extend(self.effects);
        let mut durations = self.durations.into_iter();
        rule.duration = durations.next().map(|first| {
            durations.fold(first, |sum, next| Expression::Arithmetic {
                operator: Arithmetic::Add,
                operands: vec![sum, next],
            })
        });
        let never = Condition::Or(Vec::new());
        if self.conditions.contains(&never) {
            return impossible(
                "a step's precondition never holds after the steps before".to_owned(),
            );
        }
        rule.precondition = match self.conditions.len() {
            0 | 1 => self.conditions.into_iter().next(),
            _ => Some(Condition::And(self.conditions)),
        };
        Ok(rule)
    }

    fn draw_links(&self, rule: &mut Rule) {
        let alive = |name: &Name| self.node(name).is_some_and(|node| !node.deleted);
        let created = |name: &Name| self.node(name).is_some_and(Node::created);
        for link in &self.links {
            let edge = |negated| PatternEdge {
                from: link.from.clone(),
                label: link.label.clone(),
                to: link.to.clone(),
                negated,
            };
            if let Some(needed) = link.needed {
                rule.left.edges.push(edge(!needed));
            }
            let ends = alive(&link.from) && alive(&link.to);
            let fresh = created(&link.from) || created(&link.to);
            let cleared = !link.now && link.written && link.needed != Some(true) && !fresh;
            if link.now && ends {
                rule.right.edges.push(edge(false));
            } else if cleared && (ends || rule.strict) {
                rule.right.edges.push(edge(true));
            }
        }
    }

    fn draw_values(&self, rule: &mut Rule) -> Outcome<()> {
        let alive = |name: &Name| self.node(name).is_some_and(|node| !node.deleted);
        for (target, value) in &self.assigned {
            let ends = match target {
                AttributePath::Node { variable, .. } => alive(variable),
                AttributePath::Edge { from, to, .. } => alive(from) && alive(to),
            };
            if ends {
                rule.effect.push(Effect::Assign {
                    target: target.clone(),
                    value: value.clone(),
                });
            } else if !matches!(value, Expression::Literal(_)) {
                let name = attribute(target);
                return impossible(format!(
                    "`{name}` is set on a node that a later step deletes"
                ));
            }
        }
        Ok(())
    }
}

fn draw_node(node: &Node, rule: &mut Rule) {
    let variable = || node.variable.clone();
    let after = || PatternNode::new(variable(), node.now.clone());
    let Some(before) = &node.before else {
        if !node.deleted {
            rule.right.nodes.push(after());
        }
        return;
    };
    let only_parameter = node.parameter && !node.deleted && !node.retyped;
    let side = if only_parameter {
        &mut rule.parameters
    } else {
        &mut rule.left.nodes
    };
    side.push(PatternNode::new(variable(), before.clone()));
    for type_name in &node.narrowed {
        let narrowed = PatternNode::new(variable(), type_name.clone());
        rule.parameters.push(narrowed);
    }
    if node.deleted || only_parameter {
        return;
    }
    rule.right.nodes.push(after());
    // On both sides alike it would be kept as the subtype that it may be.
    if node.retyped && node.now == *before {
        rule.effect.push(Effect::Retype {
            variable: variable(),
            type_name: node.now.clone(),
        });
    }
}
