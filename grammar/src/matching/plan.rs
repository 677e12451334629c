//! In which order a pattern's nodes are looked for.
//!
//! Guarantee: every unbound slot is bound by exactly one step, and each link and condition is
//! tested at the first step after which all that it reads is bound.

use super::domain::Domain;
use super::evaluate::node;
use super::program::{Link, Slot, Test};
use dsr::{NodeId, ReadError, Snapshot};

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
/// snapshot's own counts of nodes per type and of edges per label, and by how many links some
/// nodes have.
pub(crate) fn plan(
    snapshot: &Snapshot,
    domains: &[Domain],
    links: &[Link],
    tests: &[Test],
    environment: &[Slot],
) -> Result<Vec<Step>, ReadError> {
    let mut bound: Vec<usize> = (0..domains.len())
        .filter(|&slot| node(environment, slot).is_some())
        .collect();
    let estimates = Estimates {
        snapshot,
        domains,
        links,
        environment,
    };
    let mut steps = Vec::new();
    while bound.len() < domains.len() {
        let Some(source) = estimates.cheapest(&bound)? else {
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

/// How many nodes of a type, and edges of each, are looked at to guess what is typical.
const SAMPLE: (usize, usize) = (8, 64);

/// What the snapshot says about how many candidates a source gives.
struct Estimates<'a> {
    snapshot: &'a Snapshot,
    domains: &'a [Domain],
    links: &'a [Link],
    environment: &'a [Slot],
}

impl Estimates<'_> {
    fn cheapest(&self, bound: &[usize]) -> Result<Option<Source>, ReadError> {
        let is_bound = |slot: usize| bound.contains(&slot);
        let mut best: Option<(f64, Source)> = None;
        let mut offer = |expected: f64, source: Source| {
            if best.is_none_or(|(least, _)| expected < least) {
                best = Some((expected, source));
            }
        };
        for (index, link) in self
            .links
            .iter()
            .enumerate()
            .filter(|(_, link)| !link.negated)
        {
            match (is_bound(link.from), is_bound(link.to)) {
                (true, false) => offer(self.degree(link, true)?, Source::Out { link: index }),
                (false, true) => offer(self.degree(link, false)?, Source::In { link: index }),
                (false, false) if link.from != link.to => {
                    let edges = link.label.map(|label| self.snapshot.count_of_label(label));
                    let edges = edges.transpose()?.unwrap_or(0);
                    offer(edges as f64, Source::Edges { link: index });
                }
                _ => {}
            }
        }
        for (slot, domain) in self
            .domains
            .iter()
            .enumerate()
            .filter(|(slot, _)| !is_bound(*slot))
        {
            offer(domain.count(self.snapshot)? as f64, Source::Nodes { slot });
        }
        Ok(best.map(|(_, source)| source))
    }

    /// How many links like this leave (or enter) a node of its bound end. The count of the label
    /// alone would not do: one robot is `in` a room, and so are thousands of persons.
    fn degree(&self, link: &Link, outwards: bool) -> Result<f64, ReadError> {
        let Some(label) = link.label else {
            return Ok(0.0);
        };
        let slot = if outwards { link.from } else { link.to };
        let sample: Vec<NodeId> = match node(self.environment, slot) {
            Some(id) => vec![id],
            None => self.domains[slot]
                .nodes(self.snapshot)
                .take(SAMPLE.0)
                .collect::<Result<_, _>>()?,
        };
        let mut edges = 0;
        for &id in &sample {
            if let Some(found) = self.snapshot.find_node(id)? {
                edges += if outwards {
                    found.out_edges_of(label).take(SAMPLE.1).count()
                } else {
                    found.in_edges_of(label).take(SAMPLE.1).count()
                };
            }
        }
        Ok(edges as f64 / sample.len().max(1) as f64)
    }
}
