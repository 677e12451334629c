//! Conditions, effects and costs.

use super::super::defect::Problem;
use super::super::definition::{Atom, Condition, Cost, Effect, Term, Variables};
use super::super::expression::Expression;
use super::types::Kinds;
use super::{Reader, Signature, suggestion};
use grammar::Span;

const NOTHING: Condition = Condition::All(Vec::new());

impl Reader<'_> {
    pub(super) fn condition(&mut self, expression: &Expression) -> Condition {
        let Some(list) = expression.list() else {
            self.expected(expression, "a condition `(...)`");
            return NOTHING;
        };
        let Some((head, arguments)) = list.split_first() else {
            return NOTHING;
        };
        let (name, span) = match head {
            Expression::Word(name, span) => (name.as_str(), *span),
            Expression::List(..) => {
                self.expected(
                    head,
                    "a predicate, `and`, `or`, `not`, `imply`, `exists` or `forall`",
                );
                return NOTHING;
            }
        };
        match name {
            "and" => Condition::All(self.conditions(arguments)),
            "or" => Condition::Any(self.conditions(arguments)),
            "not" => match arguments {
                [inner] => Condition::Not(Box::new(self.condition(inner))),
                _ => self.count(span, "not", 1, arguments.len()),
            },
            "imply" => match arguments {
                [premise, conclusion] => {
                    let premise = Condition::Not(Box::new(self.condition(premise)));
                    Condition::Any(vec![premise, self.condition(conclusion)])
                }
                _ => self.count(span, "imply", 2, arguments.len()),
            },
            "exists" | "forall" => match arguments {
                [variables, body] => {
                    let (variables, body) = self.quantified(variables, |r| r.condition(body));
                    if name == "exists" {
                        Condition::Exists(variables, Box::new(body))
                    } else {
                        Condition::Forall(variables, Box::new(body))
                    }
                }
                _ => self.count(span, name, 2, arguments.len()),
            },
            "=" => match arguments {
                [Expression::Word(..), Expression::Word(..)] => {
                    let terms = arguments.iter().map(|a| self.term(a, &vec![0]));
                    match terms.collect::<Vec<_>>()[..] {
                        [Some(a), Some(b)] => Condition::Same(a, b),
                        _ => NOTHING,
                    }
                }
                [_, _] => self.unsupported(expression.span(), "a condition on numbers"),
                _ => self.count(span, "=", 2, arguments.len()),
            },
            "<" | ">" | "<=" | ">=" => {
                self.unsupported(expression.span(), "a condition on numbers")
            }
            "preference" => self.unsupported(span, "a preference"),
            _ => self.atom(expression).map_or(NOTHING, Condition::Atom),
        }
    }

    fn conditions(&mut self, list: &[Expression]) -> Vec<Condition> {
        list.iter().map(|part| self.condition(part)).collect()
    }

    fn count(&mut self, span: Span, name: &str, takes: usize, given: usize) -> Condition {
        let name = name.to_owned();
        self.wrong(span, Problem::Arguments { name, takes, given });
        NOTHING
    }

    fn unsupported(&mut self, span: Span, what: &str) -> Condition {
        self.wrong(span, Problem::Unsupported(what.to_owned()));
        NOTHING
    }

    fn quantified<T>(
        &mut self,
        variables: &Expression,
        body: impl FnOnce(&mut Self) -> T,
    ) -> (Variables, T) {
        let Some(list) = variables.list() else {
            self.expected(variables, "`(?variable - type ...)`");
            let nothing = Variables {
                first: self.scope.len(),
                domains: Vec::new(),
            };
            return (nothing, body(self));
        };
        let before = self.scope.len();
        let typed = self.typed_list(list, true);
        let variables = self.declare(typed);
        let body = body(self);
        self.scope.truncate(before);
        (variables, body)
    }

    fn term(&mut self, expression: &Expression, wanted: &Kinds) -> Option<Term> {
        let Expression::Word(name, span) = expression else {
            self.expected(expression, "a variable or an object");
            return None;
        };
        let (term, kinds) = if name.starts_with('?') {
            let Some(slot) = self.scope.iter().rposition(|(known, _)| known == name) else {
                let names = self.scope.iter().map(|(known, _)| known.as_str());
                let near = super::nearest(names, name);
                self.unknown(*span, "variable", name, near);
                return None;
            };
            (Term::Slot(slot), &self.scope[slot].1)
        } else {
            let Some(object) = self.definition.objects.find(name) else {
                let near = suggestion(&self.definition.objects, name);
                self.unknown(*span, "object", name, near);
                return None;
            };
            (Term::Object(object as u32), &self.object_kinds[object])
        };
        if !self.types.may_fit(kinds, wanted) {
            let problem = Problem::WrongType {
                name: name.clone(),
                found: self.types.words(kinds),
                wanted: self.types.words(wanted),
            };
            self.wrong(*span, problem);
        }
        Some(term)
    }

    pub(super) fn terms(
        &mut self,
        name: &str,
        span: Span,
        arguments: &[Expression],
        signature: &Signature,
    ) -> Option<Vec<Term>> {
        if arguments.len() != signature.len() {
            self.count(span, name, signature.len(), arguments.len());
            return None;
        }
        let terms: Vec<Option<Term>> = arguments
            .iter()
            .zip(signature)
            .map(|(argument, kinds)| self.term(argument, kinds))
            .collect();
        terms.into_iter().collect()
    }

    pub(super) fn atom(&mut self, expression: &Expression) -> Option<Atom> {
        let Some([Expression::Word(name, span), arguments @ ..]) = expression.list() else {
            self.expected(expression, "`(predicate argument ...)`");
            return None;
        };
        let Some(predicate) = self.definition.predicates.find(name) else {
            let near = suggestion(&self.definition.predicates, name);
            self.unknown(*span, "predicate", name, near);
            return None;
        };
        let signature = self.of_predicates[predicate].clone();
        let arguments = self.terms(name, *span, arguments, &signature)?;
        Some(Atom {
            predicate,
            arguments,
        })
    }

    /// Reads an effect; costs are allowed `outside` of conditions and quantifiers alone.
    pub(super) fn effect(
        &mut self,
        expression: &Expression,
        outside: bool,
        effects: &mut Vec<Effect>,
        costs: &mut Vec<Cost>,
    ) {
        let Some(list) = expression.list() else {
            return self.expected(expression, "an effect `(...)`");
        };
        let arguments = list.get(1..).unwrap_or_default();
        let span = list.first().map_or(expression.span(), Expression::span);
        match (expression.head(), arguments) {
            (None, _) if list.is_empty() => {}
            (Some("and"), _) => {
                for part in arguments {
                    self.effect(part, outside, effects, costs);
                }
            }
            (Some("not"), [inner]) => effects.extend(self.atom(inner).map(Effect::Delete)),
            (Some("forall"), [variables, body]) => {
                let (variables, body) = self.quantified(variables, |reader| {
                    let mut inner = Vec::new();
                    reader.effect(body, false, &mut inner, costs);
                    inner
                });
                effects.push(Effect::Forall(variables, body));
            }
            (Some("when"), [condition, body]) => {
                let condition = self.condition(condition);
                let mut inner = Vec::new();
                self.effect(body, false, &mut inner, costs);
                effects.push(Effect::When(condition, inner));
            }
            (Some("increase"), [target, amount]) => {
                if target.head() != Some("total-cost") {
                    let what = "changing another number than `(total-cost)`".to_owned();
                    self.wrong(target.span(), Problem::Unsupported(what));
                } else if outside {
                    costs.extend(self.cost(amount));
                } else {
                    let what = "a cost under a condition".to_owned();
                    self.wrong(expression.span(), Problem::Unsupported(what));
                }
            }
            (Some(name @ ("not" | "forall" | "when" | "increase")), _) => {
                let takes = if name == "not" { 1 } else { 2 };
                self.count(span, name, takes, arguments.len());
            }
            (Some(name @ ("assign" | "decrease" | "scale-up" | "scale-down")), _) => {
                self.wrong(span, Problem::Unsupported(format!("`{name}`")));
            }
            _ => effects.extend(self.atom(expression).map(Effect::Add)),
        }
    }

    fn cost(&mut self, expression: &Expression) -> Option<Cost> {
        if let Expression::Word(word, _) = expression {
            return match word.parse::<f64>() {
                Ok(number) if number.is_finite() && number >= 0.0 => Some(Cost::Number(number)),
                _ => {
                    self.expected(expression, "a number that is 0 or more, or a function");
                    None
                }
            };
        }
        let Some([Expression::Word(name, span), arguments @ ..]) = expression.list() else {
            self.expected(expression, "a number or a function");
            return None;
        };
        if let ("+" | "*" | "-" | "/", [_, _, ..]) = (name.as_str(), arguments) {
            let parts: Vec<Option<Cost>> = arguments.iter().map(|part| self.cost(part)).collect();
            let parts: Vec<Cost> = parts.into_iter().collect::<Option<_>>()?;
            return match (name.as_str(), <[Cost; 2]>::try_from(parts)) {
                ("+", parts) => Some(Cost::Sum(parts.map_or_else(|all| all, Vec::from))),
                ("*", parts) => Some(Cost::Product(parts.map_or_else(|all| all, Vec::from))),
                ("-", Ok([a, b])) => Some(Cost::Difference(Box::new(a), Box::new(b))),
                ("/", Ok([a, b])) => Some(Cost::Quotient(Box::new(a), Box::new(b))),
                (_, _) => {
                    self.count(*span, name, 2, arguments.len());
                    None
                }
            };
        }
        let Some(function) = self.definition.functions.find(name) else {
            let near = suggestion(&self.definition.functions, name);
            self.unknown(*span, "function", name, near);
            return None;
        };
        let signature = self.of_functions[function].clone();
        let arguments = self.terms(name, *span, arguments, &signature)?;
        Some(Cost::Function(function, arguments))
    }
}
