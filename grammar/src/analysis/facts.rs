//! Links and comparisons that must hold together.
//!
//! Guarantee: what is called a contradiction is met by no graph, or by none that the schema allows.

use super::contradiction::Node;
use crate::{AttributePath, Comparison, Expression, Name};
use dsr::{Schema, Value, ValueKind};
use std::collections::BTreeMap;

/// Whole numbers beyond are not told apart as reals, so nothing is said of them.
const EXACT: f64 = 9_007_199_254_740_992.0;

/// How two values can stand to each other, a bit each.
mod relation {
    pub(super) const LESS: u8 = 1;
    pub(super) const EQUAL: u8 = 2;
    pub(super) const GREATER: u8 = 4;
    /// Equal, without order: texts, say.
    pub(super) const SAME: u8 = 8;
    /// Neither equal nor in an order.
    pub(super) const OTHER: u8 = 16;
    /// One of them is not there.
    pub(super) const MISSING: u8 = 32;
    pub(super) const ANY: u8 = 63;
}

use relation::{ANY, EQUAL, GREATER, LESS, MISSING, OTHER, SAME};

fn relations(operator: Comparison) -> u8 {
    match operator {
        Comparison::Equal => EQUAL | SAME,
        Comparison::NotEqual => LESS | GREATER | OTHER,
        Comparison::Less => LESS,
        Comparison::LessOrEqual => LESS | EQUAL,
        Comparison::Greater => GREATER,
        Comparison::GreaterOrEqual => GREATER | EQUAL,
    }
}

/// A comparison of an attribute with a constant.
#[derive(Debug, Clone)]
struct Bound {
    operator: Comparison,
    constant: Value,
    holds: bool,
    words: String,
}

/// What is asked of one attribute.
#[derive(Debug, Clone)]
struct Attribute<'r> {
    path: &'r AttributePath,
    bounds: Vec<Bound>,
    /// A comparison that holds needs it.
    is_there: bool,
}

#[derive(Debug, Clone)]
pub(super) struct Facts<'r> {
    schema: Option<&'r Schema>,
    links: BTreeMap<(Node, &'r str, Node), bool>,
    /// How the values of two expressions may stand to each other.
    pairs: BTreeMap<(String, String), u8>,
    attributes: BTreeMap<String, Attribute<'r>>,
    /// Two comparisons of the same that cannot both be.
    clash: Option<String>,
}

fn constant(expression: &Expression) -> Option<Value> {
    match expression {
        Expression::Literal(literal) => Some(literal.value()),
        _ => None,
    }
}

fn mirrored(operator: Comparison) -> Comparison {
    match operator {
        Comparison::Less => Comparison::Greater,
        Comparison::LessOrEqual => Comparison::GreaterOrEqual,
        Comparison::Greater => Comparison::Less,
        Comparison::GreaterOrEqual => Comparison::LessOrEqual,
        same => same,
    }
}

impl<'r> Facts<'r> {
    pub(super) fn new(schema: Option<&'r Schema>) -> Self {
        Self {
            schema,
            links: BTreeMap::new(),
            pairs: BTreeMap::new(),
            attributes: BTreeMap::new(),
            clash: None,
        }
    }

    /// A link that is there or not; why that cannot be.
    pub(super) fn link(
        &mut self,
        (from, label, to): (Node, &'r Name, Node),
        there: bool,
        words: impl Fn() -> String,
    ) -> Option<String> {
        let known = self.links.insert((from, label, to), there);
        let both = known.is_some_and(|known| known != there);
        both.then(|| format!("`{}` would have to be there and not", words()))
    }

    /// A comparison that holds or not; why that cannot be.
    pub(super) fn compare(
        &mut self,
        operator: Comparison,
        [(left, one), (right, other)]: [(&'r Expression, String); 2],
        holds: bool,
        words: impl Fn() -> String,
    ) -> Option<String> {
        if let (Some(a), Some(b)) = (constant(left), constant(right)) {
            let never = operator.holds(&a, &b) != holds;
            return never.then(|| format!("{} never holds", words()));
        }
        for (expression, key, with, operator) in [
            (left, &one, right, operator),
            (right, &other, left, mirrored(operator)),
        ] {
            if let Expression::Attribute(path) = expression {
                let entry = self.attributes.entry(key.clone());
                let attribute = entry.or_insert_with(|| Attribute {
                    path,
                    bounds: Vec::new(),
                    is_there: false,
                });
                attribute.is_there |= holds;
                if let Some(constant) = constant(with) {
                    let not = if holds { "" } else { "not " };
                    let symbol = operator.symbol();
                    attribute.bounds.push(Bound {
                        operator,
                        words: format!("{not}({symbol} {with})"),
                        constant,
                        holds,
                    });
                }
            }
        }
        let same = one == other;
        let (key, operator) = if one <= other {
            ((one, other), operator)
        } else {
            ((other, one), mirrored(operator))
        };
        let start = if same {
            EQUAL | SAME | OTHER | MISSING
        } else {
            ANY
        };
        let may = self.pairs.entry(key).or_insert(start);
        let wanted = relations(operator);
        *may &= if holds { wanted } else { ANY ^ wanted };
        if *may != 0 {
            return None;
        }
        if same {
            return Some(format!("{} never holds", words()));
        }
        // The bounds of an attribute may say it better.
        let among = format!("what is asked of {left} and {right}");
        self.clash = Some(format!("{} contradicts the rest of {among}", words()));
        None
    }

    /// Why no value of some attribute meets all that is asked of it.
    pub(super) fn contradiction(&self) -> Option<String> {
        let mut attributes = self.attributes.values();
        let by_bounds = attributes.find_map(|attribute| attribute.contradiction(self.schema));
        by_bounds.or_else(|| self.clash.clone())
    }
}

/// Numbers from one bound to another, which belong to them or not.
struct Interval {
    low: (f64, bool),
    high: (f64, bool),
}

impl Interval {
    #[allow(clippy::float_cmp, reason = "bounds are compared as they are written")]
    fn narrow(&mut self, operator: Comparison, number: f64) {
        let open = matches!(operator, Comparison::Less | Comparison::Greater);
        let below = matches!(
            operator,
            Comparison::Less | Comparison::LessOrEqual | Comparison::Equal
        );
        let above = matches!(
            operator,
            Comparison::Greater | Comparison::GreaterOrEqual | Comparison::Equal
        );
        if below && (number < self.high.0 || (number == self.high.0 && open)) {
            self.high = (number, open);
        }
        if above && (number > self.low.0 || (number == self.low.0 && open)) {
            self.low = (number, open);
        }
    }

    #[allow(clippy::float_cmp, reason = "bounds are compared as they are written")]
    fn is_empty(&self) -> bool {
        self.low.0 > self.high.0 || (self.low.0 == self.high.0 && (self.low.1 || self.high.1))
    }

    /// The only number in it.
    #[allow(clippy::float_cmp, reason = "bounds are compared as they are written")]
    fn only(&self) -> Option<f64> {
        (self.low.0 == self.high.0).then_some(self.low.0)
    }
}

fn number(value: &Value) -> Option<f64> {
    value.as_f64().filter(|number| number.abs() < EXACT)
}

fn numeric(kind: ValueKind) -> bool {
    use ValueKind::{F32, F64, I32, I64, U32, U64};
    matches!(kind, I32 | U32 | I64 | U64 | F32 | F64)
}

/// Whether an attribute of a kind can equal the constant.
fn can_equal(kind: ValueKind, constant: &Value) -> bool {
    match constant.kind() {
        ValueKind::String => kind == ValueKind::String,
        ValueKind::Bool => kind == ValueKind::Bool,
        other => !numeric(other) || numeric(kind),
    }
}

impl Attribute<'_> {
    fn contradiction(&self, schema: Option<&Schema>) -> Option<String> {
        if !self.is_there {
            // Where it is missing, no comparison with it holds.
            return None;
        }
        let path = self.path;
        let declared = schema.and_then(|schema| declared(schema, path));
        let kind = declared.and_then(|declared| declared.kind);
        let ordered = |bound: &&Bound| {
            bound.holds && !matches!(bound.operator, Comparison::Equal | Comparison::NotEqual)
        };
        let is_ordered = self.bounds.iter().any(|bound| ordered(&bound));
        if is_ordered && kind.is_some_and(|kind| !numeric(kind)) {
            return Some(format!("`{path}` is no number by the schema"));
        }
        let equals = |bound: &&Bound| bound.holds && bound.operator == Comparison::Equal;
        for bound in self.bounds.iter().filter(equals) {
            if kind.is_some_and(|kind| !can_equal(kind, &bound.constant)) {
                return Some(format!("`{path}` is never {} by the schema", bound.words));
            }
        }
        self.by_number(declared, is_ordered)
            .or_else(|| self.by_value(kind))
    }

    /// What is asked, in words.
    fn no(&self, by_schema: &[String]) -> String {
        let words = self.bounds.iter().map(|bound| &bound.words);
        let words: Vec<&str> = by_schema.iter().chain(words).map(String::as_str).collect();
        format!("no `{}` is {}", self.path, words.join(" and "))
    }

    /// No number is within all bounds.
    fn by_number(&self, declared: Option<&dsr::AttributeType>, is_number: bool) -> Option<String> {
        let equals = |bound: &Bound| bound.holds && bound.operator == Comparison::Equal;
        let is_number = is_number
            || self
                .bounds
                .iter()
                .any(|b| equals(b) && number(&b.constant).is_some());
        if !is_number {
            return None;
        }
        let mut interval = Interval {
            low: (f64::NEG_INFINITY, false),
            high: (f64::INFINITY, false),
        };
        let mut by_schema = Vec::new();
        if let Some(min) = declared.and_then(|declared| declared.min) {
            interval.narrow(Comparison::GreaterOrEqual, min);
            by_schema.push(format!("(>= {min}, by the schema)"));
        }
        if let Some(max) = declared.and_then(|declared| declared.max) {
            interval.narrow(Comparison::LessOrEqual, max);
            by_schema.push(format!("(<= {max}, by the schema)"));
        }
        let mut excluded = Vec::new();
        for bound in &self.bounds {
            let Some(number) = number(&bound.constant) else {
                continue;
            };
            let operator = if bound.holds {
                bound.operator
            } else {
                bound.operator.negated()
            };
            match operator {
                Comparison::NotEqual => excluded.push(number),
                operator => interval.narrow(operator, number),
            }
        }
        let only = interval.only().is_some_and(|only| excluded.contains(&only));
        (only || interval.is_empty()).then(|| self.no(&by_schema))
    }

    /// No text or truth value is as asked.
    fn by_value(&self, kind: Option<ValueKind>) -> Option<String> {
        let equals = |bound: &&Bound| bound.holds && bound.operator == Comparison::Equal;
        let mut tried: Vec<Value> = Vec::new();
        if let Some(bound) = self.bounds.iter().find(equals) {
            tried.push(bound.constant.clone());
        } else if kind == Some(ValueKind::Bool) {
            tried.extend([true.into(), false.into()]);
        }
        let exact = |value: &Value| value.as_f64().is_none() || number(value).is_some();
        if tried.is_empty() || !tried.iter().all(exact) {
            return None;
        }
        let bounds: Vec<&Bound> = self.bounds.iter().filter(|b| exact(&b.constant)).collect();
        let meets = |value: &Value| {
            let mut all = bounds.iter();
            all.all(|bound| bound.operator.holds(value, &bound.constant) == bound.holds)
        };
        (!tried.iter().any(meets)).then(|| self.no(&[]))
    }
}

/// What the schema says of an attribute.
pub(super) fn declared<'s>(
    schema: &'s Schema,
    path: &AttributePath,
) -> Option<&'s dsr::AttributeType> {
    let (AttributePath::Node { attribute, .. } | AttributePath::Edge { attribute, .. }) = path;
    let id = schema.find_attribute(attribute)?;
    schema.attributes().get(usize::from(id.0))
}
