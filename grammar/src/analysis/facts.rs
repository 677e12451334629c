//! Links and comparisons that must hold together.
//!
//! Guarantee: what is called a contradiction is met by no graph, or by none that the schema allows.

use super::contradiction::Node;
use super::order::{Asked, Order, Side};
use crate::{AttributePath, Comparison, Expression, Name};
use dsr::{Schema, Value, ValueKind};
use std::collections::BTreeMap;

/// Whole numbers beyond are not told apart as reals, so nothing is said of them.
pub(super) const EXACT: f64 = 9_007_199_254_740_992.0;

/// How two values can stand to each other, a bit each.
pub(super) mod relation {
    pub(in crate::analysis) const LESS: u8 = 1;
    pub(in crate::analysis) const EQUAL: u8 = 2;
    pub(in crate::analysis) const GREATER: u8 = 4;
    /// Equal, without order: texts, say.
    pub(in crate::analysis) const SAME: u8 = 8;
    /// Neither equal nor in an order.
    pub(in crate::analysis) const OTHER: u8 = 16;
    /// One of them is not there.
    pub(in crate::analysis) const MISSING: u8 = 32;
    pub(in crate::analysis) const ANY: u8 = 63;
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

/// How two values may stand to each other, and what says so.
#[derive(Debug, Clone)]
struct Pair {
    sides: [Side; 2],
    may: u8,
    words: Vec<String>,
}

/// One side of a comparison.
pub(super) struct Compared<'r> {
    pub(super) expression: &'r Expression,
    /// The same for what is the same.
    pub(super) key: String,
    pub(super) side: Side,
}

#[derive(Debug, Clone)]
pub(super) struct Facts<'r> {
    schema: Option<&'r Schema>,
    links: BTreeMap<(Node, &'r str, Node), bool>,
    /// Two expressions that are compared.
    pairs: BTreeMap<(String, String), Pair>,
    attributes: BTreeMap<String, Attribute<'r>>,
    /// Those that something is added to.
    bases: BTreeMap<String, &'r AttributePath>,
    /// Two comparisons of the same that cannot both be.
    clash: Option<String>,
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
            bases: BTreeMap::new(),
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

    /// Whether the link is there, if that is known.
    pub(super) fn known_link(&self, (from, label, to): (Node, &str, Node)) -> Option<bool> {
        self.links.get(&(from, label, to)).copied()
    }

    /// Whether a comparison of what has these keys holds, if that is known of just these two.
    pub(super) fn known_comparison(
        &self,
        operator: Comparison,
        [one, other]: [String; 2],
    ) -> Option<bool> {
        let (key, operator) = if one <= other {
            ((one, other), operator)
        } else {
            ((other, one), mirrored(operator))
        };
        let may = self.pairs.get(&key)?.may;
        let wanted = relations(operator);
        if may & wanted == 0 {
            return Some(false);
        }
        (may & !wanted == 0).then_some(true)
    }

    /// A comparison that holds or not; why that cannot be.
    pub(super) fn compare(
        &mut self,
        operator: Comparison,
        [one, other]: [Compared<'r>; 2],
        holds: bool,
        words: impl Fn() -> String,
    ) -> Option<String> {
        let (left, right) = (one.expression, other.expression);
        if left.is_undefined() || right.is_undefined() {
            return holds.then(|| format!("{} never holds: what it reckons has no value", words()));
        }
        if let (Some(a), Some(b)) = (left.constant(), right.constant()) {
            let never = operator.holds(&a, &b) != holds;
            return never.then(|| format!("{} never holds", words()));
        }
        for (compared, with, operator) in
            [(&one, right, operator), (&other, left, mirrored(operator))]
        {
            if let (Side::Sum { base, .. }, Some(path)) = (
                &compared.side,
                compared.expression.paths().into_iter().next(),
            ) {
                self.bases.insert(base.clone(), path);
            }
            if let Expression::Attribute(path) = compared.expression {
                let entry = self.attributes.entry(compared.key.clone());
                let attribute = entry.or_insert_with(|| Attribute {
                    path,
                    bounds: Vec::new(),
                    is_there: false,
                });
                attribute.is_there |= holds;
                if let Some(constant) = with.constant() {
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
        let same = one.key == other.key;
        let start = match same {
            true if self.may_differ_from_itself(left) => EQUAL | SAME | OTHER | MISSING,
            true => EQUAL | SAME | MISSING,
            false => ANY,
        };
        let (key, sides, operator) = if one.key <= other.key {
            ((one.key, other.key), [one.side, other.side], operator)
        } else {
            let operator = mirrored(operator);
            ((other.key, one.key), [other.side, one.side], operator)
        };
        let pair = self.pairs.entry(key).or_insert_with(|| Pair {
            sides,
            may: start,
            words: Vec::new(),
        });
        pair.words.push(words());
        let wanted = relations(operator);
        pair.may &= if holds { wanted } else { ANY ^ wanted };
        if pair.may != 0 {
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

    /// Whether a value can be other than itself: one that is no number in a real, or in a list of reals.
    fn may_differ_from_itself(&self, expression: &Expression) -> bool {
        use ValueKind::{Bool, F32, F64, I32, I64, String, U32, U64};
        let Expression::Attribute(path) = expression else {
            return false;
        };
        let Some(declared) = self.schema.and_then(|schema| declared(schema, path)) else {
            return true;
        };
        match declared.kind {
            Some(Bool | String | I32 | U32 | I64 | U64) => false,
            Some(F32 | F64) => declared.min.is_none() && declared.max.is_none(),
            _ => true,
        }
    }

    /// Why no value of some attribute meets all that is asked of it.
    pub(super) fn contradiction(&self) -> Option<String> {
        let mut attributes = self.attributes.values();
        let by_bounds = attributes.find_map(|attribute| attribute.contradiction(self.schema));
        let by_pairs = by_bounds.or_else(|| self.clash.clone());
        by_pairs.or_else(|| self.order().contradiction())
    }

    /// All comparisons together.
    fn order(&self) -> Order<'_> {
        let asked = self.pairs.iter().map(|((one, other), pair)| Asked {
            keys: [one, other],
            sides: pair.sides.each_ref(),
            may: pair.may,
            words: &pair.words,
        });
        Order::new(asked.collect(), |key| {
            declared(self.schema?, self.bases.get(key)?)
        })
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

pub(super) fn numeric(kind: ValueKind) -> bool {
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
