//! In which order a pattern's nodes are looked for.
//!
//! Guarantee: every slot that is not given is bound by exactly one step, and each link and
//! condition is tested at the first step after which all that it reads is bound.

use super::ahead::Ends;
use super::environment::Environment;
use super::host::Way;
use super::program::{Link, Slot, Test};
use super::query::Query;
use super::statistics::Statistics;
use crate::Comparison;
use dsr::LabelId;

/// How a step finds candidates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Source {
    /// Every node of the slot's type.
    Nodes { slot: usize },
    /// Every edge of a link's label; binds both its ends.
    Edges { link: usize },
    /// The links of a label that leave a bound node.
    Out { link: usize },
    /// The links of a label that enter a bound node.
    In { link: usize },
    /// The nodes whose value of an indexed attribute is in a range.
    Values { bound: usize },
}

/// Binds one slot or two, and tests what can be tested then.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Step {
    pub(crate) source: Source,
    /// The label of its links, if it has one and the schema has that.
    pub(crate) label: Option<LabelId>,
    /// The slots that it binds.
    pub(crate) binds: [Option<usize>; 2],
    /// Slots bound before it that a node of each new slot could be, too, but must not.
    pub(crate) others: [Vec<usize>; 2],
    /// Where edges are looked at: at the node whose links it follows, if it does, then at those of the
    /// links tested after it whose nodes are bound before it.
    pub(crate) anchors: Vec<Anchor>,
    /// Links (by index) tested after it, with the places of their anchors.
    pub(crate) links: Vec<(usize, Option<usize>)>,
    /// Conditions (by index) tested after it.
    pub(crate) tests: Vec<usize>,
    /// Candidates expected in a whole search.
    pub(crate) candidates: f64,
    /// How many of them are expected to pass.
    pub(crate) passing: f64,
}

/// A node of which a step looks at the edges that go one way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Anchor {
    pub(crate) way: Way,
    pub(crate) slot: usize,
    /// Which of the slots it is that the step before binds, if it is one of them.
    pub(crate) fresh: Option<usize>,
}

impl Anchor {
    pub(crate) fn of(way: Way, slot: usize) -> Self {
        let fresh = None;
        Self { way, slot, fresh }
    }
}

/// How a query is searched for, some of its slots given.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plan {
    pub(crate) given: Vec<usize>,
    /// Links between given slots.
    pub(crate) links: Vec<usize>,
    /// Conditions on given slots only.
    pub(crate) tests: Vec<usize>,
    pub(crate) steps: Vec<Step>,
    /// Candidates and tests expected in a whole search.
    pub(crate) cost: f64,
}

/// Up to so many slots every order is weighed; with more, each step is the one that costs least.
const WEIGHED: usize = 8;

/// One way to go on.
#[derive(Debug, Clone, Copy)]
struct Extension {
    source: Source,
    binds: [Option<usize>; 2],
    candidates: f64,
    passing: f64,
    cost: f64,
}

/// The plan that should cost least, by the counts.
pub(crate) fn plan(query: &Query, statistics: &Statistics, given: &[usize]) -> Plan {
    let planner = Planner { query, statistics };
    let mut bound = vec![false; query.domains.len()];
    for &slot in given {
        bound[slot] = true;
    }
    let free: Vec<usize> = (0..bound.len()).filter(|&slot| !bound[slot]).collect();
    let order = if free.len() <= WEIGHED {
        planner.weigh_all(&bound, &free)
    } else {
        planner.cheapest_first(bound.clone())
    };
    let mut plan = Plan {
        given: given.to_vec(),
        links: planner
            .links_between(&bound, &[false].repeat(bound.len()), None)
            .collect(),
        tests: planner.tests_of(&bound, None).collect(),
        steps: Vec::with_capacity(order.len()),
        cost: 0.0,
    };
    for extension in order {
        let before = bound.clone();
        for slot in extension.binds.into_iter().flatten() {
            bound[slot] = true;
        }
        plan.cost += extension.cost;
        let step = planner.step(&extension, &before, &bound, plan.steps.last());
        plan.steps.push(step);
    }
    plan
}

struct Planner<'a> {
    query: &'a Query,
    statistics: &'a Statistics,
}

impl Planner<'_> {
    /// The cheapest of all orders, by dynamic programming over the sets of bound slots.
    fn weigh_all(&self, given: &[bool], free: &[usize]) -> Vec<Extension> {
        #[derive(Clone, Copy)]
        struct Best {
            cost: f64,
            partial: f64,
            from: usize,
            by: Extension,
        }
        let all = (1_usize << free.len()) - 1;
        let mut best: Vec<Option<Best>> = vec![None; all + 1];
        let mut bound = given.to_vec();
        let mut position = vec![0; given.len()];
        for (index, &slot) in free.iter().enumerate() {
            position[slot] = index;
        }
        for set in 0..all {
            let (cost, partial) = match best[set] {
                Some(best) => (best.cost, best.partial),
                None if set == 0 => (0.0, 1.0),
                None => continue,
            };
            for (index, &slot) in free.iter().enumerate() {
                bound[slot] = set >> index & 1 == 1;
            }
            self.extensions(&bound, partial, &mut |by| {
                let slots = by.binds.into_iter().flatten();
                let next = slots.fold(set, |next, slot| next | 1 << position[slot]);
                let cost = cost + by.cost;
                if best[next].is_none_or(|known| cost < known.cost) {
                    best[next] = Some(Best {
                        cost,
                        partial: by.passing,
                        from: set,
                        by,
                    });
                }
            });
        }
        let mut order = Vec::new();
        let mut set = all;
        while set != 0
            && let Some(step) = best[set]
        {
            order.push(step.by);
            set = step.from;
        }
        order.reverse();
        order
    }

    fn cheapest_first(&self, mut bound: Vec<bool>) -> Vec<Extension> {
        let mut order = Vec::new();
        let mut partial = 1.0;
        while bound.contains(&false) {
            let mut best: Option<Extension> = None;
            self.extensions(&bound, partial, &mut |by| {
                if best.is_none_or(|known| by.cost + by.passing < known.cost + known.passing) {
                    best = Some(by);
                }
            });
            let Some(by) = best else { break };
            for slot in by.binds.into_iter().flatten() {
                bound[slot] = true;
            }
            partial = by.passing;
            order.push(by);
        }
        order
    }

    /// Every way to bind more, where there are `partial` partial matches. A node that no link
    /// joins to what is bound is looked for only where nothing else is left, or at the start.
    fn extensions(&self, bound: &[bool], partial: f64, visit: &mut impl FnMut(Extension)) {
        let Statistics {
            nodes,
            links: counts,
            values,
        } = self.statistics;
        let each = |part: f64, of: f64| if of > 0.0 { part / of } else { 0.0 };
        let mut joined = false;
        let links = self.query.links.iter().enumerate();
        for (link, Link { from, to, .. }) in links.clone().filter(|(_, link)| !link.negated) {
            let count = counts[link];
            let (source, slot, candidates, fitting) = match (bound[*from], bound[*to]) {
                (true, false) => (Source::Out { link }, *to, count.from, count.both),
                (false, true) => (Source::In { link }, *from, count.to, count.both),
                _ => continue,
            };
            joined = true;
            let origin = if slot == *to { *from } else { *to };
            let candidates = partial * each(candidates, nodes[origin]);
            let fitting = partial * each(fitting, nodes[origin]);
            visit(self.extension(
                source,
                [Some(slot), None],
                bound,
                (partial, candidates, fitting),
            ));
        }
        if joined && bound.contains(&true) {
            return;
        }
        for (link, Link { from, to, .. }) in links.filter(|(_, link)| !link.negated) {
            if !bound[*from] && !bound[*to] && from != to {
                let (all, both) = (partial * counts[link].all, partial * counts[link].both);
                let binds = [Some(*from), Some(*to)];
                visit(self.extension(Source::Edges { link }, binds, bound, (partial, all, both)));
            }
        }
        for (index, limit) in self.query.bounds.iter().enumerate() {
            if !bound[limit.slot] {
                let count = partial * values[index].min(nodes[limit.slot]);
                let source = Source::Values { bound: index };
                let binds = [Some(limit.slot), None];
                visit(self.extension(source, binds, bound, (partial, count, count)));
            }
        }
        for slot in (0..bound.len()).filter(|&slot| !bound[slot]) {
            let count = partial * nodes[slot];
            let binds = [Some(slot), None];
            visit(self.extension(
                Source::Nodes { slot },
                binds,
                bound,
                (partial, count, count),
            ));
        }
    }

    fn extension(
        &self,
        source: Source,
        binds: [Option<usize>; 2],
        bound: &[bool],
        (partial, candidates, fitting): (f64, f64, f64),
    ) -> Extension {
        let mut passing = fitting;
        let mut cost = partial + candidates;
        let is_new = |slot: usize| binds.contains(&Some(slot));
        let nodes = &self.statistics.nodes;
        for (index, link) in self.query.links.iter().enumerate() {
            let ready = (is_new(link.from) || is_new(link.to))
                && (bound[link.from] || is_new(link.from))
                && (bound[link.to] || is_new(link.to));
            if !ready || Some(index) == source.link() {
                continue;
            }
            cost += passing;
            let pairs = nodes[link.from] * nodes[link.to];
            let both = self.statistics.links[index].both;
            let share = if pairs > 0.0 {
                (both / pairs).min(1.0)
            } else {
                0.0
            };
            passing *= if link.negated { 1.0 - share } else { share };
        }
        for (test, reads) in self.query.tests.iter().zip(&self.query.reads) {
            let ready = reads.iter().any(|&slot| is_new(slot))
                && reads.iter().all(|&slot| bound[slot] || is_new(slot));
            if ready {
                // Reading an attribute costs more than looking at a link.
                cost += 2.0 * passing;
                passing *= self.share(test, source);
            }
        }
        Extension {
            source,
            binds,
            candidates,
            passing,
            cost,
        }
    }

    /// What part of the candidates should pass a test.
    fn share(&self, test: &Test, source: Source) -> f64 {
        let Test::Compare(operator, ..) = test else {
            return 0.5;
        };
        if let Source::Values { bound } = source
            && matches!(test, Test::Compare(_, left, right)
                if [left, right].iter().any(|term| term.is_attribute_of(&self.query.bounds[bound])))
        {
            return 1.0;
        }
        match operator {
            Comparison::Equal => 0.1,
            Comparison::NotEqual => 0.9,
            _ => 0.5,
        }
    }

    /// Links of which both ends are bound now, but were not before.
    fn links_between<'a>(
        &'a self,
        bound: &'a [bool],
        before: &'a [bool],
        followed: Option<usize>,
    ) -> impl Iterator<Item = usize> + 'a {
        let ready = move |index: &usize| {
            let Link { from, to, .. } = self.query.links[*index];
            Some(*index) != followed && bound[from] && bound[to] && !(before[from] && before[to])
        };
        (0..self.query.links.len()).filter(ready)
    }

    /// Conditions of which all that they read is bound now, but was not before.
    fn tests_of<'a>(
        &'a self,
        bound: &'a [bool],
        before: Option<&'a [bool]>,
    ) -> impl Iterator<Item = usize> + 'a {
        let ready = move |index: &usize| {
            let reads = &self.query.reads[*index];
            reads.iter().all(|&slot| bound[slot])
                && before.is_none_or(|before| !reads.iter().all(|&slot| before[slot]))
        };
        (0..self.query.tests.len()).filter(ready)
    }

    fn step(
        &self,
        extension: &Extension,
        before: &[bool],
        bound: &[bool],
        last: Option<&Step>,
    ) -> Step {
        let Extension { source, binds, .. } = *extension;
        let domains = &self.query.domains;
        let others = binds.map(|slot| {
            let Some(slot) = slot else { return Vec::new() };
            (0..before.len())
                .filter(|&other| before[other] && domains[other].meets(&domains[slot]))
                .collect()
        });
        let anchor = |(way, slot)| Anchor {
            way,
            slot,
            fresh: last.and_then(|last| last.binds.iter().position(|bound| *bound == Some(slot))),
        };
        let origin = source.origin(self.query);
        let mut anchors: Vec<Anchor> = origin.map(anchor).into_iter().collect();
        let links = self.links_between(bound, before, source.link());
        let links = links.map(|index| {
            let Link { from, to, .. } = self.query.links[index];
            // Either end knows, but what the step has just bound was never looked at.
            let (way, slot) = if binds.contains(&Some(from)) {
                (Way::In, to)
            } else {
                (Way::Out, from)
            };
            let known = before[slot].then(|| {
                anchors.push(anchor((way, slot)));
                anchors.len() - 1
            });
            (index, known)
        });
        Step {
            source,
            label: source.link().and_then(|link| self.query.links[link].label),
            binds,
            others,
            links: links.collect(),
            anchors,
            tests: self.tests_of(bound, Some(before)).collect(),
            candidates: extension.candidates,
            passing: extension.passing,
        }
    }
}

impl Step {
    /// Whether nothing is tested after it.
    pub(crate) fn is_free(&self) -> bool {
        self.links.is_empty() && self.tests.is_empty()
    }

    /// Whether it follows the links of a node that was bound before it.
    #[inline]
    pub(crate) fn follows(&self) -> bool {
        matches!(self.source, Source::Out { .. } | Source::In { .. })
    }

    /// Puts a candidate into its slots.
    #[inline]
    pub(crate) fn bind(&self, candidate: Ends, environment: &mut Environment) {
        for (slot, id) in self.binds.into_iter().zip(candidate) {
            if let Some(slot) = slot {
                environment[slot] = Slot::Node(id);
            }
        }
    }
}

impl Source {
    /// The slot of the node whose links it follows, if it does, and which way.
    fn origin(self, query: &Query) -> Option<(Way, usize)> {
        match self {
            Self::Out { link } => Some((Way::Out, query.links[link].from)),
            Self::In { link } => Some((Way::In, query.links[link].to)),
            _ => None,
        }
    }

    /// The link that it follows.
    pub(crate) fn link(self) -> Option<usize> {
        match self {
            Self::Nodes { .. } | Self::Values { .. } => None,
            Self::Edges { link } | Self::Out { link } | Self::In { link } => Some(link),
        }
    }
}
