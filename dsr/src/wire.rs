//! What goes between processes as bytes, for who speaks to a store without this crate's sessions
//! and for whoever tries to break it. It guarantees that no bytes make a decoder panic.

use crate::arena::Word;
use crate::hot::{self, Key};
use crate::shm::decode;
use crate::{AttributeId, Change, Commit, Epoch, NodeId, Refusal, Time, Transaction, Value, desk};

/// Reads a transaction as a request holds it.
///
/// # Errors
/// [`Refusal::Malformed`].
pub fn decode_transaction(bytes: &[u8]) -> Result<Transaction, Refusal> {
    read(postcard::from_bytes(bytes))
}

/// Reads a change as it goes out to every agent.
///
/// # Errors
/// [`Refusal::Malformed`].
pub fn decode_change(bytes: &[u8]) -> Result<Change, Refusal> {
    read(postcard::from_bytes(bytes))
}

/// Words as another process could have written them.
fn page(words: &[u64]) -> Vec<Word> {
    let page: Vec<Word> = words.iter().map(|_| Word::default()).collect();
    for (word, value) in page.iter().zip(words) {
        word.store(*value);
    }
    page
}

fn read<T>(decoded: postcard::Result<T>) -> Result<T, Refusal> {
    decoded.map_err(|error| Refusal::Malformed(error.to_string()))
}

/// Reads a request to the store: its transactions.
///
/// # Errors
/// [`Refusal::Malformed`].
pub fn decode_request(bytes: &[u8]) -> Result<Vec<Transaction>, Refusal> {
    read(decode::request(bytes))
}

/// Reads the store's answer to a request.
///
/// # Errors
/// [`Refusal::Malformed`].
pub fn decode_answer(bytes: &[u8]) -> Result<Vec<Result<Commit, Refusal>>, Refusal> {
    read(decode::answers(bytes))
}

/// Reads what a session says to the store about leases; whether it can be read.
///
/// # Errors
/// [`Refusal::Malformed`].
pub fn check_lease_request(bytes: &[u8]) -> Result<(), Refusal> {
    read(decode::lease_request(bytes))
}

/// Reads what the store answers about leases; whether it can be read.
///
/// # Errors
/// [`Refusal::Malformed`].
pub fn check_lease_answer(bytes: &[u8]) -> Result<(), Refusal> {
    read(decode::lease_answer(bytes))
}

/// Reads a node's attribute from the words of a page of hot attributes, whoever wrote them, as a
/// snapshot of that epoch does.
pub fn read_hot_page(
    words: &[u64],
    epoch: Epoch,
    node: NodeId,
    attribute: AttributeId,
) -> Option<Value> {
    let page = page(words);
    hot::session_of(&page)?;
    Some(hot::read(&page, epoch, Key::of_node(node, attribute))?.value)
}

/// Reads the request for the store of that epoch that lies on a session's desk, as the store does.
/// `None` where none does.
///
/// # Errors
/// [`Refusal::Malformed`].
pub fn decode_desk(words: &[u64], epoch: Epoch) -> Option<Result<(Time, Transaction), Refusal>> {
    let page = page(words);
    desk::owner_of(&page)?;
    let request = desk::request_of(&page);
    let mut bytes = Vec::new();
    desk::take(request, desk::state(request), epoch, &mut bytes)?;
    Some(decode_laid(&bytes))
}

/// The desk of that owner, with its first request on it, for the store of that epoch. `None` where the
/// agent's name or the transaction is too long for one.
pub fn encode_desk(
    (client, process, agent): (u64, u32, &str),
    epoch: Epoch,
    time: Time,
    transaction: &Transaction,
) -> Option<Vec<u64>> {
    let page: Vec<Word> = (0..desk::DESK_WORDS).map(|_| Word::default()).collect();
    let owner = desk::Owner {
        client,
        process,
        agent: agent.to_owned(),
    };
    let bytes = postcard::to_stdvec(&(time, transaction)).ok()?;
    let laid = desk::format(&page, &owner) && desk::lay(desk::request_of(&page), 1, epoch, &bytes);
    laid.then(|| page.iter().map(Word::load).collect())
}

/// Reads what lies on a desk.
pub(crate) fn decode_laid(bytes: &[u8]) -> Result<(Time, Transaction), Refusal> {
    read(postcard::from_bytes(bytes))
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
    fn a_desk_is_that_of_the_book() {
        let mut transaction = Transaction::new();
        transaction.set(crate::NodeId(3), "a", 0.5);
        let time = Time::from_nanoseconds(-1);
        let desk = encode_desk((5, 6, "driver"), Epoch(7), time, &transaction).unwrap();
        let word = |bytes: &[u8; 8]| u64::from_le_bytes(*bytes);
        let mut book = vec![0; 512];
        book[..4].copy_from_slice(&[word(b"cortexD1"), 5, 6, 6]);
        book[8] = word(b"driver\0\0");
        book[40..44].copy_from_slice(&[2, 0, 7, 19]);
        book[44] = word(&[1, 0, 1, 5, 0, 0, 3, 1]);
        book[45] = word(&[b'a', 6, 0, 0, 0, 0, 0, 0]);
        book[46] = word(&[0xe0, 0x3f, 0, 0, 0, 0, 0, 0]);
        assert_eq!(desk, book);
        let read = decode_desk(&desk, Epoch(7)).unwrap().unwrap();
        assert_eq!(read, (time, transaction));
        assert!(decode_desk(&desk, Epoch(8)).is_none());
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
