//! Combo rules against the rules that they are made of.
//!
//! Guarantee: every alias and variable of a combo was looked up; types that can never meet are
//! pointed out.

use super::Check;
use crate::{Combo, ComboVariable, Grammar, PatternNode, Problem, Rule};

impl Check<'_> {
    pub(super) fn combo(&mut self, grammar: &Grammar, combo: &Combo) {
        for (index, step) in combo.steps.iter().enumerate() {
            self.rule_name(&step.rule);
            let earlier = combo.steps[..index]
                .iter()
                .find(|other| other.alias == step.alias);
            if let Some(earlier) = earlier {
                self.duplicate("alias", &earlier.alias, &step.alias);
            }
        }
        for equality in &combo.equalities {
            let nodes: Vec<_> = equality
                .iter()
                .map(|part| self.combo_variable(grammar, combo, part))
                .collect();
            for pair in equality.iter().zip(&nodes).collect::<Vec<_>>().windows(2) {
                if let [(first, Some(first_node)), (second, Some(second_node))] = pair {
                    self.same_type(first, first_node, second, second_node);
                }
            }
        }
    }

    fn combo_variable<'g>(
        &mut self,
        grammar: &'g Grammar,
        combo: &Combo,
        part: &ComboVariable,
    ) -> Option<&'g PatternNode> {
        let Some(step) = combo.steps.iter().find(|step| step.alias == part.alias) else {
            let suggestion =
                self.suggestion(&part.alias, combo.steps.iter().map(|step| &*step.alias));
            let name = part.alias.to_string();
            self.report(
                &part.alias,
                Problem::UnknownName {
                    what: "alias",
                    name,
                    suggestion,
                },
            );
            return None;
        };
        let rule = grammar.rule(&step.rule)?;
        let node = variables(rule).find(|node| node.variable == part.variable);
        if node.is_none() {
            let suggestion =
                self.suggestion(&part.variable, variables(rule).map(|node| &*node.variable));
            let (name, scope) = (part.variable.to_string(), "in the rule of this step");
            self.report(
                &part.variable,
                Problem::UnknownVariable {
                    name,
                    scope,
                    suggestion,
                },
            );
        }
        node
    }

    fn same_type(
        &mut self,
        first: &ComboVariable,
        first_node: &PatternNode,
        second: &ComboVariable,
        second_node: &PatternNode,
    ) {
        let (a, b) = (&first_node.type_name, &second_node.type_name);
        if a == b || self.types.is_subtype(a, b) || self.types.is_subtype(b, a) {
            return;
        }
        let problem = Problem::Incompatible {
            first: format!("{}.{}", first.alias, first.variable),
            first_type: a.to_string(),
            second: format!("{}.{}", second.alias, second.variable),
            second_type: b.to_string(),
        };
        self.report(&second.variable, problem);
    }
}

fn variables(rule: &Rule) -> impl Iterator<Item = &PatternNode> {
    rule.bound_nodes().chain(&rule.right.nodes)
}
