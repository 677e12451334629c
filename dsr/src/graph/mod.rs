//! The graph's single writer: takes transactions, applies each whole or not at all, and publishes
//! a version per commit. It knows no process, clock or socket; the store process is a thin shell
//! around it, and so is everything that works on a file.

mod answers;
mod apply;
mod image;
mod lease;
mod writer;

pub(crate) use answers::Answered;
pub use answers::TransactionId;
pub(crate) use apply::STORE;
use apply::{Effects, Work};
pub(crate) use image::{EdgeImage, Frame, NodeImage};
pub use image::{Image, decode_image};
pub use lease::LeaseRefusal;
use lease::Leased;
pub(crate) use writer::Writer;

use crate::arena::allocator::{Allocator, Full, Growth, HeapGrowth};
use crate::arena::{Arena, Root, record};
use crate::interchange::{Stamp, World};
use crate::{
    Change, Commit, Epoch, Manifest, NodeId, Operation, Refusal, Rights, Schema, Snapshot, Time,
    Transaction, Version,
};
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

/// What the store asks of a grammar: the meaning of [`Operation::ApplyRule`].
pub trait RuleEngine: Send + Sync + fmt::Debug {
    /// The operations that the rule makes at `binding`, if its left-hand side holds there.
    ///
    /// # Errors
    /// [`Refusal::RuleNotApplicable`] with what does not hold.
    fn expand(
        &self,
        snapshot: &Snapshot,
        rule: &str,
        binding: &[(String, NodeId)],
    ) -> Result<Vec<Operation>, Refusal>;

    /// The agent that the grammar gives the rule to, if it gives it to one.
    fn actor(&self, rule: &str) -> Option<&str> {
        let _ = rule;
        None
    }

    /// Asked about every change before it is published: the engine to go by from it on, where the
    /// change brings another. `after` is the graph as it will be.
    ///
    /// # Errors
    /// A [`Refusal`] refuses the whole change.
    fn successor(
        &self,
        after: &Snapshot,
        change: &Change,
    ) -> Result<Option<Arc<dyn RuleEngine>>, Refusal> {
        let _ = (after, change);
        Ok(None)
    }
}

/// Knobs of the writer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// How many bytes of old versions stay readable.
    pub history_bytes: usize,
    /// How long an old version stays readable at the most, by the clock of
    /// [`Graph::set_clock`].
    pub history_age: Duration,
    /// How many bytes beyond the history are kept for leases; 0 refuses them all.
    pub lease_bytes: usize,
    /// How long a lease may be.
    pub lease_time: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            history_bytes: 16 << 20,
            history_age: Duration::from_mins(5),
            lease_bytes: 256 << 20,
            lease_time: Duration::from_mins(10),
        }
    }
}

/// The graph and its single writer.
///
/// ```
/// use dsr::{Graph, Schema, Time, Transaction};
///
/// let mut graph = Graph::in_memory(Schema::open());
/// let mut transaction = Transaction::new();
/// transaction.create_node("room", "kitchen", vec![("area".into(), 12.5.into())]);
/// transaction.create_node("robot", "shelly", vec![]);
/// transaction.create_edge("shelly", "in", "kitchen");
/// graph.commit(&transaction, "me", Time::default())?;
///
/// let snapshot = graph.snapshot();
/// let kitchen = snapshot.find_node_by_name("kitchen")?.unwrap();
/// assert_eq!(kitchen.value("area")?.unwrap().as_f64(), Some(12.5));
/// assert_eq!(kitchen.in_edges().count(), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Graph {
    writer: Writer,
    root: Root,
    /// What the next version begins with, where that was written already.
    prepared: Option<Root>,
    schema: Arc<Schema>,
    writers: Arc<Vec<String>>,
    epoch: Epoch,
    limits: Limits,
    rules: Option<Arc<dyn RuleEngine>>,
    rights: Option<Rights>,
    /// The clients whose last transactions are known, with the versions that those made.
    clients: BTreeMap<u64, u64>,
    /// What the last commit did.
    effects: Effects,
    /// Whether nothing is left to do after the last commit.
    is_settled: bool,
    leases: Vec<Leased>,
    last_token: u64,
}

impl Graph {
    /// An empty graph on the heap of this process.
    pub fn in_memory(schema: Schema) -> Self {
        // 16 MiB segments, 64 GiB at the most. A segment has room for the cells of half a million
        // nodes; what is not used of it takes no memory.
        let arena = Arc::new(Arena::new(1 << 12, 21));
        // The heap does not refuse; where it is exhausted the process ends.
        Self::on(arena, Box::new(HeapGrowth), schema, Epoch(1)).unwrap_or_else(|Full| {
            unreachable!("the first segment of an arena on the heap is always there")
        })
    }

    /// An empty graph on an arena whose segments `growth` adds.
    pub(crate) fn on(
        arena: Arc<Arena>,
        mut growth: Box<dyn Growth>,
        schema: Schema,
        epoch: Epoch,
    ) -> Result<Self, Full> {
        growth.grow(&arena, 0)?;
        growth.reserve(0, 0, crate::arena::FIRST_BLOCK as usize)?;
        let allocator = Allocator::new(growth);
        let mut graph = Self {
            writer: Writer::new(arena, allocator),
            root: Root {
                next_id: 1,
                lineage: epoch.0,
                ..Root::default()
            },
            prepared: None,
            schema: Arc::new(schema),
            writers: Arc::default(),
            epoch,
            limits: Limits::default(),
            rules: None,
            rights: None,
            clients: BTreeMap::new(),
            effects: Effects::default(),
            is_settled: true,
            leases: Vec::new(),
            last_token: 0,
        };
        let mut root = graph.root;
        graph.write_schema(&mut root)?;
        root.version = 1;
        graph.publish(&root);
        Ok(graph)
    }

    /// Sets the limits.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
    }

    /// Sets the grammar that [`Operation::ApplyRule`] goes by.
    pub fn set_rules(&mut self, rules: Arc<dyn RuleEngine>) {
        self.rules = Some(rules);
    }

    /// Sets who may write what. Without, everybody may write everything; with, an agent without a
    /// manifest may write nothing.
    pub fn set_rights(&mut self, manifests: impl IntoIterator<Item = Manifest>) {
        self.rights = Some(Rights::new(manifests, &self.schema));
    }

    /// Who may write what, where that was said.
    pub fn rights(&self) -> Option<&Rights> {
        self.rights.as_ref()
    }

    /// The newest version.
    pub fn snapshot(&self) -> Snapshot {
        self.snapshot_of(self.root)
    }

    fn snapshot_of(&self, mut root: Root) -> Snapshot {
        if root.version != self.root.version {
            // The cells do not know of a version under way.
            root.cell_count = 0;
        }
        Snapshot::new(
            Arc::clone(&self.writer.arena),
            root,
            Arc::clone(&self.schema),
        )
    }

    /// The words of its memory's first segment, as other processes would see them; see
    /// [`Snapshot::of_words`].
    pub fn words(&self) -> Vec<u64> {
        self.announce();
        let words = self.writer.arena.from(0).unwrap_or(&[]);
        words.iter().map(crate::arena::Word::load).collect()
    }

    /// This life of the store.
    pub fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// The memory that it lies in.
    pub(crate) fn arena(&self) -> &Arena {
        &self.writer.arena
    }

    /// Shows the graph to other processes, which until then see none: what they see first is
    /// whole.
    pub(crate) fn announce(&self) {
        self.writer.arena.format(self.epoch);
    }

    /// The first life of the store that this graph goes back to: what is restored from an image is
    /// of the image's lineage.
    pub fn lineage(&self) -> Epoch {
        Epoch(self.root.lineage)
    }

    /// The last transaction of a client that was applied, if it is still known.
    pub(crate) fn answered(&self, client: u64) -> Result<Option<Answered>, Refusal> {
        let found = self.snapshot().answered(client);
        found.map_err(|error| Refusal::Malformed(error.to_string()))
    }

    /// Bytes that the current and the still readable old versions take.
    pub fn bytes_in_use(&self) -> u64 {
        self.writer.allocator.bytes_in_use()
    }

    /// Applies a transaction whole, and tells what it changed.
    ///
    /// # Errors
    /// A [`Refusal`]; the graph is then as it was.
    pub fn commit(
        &mut self,
        transaction: &Transaction,
        agent: &str,
        time: Time,
    ) -> Result<(Commit, Change), Refusal> {
        let done = self.commit_once(transaction, agent, time, None);
        self.settle();
        Ok((done?, self.last_change()))
    }

    /// Makes what a file says, each attribute with the time and agent that the file gives it, else
    /// `time` and `agent`.
    ///
    /// # Errors
    /// A [`Refusal`]; the graph is then as it was.
    pub fn import(
        &mut self,
        world: &World,
        agent: &str,
        time: Time,
    ) -> Result<(Commit, Change), Refusal> {
        let transaction = world.transaction();
        let done = self.commit_stamped(&transaction, &world.stamps(), agent, time, None);
        self.settle();
        Ok((done?, self.last_change()))
    }

    /// As [`Self::commit`], and notes the transaction's id, by which [`Self::answered`] then knows
    /// it. What nobody has to wait for is left to [`Self::settle`], and what the commit changed is told by
    /// [`Self::last_change`].
    pub(crate) fn commit_once(
        &mut self,
        transaction: &Transaction,
        agent: &str,
        time: Time,
        id: Option<TransactionId>,
    ) -> Result<Commit, Refusal> {
        self.commit_stamped(transaction, &[], agent, time, id)
    }

    fn commit_stamped(
        &mut self,
        transaction: &Transaction,
        stamps: &[Stamp],
        agent: &str,
        time: Time,
        id: Option<TransactionId>,
    ) -> Result<Commit, Refusal> {
        let before = (Arc::clone(&self.schema), Arc::clone(&self.writers));
        let mut outcome = self.try_commit(transaction, stamps, agent, time, id);
        if let Err(Refusal::OutOfMemory { .. }) = outcome {
            // History gives way before a commit is refused.
            self.abandon(&before);
            self.reclaim(0);
            self.revoke_beyond(0);
            outcome = self.try_commit(transaction, stamps, agent, time, id);
        }
        if outcome.is_err() {
            self.abandon(&before);
        }
        outcome
    }

    /// Gives up what history is too much after a commit, and gets ready for the next.
    pub(crate) fn settle(&mut self) {
        if !self.is_settled {
            self.is_settled = true;
            self.reclaim(self.limits.history_bytes);
            self.writer.allocator.prepare(&self.writer.arena);
            self.writer.arena.prepare_root(self.root.version + 1);
            if Work::prepare(self).is_err() {
                // The next commit will say so, if it still is.
                self.abandon_blocks();
            }
        }
    }

    fn try_commit(
        &mut self,
        transaction: &Transaction,
        stamps: &[Stamp],
        agent: &str,
        time: Time,
        id: Option<TransactionId>,
    ) -> Result<Commit, Refusal> {
        let mut work = Work::new(self, agent, time)?;
        work.require(&transaction.preconditions)?;
        work.apply(&transaction.operations)?;
        stamps.iter().try_for_each(|stamp| work.stamp(stamp))?;
        let commit = work.finish(id)?;
        if let Some(rules) = &work.graph.rules {
            let after = work.graph.snapshot_of(work.root);
            let change = work.graph.change_of(&work.root);
            let successor = rules.successor(&after, &change)?;
            if successor.is_some() {
                work.graph.rules = successor;
            }
        }
        work.publish(id);
        Ok(commit)
    }

    /// What the last commit changed.
    pub(crate) fn last_change(&self) -> Change {
        self.change_of(&self.root)
    }

    /// What the effects are of the commit that makes that root.
    fn change_of(&self, root: &Root) -> Change {
        let writer = root.agent.checked_sub(1);
        let agent = writer.and_then(|writer| self.writers.get(writer as usize));
        Change {
            epoch: self.epoch,
            version: Version(root.version),
            time: root.time(),
            agent: agent.cloned().unwrap_or_default(),
            rules: self.effects.rules.clone(),
            nodes: self.effects.nodes(),
            edges: self.effects.edges(),
        }
    }

    fn abandon(&mut self, before: &(Arc<Schema>, Arc<Vec<String>>)) {
        self.abandon_blocks();
        self.schema = Arc::clone(&before.0);
        self.writers = Arc::clone(&before.1);
    }

    fn abandon_blocks(&mut self) {
        self.writer.abandon();
        self.prepared = None;
        self.is_settled = false;
    }

    fn publish(&mut self, root: &Root) {
        self.writer.publish(self.root.version, root);
        self.root = *root;
    }

    fn reclaim(&mut self, keep_bytes: usize) {
        let Writer {
            arena, allocator, ..
        } = &mut self.writer;
        allocator.reclaim(arena, keep_bytes, self.limits.history_age);
        self.revoke_beyond(self.limits.lease_bytes);
    }

    fn full(&self) -> Refusal {
        Refusal::OutOfMemory {
            bytes: self.bytes_in_use(),
        }
    }

    fn write_schema(&mut self, root: &mut Root) -> Result<(), Full> {
        // Encoding to memory cannot fail for these types; an empty blob is refused by readers.
        let bytes = postcard::to_stdvec(&*self.schema).unwrap_or_default();
        let old = root.schema;
        root.schema = record::write_blob(&mut self.writer, &bytes)?;
        root.schema_version += 1;
        if old != 0 {
            let words = record::blob_len(&self.writer.arena, old);
            self.writer.retire(old, words);
        }
        Ok(())
    }

    /// The number that stands for an agent in attribute records.
    fn writer_id(&mut self, agent: &str, root: &mut Root) -> Result<u16, Full> {
        if let Some(index) = self.writers.iter().position(|name| name == agent) {
            return Ok(index as u16);
        }
        let index = u16::try_from(self.writers.len()).map_err(|_| Full)?;
        let mut writers = Vec::clone(&self.writers);
        writers.push(agent.to_owned());
        self.write_writers(writers, root)?;
        Ok(index)
    }

    fn write_writers(&mut self, writers: Vec<String>, root: &mut Root) -> Result<(), Full> {
        let bytes = postcard::to_stdvec(&writers).unwrap_or_default();
        self.writers = Arc::new(writers);
        let old = root.writers;
        root.writers = record::write_blob(&mut self.writer, &bytes)?;
        if old != 0 {
            let words = record::blob_len(&self.writer.arena, old);
            self.writer.retire(old, words);
        }
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests;
