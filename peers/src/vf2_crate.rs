//! The `vf2` crate: subgraph isomorphism of labelled graphs, on adjacency lists with sorted ends.

use crate::Labelled;
use std::time::Instant;
use vf2::{Direction, NodeIndex};

struct Graph<'a> {
    of: &'a Labelled,
    /// By node, where its edges end, with their labels, ascending.
    out: Vec<Vec<(usize, u32)>>,
    /// By node, where its edges start.
    into: Vec<Vec<usize>>,
}

impl<'a> Graph<'a> {
    fn new(of: &'a Labelled) -> Self {
        let mut out = vec![Vec::new(); of.nodes.len()];
        let mut into = vec![Vec::new(); of.nodes.len()];
        for &(from, label, to) in &of.edges {
            out[from].push((to, label));
            into[to].push(from);
        }
        for ends in &mut out {
            ends.sort_unstable();
        }
        Self { of, out, into }
    }

    fn label(&self, from: NodeIndex, to: NodeIndex) -> Option<&u32> {
        let ends = &self.out[from];
        let at = ends.binary_search_by_key(&to, |(end, _)| *end).ok()?;
        Some(&ends[at].1)
    }
}

impl vf2::Graph for Graph<'_> {
    type NodeLabel = u32;
    type EdgeLabel = u32;

    fn is_directed(&self) -> bool {
        true
    }

    fn node_count(&self) -> usize {
        self.of.nodes.len()
    }

    fn node_label(&self, node: NodeIndex) -> Option<&u32> {
        self.of.nodes.get(node)
    }

    fn neighbors(&self, node: NodeIndex, direction: Direction) -> impl Iterator<Item = NodeIndex> {
        let (out, into) = match direction {
            Direction::Outgoing => (&self.out[node][..], &[][..]),
            Direction::Incoming => (&[][..], &self.into[node][..]),
        };
        out.iter().map(|(to, _)| *to).chain(into.iter().copied())
    }

    fn contains_edge(&self, source: NodeIndex, target: NodeIndex) -> bool {
        self.label(source, target).is_some()
    }

    fn edge_label(&self, source: NodeIndex, target: NodeIndex) -> Option<&u32> {
        self.label(source, target)
    }
}

/// Seconds for all matches, and how many there are.
pub(crate) fn all(data: &Labelled, query: &Labelled) -> (f64, u64) {
    let (data, query) = (Graph::new(data), Graph::new(query));
    let started = Instant::now();
    let mut matches = vf2::subgraph_isomorphisms(&query, &data)
        .node_eq(|query, data| query == data)
        .edge_eq(|query, data| query == data)
        .iter();
    let mut count = 0;
    while matches.next_ref().is_some() {
        count += 1;
    }
    (started.elapsed().as_secs_f64(), count)
}
