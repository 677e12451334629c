//! Formulas: conditions, effects, expressions.
//!
//! Guarantee: brackets are paired before meaning is read (module `form`), so one wrong formula
//! does not spoil its neighbours.

use super::form::Form;
use super::{NodeNames, Parser};
use crate::lexer::unquote;
use crate::{
    Arithmetic, Comparison, Condition, Effect, Expression, Literal, Name, PatternNode, Problem,
    Span,
};
use dsr::suggest;
use std::ops::Range;

const CONDITIONS: [&str; 7] = ["not", "and", "or", "exists", "forall", "when", "eq"];
const EFFECTS: [&str; 8] = [
    "not", "and", "forall", "when", "create", "delete", "retype", "assign",
];
const NOT_IN_EFFECTS: [&str; 3] = ["or", "exists", "eq"];

impl Parser<'_> {
    /// After `precondition {`. Several formulas side by side must all hold.
    pub(super) fn condition_block(&mut self, opening: Range<usize>) -> Option<Condition> {
        let forms = self.forms(opening);
        let mut conditions = self.conditions(forms);
        if conditions.len() > 1 {
            return Some(Condition::And(conditions));
        }
        conditions.pop()
    }

    /// After `effect {`.
    pub(super) fn effect_block(&mut self, opening: Range<usize>) -> Vec<Effect> {
        let forms = self.forms(opening);
        self.effects(forms)
    }

    /// `( expression )`, the outer brackets being those of a clause or of the expression itself.
    pub(super) fn bracketed_expression(&mut self, what: &str) -> Option<Expression> {
        if !self.is_symbol("(") {
            self.expected(format!("`(` and {what}"), &[]);
            return None;
        }
        let Form::List(mut items, span) = self.form(0)? else {
            return None;
        };
        match items.len() {
            0 => {
                self.wanted(span, what, None);
                None
            }
            1 => {
                let item = items.remove(0);
                self.number_wanted(&item, "this");
                self.expression(item)
            }
            _ => self.expression(Form::List(items, span)),
        }
    }

    /// Reports that `expected` should stand where `found` stands.
    fn wanted(&mut self, found: Span, expected: &str, suggestion: Option<String>) {
        let text = &self.text[found.start..found.end];
        let short = if text.len() > 40 || text.contains('\n') {
            "something else"
        } else {
            text
        };
        let found_words = if short == text {
            format!("`{text}`")
        } else {
            short.to_owned()
        };
        let expected = expected.to_owned();
        let problem = Problem::Expected {
            expected,
            found: found_words,
            suggestion,
        };
        self.report(found.start..found.end, problem);
    }

    /// A list's head and the rest of it.
    fn head(&mut self, form: Form, what: &str) -> Option<(Name, Vec<Form>, Span)> {
        let span = form.span();
        if let Form::List(mut items, _) = form
            && !items.is_empty()
            && let Form::Word(head) | Form::Number(head) = items.remove(0)
        {
            return Some((head, items, span));
        }
        self.wanted(span, what, None);
        None
    }

    fn condition(&mut self, form: Form) -> Option<Condition> {
        let (head, items, span) = self.head(form, "a condition `(label a b)`, `(not ...)`, ...")?;
        match &*head {
            "not" => {
                let [inner] = self.exactly(items, span, "one condition after `not`")?;
                Some(Condition::Not(Box::new(self.condition(inner)?)))
            }
            "and" => Some(Condition::And(self.conditions(items))),
            "or" => Some(Condition::Or(self.conditions(items))),
            "exists" | "forall" => {
                let (variables, mut rest) = self.variables(items, span)?;
                let [body] = match rest.len() {
                    1 => [rest.remove(0)],
                    _ => self.exactly(rest, span, "variables and one condition")?,
                };
                let body = Box::new(self.condition(body)?);
                Some(if *head == *"exists" {
                    Condition::Exists { variables, body }
                } else {
                    Condition::Forall { variables, body }
                })
            }
            "when" => {
                let [condition, then] = self.exactly(items, span, "two conditions after `when`")?;
                let condition = self.condition(condition);
                let consequence = Box::new(self.condition(then)?);
                Some(Condition::When {
                    condition: Box::new(condition?),
                    consequence,
                })
            }
            "eq" => {
                let [first, second] = self.exactly(items, span, "two nodes after `eq`")?;
                let first = self.node_form(&first);
                Some(Condition::Same(first?, self.node_form(&second)?))
            }
            word => {
                if let Some(operator) = comparison(word) {
                    return self.comparison(operator, items, span);
                }
                let (label, from, to) = self.link(head, &items, &CONDITIONS, span)?;
                Some(Condition::Edge { label, from, to })
            }
        }
    }

    /// Those of the conditions that can be read.
    fn conditions(&mut self, forms: Vec<Form>) -> Vec<Condition> {
        let mut conditions = Vec::new();
        for form in forms {
            let span = form.span();
            match self.condition(form) {
                Some(condition) => conditions.push(condition),
                None => self.lose_span(span),
            }
        }
        conditions
    }

    /// `=` and `!=` of two nodes compare the nodes; all else compares values.
    fn comparison(
        &mut self,
        operator: Comparison,
        items: Vec<Form>,
        span: Span,
    ) -> Option<Condition> {
        let [left, right] = self.exactly(items, span, "two operands")?;
        let is_node = |form: &Form| match form {
            Form::Word(name) => !matches!(&**name, "true" | "false"),
            Form::Text(_) => self.names == NodeNames::Goal,
            Form::Number(name) => name.chars().all(char::is_alphanumeric),
            _ => false,
        };
        let word = |form: &Form| matches!(form, Form::Word(_)) && is_node(form);
        let nodes = is_node(&left) && is_node(&right) && (word(&left) || word(&right));
        if nodes && matches!(operator, Comparison::Equal | Comparison::NotEqual) {
            let same = Condition::Same(self.node_form(&left)?, self.node_form(&right)?);
            return Some(match operator {
                Comparison::Equal => same,
                _ => Condition::Not(Box::new(same)),
            });
        }
        if !matches!(operator, Comparison::Equal | Comparison::NotEqual) {
            self.number_wanted(&left, operator.symbol());
            self.number_wanted(&right, operator.symbol());
        }
        let left = self.expression(left);
        let right = self.expression(right)?;
        Some(Condition::Compare {
            operator,
            left: Box::new(left?),
            right: Box::new(right),
        })
    }

    fn effects(&mut self, forms: Vec<Form>) -> Vec<Effect> {
        let mut effects = Vec::new();
        for form in forms {
            let span = form.span();
            if self.effect(form, &mut effects).is_none() {
                self.lose_span(span);
            }
        }
        effects
    }

    fn effect(&mut self, form: Form, effects: &mut Vec<Effect>) -> Option<()> {
        let (head, items, span) = self.head(form, "an effect `(label a b)`, `(not ...)`, ...")?;
        match &*head {
            "and" => effects.extend(self.effects(items)),
            "not" => {
                let [inner] = self.exactly(items, span, "one link after `not`")?;
                let (head, items, span) = self.head(inner, "a link `(label a b)`")?;
                let (label, from, to) = self.link(head, &items, &[], span)?;
                effects.push(Effect::Unlink { label, from, to });
            }
            "forall" => {
                let (variables, rest) = self.variables(items, span)?;
                let body = self.effects(rest);
                effects.push(Effect::Forall { variables, body });
            }
            "when" => {
                let [condition, then] =
                    self.exactly(items, span, "a condition and an effect after `when`")?;
                let condition = self.condition(condition);
                let body = self.effects(vec![then]);
                effects.push(Effect::When {
                    condition: condition?,
                    body,
                });
            }
            "create" | "retype" => {
                let [node, type_form] = self.exactly(items, span, "a variable and a type")?;
                let variable = self.node_form(&node)?;
                let type_name = self.node_form(&type_form)?;
                effects.push(if *head == *"create" {
                    Effect::Create {
                        variable,
                        type_name,
                    }
                } else {
                    Effect::Retype {
                        variable,
                        type_name,
                    }
                });
            }
            "delete" => {
                let [node] = self.exactly(items, span, "one variable after `delete`")?;
                effects.push(Effect::Delete {
                    variable: self.node_form(&node)?,
                });
            }
            "assign" => {
                let [target, value] = self.exactly(items, span, "an attribute and a value")?;
                let value = self.expression(value);
                let Form::Path(target, _) = target else {
                    self.wanted(target.span(), "an attribute `x.attribute`", None);
                    return None;
                };
                effects.push(Effect::Assign {
                    target,
                    value: value?,
                });
            }
            word if NOT_IN_EFFECTS.contains(&word) || comparison(word).is_some() => {
                self.wanted(
                    head.span(),
                    "an effect: conditions belong after `when`",
                    None,
                );
            }
            _ => {
                let (label, from, to) = self.link(head, &items, &EFFECTS, span)?;
                effects.push(Effect::Link { label, from, to });
            }
        }
        Some(())
    }

    fn expression(&mut self, form: Form) -> Option<Expression> {
        match form {
            Form::Path(path, _) => Some(Expression::Attribute(path)),
            Form::Number(name) => {
                let place = name.span();
                self.number_literal(place.start..place.end)
            }
            Form::Text(name) => Some(Expression::Literal(Literal::Text(unquote(&name)))),
            Form::Word(word) if word == "true" || word == "false" => {
                Some(Expression::Literal(Literal::Boolean(word == "true")))
            }
            Form::List(..) => {
                let (head, items, span) = self.head(form, "a value")?;
                let Some(operator) = arithmetic(&head) else {
                    self.wanted(head.span(), "`+`, `-`, `*` or `/`", None);
                    return None;
                };
                let fewest = if operator == Arithmetic::Subtract {
                    1
                } else {
                    2
                };
                if items.len() < fewest {
                    self.wanted(span, "more operands", None);
                    return None;
                }
                for item in &items {
                    self.number_wanted(item, operator.symbol());
                }
                let read: Vec<_> = items
                    .into_iter()
                    .map(|item| self.expression(item))
                    .collect();
                let operands = read.into_iter().collect::<Option<_>>()?;
                Some(Expression::Arithmetic { operator, operands })
            }
            Form::Word(_) | Form::Typed(_) => {
                self.wanted(
                    form.span(),
                    "a value: a number, text, `x.attribute`, `(+ ...)`",
                    None,
                );
                None
            }
        }
    }

    /// Reports an operand that can only be text or a truth value.
    fn number_wanted(&mut self, form: &Form, operator: &'static str) {
        let found = match form {
            Form::Text(_) => "text",
            Form::Word(word) if word == "true" || word == "false" => "a truth value",
            _ => return,
        };
        let (span, expected) = (form.span(), "numbers");
        self.report(
            span.start..span.end,
            Problem::WrongOperand {
                operator,
                expected,
                found,
            },
        );
    }

    fn exactly<const N: usize>(
        &mut self,
        items: Vec<Form>,
        span: Span,
        what: &str,
    ) -> Option<[Form; N]> {
        if let Some(extra) = items.get(N) {
            let extra = extra.span();
            self.wanted(extra, &format!("only {what}"), None);
            return None;
        }
        let exact = <[Form; N]>::try_from(items).ok();
        if exact.is_none() {
            self.wanted(span, what, None);
        }
        exact
    }

    /// The leading `v:t` items, at least one, and the rest.
    fn variables(&mut self, items: Vec<Form>, span: Span) -> Option<(Vec<PatternNode>, Vec<Form>)> {
        let mut variables = Vec::new();
        let mut rest = Vec::new();
        for item in items {
            match item {
                Form::Typed(node) if rest.is_empty() => variables.push(node),
                other => rest.push(other),
            }
        }
        if variables.is_empty() {
            self.wanted(span, "variables `v:type`", None);
            return None;
        }
        Some((variables, rest))
    }

    fn link(
        &mut self,
        label: Name,
        items: &[Form],
        keywords: &[&str],
        span: Span,
    ) -> Option<(Name, Name, Name)> {
        // A number such as `-4.5` in front names nothing.
        let is_name = label.chars().all(|c| c.is_alphanumeric() || c == '_');
        if !is_name {
            self.wanted(label.span(), "a label or an operator", None);
            return None;
        }
        let keyword = suggest(&label, keywords.iter().copied());
        if let [from, to] = items
            && !matches!(from, Form::List(..) | Form::Typed(_))
            && !matches!(to, Form::List(..) | Form::Typed(_))
            // What looks like a keyword and does not join two nodes was meant as one.
            && (keyword.is_none() || items.iter().all(|item| self.is_node_form(item)))
        {
            let from = self.node_form(from);
            return Some((label, from?, self.node_form(to)?));
        }
        if keyword.is_some() {
            let expected = "a link `(label a b)` or an operator";
            self.wanted(label.span(), expected, keyword);
        } else {
            self.wanted(span, "a link `(label a b)`", None);
        }
        None
    }

    fn is_node_form(&self, form: &Form) -> bool {
        match form {
            Form::Word(name) => name.chars().all(|c| c.is_alphanumeric() || c == '_'),
            Form::Number(name) => name.chars().all(char::is_alphanumeric),
            Form::Text(_) => self.names == NodeNames::Goal,
            _ => false,
        }
    }

    fn node_form(&mut self, form: &Form) -> Option<Name> {
        match form {
            Form::Word(name) | Form::Number(name) | Form::Text(name) if self.is_node_form(form) => {
                Some(name.clone())
            }
            _ => {
                self.wanted(form.span(), "a variable", None);
                None
            }
        }
    }
}

fn comparison(symbol: &str) -> Option<Comparison> {
    Some(match symbol {
        "=" => Comparison::Equal,
        "!=" => Comparison::NotEqual,
        "<" => Comparison::Less,
        "<=" => Comparison::LessOrEqual,
        ">" => Comparison::Greater,
        ">=" => Comparison::GreaterOrEqual,
        _ => return None,
    })
}

fn arithmetic(symbol: &str) -> Option<Arithmetic> {
    Some(match symbol {
        "+" => Arithmetic::Add,
        "-" => Arithmetic::Subtract,
        "*" => Arithmetic::Multiply,
        "/" => Arithmetic::Divide,
        _ => return None,
    })
}
