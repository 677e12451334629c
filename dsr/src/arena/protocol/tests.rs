//! The protocols under loom, which tries every interleaving of a few steps, and for every load every
//! value that the orderings allow, not only the sequentially consistent one. Preemptions are bounded,
//! which bounds the time; what loom cannot do is let a store take effect before an earlier load.

use super::*;
use loom::model::Builder;
use loom::sync::Arc;
use loom::sync::atomic::{AtomicU32, AtomicU64};

/// A word of loom's.
#[derive(Debug)]
pub(crate) struct Modelled(AtomicU64);

impl Modelled {
    pub(crate) fn new(value: u64) -> Self {
        Self(AtomicU64::new(value))
    }

    pub(crate) fn row(count: usize) -> Vec<Self> {
        (0..count).map(|_| Self::new(0)).collect()
    }
}

impl Counter for AtomicU32 {
    fn load(&self, order: Ordering) -> u32 {
        self.load(order)
    }

    fn increment(&self, order: Ordering) {
        self.fetch_add(1, order);
    }
}

impl Atomic for Modelled {
    fn load(&self, order: Ordering) -> u64 {
        self.0.load(order)
    }

    fn store(&self, value: u64, order: Ordering) {
        self.0.store(value, order);
    }

    fn fence(order: Ordering) {
        loom::sync::atomic::fence(order);
    }

    fn pause() {
        loom::thread::yield_now();
    }
}

/// Runs `one` beside `other` in every way, with that many preemptions, on what `start` makes.
pub(crate) fn in_every_way<T: Send + Sync + 'static>(
    preemptions: usize,
    start: fn() -> T,
    one: fn(&T),
    other: fn(&T),
    end: fn(&T),
) {
    let mut builder = Builder::new();
    builder.preemption_bound = Some(preemptions);
    builder.max_branches = 100_000;
    builder.check(move || {
        let shared = Arc::new(start());
        let beside = Arc::clone(&shared);
        let thread = loom::thread::spawn(move || one(&beside));
        other(&shared);
        thread.join().unwrap();
        end(&shared);
    });
}

/// Words of a root.
const ROOT: usize = 2;

/// An arena of three roots and two blocks of two words each.
struct Small {
    head: Modelled,
    roots: Vec<Modelled>,
    oldest: Modelled,
    lease: Modelled,
    blocks: [[Modelled; 2]; 2],
}

impl Small {
    /// Version 1, whose root leads to the first block.
    fn new() -> Self {
        let pair = || [Modelled::new(0), Modelled::new(0)];
        let small = Self {
            head: Modelled::new(0),
            roots: Modelled::row(3 * ROOT),
            oldest: Modelled::new(0),
            lease: Modelled::new(7),
            blocks: [pair(), pair()],
        };
        small.commit(1, 0);
        small
    }

    fn ring(&self) -> Ring<'_, Modelled, ROOT> {
        Ring {
            head: &self.head,
            roots: &self.roots,
        }
    }

    fn fill(&self, block: usize, value: u64) {
        for word in &self.blocks[block] {
            word.store(value, Ordering::Relaxed);
        }
    }

    /// Makes a version that consists of a block full of its number.
    fn commit(&self, version: u64, block: usize) {
        self.fill(block, version);
        self.ring().publish([version, block as u64]);
    }

    fn look(&self, block: usize) -> [u64; 2] {
        let words = self.blocks[block].each_ref();
        words.map(|word| word.load(Ordering::Relaxed))
    }
}

#[test]
fn a_root_that_is_kept_was_read_whole() {
    let commits = |small: &Small| {
        for version in 2..=4 {
            small.ring().publish([version, version]);
        }
    };
    let reads = |small: &Small| {
        let version = small.ring().head();
        let (root, head, kept) = small.ring().read(version).unwrap();
        assert!(head >= version);
        if kept {
            assert_eq!(root, [version, if version == 1 { 0 } else { version }]);
        }
    };
    in_every_way(3, Small::new, commits, reads, |_| ());
}

#[test]
fn what_is_read_of_a_version_that_stands_was_not_written_over() {
    let reuses = |small: &Small| {
        small.commit(2, 1);
        revoke(&small.oldest, 2);
        small.commit(3, 0);
    };
    let reads = |small: &Small| {
        let version = small.ring().head();
        let (root, _, kept) = small.ring().read(version).unwrap();
        if kept {
            let found = small.look(root[1] as usize);
            if stands(&small.oldest, |oldest| version >= oldest) {
                assert_eq!(found, [version; 2]);
            }
        }
    };
    in_every_way(3, Small::new, reuses, reads, |_| ());
}

#[test]
fn what_is_read_by_a_lease_that_holds_was_not_written_over() {
    let reuses = |small: &Small| {
        revoke(&small.lease, 0);
        small.fill(0, 9);
    };
    let reads = |small: &Small| {
        let found = small.look(0);
        if stands(&small.lease, |token| token == 7) {
            assert_eq!(found, [1; 2]);
        }
    };
    in_every_way(4, Small::new, reuses, reads, |_| ());
}

/// A node's records in two places, and the cell that leads to the newest.
struct Celled {
    small: Small,
    cell: Modelled,
    /// Of each: whose it is, since which version, and a value, which is that version.
    records: [[Modelled; 3]; 2],
}

impl Celled {
    /// The node that the cell is of.
    const NODE: u64 = 7;

    /// Version 1, with the node's record in the first place.
    fn new() -> Self {
        let celled = Self {
            small: Small::new(),
            cell: Modelled::new(0),
            records: [(); 2].map(|()| [0; 3].map(Modelled::new)),
        };
        celled.write(0, Self::NODE, 1);
        lead(&celled.cell, 1);
        celled
    }

    fn write(&self, place: usize, node: u64, version: u64) {
        for (word, value) in self.records[place].iter().zip([node, version, version]) {
            word.store(value, Ordering::Relaxed);
        }
    }

    /// Gives the node a record for a version that is then published.
    fn commit(&self, version: u64, place: usize) {
        self.write(place, Self::NODE, version);
        lead(&self.cell, place as u64 + 1);
        self.small.ring().publish([version, 0]);
    }

    fn forget_before(&self, version: u64) {
        revoke(&self.small.oldest, version);
    }

    /// What a reader of a version makes of the cell, where the node changed in each up to `last`.
    fn read(&self, version: u64, last: u64) {
        let Some(place) = led(&self.cell).checked_sub(1) else {
            return;
        };
        let [whose, since, value] = &self.records[place as usize];
        if is_record_of((whose, since), Self::NODE, version) {
            let value = value.load(Ordering::Relaxed);
            if stands(&self.small.oldest, |oldest| version >= oldest) {
                assert_eq!(value, version.min(last));
            }
        }
    }
}

#[test]
fn a_cell_shows_the_record_of_the_version_also_where_the_next_takes_the_place_of_the_first() {
    let commits = |celled: &Celled| {
        celled.commit(2, 1);
        celled.forget_before(2);
        celled.commit(3, 0);
    };
    let reads = |celled: &Celled| celled.read(celled.small.ring().head(), 3);
    in_every_way(3, Celled::new, commits, reads, |_| ());
}

#[test]
fn a_cell_shows_nothing_of_another_node_that_takes_the_place_of_its_record() {
    let commits = |celled: &Celled| {
        celled.commit(2, 1);
        celled.forget_before(2);
        celled.write(0, Celled::NODE + 1, 3);
        celled.small.ring().publish([3, 0]);
    };
    let reads = |celled: &Celled| celled.read(celled.small.ring().head(), 2);
    in_every_way(3, Celled::new, commits, reads, |_| ());
}

/// A request that was sent, a store that may sleep, and who saw what.
struct Asking {
    request: Modelled,
    asleep: Modelled,
    found: Modelled,
    rung: Modelled,
}

#[test]
fn a_store_that_goes_to_sleep_is_woken_or_finds_the_request() {
    let start = || {
        let [request, asleep, found, rung] = [0; 4].map(Modelled::new);
        Asking {
            request,
            asleep,
            found,
            rung,
        }
    };
    let store = |asking: &Asking| {
        set_asleep(&asking.asleep, true);
        let found = asking.request.load(Ordering::Relaxed);
        asking.found.store(found, Ordering::Relaxed);
    };
    let sender = |asking: &Asking| {
        asking.request.store(1, Ordering::Relaxed);
        let rings = is_asleep(&asking.asleep);
        asking.rung.store(u64::from(rings), Ordering::Relaxed);
    };
    let end = |asking: &Asking| {
        let seen = [&asking.found, &asking.rung].map(|word| word.load(Ordering::Relaxed));
        assert_ne!(seen, [0; 2], "it sleeps for ever");
    };
    in_every_way(4, start, store, sender, end);
}

/// News, the bell that rings for them, and what a waiter made of both.
struct Waiting {
    news: Modelled,
    bell: AtomicU32,
    heard: Modelled,
    found: Modelled,
}

#[test]
fn who_listened_before_it_looked_does_not_sleep_through_the_news() {
    let start = || {
        let [news, heard, found] = [0; 3].map(Modelled::new);
        let bell = AtomicU32::new(0);
        Waiting {
            news,
            bell,
            heard,
            found,
        }
    };
    let store = |waiting: &Waiting| {
        waiting.news.store(1, Ordering::Relaxed);
        ring(&waiting.bell);
    };
    let waiter = |waiting: &Waiting| {
        let heard = listen(&waiting.bell);
        waiting.heard.store(heard.into(), Ordering::Relaxed);
        let found = waiting.news.load(Ordering::Relaxed);
        waiting.found.store(found, Ordering::Relaxed);
    };
    let end = |waiting: &Waiting| {
        let [heard, found] = [&waiting.heard, &waiting.found].map(|w| w.load(Ordering::Relaxed));
        // The kernel lets nobody sleep on another number than the bell's.
        let sleeps = heard == u64::from(waiting.bell.load(Ordering::Relaxed));
        assert!(found == 1 || !sleeps, "it sleeps through them");
    };
    in_every_way(4, start, store, waiter, end);
}
