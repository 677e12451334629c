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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Pose, Value};

    /// The example of `docs/src/wire.md`.
    #[test]
    fn the_bytes_are_those_of_the_book() {
        let mut transaction = Transaction::new();
        transaction.set("robot", "max_speed", 0.5);
        let bytes = encode_transaction(&transaction.durable());
        let mut book = vec![0, 1, 5, 0, 1, 5];
        book.extend(b"robot\x09max_speed\x06");
        book.extend(0.5f64.to_le_bytes());
        book.push(2);
        assert_eq!(bytes, book);
    }

    #[test]
    fn a_pose_is_its_rotation_and_then_its_translation() {
        let bytes = postcard::to_stdvec(&Value::Pose(Pose::translation(1.0, 2.0, 3.0))).unwrap();
        let numbers = [0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 3.0f64];
        let mut book = vec![14];
        book.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        assert_eq!(bytes, book);
    }
}
