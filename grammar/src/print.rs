//! Canonical text of rules and goals.
//!
//! Guarantee: what is printed parses to what was printed, comments included (those inside a rule
//! move before it). Of a grammar only the main file is printed, with its `include` lines.

use crate::lexer::quote;
use crate::{
    AttributePath, Combo, Comparison, Condition, Effect, Expression, Goal, Grammar, Kind, Literal,
    Name, Pattern, PatternNode, Rule,
};
use std::fmt::{self, Display, Formatter, Write};

/// Formulas longer than this are broken into lines.
const LINE: usize = 72;

impl Display for Grammar {
    /// The text of the main file.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for property in &self.properties {
            writeln!(f, "{}={}", property.key, property.value)?;
        }
        writeln!(f, "===")?;
        let own = |name: &Name| name.span().file == 0;
        let mut types = self
            .types
            .declarations
            .iter()
            .filter(|declaration| declaration.names.iter().all(own))
            .peekable();
        let typed = types.peek().is_some();
        if typed {
            comments(f, &self.comments)?;
            writeln!(f, "types\n{{")?;
            for declaration in types {
                write!(f, "({}", declaration.names.join(" "))?;
                if !declaration.parents.is_empty() {
                    write!(f, " : {}", declaration.parents.join(" "))?;
                }
                writeln!(f, ")")?;
            }
            writeln!(f, "}}\n===")?;
        }
        let mut items: Vec<(usize, String)> = Vec::new();
        for include in self.includes.iter().filter(|include| own(&include.path)) {
            let mut text = String::new();
            comments(&mut text, &include.comments)?;
            writeln!(text, "include({})", include.path)?;
            items.push((include.path.span().start, text));
        }
        for rule in self.rules.iter().filter(|rule| own(&rule.name)) {
            items.push((rule.name.span().start, rule.to_string()));
        }
        for combo in self.combos.iter().filter(|combo| own(&combo.name)) {
            items.push((combo.name.span().start, combo.to_string()));
        }
        items.sort_by_key(|(start, _)| *start);
        for (_, text) in items {
            write!(f, "\n{text}")?;
        }
        if !typed && !self.comments.is_empty() {
            writeln!(f)?;
            comments(f, &self.comments)?;
        }
        Ok(())
    }
}

fn comments(f: &mut impl Write, lines: &[String]) -> fmt::Result {
    for line in lines {
        writeln!(f, "{}", format!("# {line}").trim_end())?;
    }
    Ok(())
}

impl Display for Rule {
    /// The rule with its comments, ending in a line break.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        comments(f, &self.comments)?;
        let modifiers = [
            ("dormant", self.dormant),
            ("hierarchical", self.hierarchical),
            ("strict", self.strict),
        ];
        for (word, _) in modifiers.iter().filter(|(_, set)| *set) {
            write!(f, "{word} ")?;
        }
        let constant = matches!(self.cost.as_number(), Some(cost) if cost >= 0.0);
        if constant {
            write!(f, "{} : {}({})", self.name, self.kind, self.cost)?;
        } else {
            write!(f, "{} : {}(1)", self.name, self.kind)?;
        }
        if self.success.to_bits() != 1.0_f64.to_bits() {
            write!(f, " success({})", self.success)?;
        }
        if !self.activates.is_empty() {
            write!(f, " activates({})", self.activates.join(", "))?;
        }
        if let Some(agent) = &self.agent {
            write!(f, " agent({agent})")?;
        }
        if let Some(duration) = &self.duration {
            write!(f, " duration{}", Bracketed(duration))?;
        }
        if !constant {
            write!(f, " cost{}", Bracketed(&self.cost))?;
        }
        writeln!(f, "\n{{")?;
        graph(f, &self.left, 1)?;
        writeln!(f, "\t=>")?;
        graph(f, &self.right, 1)?;
        if !self.parameters.is_empty() {
            writeln!(f, "\tparameters\n\t{{")?;
            for parameter in &self.parameters {
                writeln!(f, "\t\t{parameter}")?;
            }
            writeln!(f, "\t}}")?;
        }
        if let Some(condition) = &self.precondition {
            block(f, "precondition", &[Form::of_condition(condition)], 1)?;
        }
        if !self.effect.is_empty() {
            block(f, "effect", &[Form::of_effects(&self.effect)], 1)?;
        }
        writeln!(f, "}}")
    }
}

impl Display for Kind {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Active => "active",
            Self::Passive => "passive",
        })
    }
}

/// Arithmetic brings its own brackets, anything else gets some.
struct Bracketed<'a>(&'a Expression);

impl Display for Bracketed<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.0 {
            Expression::Arithmetic { .. } => write!(f, "{}", self.0),
            _ => write!(f, "({})", self.0),
        }
    }
}

impl Display for Combo {
    /// The combo with its comments, ending in a line break.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        comments(f, &self.comments)?;
        writeln!(f, "{} : {}({})\n{{", self.name, self.kind, self.cost)?;
        for step in &self.steps {
            let optional = if step.optional { " optional" } else { "" };
            writeln!(f, "\t{} as {}{optional}", step.rule, step.alias)?;
        }
        if !self.equalities.is_empty() {
            writeln!(f, "\twhere:")?;
            for equality in &self.equalities {
                let parts: Vec<String> = equality
                    .iter()
                    .map(|part| format!("{}.{}", part.alias, part.variable))
                    .collect();
                writeln!(f, "\t{}", parts.join(" = "))?;
            }
        }
        writeln!(f, "}}")
    }
}

impl Display for Goal {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        graph(f, &self.pattern, 0)?;
        if let Some(condition) = &self.precondition {
            block(f, "precondition", &[Form::of_condition(condition)], 0)?;
        }
        Ok(())
    }
}

impl Display for PatternNode {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.variable, self.type_name)?;
        match self.position {
            Some([x, y]) => write!(f, "({x},{y})"),
            None => Ok(()),
        }
    }
}

fn graph(f: &mut Formatter<'_>, pattern: &Pattern, depth: usize) -> fmt::Result {
    let tabs = "\t".repeat(depth);
    writeln!(f, "{tabs}{{")?;
    for node in &pattern.nodes {
        writeln!(f, "{tabs}\t{node}")?;
    }
    for edge in &pattern.edges {
        writeln!(f, "{tabs}\t{edge}")?;
    }
    writeln!(f, "{tabs}}}")
}

impl Display for crate::PatternEdge {
    /// `from->to(label)`, with a star if negated.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let star = if self.negated { "*" } else { "" };
        write!(f, "{}->{}({}){star}", self.from, self.to, self.label)
    }
}

fn block(f: &mut Formatter<'_>, word: &str, forms: &[Form], depth: usize) -> fmt::Result {
    let tabs = "\t".repeat(depth);
    writeln!(f, "{tabs}{word}\n{tabs}{{")?;
    for form in forms {
        form.lines(f, depth + 1)?;
    }
    writeln!(f, "{tabs}}}")
}

impl Display for Condition {
    /// On one line.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        Form::of_condition(self).fmt(f)
    }
}

impl Display for Effect {
    /// On one line.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        Form::of_effect(self).fmt(f)
    }
}

impl Display for Expression {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Literal(literal) => literal.fmt(f),
            Self::Attribute(path) => path.fmt(f),
            Self::Arithmetic { operator, operands } => {
                write!(f, "({}", operator.symbol())?;
                for operand in operands {
                    write!(f, " {operand}")?;
                }
                f.write_str(")")
            }
        }
    }
}

impl Display for Literal {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Integer(value) => value.fmt(f),
            Self::Large(value) => value.fmt(f),
            // Debug keeps the point or exponent that tells it from an integer.
            Self::Real(value) => write!(f, "{value:?}"),
            Self::Text(text) => f.write_str(&quote(text)),
            Self::Boolean(value) => value.fmt(f),
        }
    }
}

impl Display for AttributePath {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Node {
                variable,
                attribute,
            } => write!(f, "{variable}.{attribute}"),
            Self::Edge {
                from,
                label,
                to,
                attribute,
            } => {
                write!(f, "e({from}, {label}, {to}).{attribute}")
            }
        }
    }
}

/// A formula as brackets and words, ready to be laid out.
struct Form {
    /// What stands on the opening bracket's line, without the bracket.
    head: String,
    /// Formulas inside; a formula without any is `(head)`.
    inner: Vec<Form>,
}

impl Form {
    fn leaf(head: String) -> Self {
        Self {
            head,
            inner: Vec::new(),
        }
    }

    fn of_condition(condition: &Condition) -> Self {
        match condition {
            Condition::Edge { label, from, to } => Self::leaf(format!("{label} {from} {to}")),
            Condition::Same(first, second) => {
                let symbol = if reads_as_nodes(first, second) {
                    "="
                } else {
                    "eq"
                };
                Self::leaf(format!("{symbol} {first} {second}"))
            }
            Condition::Compare {
                operator,
                left,
                right,
            } => Self::leaf(format!("{} {left} {right}", Comparison::symbol(*operator))),
            Condition::Not(inner) => Self::with("not", [&**inner]),
            Condition::And(all) => Self::with("and", all),
            Condition::Or(all) => Self::with("or", all),
            Condition::Exists { variables, body } => {
                Self::with(&quantifier("exists", variables), [&**body])
            }
            Condition::Forall { variables, body } => {
                Self::with(&quantifier("forall", variables), [&**body])
            }
            Condition::When {
                condition,
                consequence,
            } => Self::with("when", [&**condition, &**consequence]),
        }
    }

    fn with<'a>(head: &str, inner: impl IntoIterator<Item = &'a Condition>) -> Self {
        let inner = inner.into_iter().map(Self::of_condition).collect();
        Self {
            head: head.to_owned(),
            inner,
        }
    }

    /// One effect by itself, any other number of them after `and`.
    fn of_effects(effects: &[Effect]) -> Self {
        if let [effect] = effects {
            return Self::of_effect(effect);
        }
        Self {
            head: "and".to_owned(),
            inner: effects.iter().map(Self::of_effect).collect(),
        }
    }

    fn of_effect(effect: &Effect) -> Self {
        match effect {
            Effect::Link { label, from, to } => Self::leaf(format!("{label} {from} {to}")),
            Effect::Unlink { label, from, to } => {
                let link = Self::leaf(format!("{label} {from} {to}"));
                Self {
                    head: "not".to_owned(),
                    inner: vec![link],
                }
            }
            Effect::Assign { target, value } => Self::leaf(format!("assign {target} {value}")),
            Effect::Create {
                variable,
                type_name,
            } => Self::leaf(format!("create {variable} {type_name}")),
            Effect::Delete { variable } => Self::leaf(format!("delete {variable}")),
            Effect::Retype {
                variable,
                type_name,
            } => Self::leaf(format!("retype {variable} {type_name}")),
            Effect::Forall { variables, body } => Self {
                head: quantifier("forall", variables),
                inner: vec![Self::of_effects(body)],
            },
            Effect::When { condition, body } => {
                let inner = vec![Self::of_condition(condition), Self::of_effects(body)];
                Self {
                    head: "when".to_owned(),
                    inner,
                }
            }
        }
    }

    fn lines(&self, f: &mut Formatter<'_>, depth: usize) -> fmt::Result {
        let tabs = "\t".repeat(depth);
        let flat = self.to_string();
        if self.inner.is_empty() || flat.chars().count() <= LINE {
            return writeln!(f, "{tabs}{flat}");
        }
        writeln!(f, "{tabs}({}", self.head)?;
        for form in &self.inner {
            form.lines(f, depth + 1)?;
        }
        writeln!(f, "{tabs})")
    }
}

impl Display for Form {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "({}", self.head)?;
        for form in &self.inner {
            write!(f, " {form}")?;
        }
        f.write_str(")")
    }
}

fn quantifier(word: &str, variables: &[PatternNode]) -> String {
    let mut head = word.to_owned();
    for variable in variables {
        head.push(' ');
        head.push_str(&variable.to_string());
    }
    head
}

/// Whether `(= first second)` is read as a comparison of nodes rather than of values.
fn reads_as_nodes(first: &str, second: &str) -> bool {
    let word = |name: &str| name.starts_with(|c: char| c.is_alphabetic() || c == '_');
    let boolean = |name: &str| matches!(name, "true" | "false");
    (word(first) || word(second)) && !boolean(first) && !boolean(second)
}

#[cfg(test)]
mod tests;
