//! Types, typed lists and objects.

use super::super::defect::Problem;
use super::super::expression::Expression;
use super::super::names::Names;
use super::Reader;
use grammar::Span;

/// Types, of which a thing has at least one.
pub(super) type Kinds = Vec<usize>;

/// A name of a typed list.
pub(super) struct Typed {
    pub(super) name: String,
    pub(super) span: Span,
    pub(super) kinds: Kinds,
}

/// The types of a domain; number 0 is `object`, which all inherit from.
pub(super) struct Types {
    names: Names,
    /// Each type itself and all that it inherits from.
    above: Vec<Vec<usize>>,
}

impl Default for Types {
    fn default() -> Self {
        let mut names = Names::default();
        names.add("object");
        Self {
            names,
            above: vec![vec![0]],
        }
    }
}

impl Types {
    /// Whether something of type `own` is of one of `kinds`.
    pub(super) fn is_of(&self, own: usize, kinds: &Kinds) -> bool {
        kinds.iter().any(|kind| self.above[own].contains(kind))
    }

    /// Whether one thing may be of both.
    pub(super) fn may_fit(&self, own: &Kinds, wanted: &Kinds) -> bool {
        own.iter().any(|&kind| self.is_of(kind, wanted))
            || wanted.iter().any(|&kind| self.is_of(kind, own))
    }

    pub(super) fn words(&self, kinds: &Kinds) -> String {
        let names: Vec<&str> = kinds.iter().map(|&kind| self.names.name(kind)).collect();
        match names[..] {
            [only] => only.to_owned(),
            _ => format!("(either {})", names.join(" ")),
        }
    }
}

impl Reader<'_> {
    /// Reads `NAME ... - PARENT` lists.
    pub(super) fn read_types<'e>(&mut self, list: impl Iterator<Item = &'e Expression>) {
        let list: Vec<&Expression> = list.collect();
        let mut parents: Vec<(usize, Vec<String>, Span)> = Vec::new();
        let mut waiting: Vec<usize> = Vec::new();
        let mut declared = Vec::new();
        let mut rest = list.into_iter();
        while let Some(expression) = rest.next() {
            match expression {
                Expression::Word(dash, span) if dash == "-" => {
                    let (names, span) = match rest.next() {
                        Some(kind) => (parent_names(kind), kind.span()),
                        None => (Vec::new(), *span),
                    };
                    if names.is_empty() {
                        self.wrong(span, Problem::expected("a type behind `-`", "-"));
                    }
                    for of in waiting.drain(..) {
                        parents.push((of, names.clone(), span));
                    }
                }
                Expression::Word(name, span) => {
                    let number = match self.types.names.add(name) {
                        Some(number) => number,
                        None => self.types.names.find(name).unwrap_or_default(),
                    };
                    // `object` may be listed although it is always there.
                    if declared.contains(&number) {
                        let (what, name) = ("type", name.clone());
                        self.wrong(*span, Problem::Duplicate { what, name });
                    }
                    declared.push(number);
                    waiting.push(number);
                }
                other @ Expression::List(..) => self.expected(other, "a type's name"),
            }
        }
        // A parent that is not listed itself inherits from `object`.
        for name in parents.iter().flat_map(|(_, names, _)| names) {
            self.types.names.add(name);
        }
        let count = self.types.names.len();
        let mut direct = vec![Vec::new(); count];
        for (of, names, span) in &parents {
            let found = names.iter().filter_map(|name| self.types.names.find(name));
            direct[*of].extend(found.map(|parent| (parent, *span)));
        }
        self.types.above = vec![vec![0]; count];
        for kind in 1..count {
            let mut above = vec![kind];
            let mut next = 0;
            while let Some(&known) = above.get(next) {
                next += 1;
                for &(parent, span) in &direct[known] {
                    if parent == kind {
                        let name = self.types.names.name(kind).to_owned();
                        self.wrong(span, Problem::CyclicType(name));
                    } else if !above.contains(&parent) {
                        above.push(parent);
                    }
                }
            }
            if !above.contains(&0) {
                above.push(0);
            }
            self.types.above[kind] = above;
        }
    }

    /// Reads `a b - type c - (either t u) d`; `variables` begin with `?`, other names do not.
    pub(super) fn typed_list(&mut self, list: &[Expression], variables: bool) -> Vec<Typed> {
        let mut typed: Vec<Typed> = Vec::new();
        let mut named = 0;
        let mut rest = list.iter();
        while let Some(expression) = rest.next() {
            match expression {
                Expression::Word(dash, span) if dash == "-" => {
                    let kinds = match rest.next() {
                        Some(kind) => self.kinds(kind),
                        None => {
                            self.wrong(*span, Problem::expected("a type behind `-`", "-"));
                            vec![0]
                        }
                    };
                    for of in &mut typed[named..] {
                        of.kinds.clone_from(&kinds);
                    }
                    named = typed.len();
                }
                Expression::Word(name, span) if name.starts_with('?') == variables => {
                    typed.push(Typed {
                        name: name.clone(),
                        span: *span,
                        kinds: vec![0],
                    });
                }
                other if variables => self.expected(other, "a variable `?name`"),
                other => self.expected(other, "a name"),
            }
        }
        typed
    }

    fn kinds(&mut self, expression: &Expression) -> Kinds {
        let words: Vec<(&str, Span)> = match expression {
            Expression::Word(name, span) => vec![(name, *span)],
            Expression::List(list, _) if expression.head() == Some("either") => list[1..]
                .iter()
                .filter_map(|part| Some((part.word()?, part.span())))
                .collect(),
            Expression::List(..) => {
                self.expected(expression, "a type or `(either ...)`");
                return vec![0];
            }
        };
        let mut kinds = Kinds::new();
        for (name, span) in words {
            match self.types.names.find(name) {
                Some(kind) => kinds.push(kind),
                None => {
                    let near = self.types.names.nearest(name);
                    self.unknown(span, "type", name, near);
                }
            }
        }
        if kinds.is_empty() {
            kinds.push(0);
        }
        kinds
    }

    /// Reads constants or objects.
    pub(super) fn objects(&mut self, list: &[Expression]) {
        for object in self.typed_list(list, false) {
            if self.definition.objects.add(&object.name).is_some() {
                self.object_kinds.push(object.kinds);
            } else {
                let (what, name) = ("object", object.name);
                self.wrong(object.span, Problem::Duplicate { what, name });
            }
        }
    }
}

fn parent_names(kind: &Expression) -> Vec<String> {
    match kind {
        Expression::Word(name, _) => vec![name.clone()],
        Expression::List(list, _) if kind.head() == Some("either") => list[1..]
            .iter()
            .filter_map(|part| part.word().map(str::to_owned))
            .collect(),
        Expression::List(..) => Vec::new(),
    }
}
