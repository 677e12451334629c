//! A rule as a picture, in Graphviz DOT.
//!
//! Guarantee: valid DOT whatever the names: every text is quoted.

use crate::{Pattern, Rule};
use std::fmt::Write as _;

/// `text` as a quoted DOT string.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for character in text.chars() {
        match character {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            '\n' => quoted.push_str("\\n"),
            other => quoted.push(other),
        }
    }
    quoted.push('"');
    quoted
}

impl Rule {
    /// The rule as a digraph of two clusters, its left and its right side. What the rule takes
    /// away is red, what it makes green, what must not be there dashed; condition and effects
    /// stand below.
    ///
    /// # Example
    /// ```
    /// let text = "name=x\n===\nopen : active(1) { { d:door d->d(shut) } => { d:door } }\n";
    /// let (grammar, _) = grammar::parse_grammar(text, "x.aggl");
    /// let dot = grammar.rules[0].to_dot();
    /// assert!(dot.starts_with("digraph \"open\" {"));
    /// assert!(dot.contains("\"left d\" -> \"left d\" [label=\"shut\", color=red]"));
    /// ```
    pub fn to_dot(&self) -> String {
        let mut text = String::new();
        // Writing to a string does not fail.
        let _ = writeln!(text, "digraph {} {{", quoted(&self.name));
        let _ = writeln!(text, "\trankdir=LR;\n\tnode [shape=box];");
        let mut notes = Vec::new();
        for (index, condition) in self.precondition.iter().enumerate() {
            notes.push((format!("if {index}"), condition.to_string()));
        }
        for (index, effect) in self.effect.iter().enumerate() {
            notes.push((format!("then {index}"), effect.to_string()));
        }
        self.side(&mut text, "left", &self.left, &self.right, "red");
        self.side(&mut text, "right", &self.right, &self.left, "green4");
        for (name, words) in notes {
            let (name, words) = (quoted(&name), quoted(&words));
            let _ = writeln!(text, "\t{name} [shape=note, label={words}];");
        }
        text.push_str("}\n");
        text
    }

    fn side(&self, text: &mut String, side: &str, here: &Pattern, other: &Pattern, color: &str) {
        let place = |variable: &str| quoted(&format!("{side} {variable}"));
        let _ = writeln!(text, "\tsubgraph {} {{", quoted(&format!("cluster {side}")));
        let _ = writeln!(text, "\t\tlabel={};", quoted(side));
        let extra = self
            .parameters
            .iter()
            .filter(|p| here.node(&p.variable).is_none());
        for node in here.nodes.iter().chain(extra) {
            let known = other.node(&node.variable);
            let parameter = self.parameters.iter().any(|p| p.variable == node.variable);
            let style = match known {
                _ if here.node(&node.variable).is_none() => ", style=dotted".to_owned(),
                None if !parameter => format!(", color={color}"),
                Some(known) if known.type_name != node.type_name => ", color=blue".to_owned(),
                _ => String::new(),
            };
            let (name, label) = (place(&node.variable), quoted(&node.to_string()));
            let _ = writeln!(text, "\t\t{name} [label={label}{style}];");
        }
        for edge in &here.edges {
            let same = other.edge(&edge.from, &edge.label, &edge.to);
            let kept = same.is_some_and(|same| same.negated == edge.negated);
            let style = match (edge.negated, kept) {
                (true, _) => ", style=dashed".to_owned(),
                (false, false) => format!(", color={color}"),
                (false, true) => String::new(),
            };
            let (from, to, label) = (place(&edge.from), place(&edge.to), quoted(&edge.label));
            let _ = writeln!(text, "\t\t{from} -> {to} [label={label}{style}];");
        }
        text.push_str("\t}\n");
    }
}
