//! Values that meet comparisons.
//!
//! Guarantee: what is found meets all that is asked, and what the schema says of the attributes.

use super::draft::{Owner, Places, owner};
use super::facts::numeric;
use crate::{Arithmetic, Comparison, Expression, Number};
use dsr::{AttributeType, Schema, Value, ValueKind};
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

/// So many values are tried for all attributes together.
const TRIES: u64 = 2_500;
/// What taking up values for one attribute costs, in values tried.
const CANDIDATES_COST: u64 = 20;
/// So many are taken up for one attribute.
const CANDIDATES: usize = 60;

/// An attribute of a node or link.
pub(super) type Key = (Owner, Rc<str>);
pub(super) type Values = BTreeMap<Key, Value>;

/// An expression of which the nodes are known.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Term {
    Constant(Value),
    Attribute(Key),
    Arithmetic(Arithmetic, Vec<Term>),
}

impl Term {
    /// `None` where a variable stands for no node.
    pub(super) fn of(expression: &Expression, places: &Places) -> Option<Self> {
        Some(match expression {
            Expression::Literal(literal) => Self::Constant(literal.value()),
            Expression::Attribute(path) => Self::Attribute(owner(path, places)?),
            Expression::Arithmetic { operator, operands } => {
                let operands = operands.iter().map(|one| Self::of(one, places));
                Self::Arithmetic(*operator, operands.collect::<Option<_>>()?)
            }
        })
    }

    /// Its value, as conditions mean it; `Err` where it is not known yet.
    pub(super) fn value(
        &self,
        of: &impl Fn(&Key) -> Result<Option<Value>, Unknown>,
    ) -> Result<Option<Value>, Unknown> {
        match self {
            Self::Constant(value) => Ok(Some(value.clone())),
            Self::Attribute(key) => of(key),
            Self::Arithmetic(operator, operands) => {
                let mut numbers = Vec::new();
                let mut unknown = false;
                for operand in operands {
                    match operand.value(of) {
                        Ok(value) => match value.as_ref().and_then(Number::of) {
                            Some(number) => numbers.push(number),
                            None => return Ok(None),
                        },
                        Err(Unknown) => unknown = true,
                    }
                }
                if unknown {
                    return Err(Unknown);
                }
                Ok(operator.compute(&numbers).and_then(Number::into_value))
            }
        }
    }

    fn keys<'t>(&'t self, into: &mut Vec<&'t Key>) {
        match self {
            Self::Constant(_) => {}
            Self::Attribute(key) => into.push(key),
            Self::Arithmetic(_, operands) => operands.iter().for_each(|one| one.keys(into)),
        }
    }

    fn constants<'t>(&'t self, into: &mut Vec<&'t Value>) {
        match self {
            Self::Constant(value) => into.push(value),
            Self::Attribute(_) => {}
            Self::Arithmetic(_, operands) => operands.iter().for_each(|one| one.constants(into)),
        }
    }
}

/// A value that is not known yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Unknown;

/// A comparison that must hold or not.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Asked {
    pub(super) operator: Comparison,
    pub(super) sides: [Term; 2],
    pub(super) holds: bool,
}

impl Asked {
    /// Whether it comes out as asked, if that is known.
    pub(super) fn is_met(
        &self,
        of: &impl Fn(&Key) -> Result<Option<Value>, Unknown>,
    ) -> Option<bool> {
        let holds = match [self.sides[0].value(of), self.sides[1].value(of)] {
            [Ok(Some(left)), Ok(Some(right))] => self.operator.holds(&left, &right),
            // A comparison with what is not there does not hold.
            [Ok(None), _] | [_, Ok(None)] => false,
            _ => return None,
        };
        Some(holds == self.holds)
    }

    pub(super) fn keys(&self) -> Vec<&Key> {
        let mut keys = Vec::new();
        self.sides.iter().for_each(|side| side.keys(&mut keys));
        keys
    }
}

/// Looks for values for all attributes that are asked of.
struct Search<'a> {
    asked: &'a [Asked],
    schema: Option<&'a Schema>,
    /// The attributes, in the order in which values are chosen, with the comparisons that each is in.
    keys: Vec<(&'a Key, Vec<&'a Asked>)>,
    /// Attributes of links that are not there.
    nowhere: &'a dyn Fn(&Key) -> bool,
    chosen: BTreeMap<&'a Key, Option<Value>>,
    left: u64,
}

/// Values that meet all that is asked, if any were found, and how many were tried. Attributes of what is `nowhere` are missing.
pub(super) fn values(
    asked: &[Asked],
    schema: Option<&Schema>,
    nowhere: &dyn Fn(&Key) -> bool,
) -> (Option<Values>, u64) {
    let mut order: Vec<&Key> = Vec::new();
    for key in asked.iter().flat_map(Asked::keys) {
        if !order.contains(&key) {
            order.push(key);
        }
    }
    let of = |key: &Key| {
        asked
            .iter()
            .filter(|one| one.keys().contains(&key))
            .collect()
    };
    let mut search = Search {
        asked,
        schema,
        keys: order.into_iter().map(|key| (key, of(key))).collect(),
        nowhere,
        chosen: BTreeMap::new(),
        left: TRIES,
    };
    let found = search.may(search.asked) && search.choose(0);
    let tried = TRIES - search.left;
    if !found {
        return (None, tried);
    }
    let chosen = search.chosen.into_iter();
    let values = chosen.filter_map(|(key, value)| Some((key.clone(), value?)));
    (Some(values.collect()), tried)
}

impl Search<'_> {
    fn may<'b>(&self, asked: impl IntoIterator<Item = &'b Asked>) -> bool {
        let of = |key: &Key| self.chosen.get(key).cloned().ok_or(Unknown);
        asked.into_iter().all(|one| one.is_met(&of) != Some(false))
    }

    fn choose(&mut self, place: usize) -> bool {
        let Some((key, within)) = self.keys.get(place).cloned() else {
            return true;
        };
        let mut candidates = vec![None];
        if !(self.nowhere)(key) {
            self.left = self.left.saturating_sub(CANDIDATES_COST);
            candidates.extend(self.candidates(key, &within).into_iter().map(Some));
        }
        for candidate in candidates {
            let Some(left) = self.left.checked_sub(1) else {
                return false;
            };
            self.left = left;
            self.chosen.insert(key, candidate);
            if self.may(within.iter().copied()) && self.choose(place + 1) {
                return true;
            }
        }
        self.chosen.remove(key);
        false
    }

    /// Values that may be of use: those that comparisons come to and their neighbours first.
    fn candidates(&self, key: &Key, within: &[&Asked]) -> Vec<Value> {
        let declared = self.schema.and_then(|schema| {
            let id = schema.find_attribute(&key.1)?;
            schema.attributes().get(usize::from(id.0))
        });
        let mut bounds: Vec<f64> = Vec::new();
        let mut found = Vec::new();
        for asked in within {
            for root in self.root(key, asked).into_iter().flatten() {
                found.push(root.clone());
                bounds.extend(root.as_f64());
            }
        }
        for value in self.chosen.values().flatten() {
            found.push(value.clone());
            bounds.extend(value.as_f64());
        }
        let mut constants = Vec::new();
        for asked in self.asked {
            asked
                .sides
                .iter()
                .for_each(|side| side.constants(&mut constants));
        }
        for value in constants {
            found.push(value.clone());
            bounds.extend(value.as_f64());
        }
        let ends = declared.map(|declared| [declared.min, declared.max]);
        bounds.extend(ends.into_iter().flatten().flatten());
        bounds.push(0.0);
        bounds.retain(|bound| bound.is_finite());
        bounds.sort_by(f64::total_cmp);
        bounds.dedup_by(|a, b| a.total_cmp(b).is_eq());
        let wholes: BTreeSet<i64> = bounds
            .iter()
            .filter(|bound| bound.abs() < 9e15)
            .flat_map(|bound| {
                let (floor, ceil) = (bound.floor() as i64, bound.ceil() as i64);
                [floor - 1, floor, ceil, ceil + 1]
            })
            .collect();
        found.extend(wholes.into_iter().map(Value::I64));
        let pairs = bounds.windows(2);
        found.extend(pairs.map(|pair| Value::F64(pair[0].midpoint(pair[1]))));
        found.extend(bounds.iter().map(|bound| Value::F64(bound + 0.25)));
        found.extend(["other".into(), true.into(), false.into()]);
        let mut fitting: Vec<Value> = Vec::new();
        for value in found {
            if let Some(value) = fitted(value, declared)
                && !fitting.contains(&value)
            {
                fitting.push(value);
            }
        }
        fitting.truncate(CANDIDATES);
        fitting
    }

    /// Where both sides of a comparison are equal, if the attribute is the only one in it that has no value yet.
    fn root(&self, key: &Key, asked: &Asked) -> [Option<Value>; 3] {
        let at = |value: &Value, side: usize| {
            let of = |other: &Key| {
                if other == key {
                    return Ok(Some(value.clone()));
                }
                self.chosen.get(other).cloned().ok_or(Unknown)
            };
            asked.sides[side].value(&of).ok().flatten()
        };
        let nothing = [None, None, None];
        // Of two that are the same or not, the other is known.
        let plain = |side: usize| asked.sides[side] == Term::Attribute(key.clone());
        let zero = Value::I64(0);
        for side in [0, 1] {
            if plain(side)
                && let Some(other) = at(&zero, 1 - side)
            {
                let Some(Number::Whole(number)) = Number::of(&other) else {
                    return [Some(other), None, None];
                };
                let beside = |by: i128| Number::Whole(number.checked_add(by)?).into_value();
                return [Some(other), beside(-1), beside(1)];
            }
        }
        let apart = |value: f64| {
            let value = Value::F64(value);
            let both = [at(&value, 0), at(&value, 1)];
            let [left, right] = both.map(|side| side.and_then(|side| side.as_f64()));
            Some(left? - right?)
        };
        let (Some(start), Some(end)) = (apart(1.0), apart(2.0)) else {
            return nothing;
        };
        let slope = end - start;
        let root = 1.0 - start / slope;
        if !root.is_finite() {
            return nothing;
        }
        let whole = (root.fract() == 0.0 && root.abs() < 9e15).then_some(Value::I64(root as i64));
        [whole, Some(Value::F64(root)), None]
    }
}

/// The value as an attribute that is declared so can have it.
fn fitted(value: Value, declared: Option<&AttributeType>) -> Option<Value> {
    use ValueKind::{Bool, F32, F64, I32, I64, String, U32, U64};
    let Some(declared) = declared else {
        return Some(value);
    };
    let number = Number::of(&value);
    if let Some(number) = number {
        let number = number.real();
        let below = declared.min.is_some_and(|min| number < min);
        if below || declared.max.is_some_and(|max| number > max) {
            return None;
        }
    }
    let Some(kind) = declared.kind else {
        return Some(value);
    };
    match (kind, number) {
        (F32 | F64, Some(number)) => Some(Value::F64(number.real())),
        (I32, Some(Number::Whole(n))) => i32::try_from(n).ok().map(|_| value),
        (U32, Some(Number::Whole(n))) => u32::try_from(n).ok().map(|_| value),
        (I64, Some(Number::Whole(n))) => i64::try_from(n).ok().map(|_| value),
        (U64, Some(Number::Whole(n))) => u64::try_from(n).ok().map(|_| value),
        (kind, Some(_)) if numeric(kind) => None,
        (Bool, None) => matches!(value, Value::Bool(_)).then_some(value),
        (String, None) => matches!(value, Value::String(_)).then_some(value),
        _ => None,
    }
}
