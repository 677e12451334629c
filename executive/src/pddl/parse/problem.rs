//! The problem: objects, what holds at first, goal and metric.

use super::super::defect::Problem;
use super::super::definition::{Object, Term};
use super::super::expression::Expression;
use super::super::names::nearest;
use super::{Reader, Sections};

impl Reader<'_> {
    pub(super) fn objects_of(&mut self, sections: &Sections<'_>) {
        for objects in sections.all(":objects") {
            self.objects(&objects[1..]);
        }
    }

    pub(super) fn problem(&mut self, domain: &Sections<'_>, sections: &Sections<'_>) {
        const KNOWN: [&str; 6] = [
            ":domain",
            ":requirements",
            ":objects",
            ":init",
            ":goal",
            ":metric",
        ];
        for section in &sections.list {
            let head = section[0].word().unwrap_or_default();
            if head == ":constraints" || head == ":length" {
                self.wrong(section[0].span(), Problem::Unsupported(format!("`{head}`")));
            } else if !KNOWN.contains(&head) {
                let near = nearest(KNOWN.into_iter(), head);
                self.unknown(section[0].span(), "section", head, near);
            }
        }
        match sections
            .all(":domain")
            .next()
            .and_then(|section| section.get(1))
        {
            Some(Expression::Word(name, span)) if *name != domain.name => {
                let problem = Problem::OtherDomain {
                    wanted: name.clone(),
                    found: domain.name.clone(),
                };
                self.wrong(*span, problem);
            }
            Some(_) => {}
            None => self.wrong(sections.name_span, Problem::Missing("`(:domain NAME)`")),
        }
        for fact in sections.all(":init").flat_map(|section| &section[1..]) {
            self.initially(fact);
        }
        let goals: Vec<&[Expression]> = sections.all(":goal").collect();
        match goals[..] {
            [[_, goal]] => {
                self.most = 0;
                self.definition.goal = Some(self.condition(goal));
                self.definition.goal_slots = self.most;
            }
            [] => self.wrong(sections.end, Problem::Missing("`(:goal ...)`")),
            [section, ..] => self.wrong(
                section[0].span(),
                Problem::expected("one goal with one condition", ":goal"),
            ),
        }
        for metric in sections.all(":metric") {
            let total =
                |e: &Expression| e.head() == Some("total-cost") || e.word() == Some("total-cost");
            match metric {
                [_, minimize, cost] if minimize.word() == Some("minimize") && total(cost) => {
                    self.definition.metric = true;
                }
                _ => {
                    let what = "a metric other than `minimize (total-cost)`".to_owned();
                    self.wrong(metric[0].span(), Problem::Unsupported(what));
                }
            }
        }
    }

    /// The objects that terms without variables stand for.
    fn constants(terms: &[Term]) -> Vec<Object> {
        terms.iter().map(|term| term.at(&[])).collect()
    }

    fn initially(&mut self, fact: &Expression) {
        match (fact.head(), fact.list().unwrap_or_default()) {
            (Some("="), [_, function @ Expression::List(..), value]) => {
                let number = value.word().and_then(|word| word.parse::<f64>().ok());
                let Some(number) = number.filter(|number| number.is_finite()) else {
                    return self.expected(value, "a number");
                };
                let Some([Expression::Word(name, span), arguments @ ..]) = function.list() else {
                    return self.expected(function, "`(function object ...)`");
                };
                let Some(index) = self.definition.functions.find(name) else {
                    // The total cost begins at nothing, declared or not.
                    if name != "total-cost" {
                        let near = self.definition.functions.nearest(name);
                        self.unknown(*span, "function", name, near);
                    }
                    return;
                };
                let signature = self.of_functions[index].clone();
                if let Some(terms) = self.terms(name, *span, arguments, &signature) {
                    let value = (index, Self::constants(&terms), number);
                    self.definition.values.push(value);
                }
            }
            (Some("at"), [_, Expression::Word(time, _), _]) if time.parse::<f64>().is_ok() => {
                let what = "a fact that comes at a time".to_owned();
                self.wrong(fact.span(), Problem::Unsupported(what));
            }
            // What is not listed does not hold; some files say so.
            (Some("not"), [_, inner]) => {
                self.atom(inner);
            }
            _ => {
                if let Some(atom) = self.atom(fact) {
                    let fact = (atom.predicate, Self::constants(&atom.arguments));
                    self.definition.initial.push(fact);
                }
            }
        }
    }
}
