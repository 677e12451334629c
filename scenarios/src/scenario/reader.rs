//! Reads typed values out of a TOML document and notes every problem with its place. A table knows
//! which keys were asked of it, so that it can name the ones nobody reads.

use super::diagnostic::{Problem, ProblemKind};
use super::value::{Value, is_finite};
use agents::names::suggest;
use std::cell::RefCell;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// Every problem found so far.
#[derive(Debug, Default)]
pub(super) struct Problems(RefCell<Vec<Problem>>);

impl Problems {
    pub(super) fn add(&self, kind: ProblemKind, span: Range<usize>) {
        self.0.borrow_mut().push(Problem::new(kind, span));
    }

    pub(super) fn into_vec(self) -> Vec<Problem> {
        self.0.into_inner()
    }
}

/// A value and where it stands.
#[derive(Debug, Clone)]
pub(super) struct Located<T> {
    pub(super) value: T,
    pub(super) span: Range<usize>,
}

/// What a number may be.
#[derive(Debug, Clone, Copy)]
pub(super) enum Bound {
    Any,
    Positive,
    NotNegative,
    Probability,
    FullTurn,
    /// Seconds that a calendar can hold.
    Seconds,
}

/// A hundred years, s.
pub(super) const LONGEST: f64 = 3.2e9;

impl Bound {
    /// What is allowed, where `value` is not.
    fn refuses(self, value: f64) -> Option<&'static str> {
        let (fine, allowed) = match self {
            Self::Any => (true, ""),
            Self::Positive => (value > 0.0, "more than 0"),
            Self::NotNegative => (value >= 0.0, "0 or more"),
            Self::Probability => ((0.0..=1.0).contains(&value), "from 0 to 1"),
            Self::Seconds => (
                value > 0.0 && value <= LONGEST,
                "more than 0 and at most 3.2e9 (seconds: a hundred years)",
            ),
            Self::FullTurn => {
                let limit = std::f64::consts::TAU + 1e-3;
                (
                    value > 0.0 && value <= limit,
                    "more than 0 and at most 6.283 (radians)",
                )
            }
        };
        (!fine).then_some(allowed)
    }
}

/// A table being read. Call [`Table::close`] when all keys were asked for.
pub(super) struct Table<'a> {
    entries: &'a DeTable<'a>,
    /// Where it stands.
    pub(super) span: Range<usize>,
    /// How a diagnostic calls it, such as `[[room]]`.
    pub(super) title: String,
    /// Takes the problems.
    pub(super) problems: &'a Problems,
    asked: RefCell<Vec<&'static str>>,
}

impl<'a> Table<'a> {
    pub(super) fn new(
        table: &'a DeTable<'a>,
        span: Range<usize>,
        title: String,
        problems: &'a Problems,
    ) -> Self {
        Self {
            entries: table,
            span,
            title,
            problems,
            asked: RefCell::default(),
        }
    }

    fn find(&self, key: &'static str) -> Option<&'a Spanned<DeValue<'a>>> {
        self.allow(key);
        self.entries.get(key)
    }

    /// Whether the key is there; asking does not count as reading it.
    pub(super) fn has(&self, key: &str) -> bool {
        self.entries.contains_key(key)
    }

    /// The value where the key is there and of the right type; a problem where of a wrong one.
    pub(super) fn get<T: Value>(&self, key: &'static str) -> Option<Located<T>> {
        let found = self.find(key)?;
        let span = found.span();
        if !is_finite(found.get_ref()) {
            self.problems.add(
                ProblemKind::NotFinite {
                    key: key.to_owned(),
                },
                span,
            );
            return None;
        }
        let Some(value) = T::read(found.get_ref()) else {
            let kind = ProblemKind::WrongType {
                key: key.to_owned(),
                expected: T::EXPECTED,
            };
            self.problems.add(kind, span);
            return None;
        };
        Some(Located { value, span })
    }

    /// The value; a problem where the key is not there.
    pub(super) fn require<T: Value>(&self, key: &'static str) -> Option<Located<T>> {
        if !self.has(key) {
            self.missing(key);
        }
        self.get(key)
    }

    /// Lets `key` stand without reading it.
    pub(super) fn allow(&self, key: &'static str) {
        let mut asked = self.asked.borrow_mut();
        if !asked.contains(&key) {
            asked.push(key);
        }
    }

    /// Notes that `key` is not there.
    pub(super) fn missing(&self, key: &'static str) {
        self.allow(key);
        let kind = ProblemKind::MissingKey {
            key: key.to_owned(),
            table: self.title.clone(),
        };
        self.problems.add(kind, self.span.clone());
    }

    /// A number within bounds, or `default` where it is absent (or wrong, and noted).
    pub(super) fn number(&self, key: &'static str, bound: Bound, default: f64) -> f64 {
        let Some(number) = self.get::<f64>(key) else {
            return default;
        };
        if let Some(allowed) = bound.refuses(number.value) {
            let kind = ProblemKind::OutOfRange {
                key: key.to_owned(),
                allowed,
            };
            self.problems.add(kind, number.span);
            return default;
        }
        number.value
    }

    /// A number that must be there; where it is wrong, a stand-in that keeps the reading going.
    pub(super) fn required_number(&self, key: &'static str, bound: Bound) -> f64 {
        if !self.has(key) {
            self.missing(key);
        }
        self.number(key, bound, 1.0)
    }

    /// A date with a time, or a time of the day; noted where it is none.
    pub(super) fn moment<T>(&self, key: &'static str) -> Option<T>
    where
        Result<T, String>: Value,
    {
        let located = self.get::<Result<T, String>>(key)?;
        let expected = <Result<T, String>>::EXPECTED;
        located
            .value
            .map_err(|text| {
                self.problems
                    .add(ProblemKind::NotATime { text, expected }, located.span);
            })
            .ok()
    }

    /// The span of the value to which a key or a path of keys leads, `a.b`, or as far as it leads: at
    /// least of the table.
    pub(super) fn span_of(&self, path: &str) -> Range<usize> {
        let (mut table, mut span) = (Some(self.entries), self.span.clone());
        for key in path.split('.') {
            let Some(value) = table.and_then(|table| table.get(key)) else {
                break;
            };
            span = value.span();
            table = value.get_ref().as_table();
        }
        span
    }

    /// The keys of the table to which two keys lead, none where there is none.
    pub(super) fn keys_of(&self, table: &str, key: &str) -> Vec<Located<String>> {
        let outer = self.entries.get(table);
        let inner = outer.and_then(|table| table.get_ref().as_table()?.get(key));
        let entries = inner.and_then(|table| table.get_ref().as_table());
        let keys = entries.into_iter().flat_map(DeTable::keys);
        keys.map(|key| Located {
            value: key.get_ref().to_string(),
            span: key.span(),
        })
        .collect()
    }

    /// The tables of `[[key]]`, titled so.
    pub(super) fn tables(&self, key: &'static str) -> Vec<Table<'a>> {
        let Some(found) = self.find(key) else {
            return Vec::new();
        };
        let expected = "one or more tables, each under its own [[heading]]";
        let wrong = |span| {
            let kind = ProblemKind::WrongType {
                key: key.to_owned(),
                expected,
            };
            self.problems.add(kind, span);
        };
        let DeValue::Array(list) = found.get_ref() else {
            wrong(found.span());
            return Vec::new();
        };
        let mut tables = Vec::new();
        for item in list {
            if let DeValue::Table(table) = item.get_ref() {
                let title = format!("[[{key}]]");
                tables.push(Table::new(table, item.span(), title, self.problems));
            } else {
                wrong(item.span());
            }
        }
        tables
    }

    /// The table `[key]`.
    pub(super) fn table(&self, key: &'static str) -> Option<Table<'a>> {
        let found = self.find(key)?;
        if let DeValue::Table(table) = found.get_ref() {
            return Some(Table::new(
                table,
                found.span(),
                format!("[{key}]"),
                self.problems,
            ));
        }
        let kind = ProblemKind::WrongType {
            key: key.to_owned(),
            expected: "a table",
        };
        self.problems.add(kind, found.span());
        None
    }

    /// The value of `key` as serde reads it; the first problem is noted with its place.
    pub(super) fn deserialize<T: serde::de::DeserializeOwned>(
        &self,
        key: &'static str,
    ) -> Option<T> {
        let found = self.find(key)?;
        T::deserialize(ValueDeserializer::from(found.clone()))
            .map_err(|error| {
                let message = error.message().to_owned();
                let span = error.span().unwrap_or_else(|| found.span());
                self.problems.add(ProblemKind::Figure { message }, span);
            })
            .ok()
    }

    /// Notes every key that nobody asked for.
    pub(super) fn close(self) {
        let asked = self.asked.into_inner();
        for key in self.entries.keys() {
            let name: &str = key.get_ref();
            if !asked.contains(&name) {
                let help = suggest(name, asked.iter().copied());
                let key_name = name.to_owned();
                let kind = ProblemKind::UnknownKey {
                    key: key_name,
                    table: self.title.clone(),
                    help,
                };
                self.problems.add(kind, key.span());
            }
        }
    }
}
