//! What the store answers to a request. This file guarantees that a transaction is applied once
//! however often it is asked for, and for nobody who may not ask.

use super::{Answer, Asker, Store};
use crate::graph::STORE;
use crate::shm::session::Request;
use crate::shm::{InstanceError, ROOM, ipc, room_for};
use crate::{Refusal, TransactionId};
use smallvec::{SmallVec, smallvec};
use std::cmp::Ordering;

/// Bytes of an answer that has its place from the beginning; a larger one takes new memory.
pub(super) const SMALL: usize = 1024;
/// Clients whose last requests are remembered.
const CLIENTS: usize = 1024;

/// The answers to a request, which mostly holds one transaction.
pub(super) type Answers = SmallVec<[Answer; 1]>;

/// What became of a client's last request.
#[derive(Debug)]
pub(super) struct Answered {
    pub(super) sequence: u64,
    pub(super) answers: Answers,
    /// When it came, in requests.
    round: u64,
}

impl Store {
    /// Sees to it that the request's answers are among the answered, and tells whether they are:
    /// not those of one that its sender has given up, for it has asked for something else since.
    pub(super) fn is_answered(&mut self, request: &Request) -> bool {
        let Request {
            client, sequence, ..
        } = *request;
        let mut known = None;
        if let Some(last) = self.answered.get(&client) {
            match sequence.cmp(&last.sequence) {
                Ordering::Less => return false,
                Ordering::Equal => return true,
                Ordering::Greater => {}
            }
        } else {
            // A store that died may have applied it, and this one goes on where that ended.
            match self.graph.answered(client) {
                Err(refusal) => known = Some(Err(refusal)),
                Ok(Some(last)) if sequence < last.id.sequence => return false,
                Ok(Some(last)) if sequence == last.id.sequence => known = Some(Ok(last.commit)),
                Ok(_) => {}
            }
        }
        let answers = match known {
            Some(answer) => smallvec![answer],
            None => self.decide_all(request),
        };
        if answers.iter().any(Result::is_ok) {
            self.graph.note_session(&request.agent, client);
        }
        // Before the answer: who goes on when it has it finds the changes there.
        self.tell();
        if self.answered.len() >= CLIENTS && !self.answered.contains_key(&client) {
            let oldest = self.answered.iter().min_by_key(|(_, last)| last.round);
            if let Some((&oldest, _)) = oldest {
                self.answered.remove(&oldest);
            }
        }
        self.round += 1;
        let answered = Answered {
            sequence,
            answers,
            round: self.round,
        };
        self.answered.insert(client, answered);
        true
    }

    fn decide_all(&mut self, request: &Request) -> Answers {
        if let Err(refusal) = self.identify(request) {
            return smallvec![Err(refusal); request.transactions.len()];
        }
        let Request {
            client, sequence, ..
        } = *request;
        // Of several under one number it could not be told which were applied.
        let alone = request.transactions.len() == 1;
        let id = alone.then_some(TransactionId { client, sequence });
        let transactions = request.transactions.iter();
        let decide = |transaction| {
            // What the one before left to do; what the last leaves waits for the answer.
            self.graph.settle();
            self.decide(transaction, &request.agent, request.time, id)
        };
        transactions.map(decide).collect()
    }

    /// Whether the one who asks may go by that name.
    fn identify(&mut self, request: &Request) -> Result<(), Refusal> {
        let Some(rights) = self.graph.rights() else {
            return Ok(());
        };
        let agent = request.agent.as_str();
        if agent == STORE {
            let why = format!("no agent may call itself `{STORE}`");
            return Err(Refusal::NotAllowed(why));
        }
        match rights.find(agent) {
            Some(manifest) if !manifest.several() => self.names.claim(agent, request.process),
            _ => Ok(()),
        }
    }
}

/// Answers a request.
pub(super) fn reply(
    asker: &Asker,
    answers: &[Answer],
    scratch: &mut Vec<u8>,
) -> Result<(), InstanceError> {
    let mut bytes = std::mem::take(scratch);
    bytes.clear();
    let bytes = postcard::to_extend(answers, bytes).map_err(|e| ipc("encoding an answer", e))?;
    if bytes.len() > SMALL
        && let Err(error) = room_for(ROOM + bytes.len() as u64)
    {
        tracing::warn!("an answer was not sent: {error}");
        return Ok(());
    }
    match asker.loan_slice_uninit(bytes.len()) {
        // A client that went away meanwhile does not hear; that is its affair.
        Ok(response) => drop(response.write_from_slice(&bytes).send()),
        Err(error) => tracing::warn!("an answer was not sent: {error}"),
    }
    *scratch = bytes;
    Ok(())
}
