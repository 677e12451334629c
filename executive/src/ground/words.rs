//! Conditions and links in words, for reasons that people read.

use super::program::{Link, Object, Operator, Place, Quantified, Term, Test, UNBOUND};
use super::vocabulary::{TypeSet, Vocabulary};
use grammar::{Arithmetic, Comparison};

/// Names for numbers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Words<'a> {
    pub(crate) vocabulary: &'a Vocabulary,
    pub(crate) names: &'a [String],
}

impl Words<'_> {
    /// An object, or the type of what may stand in its place.
    pub(crate) fn object(&self, object: Object, operator: &Operator, slot: usize) -> String {
        if let Some(name) = self.names.get(object as usize) {
            return name.clone();
        }
        match operator.variables.get(slot) {
            Some(variable) if object == UNBOUND => {
                format!("some {}", self.types(&variable.types))
            }
            Some(variable) => variable.name.clone(),
            None => "some node".to_owned(),
        }
    }

    /// The most general of some types, as far as the order of names tells.
    pub(crate) fn types(&self, types: &TypeSet) -> String {
        let names: Vec<&str> = types
            .ones()
            .take(3)
            .map(|exact| self.vocabulary.types.name(exact as u16))
            .collect();
        if names.is_empty() {
            "node".to_owned()
        } else {
            names.join(" or ")
        }
    }

    /// `shelly -in-> kitchen`, at a binding of which parts may be open.
    pub(crate) fn link(&self, link: Link, operator: &Operator, environment: &[Object]) -> String {
        let end = |slot: u32| {
            let object = environment.get(slot as usize).copied().unwrap_or(UNBOUND);
            self.object(object, operator, slot as usize)
        };
        let label = self.vocabulary.labels.name(link.label);
        format!("{} -{label}-> {}", end(link.from), end(link.to))
    }

    /// A condition as AGGL writes it, with names for bound variables.
    pub(crate) fn test(&self, test: &Test, operator: &Operator, environment: &[Object]) -> String {
        let end = |slot: u32| {
            let object = environment.get(slot as usize).copied().unwrap_or(UNBOUND);
            self.object(object, operator, slot as usize)
        };
        let all = |parts: &[Test]| {
            let parts: Vec<String> = parts
                .iter()
                .map(|part| self.test(part, operator, environment))
                .collect();
            parts.join(" ")
        };
        let quantified = |word: &str, quantified: &Quantified<Box<Test>>| {
            let mut open = environment.to_vec();
            let mut types = Vec::new();
            for (index, domain) in quantified.domains.iter().enumerate() {
                if let Some(slot) = open.get_mut(quantified.first + index) {
                    *slot = UNBOUND;
                }
                types.push(self.types(domain));
            }
            let body = self.test(&quantified.body, operator, &open);
            format!("({word} {}: {body})", types.join(", "))
        };
        match test {
            Test::Link(link) => {
                let label = self.vocabulary.labels.name(link.label);
                format!("({label} {} {})", end(link.from), end(link.to))
            }
            Test::Same(a, b) => format!("(= {} {})", end(*a), end(*b)),
            Test::Compare(operation, left, right) => format!(
                "({} {} {})",
                Comparison::symbol(*operation),
                self.term(left, operator, environment),
                self.term(right, operator, environment)
            ),
            Test::Not(inner) => format!("(not {})", self.test(inner, operator, environment)),
            Test::All(parts) => format!("(and {})", all(parts)),
            Test::Any(parts) => format!("(or {})", all(parts)),
            Test::Exists(inner) => quantified("exists", inner),
            Test::Forall(inner) => quantified("forall", inner),
        }
    }

    /// An expression as AGGL writes it, with names for bound variables.
    pub(crate) fn term(&self, term: &Term, operator: &Operator, environment: &[Object]) -> String {
        match term {
            Term::Constant(value) => dsr::json::value_to_json(value).to_string(),
            Term::Place(Place::Node(slot, attribute)) => {
                let object = environment.get(*slot as usize).copied();
                let object = self.object(object.unwrap_or(UNBOUND), operator, *slot as usize);
                format!("{object}.{}", self.vocabulary.attributes.name(*attribute))
            }
            Term::Place(Place::Link(link, attribute)) => format!(
                "({}).{}",
                self.link(*link, operator, environment),
                self.vocabulary.attributes.name(*attribute)
            ),
            Term::Arithmetic(operation, operands) => {
                let operands: Vec<String> = operands
                    .iter()
                    .map(|operand| self.term(operand, operator, environment))
                    .collect();
                format!(
                    "({} {})",
                    Arithmetic::symbol(*operation),
                    operands.join(" ")
                )
            }
        }
    }
}
