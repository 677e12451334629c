//! The decoders of what processes send each other here, without a process: for those who try to break
//! them. It guarantees that they are the ones that run.

use super::{lease, session};
use crate::{Commit, Refusal, Transaction};

type Answers = Vec<Result<Commit, Refusal>>;

/// The transactions of a request to the store.
pub(crate) fn request(bytes: &[u8]) -> postcard::Result<Vec<Transaction>> {
    postcard::from_bytes::<session::Request>(bytes).map(|request| request.transactions)
}

/// The store's answers to a request.
pub(crate) fn answers(bytes: &[u8]) -> postcard::Result<Answers> {
    postcard::from_bytes(bytes)
}

/// A request for a lease, or that one end.
pub(crate) fn lease_request(bytes: &[u8]) -> postcard::Result<()> {
    postcard::from_bytes::<lease::Ask>(bytes).map(drop)
}

/// The store's answer to a request for a lease.
pub(crate) fn lease_answer(bytes: &[u8]) -> postcard::Result<()> {
    postcard::from_bytes::<lease::Answer>(bytes).map(drop)
}
