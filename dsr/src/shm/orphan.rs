//! The graph of a store that was killed, in shared memory that nobody writes any more. This file guarantees
//! that what it finds is the last version which the newest such store committed, whole, whatever the store
//! was at when it was killed.
//!
//! Shared memory outlives the process that made it, until it is removed. Before anybody cleans up after a
//! killed store, its graph's memory gets a second name; both names go when another store shows its graph.

use super::arena::{CAPACITY, SHIFT, SegmentHeader};
use super::leftovers::{Members, name_of, processes_in, remove};
use super::{InstanceError, Segment, memory_of};
use crate::arena::{Arena, MAGIC};
use crate::{Epoch, ReadError, Snapshot, Version};
use iceoryx2::config::Config;
use rustix::fs::{SeekFrom, seek};
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::sync::Arc;
use thiserror::Error;

const WORD: usize = size_of::<u64>();
/// Bytes of a segment.
const SEGMENT: u64 = (WORD as u64) << SHIFT;
/// How far behind the place where the memory for a segment begins its words may: iceoryx2's own and
/// the headers of the sample come first.
const AHEAD: usize = 8 << 10;
/// How much is read at once.
const PIECE: usize = 1 << 20;

/// Why the graph of a store that was killed cannot be read.
#[derive(Debug, Error)]
pub enum OrphanError {
    /// Its memory cannot be opened or read.
    #[error("the graph that a killed store left cannot be read: {path}: {source}")]
    Io {
        /// The file in shared memory.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// Its memory begins with something else than this program writes.
    #[error(
        "the graph that a killed store left is damaged, or of another version of this program: {path}"
    )]
    Foreign {
        /// The file in shared memory.
        path: PathBuf,
    },
    /// A part of its memory is not there, or not what a store writes.
    #[error("the graph that a killed store left is damaged: {0}")]
    Damaged(#[from] ReadError),
}

/// The end of the second name.
const KEPT: &str = ".orphan";

/// Where a graph is that no other is newer than.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Orphan {
    path: PathBuf,
    first: First,
}

/// The first segment in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct First {
    epoch: Epoch,
    /// The newest version.
    head: Version,
    /// Bytes before it.
    start: u64,
    /// Whether the epoch is the same before it and in it.
    is_whole: bool,
}

/// The graphs that are in an instance's memory, the newest last; the second name of one after its first.
fn graphs(config: &Config) -> Vec<Orphan> {
    let files = memory_of(&config.global.prefix.to_string()).unwrap_or_default();
    let graph = |path: PathBuf| {
        let file = File::open(&path).ok()?;
        let large = file.metadata().ok()?.len() > SEGMENT * CAPACITY as u64;
        let first = large.then(|| first(&file).ok().flatten()).flatten()?;
        Some(Orphan { path, first })
    };
    let mut graphs: Vec<Orphan> = files.into_iter().filter_map(graph).collect();
    graphs.sort_by_key(|graph| (graph.first.epoch.0, graph.is_kept()));
    graphs
}

/// The graph that was shown last, and who belongs to the instance, in this order: who made the one was a
/// member before, and is now if it lives.
fn newest(config: &Config) -> Result<(Option<Orphan>, Members), InstanceError> {
    let newest = graphs(config).pop();
    Ok((newest, Members::of(config)?))
}

/// Gives the newest graph a second name if its store has ended, for as long as it is the newest. To be
/// called before anything is removed of those that have ended. Who belongs to the instance.
pub(super) fn keep(config: &Config) -> Result<Members, InstanceError> {
    let (newest, members) = newest(config)?;
    let left = newest.filter(|graph| !graph.is_kept() && graph.is_left(&members));
    if let Some(newest) = left {
        let name = format!("{}{}{KEPT}", config.global.prefix, newest.first.epoch.0);
        let kept = newest.path.with_file_name(name);
        match fs::hard_link(&newest.path, &kept) {
            // By another process at the same time.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            linked => linked.map_err(|source| InstanceError::Io { path: kept, source })?,
        }
    }
    Ok(members)
}

/// Removes the graphs of other lives of the store than that one, which has shown its own.
pub(super) fn forget(config: &Config, epoch: Epoch) {
    for old in graphs(config).iter().filter(|graph| graph.epoch() != epoch) {
        remove(&old.path);
    }
}

impl Orphan {
    /// That of an instance, if the store that showed its graph last has ended.
    pub(super) fn find(config: &Config) -> Result<Option<Self>, InstanceError> {
        let (newest, members) = newest(config)?;
        Ok(newest.filter(|graph| graph.is_left(&members)))
    }

    fn is_kept(&self) -> bool {
        name_of(&self.path).ends_with(KEPT)
    }

    /// Whether its store has ended.
    fn is_left(&self, members: &Members) -> bool {
        let process = processes_in(name_of(&self.path)).next();
        process.is_none_or(|process| members.has_ended(process))
    }

    /// The life of the store that it is of.
    pub(super) fn epoch(&self) -> Epoch {
        self.first.epoch
    }

    /// Its newest version.
    pub(super) fn version(&self) -> Version {
        self.first.head
    }

    /// Reads it, into memory of this process.
    pub(super) fn read(&self) -> Result<Snapshot, OrphanError> {
        let io = |source| OrphanError::Io {
            path: self.path.clone(),
            source,
        };
        let file = File::open(&self.path).map_err(io)?;
        let arena = Arena::new(CAPACITY, SHIFT);
        let mut start = self.first.start;
        arena.attach(0, segment(&file, start).map_err(io)?);
        if !self.first.is_whole || arena.epoch() != Some(self.first.epoch) {
            let path = self.path.clone();
            return Err(OrphanError::Foreign { path });
        }
        for index in 1..arena.announced_segments().min(CAPACITY as u64) {
            let next = next(&file, start + SEGMENT, self.first.epoch, index).map_err(io)?;
            start = next.ok_or(ReadError::Damaged {
                address: index << SHIFT,
            })?;
            arena.attach(index as usize, segment(&file, start).map_err(io)?);
        }
        Ok(Snapshot::of_arena(Arc::new(arena))?)
    }
}

/// The words of `bytes`, as the host lays them out.
fn words(bytes: &[u8]) -> impl Iterator<Item = u64> {
    let (words, _) = bytes.as_chunks::<WORD>();
    words.iter().map(|word| u64::from_ne_bytes(*word))
}

/// Where at or behind `from` a file has memory, and where that ends; `None` at the file's end.
fn extent(file: &File, from: u64) -> io::Result<Option<(u64, u64)>> {
    let begin = match seek(file, SeekFrom::Data(from)) {
        Err(rustix::io::Errno::NXIO) => return Ok(None),
        begin => begin?,
    };
    Ok(Some((begin, seek(file, SeekFrom::Hole(begin))?)))
}

/// Fills `bytes` from a place in a file, up to the file's end. How many.
fn read(file: &File, bytes: &mut [u8], at: u64) -> io::Result<usize> {
    let mut filled = 0;
    while let Some(rest) = bytes.get_mut(filled..).filter(|rest| !rest.is_empty()) {
        match file.read_at(rest, at + filled as u64) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}

/// The words with which the memory for a segment begins.
fn beginning(file: &File, from: u64) -> io::Result<Vec<u64>> {
    let mut bytes = vec![0; AHEAD];
    let count = read(file, &mut bytes, from)?;
    bytes.truncate(count);
    Ok(words(&bytes).collect())
}

/// The words that a sample has just before its segment's.
fn header(epoch: Epoch, index: u64) -> [u64; 2] {
    const _: () = assert!(size_of::<SegmentHeader>() == 2 * WORD);
    [epoch.0, index]
}

/// The first segment of a file in which a store has shown its graph.
fn first(file: &File) -> io::Result<Option<First>> {
    let words = beginning(file, 0)?;
    let found = words.windows(6).enumerate().find_map(|(at, window)| {
        // What is written into the arena's first words is in the file `arena/mod.rs`.
        let &[sample, index, magic, _, epoch, head] = window else {
            return None;
        };
        (magic == MAGIC && index == 0).then_some(First {
            // That of the sample: the arena's own is looked at when it is read.
            epoch: Epoch(sample),
            head: Version(head),
            start: ((at + 2) * WORD) as u64,
            is_whole: sample == epoch,
        })
    });
    Ok(found)
}

/// Where segment `index` begins, of which the segment before it ended at `end`.
fn next(file: &File, end: u64, epoch: Epoch, index: u64) -> io::Result<Option<u64>> {
    let mut from = end & !(WORD as u64 - 1);
    while let Some((begin, hole)) = extent(file, from)? {
        let words = beginning(file, begin)?;
        let sought = header(epoch, index);
        if let Some(at) = words.windows(2).position(|window| window == sought) {
            return Ok(Some(begin + ((at + 2) * WORD) as u64));
        }
        from = hole;
    }
    Ok(None)
}

/// The segment that begins at `start`.
fn segment(file: &File, start: u64) -> io::Result<Segment> {
    let segment = Segment::of_zeros(1 << SHIFT);
    let end = start + SEGMENT;
    let mut bytes = vec![0; PIECE];
    let mut from = start;
    while let Some((begin, hole)) = extent(file, from)?.filter(|(begin, _)| *begin < end) {
        // Where memory begins and ends is a page's edge, and a word's.
        let mut at = begin.max(start);
        let hole = hole.min(end);
        while at < hole {
            let length = PIECE.min((hole - at) as usize);
            let count = read(file, &mut bytes[..length], at)?;
            if count < WORD {
                break;
            }
            let place = ((at - start) as usize) / WORD;
            let target = segment.words().get(place..).unwrap_or(&[]);
            for (target, word) in target.iter().zip(words(&bytes[..count])) {
                target.store(word);
            }
            at += (count - count % WORD) as u64;
        }
        from = hole;
    }
    Ok(segment)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Graph, Schema, Time, Transaction};
    use proptest::prelude::*;

    /// A file that nobody else sees, as sparse as shared memory is.
    fn file() -> File {
        tempfile::tempfile_in(crate::shm::SHARED_MEMORY).unwrap()
    }

    fn put(file: &File, words: &[u64], at: u64) {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_ne_bytes()).collect();
        file.write_all_at(&bytes, at).unwrap();
    }

    fn orphan(file: &File) -> Option<First> {
        first(file).unwrap()
    }

    #[test]
    fn a_graph_is_found_behind_its_headers_wherever_they_are() {
        let mut graph = Graph::in_memory(Schema::open());
        let mut first = Transaction::new();
        first.create_node("thing", "a", Vec::new());
        graph.commit(&first, "tester", Time::default()).unwrap();
        let words = graph.words();
        let head = graph.snapshot().version();
        let epoch = graph.epoch();
        for start in [16, 256, 4096] {
            let file = file();
            file.set_len(start + SEGMENT).unwrap();
            assert_eq!(orphan(&file), None, "there is nothing yet");
            put(&file, &words, start);
            assert!(!orphan(&file).unwrap().is_whole, "no header is before it");
            put(&file, &header(epoch, 0), start - 16);
            let found = orphan(&file).unwrap();
            let expected = First {
                epoch,
                head,
                start,
                is_whole: true,
            };
            assert_eq!(found, expected);
            let arena = Arena::new(CAPACITY, SHIFT);
            arena.attach(0, segment(&file, start).unwrap());
            let snapshot = Snapshot::of_arena(Arc::new(arena)).unwrap();
            assert!(snapshot.find_node_by_name("a").unwrap().is_some());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn no_words_make_it_panic_or_go_on_for_ever(
            mut found in prop::collection::vec(any::<u64>(), 0..600),
            header in 0usize..600,
            index in 0u64..3,
        ) {
            let epoch = 7;
            for (word, value) in found.iter_mut().skip(header).zip([epoch, index, MAGIC]) {
                *word = value;
            }
            let file = file();
            put(&file, &found, 0);
            file.set_len(2 * SEGMENT).unwrap();
            if let Some(first) = first(&file).unwrap() {
                let arena = Arena::new(CAPACITY, SHIFT);
                arena.attach(0, segment(&file, first.start).unwrap());
                prop_assert!(Snapshot::of_arena(Arc::new(arena)).is_err());
            }
            next(&file, SEGMENT, Epoch(epoch), index).unwrap();
        }
    }

    #[test]
    fn the_segments_behind_the_first_are_found_by_their_headers() {
        let file = file();
        let epoch = Epoch(7);
        // As far apart as iceoryx2 lays them, and close together.
        let starts = [256, (2 << 30) + 320, (2 << 30) + 320 + SEGMENT + 64];
        file.set_len(8 << 30).unwrap();
        for (start, index) in starts.into_iter().zip(0..) {
            put(&file, &header(epoch, index), start - 16);
            put(&file, &[index + 40], start);
            put(&file, &[index + 50], start + SEGMENT - 8);
        }
        let mut start = starts[0];
        for (index, expected) in [(1, starts[1]), (2, starts[2])] {
            start = next(&file, start + SEGMENT, epoch, index).unwrap().unwrap();
            assert_eq!(start, expected);
            let segment = segment(&file, start).unwrap();
            let words = segment.words();
            assert_eq!(words.len(), 1 << SHIFT);
            assert_eq!(words.first().unwrap().load(), index + 40);
            assert_eq!(words.last().unwrap().load(), index + 50);
            assert_eq!(words[1].load(), 0);
        }
        assert_eq!(next(&file, start + SEGMENT, epoch, 3).unwrap(), None);
        assert_eq!(next(&file, starts[0], Epoch(8), 1).unwrap(), None);
    }
}
