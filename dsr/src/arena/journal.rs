//! Every store of a word by this thread, in order: for tests that cut a writer off in the middle.

use super::Word;
use std::cell::RefCell;

/// A word's address in this process, and what was stored there.
pub(crate) type Store = (usize, u64);

thread_local! {
    static STORES: RefCell<Option<Vec<Store>>> = const { RefCell::new(None) };
}

/// What `act` gives, and what it stored on the way.
pub(crate) fn of<T>(act: impl FnOnce() -> T) -> (T, Vec<Store>) {
    STORES.set(Some(Vec::new()));
    let outcome = act();
    (outcome, STORES.take().unwrap_or_default())
}

pub(super) fn note(word: &Word, value: u64) {
    STORES.with_borrow_mut(|stores| {
        if let Some(stores) = stores {
            stores.push((std::ptr::from_ref(word).addr(), value));
        }
    });
}
