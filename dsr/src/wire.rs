//! What goes between processes as bytes, for who speaks to a store without this crate's sessions
//! and for whoever tries to break it. It guarantees that no bytes make a decoder panic.

use crate::{Change, Refusal, Transaction};

/// Reads a transaction as a request holds it.
///
/// # Errors
/// [`Refusal::Malformed`].
pub fn decode_transaction(bytes: &[u8]) -> Result<Transaction, Refusal> {
    postcard::from_bytes(bytes).map_err(|error| Refusal::Malformed(error.to_string()))
}

/// Reads a change as it goes out to every agent.
///
/// # Errors
/// [`Refusal::Malformed`].
pub fn decode_change(bytes: &[u8]) -> Result<Change, Refusal> {
    postcard::from_bytes(bytes).map_err(|error| Refusal::Malformed(error.to_string()))
}

/// A transaction as a request holds it.
pub fn encode_transaction(transaction: &Transaction) -> Vec<u8> {
    // Encoding to memory cannot fail for these types.
    postcard::to_stdvec(transaction).unwrap_or_default()
}

/// A change as it goes out.
pub fn encode_change(change: &Change) -> Vec<u8> {
    postcard::to_stdvec(change).unwrap_or_default()
}
