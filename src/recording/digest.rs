//! A digest of a whole graph: SHA-256 of its graph JSON without spaces, every name in order. It
//! guarantees that two graphs have the same digest if and only if `cortex graph export json` prints
//! the same for both.

use dsr::{ReadError, Snapshot, json};
use sha2::{Digest, Sha256};
use std::fmt::Write as _;

/// The graph as JSON, and its digest in hexadecimal.
///
/// # Errors
/// [`ReadError`].
pub(super) fn digest(snapshot: &Snapshot) -> Result<(serde_json::Value, String), ReadError> {
    let graph = json::to_json(&snapshot.committed())?;
    let mut text = String::new();
    for byte in Sha256::digest(graph.to_string()) {
        // Writing to a string does not fail.
        let _ = write!(text, "{byte:02x}");
    }
    Ok((graph, text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::{Graph, Schema, Time, Transaction};

    #[test]
    fn the_order_in_which_attributes_came_does_not_count_and_each_value_does() {
        let of = |names: [&str; 2], value: f64| {
            let mut graph = Graph::in_memory(Schema::open());
            let mut transaction = Transaction::new();
            transaction.create_node("room", "kitchen", vec![]);
            for name in names {
                transaction.set("kitchen", name, value);
            }
            graph.commit(&transaction, "test", Time::default()).unwrap();
            digest(&graph.snapshot()).unwrap().1
        };
        assert_eq!(of(["a", "b"], 1.0), of(["b", "a"], 1.0));
        assert_ne!(of(["a", "b"], 1.0), of(["a", "b"], 1.5));
        assert_eq!(of(["a", "b"], 1.0).len(), 64);
    }
}
