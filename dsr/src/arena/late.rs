//! What a version's root says beside its trie and its tree of answers: the record of one node and one
//! client's last transaction, which those have only in later versions. So a small commit is published
//! before the ways to what it changed are copied. This file guarantees that who looks for a node
//! through it finds the record that belongs to the root's version.
//!
//! The trie always has the node, if with an older record: only what leads to it is late.

use super::{Address, Arena, Root, Word, trie};

/// The node's id and its record's words, where a root has a late node; `Err` where it leads to an
/// impossible place.
pub(crate) fn node<'a>(
    arena: &'a Arena,
    root: &Root,
) -> Result<Option<(u64, &'a [Word])>, Address> {
    if root.late_node == 0 {
        return Ok(None);
    }
    let words = arena.from(root.late_node).ok_or(root.late_node)?;
    let id = words.first().ok_or(root.late_node)?.load();
    Ok(Some((id, words)))
}

/// The record of node `id`; `Err` where the root leads to an impossible place.
pub(crate) fn find(arena: &Arena, root: &Root, id: u64) -> Result<Option<Address>, Address> {
    match node(arena, root)? {
        Some((late, _)) if late == id => Ok(Some(root.late_node)),
        _ => trie::find(arena, root.nodes, id),
    }
}

/// Walks all nodes by ascending id: where each lies, and its words.
#[derive(Debug)]
pub(crate) struct Walk {
    trie: trie::Walk,
    root: Root,
}

impl Walk {
    pub(crate) fn new(root: Root) -> Self {
        let trie = trie::Walk::new(root.nodes);
        Self { trie, root }
    }

    /// The next node; `Err` where the root leads to an impossible place.
    pub(crate) fn next<'a>(
        &mut self,
        arena: &'a Arena,
    ) -> Result<Option<(Address, &'a [Word])>, Address> {
        let Some((address, words)) = self.trie.next(arena)? else {
            return Ok(None);
        };
        let id = words.first().map(Word::load);
        Ok(Some(match node(arena, &self.root)? {
            Some((late, there)) if Some(late) == id => (self.root.late_node, there),
            _ => (address, words),
        }))
    }
}
