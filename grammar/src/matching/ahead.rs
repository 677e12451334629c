//! Candidates of a step, read ahead.
//!
//! Guarantee: reading ahead takes memory only the first time, and never for more nodes than lie together
//! in the graph.

use dsr::NodeId;

/// What a step binds: one node, or the two ends of an edge.
pub(crate) type Ends = [NodeId; 2];

/// The candidates of one step that were read and not yet tried.
#[derive(Debug, Clone, Default)]
pub(crate) struct Ahead {
    read: Vec<Ends>,
    next: usize,
    /// From which node on there may be more to read.
    more: Option<NodeId>,
}

impl Ahead {
    /// Begins anew: nothing is read yet.
    #[inline]
    pub(crate) fn begin(&mut self) {
        self.read.clear();
        self.next = 0;
        self.more = Some(NodeId(0));
    }

    /// The next of what was read.
    #[inline]
    pub(crate) fn next(&mut self) -> Option<Ends> {
        let ends = self.read.get(self.next)?;
        self.next += 1;
        Some(*ends)
    }

    /// Where to read on, after all that was read, and what takes it in; `None` where there is no more.
    #[inline]
    pub(crate) fn read_on(&mut self) -> Option<(NodeId, &mut Vec<Ends>)> {
        let from = self.more.take()?;
        self.read.clear();
        self.next = 0;
        Some((from, &mut self.read))
    }

    /// Says where to read on after that.
    #[inline]
    pub(crate) fn stopped_at(&mut self, more: Option<NodeId>) {
        self.more = more;
    }
}
