//! Types and scopes: what a grammar says must fit together.
//!
//! Guarantee: a rule that passes uses only variables that are bound where they are used, and only
//! declared types (where types are declared at all).

mod combo;
mod scope;

use crate::parser::Finding;
use crate::{Goal, Grammar, Name, Pattern, PatternNode, Problem, Types};
use dsr::suggest;
use scope::Scope;

/// Checks the rules and combos against each other and the types.
///
/// `broken` are rules that exist but could not be read; if files are `missing`, names may be
/// declared there and are not complained of.
pub(crate) fn check_grammar(grammar: &Grammar, broken: &[Name], missing: bool) -> Vec<Finding> {
    let mut check = Check {
        types: &grammar.types,
        types_missing: missing,
        findings: Vec::new(),
    };
    check.type_declarations();
    check.distinct_rules(grammar, broken);
    for rule in &grammar.rules {
        check.rule(rule);
        for name in &rule.activates {
            if !missing {
                check.rule_name(grammar, broken, name);
            }
        }
    }
    for combo in &grammar.combos {
        check.combo(grammar, broken, missing, combo);
    }
    check.findings
}

/// Checks a goal against types (any type goes if there are none).
pub(crate) fn check_goal(goal: &Goal, types: &Types) -> Vec<Finding> {
    let mut check = Check {
        types,
        types_missing: false,
        findings: Vec::new(),
    };
    check.pattern(&goal.pattern, &[], "left", "in this goal");
    if let Some(condition) = &goal.precondition {
        let mut scope = Scope::new("in this goal");
        scope.extend(&goal.pattern.nodes);
        check.condition(condition, &mut scope);
    }
    check.findings
}

struct Check<'a> {
    types: &'a Types,
    types_missing: bool,
    findings: Vec<Finding>,
}

impl Check<'_> {
    fn report(&mut self, at: &Name, problem: Problem) {
        self.findings.push(Finding {
            span: at.span(),
            problem,
            related: None,
        });
    }

    fn duplicate(&mut self, what: &'static str, first: &Name, again: &Name) {
        self.findings.push(Finding {
            span: again.span(),
            problem: Problem::Duplicate {
                what,
                name: again.to_string(),
            },
            related: Some((first.span(), "declared here first".to_owned())),
        });
    }

    fn type_declarations(&mut self) {
        let mut seen: Vec<&Name> = Vec::new();
        for name in self.types.names() {
            match seen.iter().find(|earlier| **earlier == name) {
                // An included file may declare what its includer declares, too.
                Some(first) if first.span().file == name.span().file => {
                    self.duplicate("type", first, name);
                }
                _ => seen.push(name),
            }
        }
        for declaration in &self.types.declarations {
            for parent in &declaration.parents {
                self.type_name(parent);
                for name in &declaration.names {
                    if self.types.is_subtype(parent, name) {
                        self.report(
                            name,
                            Problem::CyclicType {
                                name: name.to_string(),
                            },
                        );
                    }
                }
            }
        }
    }

    fn type_name(&mut self, name: &Name) {
        if self.types.is_empty() || self.types_missing || self.types.contains(name) {
            return;
        }
        let suggestion = suggest(name, self.types.names().map(Name::as_str));
        self.report(
            name,
            Problem::UnknownType {
                name: name.to_string(),
                suggestion,
            },
        );
    }

    fn distinct_rules(&mut self, grammar: &Grammar, broken: &[Name]) {
        let rules = grammar.rules.iter().map(|rule| &rule.name);
        let combos = grammar.combos.iter().map(|combo| &combo.name);
        let mut names: Vec<&Name> = rules.chain(combos).chain(broken).collect();
        names.sort_by_key(|name| (name.as_str(), name.span()));
        for pair in names.windows(2) {
            if pair[0] == pair[1] {
                self.duplicate("rule", pair[0], pair[1]);
            }
        }
    }

    fn rule_name(&mut self, grammar: &Grammar, broken: &[Name], name: &Name) {
        let rules = grammar.rules.iter().map(|rule| &rule.name);
        let combos = grammar.combos.iter().map(|combo| &combo.name);
        let names: Vec<&str> = rules
            .chain(combos)
            .chain(broken)
            .map(Name::as_str)
            .collect();
        if !names.contains(&name.as_str()) {
            let suggestion = suggest(name, names);
            let name_text = name.to_string();
            self.report(
                name,
                Problem::UnknownName {
                    what: "rule",
                    name: name_text,
                    suggestion,
                },
            );
        }
    }

    /// Nodes distinct and of known types; links between known nodes, each once.
    fn pattern(
        &mut self,
        pattern: &Pattern,
        parameters: &[PatternNode],
        side: &'static str,
        scope_words: &'static str,
    ) {
        self.declarations(&pattern.nodes);
        let mut scope = Scope::new(scope_words);
        scope.extend(&pattern.nodes);
        scope.extend(parameters);
        for (index, edge) in pattern.edges.iter().enumerate() {
            self.variable(&edge.from, &scope);
            self.variable(&edge.to, &scope);
            let earlier = pattern.edges[..index]
                .iter()
                .find(|earlier| earlier.joins(&edge.from, &edge.label, &edge.to));
            if let Some(earlier) = earlier {
                let link = format!("{}->{}({})", edge.from, edge.to, edge.label);
                let problem = if earlier.negated == edge.negated {
                    Problem::Duplicate {
                        what: "link",
                        name: link,
                    }
                } else {
                    Problem::Contradiction { link, side }
                };
                self.findings.push(Finding {
                    span: edge.from.span().to(edge.label.span()),
                    problem,
                    related: Some((earlier.from.span(), "first here".to_owned())),
                });
            }
        }
    }

    /// Variables declared side by side: distinct, of known types.
    fn declarations(&mut self, nodes: &[PatternNode]) {
        for (index, node) in nodes.iter().enumerate() {
            let earlier = nodes[..index]
                .iter()
                .find(|other| other.variable == node.variable);
            if let Some(earlier) = earlier {
                self.duplicate("variable", &earlier.variable, &node.variable);
            }
            self.type_name(&node.type_name);
        }
    }

    fn variable(&mut self, name: &Name, scope: &Scope) {
        if scope.contains(name) {
            return;
        }
        if scope.is_deleted(name) {
            self.report(
                name,
                Problem::Deleted {
                    name: name.to_string(),
                },
            );
            return;
        }
        let suggestion = suggest(name, scope.names());
        let (name_text, scope) = (name.to_string(), scope.words());
        self.report(
            name,
            Problem::UnknownVariable {
                name: name_text,
                scope,
                suggestion,
            },
        );
    }
}
