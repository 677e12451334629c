//! What was answered to each client last, kept in the graph itself, version by version. This file
//! guarantees that a transaction that a version contains is known there by its id, so that it is
//! not applied again whatever became of the store meanwhile.
//!
//! A client waits for an answer before it asks for the next thing, so that its last transaction is
//! the only one that it can ask for again.

use super::apply::{Work, read};
use crate::arena::{Address, Arena, tree};
use crate::{Commit, Graph, NodeId, ReadError, Refusal, Snapshot, Time, Version};
use serde::{Deserialize, Serialize};

/// Clients whose last transactions are known; of more, those that asked last.
pub(super) const CLIENTS: usize = 256;
/// Words of a record before the ids of created nodes.
const HEAD: usize = 4;

/// What tells a transaction from all others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct TransactionId {
    /// Who asks: a number that no other client has.
    pub client: u64,
    /// The how-manyeth transaction of that client; the first is 1.
    pub sequence: u64,
}

impl Graph {
    /// Notes by which session an agent commits: readers take hot values of what it committed last from
    /// that session alone.
    pub(crate) fn note_session(&self, agent: &str, session: u64) {
        if self.schema.has_hot()
            && let Some(writer) = self.writers.iter().position(|name| name == agent)
        {
            self.writer.arena.set_session(writer as u16, session);
        }
    }
}

/// A client's last transaction that was applied.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Answered {
    pub(crate) id: TransactionId,
    pub(crate) commit: Commit,
}

/// Appends the words of a record.
fn encode(id: TransactionId, commit: &Commit, words: &mut Vec<u64>) {
    words.extend([
        id.sequence,
        commit.version.0,
        commit.time.nanoseconds().cast_unsigned(),
        commit.created.len() as u64,
    ]);
    words.extend(commit.created.iter().map(|id| id.0));
}

impl Answered {
    /// The words of the record at `address`.
    fn len(arena: &Arena, address: Address) -> Result<usize, Address> {
        let count = arena.from(address).and_then(|words| words.get(HEAD - 1));
        Ok(HEAD + count.ok_or(address)?.load() as usize)
    }

    fn read(arena: &Arena, client: u64, address: Address) -> Result<Self, Address> {
        let words = arena.from(address).ok_or(address)?;
        let at = |i: usize| words.get(i).map(crate::arena::Word::load).ok_or(address);
        let created = words
            .get(HEAD..)
            .and_then(|ids| ids.get(..at(3).ok()? as usize));
        let created = created.ok_or(address)?.iter().map(|id| NodeId(id.load()));
        let sequence = at(0)?;
        Ok(Self {
            id: TransactionId { client, sequence },
            commit: Commit {
                version: Version(at(1)?),
                time: Time::from_nanoseconds(at(2)?.cast_signed()),
                created: created.collect(),
                durable: false,
            },
        })
    }
}

impl Snapshot {
    /// The last transaction of a client.
    pub(crate) fn answered(&self, client: u64) -> Result<Option<Answered>, ReadError> {
        let late = self.late_answer().filter(|(of, _)| *of == client);
        let found = match late {
            Some((_, address)) => Ok(Some(address)),
            None => tree::find(&self.arena, self.root.answers, [client, 0]),
        };
        self.genuine(found)?
            .map(|address| self.genuine(Answered::read(&self.arena, client, address)))
            .transpose()
    }

    /// The client of which the tree has an older transaction than its last, and where that is.
    fn late_answer(&self) -> Option<(u64, Address)> {
        let (client, answer) = (self.root.late_client, self.root.late_answer);
        (answer != 0).then_some((client, answer))
    }

    /// The last transaction of every client, by client.
    pub(crate) fn all_answered(&self) -> Result<Vec<Answered>, ReadError> {
        let range = tree::Range::new(&self.arena, self.root.answers, [0, 0], [u64::MAX; 2]);
        let mut range = self.genuine(range)?;
        let mut all = Vec::new();
        while let Some(([client, _], found)) = self.genuine(range.next())? {
            let late = self.late_answer().filter(|(of, _)| *of == client);
            let address = late.map_or(found, |(_, address)| address);
            all.push(self.genuine(Answered::read(&self.arena, client, address))?);
            if all.len() > CLIENTS {
                return Err(ReadError::Damaged {
                    address: self.root.answers,
                });
            }
        }
        Ok(all)
    }
}

impl Work<'_> {
    /// Notes what this commit answers.
    pub(super) fn remember(&mut self, id: TransactionId, commit: &Commit) -> Result<(), Refusal> {
        let client = id.client;
        let known = &self.graph.clients;
        if known.len() >= CLIENTS && !known.contains_key(&client) {
            let oldest = known.iter().min_by_key(|(_, version)| **version);
            if let Some((&oldest, _)) = oldest {
                self.forget(oldest)?;
                let writer = &mut self.graph.writer;
                let answers = tree::remove(writer, self.root.answers, [oldest, 0]);
                self.root.answers = self.room(answers)?;
                self.forgotten = Some(oldest);
            }
        }
        let put = self
            .graph
            .writer
            .put(None, |words| encode(id, commit, words));
        let address = self.room(put)?;
        // What the tree has of the client is found again, and given up, in the next commit.
        if self.root.late_answer == 0 && self.graph.clients.contains_key(&client) {
            (self.root.late_client, self.root.late_answer) = (client, address);
            return Ok(());
        }
        self.enter_answer(client, address)
    }

    /// Enters into the tree the answer that only the root leads to.
    pub(super) fn enter_late_answer(&mut self) -> Result<(), Refusal> {
        let client = std::mem::take(&mut self.root.late_client);
        match std::mem::take(&mut self.root.late_answer) {
            0 => Ok(()),
            answer => self.enter_answer(client, answer),
        }
    }

    fn enter_answer(&mut self, client: u64, address: Address) -> Result<(), Refusal> {
        let (root, key) = (self.root.answers, [client, 0]);
        let set = tree::set(&mut self.graph.writer, root, key, address);
        self.root.answers = if let Some((answers, last)) = self.room(set)? {
            self.give_up(last)?;
            answers
        } else {
            let answers = tree::insert(&mut self.graph.writer, root, key, address);
            self.room(answers)?
        };
        Ok(())
    }

    /// Gives up the record of a client's last transaction.
    fn forget(&mut self, client: u64) -> Result<(), Refusal> {
        let arena = &self.graph.writer.arena;
        let found = read(tree::find(arena, self.root.answers, [client, 0]))?;
        found.map_or(Ok(()), |address| self.give_up(address))
    }

    fn give_up(&mut self, address: Address) -> Result<(), Refusal> {
        let words = read(Answered::len(&self.graph.writer.arena, address))?;
        self.graph.writer.retire(address, words);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Graph, Image, Limits, Schema, Transaction};

    fn id(client: u64, sequence: u64) -> TransactionId {
        TransactionId { client, sequence }
    }

    fn node(name: &str, at: Option<NodeId>) -> Transaction {
        let mut transaction = Transaction::new();
        transaction.push(crate::Operation::CreateNode {
            id: at,
            type_name: "thing".into(),
            name: name.into(),
            attributes: vec![],
        });
        transaction
    }

    fn commit(graph: &mut Graph, id: TransactionId, transaction: &Transaction) -> Commit {
        let done = graph.commit_once(transaction, "agent", Time::default(), Some(id));
        graph.settle();
        done.unwrap()
    }

    #[test]
    fn a_transaction_is_known_by_its_id_also_after_the_graph_was_restored() {
        let mut graph = Graph::in_memory(Schema::open());
        let mut both = node("a", Some(NodeId(40)));
        both.operations
            .extend(node("b", Some(NodeId(7))).operations);
        let first = commit(&mut graph, id(5, 1), &both);
        assert_eq!(first.created, [NodeId(40), NodeId(7)]);
        let other = commit(&mut graph, id(6, 9), &node("c", None));
        assert_eq!(graph.answered(5).unwrap().unwrap().commit, first);
        let image = Image::of(&graph.snapshot()).unwrap();
        let mut restored = Graph::in_memory(Schema::open());
        restored.restore(&image).unwrap();
        assert_eq!(restored.lineage(), graph.lineage());
        let known = restored.answered(5).unwrap().unwrap();
        assert_eq!((known.id, known.commit), (id(5, 1), first));
        assert_eq!(restored.answered(6).unwrap().unwrap().commit, other);
        let last = commit(&mut restored, id(5, 2), &Transaction::new());
        assert_eq!(restored.answered(5).unwrap().unwrap().commit, last);
        assert!(restored.answered(4).unwrap().is_none());
        let all = restored.snapshot().all_answered().unwrap();
        assert_eq!(all.len(), 2);
        assert_eq!(all[0].commit, last, "also before the tree has it");
    }

    #[test]
    fn a_refused_transaction_is_not_known() {
        let mut graph = Graph::in_memory(Schema::open());
        commit(&mut graph, id(1, 1), &node("a", None));
        let again = graph.commit_once(&node("a", None), "x", Time::default(), Some(id(1, 2)));
        again.unwrap_err();
        assert_eq!(graph.answered(1).unwrap().unwrap().id, id(1, 1));
    }

    #[test]
    fn of_many_clients_those_that_asked_last_are_known_and_memory_stays_bounded() {
        let mut graph = Graph::in_memory(Schema::open());
        graph.set_limits(Limits {
            history_bytes: 10_000,
            ..Limits::default()
        });
        let many = CLIENTS as u64;
        let mut bytes = 0;
        for round in 1..=4 {
            for client in 0..many * 2 {
                commit(&mut graph, id(client, round), &Transaction::new());
            }
            assert_eq!(graph.snapshot().all_answered().unwrap().len(), CLIENTS);
            assert!(graph.answered(many - 1).unwrap().is_none());
            assert!(graph.answered(many).unwrap().is_some());
            if round == 1 {
                bytes = graph.bytes_in_use();
            }
        }
        assert!(graph.bytes_in_use() < bytes + 10_000);
    }
}
