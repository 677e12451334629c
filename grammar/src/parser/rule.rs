//! Rules: header, graphs, blocks.
//!
//! Guarantee: what is returned was read without an error that changes its meaning.

use super::Parser;
use super::pattern::SECTIONS;
use crate::lexer::TokenKind;
use crate::{Combo, Effect, Expression, Kind, Literal, Name, Pattern, PatternNode, Problem, Rule};
use std::ops::Range;

/// Which whole numbers a value can be.
const WHOLE: &str =
    "from -9223372036854775808 to 18446744073709551615 (a real has a point or an exponent)";

/// Words that may stand before a rule's name.
pub(super) const MODIFIERS: [&str; 3] = ["dormant", "hierarchical", "strict"];
pub(super) const KINDS: [&str; 2] = ["active", "passive"];
/// Words that may stand between a rule's cost and its body.
const CLAUSES: [&str; 5] = ["success", "activates", "cost", "duration", "agent"];

/// A rule or a combo.
#[derive(Debug)]
pub(crate) enum Action {
    Rule(Box<Rule>),
    Combo(Combo),
}

/// What was made of a rule or combo that has errors in it.
#[derive(Debug)]
pub(crate) struct Broken {
    pub(crate) name: Option<Name>,
    /// What could be read of it; for checking only.
    pub(crate) action: Option<Action>,
    /// Words in the parts that could not be read: they may have declared what the rest uses.
    pub(crate) lost: Vec<Name>,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) name: Name,
    pub(super) kind: Kind,
    pub(super) constant_cost: Expression,
    cost: Option<Expression>,
    duration: Option<Expression>,
    agent: Option<Name>,
    success: Option<f64>,
    activates: Option<Vec<Name>>,
    pub(super) modifiers: Vec<Name>,
    /// The words of the clauses.
    pub(super) clauses: Vec<Name>,
}

impl Header {
    fn new(name: Name) -> Self {
        Self {
            name,
            kind: Kind::Active,
            constant_cost: Expression::Literal(Literal::Integer(1)),
            cost: None,
            duration: None,
            agent: None,
            success: None,
            activates: None,
            modifiers: Vec::new(),
            clauses: Vec::new(),
        }
    }
}

#[derive(Debug, Default)]
struct Sections {
    parameters: Option<Vec<PatternNode>>,
    /// Its conditions, of which there is at most one.
    precondition: Option<Vec<crate::Condition>>,
    effect: Option<Vec<Effect>>,
}

impl Parser<'_> {
    /// A rule or combo, from its first token to its end or the next rule's beginning.
    pub(super) fn action(&mut self) -> Result<Action, Broken> {
        let fatal = self.fatal;
        self.lost.clear();
        let first = self.at;
        let next = self
            .beginnings
            .partition_point(|&beginning| beginning <= first);
        self.limit = self
            .beginnings
            .get(next)
            .copied()
            .unwrap_or(self.tokens.len());
        let name = self.tokens[first..self.limit]
            .windows(2)
            .take_while(|pair| pair[0].kind != TokenKind::Symbol("{"))
            .find(|pair| pair[1].kind == TokenKind::Symbol(":"))
            .map(|pair| pair[0].range.clone())
            .map(|range| Name::new(&self.text[range.clone()], self.span(range)));
        let mut header = Header::new(name.unwrap_or_default());
        let read = self.header(&mut header);
        let name = (!header.name.is_empty()).then(|| header.name.clone());
        if read.is_none() {
            while self.peek().is_some() && !self.is_symbol("{") {
                self.bump();
            }
            if self.peek().is_none() {
                return Err(Broken {
                    name,
                    action: None,
                    lost: Vec::new(),
                });
            }
        }
        match self.body(header) {
            Some(action) if self.fatal == fatal => Ok(action),
            action => Err(Broken {
                name,
                action,
                lost: std::mem::take(&mut self.lost),
            }),
        }
    }

    fn header(&mut self, header: &mut Header) -> Option<()> {
        self.modifiers(header)?;
        header.name = self.name("a rule's name")?;
        let colon = self.expect(":", "`:` after the rule's name");
        if colon.is_none() && !KINDS.contains(&self.token_text(self.at)) {
            return None;
        }
        while MODIFIERS.contains(&self.token_text(self.at)) {
            let word = self.token_text(self.at).to_owned();
            let range = self.bump();
            let rule = header.name.to_string();
            self.report(range, Problem::Misplaced { word, rule });
        }
        header.kind = match self.keyword_among(&KINDS, "`active` or `passive`") {
            Some("passive") => Kind::Passive,
            None if !self.is_symbol_at(self.at + 1, "(") => return None,
            _ => Kind::Active,
        };
        self.bump();
        let cost = self.at;
        if self.constant_cost(header).is_none() {
            self.skip_clause(cost);
        }
        while !self.is_symbol("{") {
            if self.peek().is_none() {
                self.expected("`{` and the rule's body", &[]);
                return None;
            }
            let clause = self.at;
            if self.clause(header).is_none() {
                self.skip_clause(clause);
            }
        }
        Some(())
    }

    /// The words before a rule's name.
    fn modifiers(&mut self, header: &mut Header) -> Option<()> {
        let names = |parser: &Self| {
            let next = parser.at + 1;
            let kind = KINDS.contains(&parser.token_text(next));
            (parser.is_word_at(next) || parser.is_digits(next)) && !kind
        };
        while names(self) {
            let expected = "`dormant`, `hierarchical`, `strict` or a rule's name";
            if let Some(modifier) = self.keyword_among(&MODIFIERS, expected) {
                let range = self.bump();
                let modifier = Name::new(modifier, self.span(range.clone()));
                if header.modifiers.contains(&modifier) {
                    self.repeated(range, format!("`{modifier}`"));
                }
                header.modifiers.push(modifier);
                continue;
            }
            // What no word was meant to be is told once, and the name may still come.
            while names(self) {
                self.bump();
            }
            return self.is_symbol_at(self.at + 1, ":").then_some(());
        }
        Some(())
    }

    fn constant_cost(&mut self, header: &mut Header) -> Option<()> {
        self.expect("(", "`(` and the rule's cost")?;
        header.constant_cost = self.not_negative("the cost")?;
        self.expect(")", "`)` after the cost")?;
        Some(())
    }

    /// After a broken clause that began at token `start`: skips to the next one or to the body.
    fn skip_clause(&mut self, start: usize) {
        self.at = self.at.max(start + 1).min(self.limit);
        let count = |symbol| {
            let places = start..self.at;
            places.filter(|&at| self.is_symbol_at(at, symbol)).count()
        };
        let mut open = count("(").saturating_sub(count(")"));
        while self.peek().is_some() && !self.is_symbol("{") {
            let begins = self.is_word_at(self.at) && self.is_symbol_at(self.at + 1, "(");
            let keyword = |keyword: &&str| self.is_keyword(self.at, keyword, "(");
            if begins && (open == 0 || CLAUSES.iter().any(keyword)) {
                break;
            }
            open += usize::from(self.is_symbol("("));
            open = open.saturating_sub(usize::from(self.is_symbol(")")));
            self.bump();
        }
    }

    fn clause(&mut self, header: &mut Header) -> Option<()> {
        let expected = "`{`, `success`, `activates`, `cost`, `duration` or `agent`";
        let word = self.keyword_among(&CLAUSES, expected)?;
        let range = self.bump();
        let name = Name::new(word, self.span(range.clone()));
        header.clauses.push(name);
        let repeated = match word {
            "cost" => header.cost.replace(self.amount("the cost")?).is_some(),
            "duration" => header
                .duration
                .replace(self.amount("the duration in seconds")?)
                .is_some(),
            "agent" => {
                self.expect("(", "`(` and an agent's name")?;
                let agent = self.name("an agent's name")?;
                self.expect(")", "`)` after the agent's name")?;
                header.agent.replace(agent).is_some()
            }
            "success" => {
                self.expect("(", "`(` and a probability")?;
                let (value, place) = self.number("a probability between 0 and 1")?;
                if !(0.0..=1.0).contains(&value) {
                    self.out_of_range(place, "the probability", "between 0 and 1");
                }
                self.expect(")", "`)` after the probability")?;
                header.success.replace(value).is_some()
            }
            _ => {
                self.expect("(", "`(` and the names of rules")?;
                let mut names = vec![self.name("the name of a rule")?];
                while self.eat(",") {
                    names.push(self.name("the name of a rule")?);
                }
                self.expect(")", "`,` or `)`")?;
                header.activates.replace(names).is_some()
            }
        };
        if repeated {
            self.repeated(range, format!("`{word}`"));
        }
        Some(())
    }

    fn not_negative(&mut self, what: &'static str) -> Option<Expression> {
        let (value, range) = self.number("a number")?;
        if value < 0.0 {
            self.out_of_range(range.clone(), what, "0 or more");
        }
        self.number_literal(range)
    }

    /// An expression in brackets that can be a number of 0 or more.
    fn amount(&mut self, what: &'static str) -> Option<Expression> {
        let (first, told) = (self.at, self.findings.len());
        let expression = self.bracketed_expression(what)?;
        if expression.is_no_amount() && self.findings.len() == told {
            let last = &self.tokens[self.at - 1];
            let (start, end) = (self.tokens[first].range.start, last.range.end);
            self.out_of_range(start..end, what, "a number of 0 or more");
        }
        Some(expression)
    }

    /// The number that is written there.
    pub(super) fn number_literal(&mut self, place: Range<usize>) -> Option<Expression> {
        let literal = Literal::number(&self.text[place.clone()]);
        if literal.is_none() {
            self.out_of_range(place, "a whole number", WHOLE);
        }
        literal.map(Expression::Literal)
    }

    fn out_of_range(&mut self, place: Range<usize>, what: &'static str, range: &'static str) {
        let found = self.text[place.clone()].to_owned();
        self.report(place, Problem::OutOfRange { what, range, found });
    }

    pub(super) fn repeated(&mut self, range: Range<usize>, what: String) {
        self.report(range, Problem::Repeated { what });
    }

    fn body(&mut self, header: Header) -> Option<Action> {
        let opening = self.expect("{", "`{` and the rule's body")?;
        let word = self
            .peek()
            .is_some_and(|token| token.kind == TokenKind::Word);
        if (word && !self.at_section()) || self.is_digits(self.at) {
            return self.combo_body(header, opening);
        }
        let Some(left) = self.graph("`{` and the left side, or a step `rule as alias`") else {
            self.skip_braces(1);
            return None;
        };
        let arrow = self.expect("=>", "`=>` between the two sides");
        if arrow.is_none() && self.is_symbol_at(self.at + 1, "{") {
            self.bump();
        }
        let Some(right) = self.graph("`{` and the right side") else {
            self.skip_braces(1);
            return None;
        };
        let sections = self.sections();
        if self.expect("}", "`}` at the end of the rule").is_none() {
            self.skip_braces(1);
        }
        Some(Action::Rule(Box::new(rule(header, left, right, sections))))
    }

    fn sections(&mut self) -> Sections {
        let mut sections = Sections::default();
        while let Some(token) = self.peek() {
            if token.kind != TokenKind::Word {
                break;
            }
            let expected = "`parameters`, `precondition`, `effect` or `}`";
            let Some(word) = self.keyword_among(&SECTIONS, expected) else {
                let start = self.at;
                self.bump();
                if self.eat("{") {
                    self.skip_braces(1);
                }
                self.lose(start..self.at);
                continue;
            };
            let range = self.bump();
            let Some(opening) = self.expect("{", "`{`") else {
                self.skip_line();
                continue;
            };
            let repeated = match word {
                "parameters" => {
                    let parameters = self.parameters(opening);
                    sections.parameters.replace(parameters).is_some()
                }
                "precondition" => {
                    let condition = self.condition_block(opening).into_iter().collect();
                    sections.precondition.replace(condition).is_some()
                }
                _ => sections
                    .effect
                    .replace(self.effect_block(opening))
                    .is_some(),
            };
            if repeated {
                self.repeated(range, format!("`{word}`"));
            }
        }
        sections
    }

    fn parameters(&mut self, opening: Range<usize>) -> Vec<PatternNode> {
        let mut parameters = Vec::new();
        while !self.eat("}") {
            if self.peek().is_none() || self.is_symbol("{") || self.at_section() {
                self.unclosed(opening, '{');
                break;
            }
            let before = self.at;
            let parameter = self.parameter();
            if parameter.is_none() {
                self.skip_broken_line(before);
            }
            parameters.extend(parameter);
        }
        parameters
    }

    fn parameter(&mut self) -> Option<PatternNode> {
        let variable = self.name("a parameter `variable:type` or `}`")?;
        self.expect(":", "`:` and the parameter's type")?;
        let parameter = self.rest_of_node(variable)?;
        self.eat(",");
        Some(parameter)
    }
}

fn rule(header: Header, left: Pattern, right: Pattern, sections: Sections) -> Rule {
    let has = |modifier: &str| header.modifiers.iter().any(|word| word == modifier);
    Rule {
        dormant: has("dormant"),
        hierarchical: has("hierarchical"),
        strict: has("strict"),
        name: header.name,
        kind: header.kind,
        cost: header.cost.unwrap_or(header.constant_cost),
        duration: header.duration,
        agent: header.agent,
        success: header.success.unwrap_or(1.0),
        activates: header.activates.unwrap_or_default(),
        left,
        right,
        parameters: sections.parameters.unwrap_or_default(),
        precondition: sections
            .precondition
            .and_then(|mut condition| condition.pop()),
        effect: sections.effect.unwrap_or_default(),
        comments: Vec::new(),
    }
}
