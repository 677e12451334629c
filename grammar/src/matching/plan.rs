//! In which order a pattern's nodes are looked for.
//!
//! Guarantee: every unbound slot is bound by exactly one step, and each link and condition is
//! tested at the first step after which all that it reads is bound.

use super::domain::Domain;
use super::program::{Link, Test};
use dsr::{ReadError, Snapshot};

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
}

/// Binds one slot or two, and tests what can be tested then.
#[derive(Debug)]
pub(crate) struct Step {
    pub(crate) source: Source,
    /// Slots that are bound before it; what it binds must differ from them.
    pub(crate) bound: Vec<usize>,
    /// Links (by index) tested after it.
    pub(crate) links: Vec<usize>,
    /// Conditions (by index) tested after it.
    pub(crate) tests: Vec<usize>,
}

impl Source {
    /// The slots that it binds.
    pub(crate) fn binds(self, links: &[Link]) -> [Option<usize>; 2] {
        match self {
            Self::Nodes { slot } => [Some(slot), None],
            Self::Edges { link } => [Some(links[link].from), Some(links[link].to)],
            Self::Out { link } => [Some(links[link].to), None],
            Self::In { link } => [Some(links[link].from), None],
        }
    }
}

/// Orders the steps: each time the source that is expected to give the fewest candidates, by the
/// snapshot's own counts of nodes per type and of edges per label.
pub(crate) fn plan(
    snapshot: &Snapshot,
    domains: &[Domain],
    links: &[Link],
    tests: &[Test],
    bound: &[usize],
) -> Result<Vec<Step>, ReadError> {
    let counts = domains
        .iter()
        .map(|domain| Ok(domain.count(snapshot)? as f64))
        .collect::<Result<Vec<_>, ReadError>>()?;
    let edges = links
        .iter()
        .map(|link| Ok(link.label.map_or(Ok(0), |l| snapshot.count_of_label(l))? as f64))
        .collect::<Result<Vec<_>, ReadError>>()?;
    let mut bound = bound.to_vec();
    let mut steps = Vec::new();
    while bound.len() < domains.len() {
        let Some(source) = cheapest(&counts, &edges, links, &bound) else {
            break;
        };
        let before = bound.clone();
        bound.extend(source.binds(links).into_iter().flatten());
        let followed = match source {
            Source::Nodes { .. } => None,
            Source::Edges { link } | Source::Out { link } | Source::In { link } => Some(link),
        };
        let new = |slot: usize| bound.contains(&slot) && !before.contains(&slot);
        let ready = |index: &usize| {
            let link = &links[*index];
            Some(*index) != followed
                && bound.contains(&link.from)
                && bound.contains(&link.to)
                && (new(link.from) || new(link.to))
        };
        let links = (0..links.len()).filter(ready).collect();
        let testable = |index: &usize| {
            let test = &tests[*index];
            (0..domains.len()).any(|slot| new(slot) && test.reads(slot))
                && (0..domains.len()).all(|slot| bound.contains(&slot) || !test.reads(slot))
        };
        let tests = (0..tests.len()).filter(testable).collect();
        steps.push(Step {
            source,
            bound: before,
            links,
            tests,
        });
    }
    Ok(steps)
}

fn cheapest(counts: &[f64], edges: &[f64], links: &[Link], bound: &[usize]) -> Option<Source> {
    let is_bound = |slot: usize| bound.contains(&slot);
    let mut best: Option<(f64, Source)> = None;
    let mut offer = |expected: f64, source: Source| {
        if best.is_none_or(|(least, _)| expected < least) {
            best = Some((expected, source));
        }
    };
    for (index, link) in links.iter().enumerate().filter(|(_, link)| !link.negated) {
        match (is_bound(link.from), is_bound(link.to)) {
            (true, false) => {
                offer(
                    edges[index] / counts[link.from].max(1.0),
                    Source::Out { link: index },
                );
            }
            (false, true) => {
                offer(
                    edges[index] / counts[link.to].max(1.0),
                    Source::In { link: index },
                );
            }
            (false, false) if link.from != link.to => {
                offer(edges[index], Source::Edges { link: index });
            }
            _ => {}
        }
    }
    for (slot, &count) in counts
        .iter()
        .enumerate()
        .filter(|(slot, _)| !is_bound(*slot))
    {
        offer(count, Source::Nodes { slot });
    }
    best.map(|(_, source)| source)
}
