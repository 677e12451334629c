//! A graph that is worked on in memory.
//!
//! Guarantee: both ends of every edge have it, in ascending order.

use crate::matching::{Host, Way};
use dsr::{
    AttributeId, EdgeKey, LabelId, NodeId, NodeIds, ReadError, Snapshot, TripleCount, TypeId,
    Value, ValueRange, Version,
};
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::BTreeSet;

/// Ids below this many times the number of nodes, and a few, are looked up by place.
const DENSE: u64 = 4;
/// So many ends of edges are visited together: where the first match is enough, not all are wanted.
const TOGETHER: usize = 4;

/// Nodes and links of a snapshot, to be rewritten in place: without versions, names or a schema's
/// ranges. Attributes are those of the snapshot, for as long as it can be read.
#[derive(Debug, Clone)]
pub struct WorkingGraph {
    base: Snapshot,
    near: Vec<Option<Entry>>,
    far: FxHashMap<NodeId, Entry>,
    /// By exact type.
    members: Vec<BTreeSet<NodeId>>,
    /// Edges that went: if they are there again, then without attributes.
    renewed: FxHashSet<EdgeKey>,
    next: u64,
}

#[derive(Debug, Clone)]
struct Entry {
    exact: TypeId,
    out: Vec<(LabelId, NodeId)>,
    into: Vec<(LabelId, NodeId)>,
}

/// The ends under one label.
fn labelled(ends: &[(LabelId, NodeId)], label: LabelId) -> &[(LabelId, NodeId)] {
    let from = ends.partition_point(|&(other, _)| other < label);
    let count = ends[from..].partition_point(|&(other, _)| other == label);
    &ends[from..from + count]
}

fn add(ends: &mut Vec<(LabelId, NodeId)>, end: (LabelId, NodeId)) -> bool {
    match ends.binary_search(&end) {
        Ok(_) => false,
        Err(at) => {
            ends.insert(at, end);
            true
        }
    }
}

fn take(ends: &mut Vec<(LabelId, NodeId)>, end: (LabelId, NodeId)) -> bool {
    let at = ends.binary_search(&end);
    at.map(|at| ends.remove(at)).is_ok()
}

impl WorkingGraph {
    /// A copy of a snapshot's nodes and links.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn of(snapshot: &Snapshot) -> Result<Self, ReadError> {
        let mut graph = Self {
            base: snapshot.clone(),
            near: Vec::new(),
            far: FxHashMap::default(),
            members: vec![BTreeSet::new(); snapshot.schema().types().len()],
            renewed: FxHashSet::default(),
            next: 1,
        };
        let dense = snapshot.node_count().saturating_mul(DENSE) + 64;
        graph.near.resize(dense as usize, None);
        for node in snapshot.nodes() {
            let node = node?;
            let ends = |ids: &mut dyn Iterator<Item = Result<(LabelId, NodeId), ReadError>>| {
                ids.collect::<Result<Vec<_>, _>>()
            };
            let out = ends(
                &mut node
                    .out_edges()
                    .map(|key| key.map(|key| (key.label, key.to))),
            )?;
            let into = ends(
                &mut node
                    .in_edges()
                    .map(|key| key.map(|key| (key.label, key.from))),
            )?;
            graph.put(
                node.id(),
                Entry {
                    exact: node.type_id(),
                    out,
                    into,
                },
            );
        }
        Ok(graph)
    }

    fn put(&mut self, node: NodeId, entry: Entry) {
        let exact = usize::from(entry.exact.0);
        if self.members.len() <= exact {
            self.members.resize(exact + 1, BTreeSet::new());
        }
        self.members[exact].insert(node);
        self.next = self.next.max(node.0.saturating_add(1));
        match self.near.get_mut(node.0 as usize) {
            Some(place) => *place = Some(entry),
            None => {
                self.far.insert(node, entry);
            }
        }
    }

    fn entry(&self, node: NodeId) -> Option<&Entry> {
        match self.near.get(node.0 as usize) {
            Some(place) => place.as_ref(),
            None => self.far.get(&node),
        }
    }

    fn entry_mut(&mut self, node: NodeId) -> Option<&mut Entry> {
        match self.near.get_mut(node.0 as usize) {
            Some(place) => place.as_mut(),
            None => self.far.get_mut(&node),
        }
    }

    fn ends(&self, way: Way, of: NodeId) -> &[(LabelId, NodeId)] {
        self.entry(of).map_or(&[], |entry| match way {
            Way::Out => &entry.out,
            Way::In => &entry.into,
        })
    }

    /// All nodes with their types, type by type.
    pub fn nodes(&self) -> impl Iterator<Item = (NodeId, TypeId)> {
        let types = (0..).map(TypeId).zip(&self.members);
        types.flat_map(|(exact, nodes)| nodes.iter().map(move |&node| (node, exact)))
    }

    /// All edges, by the types of their sources.
    pub fn edges(&self) -> impl Iterator<Item = EdgeKey> {
        self.nodes().flat_map(|(from, _)| {
            let out = self.ends(Way::Out, from);
            out.iter()
                .map(move |&(label, to)| EdgeKey { from, label, to })
        })
    }

    pub(super) fn create(&mut self, exact: TypeId) -> NodeId {
        let node = NodeId(self.next);
        let (out, into) = (Vec::new(), Vec::new());
        self.put(node, Entry { exact, out, into });
        node
    }

    pub(super) fn retype(&mut self, node: NodeId, exact: TypeId) {
        if let Some(entry) = self.entry_mut(node) {
            let before = std::mem::replace(&mut entry.exact, exact);
            self.members[usize::from(before.0)].remove(&node);
            self.members[usize::from(exact.0)].insert(node);
        }
    }

    pub(super) fn delete(&mut self, node: NodeId) {
        let gone = match self.near.get_mut(node.0 as usize) {
            Some(place) => place.take(),
            None => self.far.remove(&node),
        };
        let Some(gone) = gone else { return };
        self.members[usize::from(gone.exact.0)].remove(&node);
        for (label, to) in gone.out {
            if let Some(other) = self.entry_mut(to) {
                take(&mut other.into, (label, node));
            }
        }
        for (label, from) in gone.into {
            if let Some(other) = self.entry_mut(from) {
                take(&mut other.out, (label, node));
            }
        }
    }

    pub(super) fn link(&mut self, key: EdgeKey) {
        let there = self.entry(key.to).is_some();
        if there
            && let Some(from) = self.entry_mut(key.from)
            && add(&mut from.out, (key.label, key.to))
            && let Some(to) = self.entry_mut(key.to)
        {
            add(&mut to.into, (key.label, key.from));
        }
    }

    pub(super) fn unlink(&mut self, key: EdgeKey) {
        if let Some(from) = self.entry_mut(key.from)
            && take(&mut from.out, (key.label, key.to))
            && let Some(to) = self.entry_mut(key.to)
        {
            take(&mut to.into, (key.label, key.from));
            self.renewed.insert(key);
        }
    }
}

/// Nodes at the other ends of edges.
pub(crate) struct Ends<'a> {
    graph: &'a WorkingGraph,
    ends: std::slice::Iter<'a, (LabelId, NodeId)>,
}

impl Iterator for Ends<'_> {
    type Item = Result<(NodeId, TypeId), ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        let &(_, node) = self.ends.next()?;
        Some(Ok((node, self.graph.type_of(node))))
    }
}

/// Ids of nodes of a working graph.
pub(crate) enum Ids<'a> {
    Members(std::collections::btree_set::Iter<'a, NodeId>),
    Base(NodeIds<'a>),
    Nothing,
}

impl Iterator for Ids<'_> {
    type Item = Result<NodeId, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self {
            Self::Members(nodes) => nodes.next().map(|&node| Ok(node)),
            Self::Base(ids) => ids.next(),
            Self::Nothing => None,
        }
    }
}

impl Host for WorkingGraph {
    /// The id of one that is there.
    type Node<'a> = NodeId;
    type Adjacency<'a> = &'a [(LabelId, NodeId)];
    type Ids<'a> = Ids<'a>;
    type Ends<'a> = Ends<'a>;
    type Edges<'a> = Box<dyn Iterator<Item = Result<(EdgeKey, [TypeId; 2]), ReadError>> + 'a>;

    fn version(&self) -> Version {
        self.base.version()
    }

    fn find(&self, id: NodeId) -> Result<Option<NodeId>, ReadError> {
        Ok(self.entry(id).map(|_| id))
    }

    fn type_of(&self, node: NodeId) -> TypeId {
        self.entry(node)
            .map_or(TypeId(u16::MAX), |entry| entry.exact)
    }

    #[inline]
    fn adjacency(&self, way: Way, of: NodeId) -> Result<&[(LabelId, NodeId)], ReadError> {
        Ok(self.ends(way, of))
    }

    fn fetch(&self, _: &[(LabelId, NodeId)]) {}

    fn has_end(
        &self,
        ends: &[(LabelId, NodeId)],
        label: LabelId,
        other: NodeId,
    ) -> Result<bool, ReadError> {
        Ok(ends.binary_search(&(label, other)).is_ok())
    }

    fn node_value(&self, node: NodeId, attribute: AttributeId) -> Result<Option<Value>, ReadError> {
        match self.base.find_node(node)? {
            Some(node) => self.base.node_value(node, attribute),
            None => Ok(None),
        }
    }

    fn edge_value(&self, key: EdgeKey, attribute: AttributeId) -> Result<Option<Value>, ReadError> {
        if self.renewed.contains(&key) || !self.has_edge(key)? {
            return Ok(None);
        }
        Host::edge_value(&self.base, key, attribute)
    }

    fn targets(&self, from: NodeId, label: LabelId) -> Ends<'_> {
        Ends {
            graph: self,
            ends: labelled(self.ends(Way::Out, from), label).iter(),
        }
    }

    fn sources(&self, to: NodeId, label: LabelId) -> Ends<'_> {
        Ends {
            graph: self,
            ends: labelled(self.ends(Way::In, to), label).iter(),
        }
    }

    fn visit_ends(
        &self,
        ends: &[(LabelId, NodeId)],
        label: LabelId,
        from: NodeId,
        mut visit: impl FnMut(NodeId, TypeId),
    ) -> Result<Option<NodeId>, ReadError> {
        let first = ends.partition_point(|end| *end < (label, from));
        let mut ends = ends[first..].iter();
        let mut ends = ends.by_ref().take_while(|(other, _)| *other == label);
        for &(_, node) in ends.by_ref().take(TOGETHER) {
            visit(node, self.type_of(node));
        }
        Ok(ends.next().map(|&(_, node)| node))
    }

    fn members(&self, exact: TypeId) -> Ids<'_> {
        let nodes = self.members.get(usize::from(exact.0));
        nodes.map_or(Ids::Nothing, |nodes| Ids::Members(nodes.iter()))
    }

    fn visit_ids(
        &self,
        ids: &mut Ids<'_>,
        mut visit: impl FnMut(NodeId),
    ) -> Result<bool, ReadError> {
        let next = ids.next().transpose()?;
        if let Some(id) = next {
            visit(id);
        }
        Ok(next.is_some())
    }

    fn edges(&self, label: LabelId) -> Self::Edges<'_> {
        let edges = self.edges().filter(move |key| key.label == label);
        Box::new(edges.map(|key| Ok((key, [key.from, key.to].map(|end| self.type_of(end))))))
    }

    fn visit_edges(
        &self,
        edges: &mut Self::Edges<'_>,
        mut visit: impl FnMut(EdgeKey, [TypeId; 2]),
    ) -> Result<bool, ReadError> {
        let next = edges.next().transpose()?;
        if let Some((key, types)) = next {
            visit(key, types);
        }
        Ok(next.is_some())
    }

    fn by_value(&self, attribute: AttributeId, range: &ValueRange) -> Ids<'_> {
        Ids::Base(self.base.ids_by_value(attribute, range))
    }

    fn count_of_type(&self, exact: TypeId) -> Result<u64, ReadError> {
        let nodes = self.members.get(usize::from(exact.0));
        Ok(nodes.map_or(0, |nodes| nodes.len() as u64))
    }

    /// As the snapshot has them: they guide the search, and rewriting leaves them alike.
    fn triples(&self, label: LabelId, visit: &mut dyn FnMut(TripleCount)) -> Result<(), ReadError> {
        Host::triples(&self.base, label, visit)
    }
}
