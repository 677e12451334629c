//! From PDDL text to a [`Definition`]. This module guarantees that a definition comes out only
//! where nothing is wrong with either file, and that all that is wrong is told at once.

mod formula;
mod problem;
mod types;

use super::defect::{Defects, Problem};
use super::definition::{Action, Condition, Cost, Definition, Object, Variables};
use super::expression::{self, Expression};
use super::names::{Names, nearest};
use grammar::{SourceFile, Span};
use types::{Kinds, Typed, Types};

/// What a domain may require.
const REQUIREMENTS: [&str; 13] = [
    ":strips",
    ":typing",
    ":equality",
    ":negative-preconditions",
    ":disjunctive-preconditions",
    ":existential-preconditions",
    ":universal-preconditions",
    ":quantified-preconditions",
    ":conditional-effects",
    ":adl",
    ":action-costs",
    // Numbers are read as long as they only sum up to the total cost.
    ":fluents",
    ":numeric-fluents",
];

/// What the arguments of a predicate or function may be.
type Signature = Vec<Kinds>;

pub(super) struct Reader<'a> {
    file: &'a SourceFile,
    defects: &'a mut Defects,
    types: Types,
    object_kinds: Vec<Kinds>,
    of_predicates: Vec<Signature>,
    of_functions: Vec<Signature>,
    definition: Definition,
    /// Variables in scope, by slot.
    scope: Vec<(String, Kinds)>,
    /// The most slots that were in scope at once.
    most: usize,
}

/// Reads a domain and a problem of it.
pub(super) fn read(domain: &SourceFile, problem: &SourceFile) -> Result<Definition, Defects> {
    let mut defects = Defects::default();
    let domain_text = expression::read(domain, &mut defects);
    let problem_text = expression::read(problem, &mut defects);
    let mut reader = Reader {
        file: domain,
        defects: &mut defects,
        types: Types::default(),
        object_kinds: Vec::new(),
        of_predicates: Vec::new(),
        of_functions: Vec::new(),
        definition: Definition::default(),
        scope: Vec::new(),
        most: 0,
    };
    let domain_sections = domain_text
        .as_ref()
        .map(|text| reader.sections(text, "domain"));
    reader.file = problem;
    let problem_sections = problem_text
        .as_ref()
        .map(|text| reader.sections(text, "problem"));
    if let Some(of_domain) = domain_sections {
        reader.file = domain;
        reader.declarations(&of_domain);
        if let Some(of_problem) = &problem_sections {
            reader.file = problem;
            reader.objects_of(of_problem);
            reader.file = domain;
        }
        for section in of_domain.all(":action") {
            reader.action(section);
        }
        if let Some(of_problem) = &problem_sections {
            reader.file = problem;
            reader.problem(&of_domain, of_problem);
        }
    }
    let definition = reader.definition;
    if defects.is_empty() {
        Ok(definition)
    } else {
        Err(defects)
    }
}

/// The sections of a definition.
struct Sections<'e> {
    name: String,
    name_span: Span,
    end: Span,
    list: Vec<&'e [Expression]>,
}

impl<'e> Sections<'e> {
    fn all<'s>(
        &'s self,
        head: &'static str,
    ) -> impl Iterator<Item = &'e [Expression]> + use<'e, 's> {
        let heads = self.list.iter().copied();
        heads.filter(move |section| section[0].word() == Some(head))
    }
}

impl Reader<'_> {
    fn wrong(&mut self, span: Span, problem: Problem) {
        self.defects.add(self.file, span, problem);
    }

    fn expected(&mut self, found: &Expression, expected: &str) {
        let word = match found {
            Expression::Word(word, _) => word.clone(),
            Expression::List(list, _) if list.is_empty() => "()".to_owned(),
            Expression::List(..) => format!("({} ...)", found.head().unwrap_or("(...)")),
        };
        self.wrong(found.span(), Problem::expected(expected, &word));
    }

    fn unknown(&mut self, span: Span, what: &'static str, name: &str, suggestion: Option<String>) {
        let name = name.to_owned();
        self.wrong(
            span,
            Problem::Unknown {
                what,
                name,
                suggestion,
            },
        );
    }

    /// The sections of `(define (KIND NAME) (:SECTION ...) ...)`.
    fn sections<'e>(&mut self, text: &'e Expression, kind: &str) -> Sections<'e> {
        let mut sections = Sections {
            name: String::new(),
            name_span: text.span(),
            end: Span::new(0, text.span().end.saturating_sub(1), text.span().end),
            list: Vec::new(),
        };
        let list = text.list().unwrap_or_default();
        let mut rest = list.iter();
        let define = rest.next();
        if define.and_then(Expression::word) != Some("define") {
            self.expected(define.unwrap_or(text), "`define`");
            return sections;
        }
        match rest.next() {
            Some(Expression::List(named, span))
                if named.len() == 2 && named[0].word() == Some(kind) =>
            {
                named[1]
                    .word()
                    .unwrap_or_default()
                    .clone_into(&mut sections.name);
                sections.name_span = *span;
            }
            other => self.expected(other.unwrap_or(text), &format!("`({kind} NAME)`")),
        }
        for section in rest {
            match section {
                Expression::List(parts, _)
                    if section.head().is_some_and(|h| h.starts_with(':')) =>
                {
                    sections.list.push(parts);
                }
                other => self.expected(other, "a section `(:... )`"),
            }
        }
        sections
    }

    fn declarations(&mut self, sections: &Sections<'_>) {
        const KNOWN: [&str; 6] = [
            ":requirements",
            ":types",
            ":constants",
            ":predicates",
            ":functions",
            ":action",
        ];
        const BEYOND: [&str; 4] = [":derived", ":durative-action", ":axiom", ":constraints"];
        for section in &sections.list {
            let head = section[0].word().unwrap_or_default();
            if BEYOND.contains(&head) {
                self.wrong(section[0].span(), Problem::Unsupported(format!("`{head}`")));
            } else if !KNOWN.contains(&head) {
                let suggestion = nearest(KNOWN.into_iter(), head);
                self.unknown(section[0].span(), "section", head, suggestion);
            }
        }
        for requirement in sections.all(":requirements").flat_map(|s| &s[1..]) {
            let word = requirement.word().unwrap_or_default();
            if !REQUIREMENTS.contains(&word) {
                let problem = match nearest(REQUIREMENTS.into_iter(), word) {
                    Some(near) => Problem::Unknown {
                        what: "requirement",
                        name: word.to_owned(),
                        suggestion: Some(near),
                    },
                    None => Problem::Unsupported(format!("the requirement `{word}`")),
                };
                self.wrong(requirement.span(), problem);
            }
        }
        self.read_types(sections.all(":types").flat_map(|s| &s[1..]));
        for constants in sections.all(":constants") {
            self.objects(&constants[1..]);
        }
        for predicate in sections.all(":predicates").flat_map(|s| &s[1..]) {
            if let Some((name, span, signature)) = self.signature(predicate) {
                if self.definition.predicates.add(&name).is_some() {
                    self.of_predicates.push(signature);
                } else {
                    let what = "predicate";
                    self.wrong(span, Problem::Duplicate { what, name });
                }
            }
        }
        for section in sections.all(":functions") {
            self.functions(&section[1..]);
        }
    }

    /// `(NAME ?x - TYPE ...)`.
    fn signature(&mut self, declared: &Expression) -> Option<(String, Span, Signature)> {
        let Some(Expression::Word(name, span)) = declared.list().and_then(<[_]>::first) else {
            self.expected(declared, "`(NAME ?variable - type ...)`");
            return None;
        };
        let list = declared.list().unwrap_or_default();
        let variables = self.typed_list(&list[1..], true);
        let signature = variables.into_iter().map(|variable| variable.kinds);
        Some((name.clone(), *span, signature.collect()))
    }

    fn functions(&mut self, list: &[Expression]) {
        let mut rest = list.iter();
        while let Some(declared) = rest.next() {
            if declared.word() == Some("-") {
                match rest.next() {
                    Some(kind) if kind.word() == Some("number") => {}
                    Some(kind) => self.expected(kind, "`number`"),
                    None => self.expected(declared, "`- number`"),
                }
            } else if let Some((name, span, signature)) = self.signature(declared) {
                if self.definition.functions.add(&name).is_some() {
                    self.of_functions.push(signature);
                } else {
                    let what = "function";
                    self.wrong(span, Problem::Duplicate { what, name });
                }
            }
        }
    }

    /// Adds typed variables to the scope, as slots of their own.
    fn declare(&mut self, variables: Vec<Typed>) -> Variables {
        let first = self.scope.len();
        let mut domains = Vec::new();
        for variable in variables {
            let what = "variable";
            if self.scope[first..]
                .iter()
                .any(|(name, _)| *name == variable.name)
            {
                let name = variable.name.clone();
                self.wrong(variable.span, Problem::Duplicate { what, name });
            }
            domains.push(self.domain(&variable.kinds));
            self.scope.push((variable.name, variable.kinds));
        }
        self.most = self.most.max(self.scope.len());
        Variables { first, domains }
    }

    /// The objects of one of some types.
    fn domain(&self, kinds: &Kinds) -> Vec<Object> {
        let objects = (0..).zip(&self.object_kinds);
        let fits = |own: &Kinds| own.iter().any(|&own| self.types.is_of(own, kinds));
        objects
            .filter(|(_, own)| fits(own))
            .map(|(o, _)| o)
            .collect()
    }

    fn action(&mut self, section: &[Expression]) {
        let mut rest = section[1..].iter();
        let name = match rest.next() {
            Some(Expression::Word(name, span)) if !name.starts_with(':') => {
                if self
                    .definition
                    .actions
                    .iter()
                    .any(|known| known.name == *name)
                {
                    let (what, name) = ("action", name.clone());
                    self.wrong(*span, Problem::Duplicate { what, name });
                }
                name.clone()
            }
            other => return self.expected(other.unwrap_or(&section[0]), "the action's name"),
        };
        let (mut parameters, mut precondition, mut effect) = (None, None, None);
        while let Some(key) = rest.next() {
            let slot = match key.word() {
                Some(":parameters") => &mut parameters,
                Some(":precondition") => &mut precondition,
                Some(":effect") => &mut effect,
                _ => {
                    self.expected(key, "`:parameters`, `:precondition` or `:effect`");
                    continue;
                }
            };
            let value = rest.next();
            if slot.is_some() {
                let (what, name) = ("part", key.word().unwrap_or_default().to_owned());
                self.wrong(key.span(), Problem::Duplicate { what, name });
            }
            if value.is_none() {
                self.expected(key, "a value behind this");
            }
            *slot = value;
        }
        self.most = 0;
        let list = parameters.and_then(Expression::list).unwrap_or_default();
        let typed = self.typed_list(list, true);
        let variables = self.declare(typed);
        let parameters = self
            .scope
            .iter()
            .map(|(name, _)| name[1..].to_owned())
            .collect();
        let precondition = match precondition {
            Some(condition) => self.condition(condition),
            None => Condition::All(Vec::new()),
        };
        let mut costs = Vec::new();
        let mut effects = Vec::new();
        match effect {
            Some(effect) => self.effect(effect, true, &mut effects, &mut costs),
            None => self.wrong(
                section[0].span(),
                Problem::Missing("`:effect` of this action"),
            ),
        }
        self.scope.clear();
        self.definition.actions.push(Action {
            name,
            parameters,
            variables,
            slots: self.most,
            precondition,
            effects,
            cost: Cost::Sum(costs),
        });
    }
}

/// What a name in a position is looked up in.
fn suggestion(names: &Names, name: &str) -> Option<String> {
    names.nearest(name)
}
