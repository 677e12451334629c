//! Graphs in braces: nodes and links.
//!
//! Guarantee: a broken line of a graph is reported and the other lines are still read.

use super::Parser;
use crate::{Name, Pattern, PatternEdge, PatternNode};

/// Blocks that may follow the graphs of a rule or goal.
pub(super) const SECTIONS: [&str; 3] = ["parameters", "precondition", "effect"];

impl Parser<'_> {
    /// `{ nodes and links }`. `None` if there is no graph at all.
    pub(super) fn graph(&mut self, expected: &str) -> Option<Pattern> {
        let opening = self.expect("{", expected)?;
        let mut pattern = Pattern::default();
        loop {
            if self.eat("}") {
                return Some(pattern);
            }
            if self.peek().is_none() || self.is_symbol("=>") || self.is_symbol("{") {
                break;
            }
            if self.at_section() {
                break;
            }
            let before = self.at;
            if self.graph_item(&mut pattern).is_none() {
                self.skip_broken_line(before);
            }
        }
        self.unclosed(opening, '{');
        Some(pattern)
    }

    /// Whether a block such as `precondition {` begins here, misspelt or not.
    pub(super) fn at_section(&self) -> bool {
        let mut keywords = SECTIONS.iter();
        self.peek().is_some() && keywords.any(|keyword| self.is_keyword(self.at, keyword, "{"))
    }

    fn graph_item(&mut self, pattern: &mut Pattern) -> Option<()> {
        let first = self.node("a node, a link or `}`")?;
        if self.eat(":") {
            pattern.nodes.push(self.rest_of_node(first)?);
        } else if self.eat("->") {
            pattern.edges.push(self.rest_of_edge(first)?);
        } else {
            self.expected("`:` and a type, or `->` and a node", &[]);
            return None;
        }
        Some(())
    }

    /// After `variable :`.
    pub(super) fn rest_of_node(&mut self, variable: Name) -> Option<PatternNode> {
        let type_name = self.name("a type")?;
        let mut position = None;
        if self.eat("(") {
            let (x, _) = self.number("the node's drawing position `(x, y)`")?;
            self.expect(",", "`,` between x and y")?;
            let (y, _) = self.number("the node's drawing position `(x, y)`")?;
            self.expect(")", "`)` after the drawing position")?;
            position = Some([x, y]);
        }
        Some(PatternNode {
            variable,
            type_name,
            position,
        })
    }

    /// After `from ->`.
    fn rest_of_edge(&mut self, from: Name) -> Option<PatternEdge> {
        let to = self.node("the node that the link enters")?;
        self.expect("(", "`(` and the link's label")?;
        let label = self.name("the link's label")?;
        self.expect(")", "`)` after the label")?;
        let negated = self.eat("*");
        Some(PatternEdge {
            from,
            label,
            to,
            negated,
        })
    }
}
