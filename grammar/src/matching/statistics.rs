//! What a graph's own counts say of a query.
//!
//! Guarantee: reading them costs a few lookups per variable and link, however large the graph is.

use super::host::Host;
use super::query::Query;
use dsr::ReadError;

/// No more nodes than this are counted in a range of an index.
const COUNTED: usize = 1000;
/// Counts below this are all alike: no plan is so bad that it matters.
pub(super) const FEW: f64 = 16.0;

/// How many candidates there are for what a query names.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Statistics {
    /// By slot: nodes of its type.
    pub(crate) nodes: Vec<f64>,
    /// By link.
    pub(crate) links: Vec<LinkCount>,
    /// By bound: nodes whose value is in its range.
    pub(crate) values: Vec<f64>,
}

/// How many edges have the label of a link,
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct LinkCount {
    /// of all of them;
    pub(crate) all: f64,
    /// those that start at a node of the right type;
    pub(crate) from: f64,
    /// those that end at one;
    pub(crate) to: f64,
    /// those that do both.
    pub(crate) both: f64,
}

impl Statistics {
    /// What a graph says, or without one what is taken for granted.
    pub(super) fn known<H: Host>(host: Option<&H>, query: &Query) -> Result<Self, ReadError> {
        host.map_or_else(|| Ok(Self::assumed(query)), |host| Self::of(host, query))
    }

    pub(crate) fn of<H: Host>(host: &H, query: &Query) -> Result<Self, ReadError> {
        let nodes = query.domains.iter().map(|domain| {
            let counts = domain
                .types()
                .iter()
                .map(|&exact| host.count_of_type(exact));
            counts.sum::<Result<u64, _>>().map(|count| count as f64)
        });
        let nodes = nodes.collect::<Result<_, _>>()?;
        let links = query.links.iter().map(|link| {
            let mut count = LinkCount::default();
            let Some(label) = link.label else {
                return Ok(count);
            };
            let (from, to) = (&query.domains[link.from], &query.domains[link.to]);
            host.triples(label, &mut |triple| {
                let edges = triple.count as f64;
                let (from, to) = (from.contains(triple.from), to.contains(triple.to));
                count.all += edges;
                count.from += if from { edges } else { 0.0 };
                count.to += if to { edges } else { 0.0 };
                count.both += if from && to { edges } else { 0.0 };
            })?;
            Ok(count)
        });
        let links = links.collect::<Result<_, ReadError>>()?;
        let values = query.bounds.iter().map(|bound| {
            let mut count = 0_u32;
            for id in host.by_value(bound.attribute, &bound.range).take(COUNTED) {
                id?;
                count += 1;
            }
            Ok(f64::from(count))
        });
        Ok(Self {
            nodes,
            links,
            values: values.collect::<Result<_, ReadError>>()?,
        })
    }

    /// What is taken for granted where there is no graph: a hundred nodes of a type, two edges
    /// of a label at each, ten nodes of a value.
    pub(crate) fn assumed(query: &Query) -> Self {
        let link = LinkCount {
            all: 200.0,
            from: 200.0,
            to: 200.0,
            both: 200.0,
        };
        Self {
            nodes: vec![100.0; query.domains.len()],
            links: vec![link; query.links.len()],
            values: vec![10.0; query.bounds.len()],
        }
    }

    /// Whether some count is more than twice, or less than half, what it was.
    pub(crate) fn drifted(&self, before: &Self) -> bool {
        let far = |(now, then): (&f64, &f64)| {
            let (now, then) = (now.max(FEW), then.max(FEW));
            now > 2.0 * then || then > 2.0 * now
        };
        self.nodes.iter().zip(&before.nodes).any(far)
            || self.values.iter().zip(&before.values).any(far)
            || self.links.iter().zip(&before.links).any(|(now, then)| {
                [
                    (now.all, then.all),
                    (now.from, then.from),
                    (now.to, then.to),
                    (now.both, then.both),
                ]
                .iter()
                .any(|(now, then)| far((now, then)))
            })
    }
}
