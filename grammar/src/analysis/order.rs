//! Comparisons that cannot hold all together, though each two of them may.
//!
//! Guarantee: what is called impossible is met by no values, whole or real. Whole numbers compare exactly with each
//! other and by the nearest real with reals, and adding to a real rounds; so what holds of exact numbers is only
//! concluded where the schema says that they are whole, and else what rounding keeps: that it never turns an order
//! around.

use super::facts::relation::{EQUAL, GREATER, LESS, SAME};
use super::facts::{EXACT, numeric};
use crate::Number;
use dsr::{AttributeType, Value, ValueKind};
use std::collections::{BTreeMap, BTreeSet};

/// More comparisons than this are not held against each other.
const ASKED_LIMIT: usize = 200;

/// What is compared.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Side {
    Constant(Value),
    /// An attribute, and what is added to it, one after the other.
    Sum {
        base: String,
        added: Vec<Number>,
    },
    Other,
}

/// How two sides may stand to each other.
#[derive(Clone, Copy)]
pub(super) struct Asked<'f> {
    pub(super) keys: [&'f str; 2],
    pub(super) sides: [&'f Side; 2],
    pub(super) may: u8,
    pub(super) words: &'f [String],
}

/// What the schema says of the numbers of an attribute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Width {
    Whole,
    Real,
    Unknown,
}

fn width(declared: Option<&AttributeType>) -> Width {
    use ValueKind::{F32, F64};
    match declared.and_then(|declared| declared.kind) {
        Some(F32 | F64) => Width::Real,
        Some(kind) if numeric(kind) => Width::Whole,
        _ => Width::Unknown,
    }
}

/// Comparisons, and the sums and constants in them.
pub(super) struct Order<'f> {
    asked: Vec<Asked<'f>>,
    /// By attribute, what the schema says.
    declared: BTreeMap<&'f str, Option<&'f AttributeType>>,
    sums: Vec<Sum<'f>>,
    /// The constants, ascending.
    constants: Vec<f64>,
}

/// An attribute and what is added to it.
struct Sum<'f> {
    key: &'f str,
    base: &'f str,
    added: &'f [Number],
}

/// Where a value stands among the others.
type Node = usize;

/// That one value is at most another.
struct Edge {
    from: Node,
    to: Node,
    strict: Strict,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Strict {
    No,
    /// It is less, if both are whole.
    IfWhole,
    /// It is less, and if one of them is real, also by the nearest reals.
    Asked,
    /// It is less by the nearest reals.
    ByReals,
}

/// A constant that is the same as a whole number and as a real.
fn exact(value: &Value) -> Option<f64> {
    value.as_f64().filter(|number| number.abs() < EXACT)
}

#[allow(
    clippy::float_cmp,
    reason = "constants are compared as they are written"
)]
fn is_same(one: f64, other: f64) -> bool {
    one == other
}

/// What is added, where all of it is whole.
fn whole_sum(added: &[Number]) -> Option<i128> {
    added.iter().try_fold(0_i128, |sum, number| match number {
        Number::Whole(number) => sum.checked_add(*number),
        Number::Real(_) => None,
    })
}

impl<'f> Order<'f> {
    pub(super) fn new(
        mut asked: Vec<Asked<'f>>,
        declared: impl Fn(&str) -> Option<&'f AttributeType>,
    ) -> Self {
        asked.truncate(ASKED_LIMIT);
        let mut order = Self {
            asked,
            declared: BTreeMap::new(),
            sums: Vec::new(),
            constants: Vec::new(),
        };
        let mut known = BTreeSet::new();
        for asked in &order.asked {
            for (key, side) in asked.keys.into_iter().zip(asked.sides) {
                match side {
                    Side::Constant(value) => order.constants.extend(exact(value)),
                    Side::Sum { base, added } => {
                        order.declared.insert(base, declared(base));
                        for (key, added) in [(&**base, &[][..]), (key, added)] {
                            if known.insert(key) {
                                order.sums.push(Sum { key, base, added });
                            }
                        }
                    }
                    Side::Other => {}
                }
            }
        }
        for declared in order.declared.values().flatten() {
            let ends = [declared.min, declared.max].into_iter().flatten();
            order.constants.extend(ends.filter(|end| end.abs() < EXACT));
        }
        order.constants.sort_by(f64::total_cmp);
        order.constants.dedup_by(|a, b| is_same(*a, *b));
        order
    }

    /// Comparisons that cannot hold together, none of which could be left out.
    pub(super) fn contradiction(&self) -> Option<String> {
        let mut used: Vec<bool> = self.asked.iter().map(|_| true).collect();
        if !self.is_impossible(&used) {
            return None;
        }
        for index in 0..used.len() {
            used[index] = false;
            used[index] = !self.is_impossible(&used);
        }
        let asked = self.asked.iter().zip(&used).filter(|(_, used)| **used);
        let words: Vec<&str> = asked
            .flat_map(|(asked, _)| asked.words)
            .map(String::as_str)
            .collect();
        Some(match words.as_slice() {
            [one] => format!("{one} never holds"),
            several => format!("{} never hold together", several.join(" and ")),
        })
    }

    fn is_impossible(&self, used: &[bool]) -> bool {
        let asked = self.asked.iter().zip(used).filter(|(_, used)| **used);
        let mut asked: Vec<Asked> = asked.map(|(asked, _)| *asked).collect();
        self.narrow(&mut asked);
        asked.iter().any(|asked| asked.may == 0)
            || self.goes_round(&asked)
            || self.whole_numbers_are_impossible(&asked)
    }

    fn declared(&self, base: &str) -> Option<&'f AttributeType> {
        self.declared.get(base).copied().flatten()
    }

    /// Leaves only the order of sides that must be numbers: of which something holds that only holds of numbers.
    fn narrow(&self, asked: &mut [Asked<'f>]) {
        const ORDER: u8 = LESS | EQUAL | GREATER;
        let mut numbers: BTreeSet<&str> = BTreeSet::new();
        loop {
            let before = numbers.len();
            for asked in asked.iter() {
                let number = |side: &&Side| match side {
                    Side::Constant(value) => exact(value).is_some(),
                    Side::Sum { base, added } => {
                        let kind = self.declared(base).and_then(|declared| declared.kind);
                        !added.is_empty() || kind.is_some_and(numeric)
                    }
                    Side::Other => false,
                };
                let equal = asked.may & !(EQUAL | SAME) == 0;
                let known = asked.keys.iter().any(|key| numbers.contains(key));
                if asked.may & !ORDER == 0 || equal && (known || asked.sides.iter().any(number)) {
                    numbers.extend(asked.keys);
                }
            }
            if numbers.len() == before {
                break;
            }
        }
        for asked in asked {
            if asked.keys.iter().all(|key| numbers.contains(key)) {
                asked.may &= ORDER;
            }
        }
    }

    fn constant(&self, number: f64) -> Option<Node> {
        let mut known = self.constants.iter();
        let place = known.position(|known| is_same(*known, number))?;
        Some(self.sums.len() + place)
    }

    fn node_of(&self, key: &str, side: &Side) -> Option<Node> {
        match side {
            Side::Constant(value) => self.constant(exact(value)?),
            Side::Sum { .. } => self.sums.iter().position(|sum| sum.key == key),
            Side::Other => None,
        }
    }

    fn width_of(&self, base: &str) -> Width {
        width(self.declared(base))
    }

    /// Whether values that each are at most the next come round to one that is less than itself.
    fn goes_round(&self, asked: &[Asked]) -> bool {
        let mut edges = self.always();
        for asked in asked {
            let [one, other] = [0, 1].map(|end| self.node_of(asked.keys[end], asked.sides[end]));
            if let (Some(one), Some(other)) = (one, other) {
                self.ask(asked.may, [one, other], &mut edges);
            }
        }
        let count = self.sums.len() + self.constants.len();
        let mut kept = vec![true; count];
        loop {
            let inside = |edge: &&Edge| kept[edge.from] && kept[edge.to];
            let part = parts(count, edges.iter().filter(inside));
            let round = |edge: &&Edge| inside(edge) && part[edge.from] == part[edge.to];
            if edges
                .iter()
                .filter(round)
                .any(|edge| edge.strict == Strict::ByReals)
            {
                return true;
            }
            // If all are whole, one that is less comes round; if one is real, it must be less or more than another.
            let less: BTreeSet<(&str, usize)> = edges
                .iter()
                .filter(round)
                .filter(|edge| edge.strict == Strict::Asked)
                .flat_map(|edge| [edge.from, edge.to])
                .filter_map(|node| Some((self.sums.get(node)?.base, part[node])))
                .collect();
            let stays = |node: Node| {
                self.sums.get(node).is_none_or(|sum| {
                    let is_whole = self.width_of(sum.base) == Width::Whole;
                    whole_sum(sum.added).is_some()
                        && (is_whole || less.contains(&(sum.base, part[node])))
                })
            };
            let next: Vec<bool> = (0..count).map(|node| kept[node] && stays(node)).collect();
            if next == kept {
                return edges
                    .iter()
                    .filter(round)
                    .any(|edge| edge.strict != Strict::No);
            }
            kept = next;
        }
    }

    /// What holds of sums and constants whatever is asked.
    fn always(&self) -> Vec<Edge> {
        let mut edges = Vec::new();
        for (node, sum) in self.sums.iter().enumerate() {
            let base = self.sums.iter().position(|other| other.key == sum.base);
            let signs = |wanted: fn(f64) -> bool| sum.added.iter().all(|n| wanted(n.real()));
            if let Some(base) = base.filter(|base| *base != node) {
                let whole = whole_sum(sum.added).is_some_and(|sum| sum != 0);
                let strict = if whole { Strict::IfWhole } else { Strict::No };
                if signs(|added| added >= 0.0) {
                    edges.push(Edge {
                        from: base,
                        to: node,
                        strict,
                    });
                }
                if signs(|added| added <= 0.0) {
                    edges.push(Edge {
                        from: node,
                        to: base,
                        strict,
                    });
                }
            }
            // Rounding keeps the order of what is added at once.
            for (other, second) in self.sums.iter().enumerate() {
                if let ([Number::Whole(a)], [Number::Whole(b)]) = (sum.added, second.added)
                    && sum.base == second.base
                    && a < b
                {
                    let strict = Strict::IfWhole;
                    edges.push(Edge {
                        from: node,
                        to: other,
                        strict,
                    });
                }
            }
            if let (true, Some(declared)) = (sum.key == sum.base, self.declared(sum.base)) {
                let strict = Strict::No;
                let constant = |end| self.constant(end);
                let (least, most) = (
                    declared.min.and_then(constant),
                    declared.max.and_then(constant),
                );
                edges.extend(least.map(|from| Edge {
                    from,
                    to: node,
                    strict,
                }));
                edges.extend(most.map(|to| Edge {
                    from: node,
                    to,
                    strict,
                }));
            }
        }
        for place in 1..self.constants.len() {
            let to = self.sums.len() + place;
            let (from, strict) = (to - 1, Strict::ByReals);
            edges.push(Edge { from, to, strict });
        }
        edges
    }

    fn ask(&self, may: u8, [one, other]: [Node; 2], edges: &mut Vec<Edge>) {
        let is_real = |node: Node| {
            self.sums.get(node).is_none_or(|sum| {
                let by_schema = self.width_of(sum.base) == Width::Real;
                by_schema || sum.added.iter().any(|n| matches!(n, Number::Real(_)))
            })
        };
        let less = if is_real(one) || is_real(other) {
            Strict::ByReals
        } else {
            Strict::Asked
        };
        let mut edge = |from, to, strict| edges.push(Edge { from, to, strict });
        match may {
            LESS => edge(one, other, less),
            GREATER => edge(other, one, less),
            EQUAL => {
                edge(one, other, Strict::No);
                edge(other, one, Strict::No);
            }
            may if may == LESS | EQUAL => edge(one, other, Strict::No),
            may if may == GREATER | EQUAL => edge(other, one, Strict::No),
            _ => {}
        }
    }

    /// Whether attributes that the schema says to be whole cannot be as far from each other as is asked.
    fn whole_numbers_are_impossible(&self, asked: &[Asked]) -> bool {
        let whole: Vec<&str> = self
            .declared
            .keys()
            .copied()
            .filter(|base| self.width_of(base) == Width::Whole)
            .collect();
        // A place for each of them, and one for 0; one is at most another and so much.
        let zero = whole.len();
        let mut most: Vec<(usize, usize, i128)> = Vec::new();
        // The place, and what is more there: between two whole numbers, or one.
        let place = |side: &Side| match side {
            Side::Constant(value) => {
                let number = exact(value)?;
                Some((zero, [number.floor() as i128, number.ceil() as i128]))
            }
            Side::Sum { base, added } => {
                let place = whole.iter().position(|known| *known == base)?;
                let added = whole_sum(added).filter(|added| added.abs() < EXACT as i128)?;
                Some((place, [added, added]))
            }
            Side::Other => None,
        };
        for asked in asked {
            let [Some(one), Some(other)] = asked.sides.map(place) else {
                continue;
            };
            let at_most = |(one, [_, more]): (usize, [i128; 2]),
                           (other, [than, _]): (usize, [i128; 2])| {
                (one, other, than - more)
            };
            let less = |(one, [more, _]): (usize, [i128; 2]),
                        (other, [_, than]): (usize, [i128; 2])| {
                (one, other, than - more - 1)
            };
            match asked.may {
                LESS => most.push(less(one, other)),
                GREATER => most.push(less(other, one)),
                EQUAL => most.extend([at_most(one, other), at_most(other, one)]),
                may if may == LESS | EQUAL => most.push(at_most(one, other)),
                may if may == GREATER | EQUAL => most.push(at_most(other, one)),
                _ => {}
            }
        }
        for (place, base) in whole.iter().enumerate() {
            let declared = self.declared(base);
            let within = |end: Option<f64>| end.filter(|end| end.abs() < EXACT);
            if let Some(least) = declared.and_then(|declared| within(declared.min)) {
                most.push((zero, place, -(least.ceil() as i128)));
            }
            if let Some(largest) = declared.and_then(|declared| within(declared.max)) {
                most.push((place, zero, largest.floor() as i128));
            }
        }
        let mut above = vec![0_i128; zero + 1];
        for _ in 0..=zero {
            let mut changed = false;
            for &(one, other, more) in &most {
                if above[other] + more < above[one] {
                    above[one] = above[other] + more;
                    changed = true;
                }
            }
            if !changed {
                return false;
            }
        }
        true
    }
}

/// By node, which part it is in of those within which each leads to each.
fn parts<'e>(count: usize, edges: impl Iterator<Item = &'e Edge>) -> Vec<usize> {
    let (mut next, mut back) = (vec![Vec::new(); count], vec![Vec::new(); count]);
    for edge in edges {
        next[edge.from].push(edge.to);
        back[edge.to].push(edge.from);
    }
    let mut order = Vec::new();
    let mut seen = vec![false; count];
    for start in 0..count {
        walk(start, &next, &mut seen, &mut |node| order.push(node));
    }
    let mut part = vec![0; count];
    let mut seen = vec![false; count];
    for &start in order.iter().rev() {
        walk(start, &back, &mut seen, &mut |node| part[node] = start);
    }
    part
}

/// Visits what can be reached and was not seen, each node after those that it leads to.
fn walk(start: usize, next: &[Vec<usize>], seen: &mut [bool], visit: &mut impl FnMut(usize)) {
    if seen[start] {
        return;
    }
    seen[start] = true;
    let mut path = vec![(start, 0)];
    while let Some((node, at)) = path.last_mut() {
        if let Some(&to) = next[*node].get(*at) {
            *at += 1;
            if !seen[to] {
                seen[to] = true;
                path.push((to, 0));
            }
        } else {
            visit(*node);
            path.pop();
        }
    }
}

#[cfg(test)]
mod tests;
