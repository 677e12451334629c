//! Types and scopes: what a grammar says must fit together.
//!
//! Guarantee: a rule that passes uses only variables that are bound where they are used, and only
//! declared types (where types are declared at all).

mod combo;
mod cycles;
mod schema;
mod scope;

use crate::parser::{Action, Broken, Finding};
use crate::{Goal, Grammar, Name, Pattern, PatternEdge, PatternNode, Problem, Rule, Types};
use dsr::suggest;
pub use scope::NODE_LIMIT;
use scope::Scope;
use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};

/// Checks the rules and combos against each other and the types.
///
/// `broken` are rules that are there but have errors in them already: what could be read of them
/// is checked, too. If files are `missing`, types and rules may be declared there: that is said, of each
/// name once.
pub(crate) fn check_grammar(grammar: &Grammar, broken: &[Broken], missing: bool) -> Vec<Finding> {
    let mut check = Check {
        types: &grammar.types,
        missing,
        rules: rule_names(grammar, broken),
        not_read: BTreeSet::new(),
        suggesting: Cell::new(SUGGESTING),
        findings: Vec::new(),
    };
    check.type_declarations();
    check.distinct_rules();
    for rule in &grammar.rules {
        check.rule(rule);
        check.activates(rule);
    }
    for combo in &grammar.combos {
        check.combo(grammar, combo);
    }
    let mut findings = std::mem::take(&mut check.findings);
    for broken in broken {
        match &broken.action {
            Some(Action::Rule(rule)) => {
                check.rule(rule);
                check.activates(rule);
            }
            Some(Action::Combo(combo)) => check.combo(grammar, combo),
            None => {}
        }
        check.forget_lost(&broken.lost);
        findings.append(&mut check.findings);
    }
    findings
}

fn rule_names(grammar: &Grammar, broken: &[Broken]) -> Vec<Name> {
    let rules = grammar.rules.iter().map(|rule| &rule.name);
    let combos = grammar.combos.iter().map(|combo| &combo.name);
    let broken = broken.iter().filter_map(|broken| broken.name.as_ref());
    let mut names: Vec<Name> = rules.chain(combos).chain(broken).cloned().collect();
    names.sort_by(|a, b| (a, a.span()).cmp(&(b, b.span())));
    names
}

/// Checks a goal against types (any type goes if there are none). Words in `lost` parts of it
/// may have declared what the rest uses.
pub(crate) fn check_goal(goal: &Goal, types: &Types, lost: &[Name]) -> Vec<Finding> {
    let mut check = Check {
        types,
        missing: false,
        rules: Vec::new(),
        not_read: BTreeSet::new(),
        suggesting: Cell::new(SUGGESTING),
        findings: Vec::new(),
    };
    check.pattern(&goal.pattern, &[], "left", "in this goal");
    if let Some(condition) = &goal.precondition {
        let mut scope = Scope::new("in this goal");
        scope.extend(&goal.pattern.nodes);
        check.condition(condition, &mut scope);
    }
    check.forget_lost(lost);
    check.findings
}

/// So much is done to find what was probably meant, in pairs of letters that are compared: in a file of nothing but mistakes
/// each name would be held against all others.
const SUGGESTING: u64 = 100_000_000;

struct Check<'a> {
    types: &'a Types,
    missing: bool,
    /// Of all rules and combos, broken ones included; in their order as texts.
    rules: Vec<Name>,
    /// What was told to be in no file that could be read, each name once.
    not_read: BTreeSet<(&'static str, Name)>,
    /// What is left of [`SUGGESTING`].
    suggesting: Cell<u64>,
    findings: Vec<Finding>,
}

impl Check<'_> {
    /// What was probably meant.
    fn suggestion<'n>(&self, name: &str, known: impl Iterator<Item = &'n str>) -> Option<String> {
        let affordable = |known: &&str| {
            let cost = 16 + (name.len() * known.len()) as u64;
            let left = self.suggesting.get().checked_sub(cost);
            self.suggesting.set(left.unwrap_or(0));
            left.is_some()
        };
        let found = suggest(name, known.take_while(affordable));
        found.filter(|_| self.suggesting.get() > 0)
    }

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
        let mut seen: BTreeMap<&str, &Name> = BTreeMap::new();
        for name in self.types.names() {
            match seen.get(name.as_str()) {
                // An included file may declare what its includer declares, too.
                Some(first) if first.span().file == name.span().file => {
                    self.duplicate("type", first, name);
                }
                _ => {
                    seen.insert(name, name);
                }
            }
        }
        let cycles = cycles::cycles(self.types);
        for declaration in &self.types.declarations {
            for parent in &declaration.parents {
                self.parent(parent);
                for name in &declaration.names {
                    if cycles.get(parent.as_str()) == cycles.get(name.as_str()) {
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

    /// A type that others inherit from need not be declared; but it may be a misspelling.
    fn parent(&mut self, name: &Name) {
        let mut declared = self.types.names().map(Name::as_str);
        if self.missing || declared.any(|declared| *name == *declared) {
            return;
        }
        if let Some(suggestion) = self.suggestion(name, self.types.names().map(Name::as_str)) {
            self.report(
                name,
                Problem::UndeclaredParent {
                    name: name.to_string(),
                    suggestion,
                },
            );
        }
    }

    fn type_name(&mut self, name: &Name) {
        if self.types.is_empty() || self.types.contains(name) {
            return;
        }
        let known = self.types.names().chain(self.types.undeclared());
        let suggestion = self.suggestion(name, known.map(Name::as_str));
        if self.missing {
            return self.not_read("type", name, suggestion);
        }
        let text = name.to_string();
        let problem = Problem::UnknownType {
            name: text,
            suggestion,
        };
        self.report(name, problem);
    }

    /// A name that a missing file may declare; told once.
    fn not_read(&mut self, what: &'static str, name: &Name, suggestion: Option<String>) {
        if self.not_read.insert((what, name.clone())) {
            let text = name.to_string();
            let problem = Problem::NotRead {
                what,
                name: text,
                suggestion,
            };
            self.report(name, problem);
        }
    }

    fn distinct_rules(&mut self) {
        let names = std::mem::take(&mut self.rules);
        for pair in names.windows(2) {
            if pair[0] == pair[1] {
                self.duplicate("rule", &pair[0], &pair[1]);
            }
        }
        self.rules = names;
    }

    fn activates(&mut self, rule: &Rule) {
        for name in &rule.activates {
            self.rule_name(name);
        }
    }

    fn rule_name(&mut self, name: &Name) {
        if self.rules.binary_search(name).is_ok() {
            return;
        }
        let suggestion = self.suggestion(name, self.rules.iter().map(Name::as_str));
        if self.missing {
            return self.not_read("rule", name, suggestion);
        }
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

    /// Drops complaints about names that the unread parts of a rule may have declared.
    fn forget_lost(&mut self, lost: &[Name]) {
        self.findings.retain(|finding| match &finding.problem {
            Problem::UnknownVariable { name, .. }
            | Problem::UnknownName { name, .. }
            | Problem::Deleted { name } => !lost.iter().any(|word| word == name.as_str()),
            _ => true,
        });
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
        let mut seen: BTreeMap<[&str; 3], &PatternEdge> = BTreeMap::new();
        for edge in &pattern.edges {
            self.variable(&edge.from, &scope);
            self.variable(&edge.to, &scope);
            let earlier = *seen
                .entry([&edge.from, &edge.label, &edge.to])
                .or_insert(edge);
            if !std::ptr::eq(earlier, edge) {
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
        let mut seen: BTreeSet<&Name> = BTreeSet::new();
        for node in nodes {
            if let Some(earlier) = seen.get(&node.variable) {
                self.duplicate("variable", earlier, &node.variable);
            }
            seen.insert(&node.variable);
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
        let suggestion = self.suggestion(name, scope.names());
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
