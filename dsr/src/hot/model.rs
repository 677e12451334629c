//! The page's protocol under loom: see [`crate::arena::protocol`] for what that tries, and what not.

use super::*;
use crate::arena::protocol::tests::{Modelled, in_every_way};

const EPOCH: Epoch = Epoch(3);

fn key(node: u64) -> Key {
    Key::of_node(NodeId(node), AttributeId(1))
}

/// A page with room for two attributes.
fn page() -> Vec<Modelled> {
    let page = Modelled::row(FIRST_SLOT + 2 * SLOT_WORDS);
    format(&page, 7);
    page
}

/// Writes a number as the value and as its time.
fn put(page: &[Modelled], index: usize, n: u64) {
    let value = (&Value::U64(n), n.cast_signed());
    write(page, index, EPOCH, value, &mut Vec::new());
}

/// The number that an attribute has, which must be its time too.
fn get(page: &[Modelled], key: Key) -> Option<u64> {
    let found = read(page, EPOCH, key)?;
    let Value::U64(n) = found.value else {
        panic!("{found:?}");
    };
    assert_eq!(found.head.time, n.cast_signed(), "read in halves");
    Some(n)
}

#[test]
fn a_value_is_read_whole_while_it_is_written() {
    let start = || {
        let page = page();
        claim(&page, key(5)).unwrap();
        put(&page, 0, 1);
        page
    };
    // The second of them goes where the value is that a reader finds first.
    let writes = |page: &Vec<Modelled>| {
        put(page, 0, 2);
        put(page, 0, 3);
    };
    let reads = |page: &Vec<Modelled>| {
        let found = get(page, key(5)).unwrap();
        assert!((1..=3).contains(&found));
    };
    let end = |page: &Vec<Modelled>| assert_eq!(get(page, key(5)), Some(3));
    in_every_way(2, start, writes, reads, end);
}

#[test]
fn an_attribute_that_comes_is_found_with_its_own_value_or_not_at_all() {
    let comes = |page: &Vec<Modelled>| {
        let index = claim(page, key(6)).unwrap();
        put(page, index, 6);
    };
    let reads = |page: &Vec<Modelled>| {
        assert_eq!(get(page, key(0)), None, "a slot before it has a key");
        assert!(get(page, key(6)).is_none_or(|n| n == 6));
    };
    in_every_way(2, page, comes, reads, |_| ());
}
