//! By which session each agent commits, in a table of the arena's header. This file guarantees that a
//! reader which believes hot values of the session noted for an attribute's last writer believes
//! nobody whom the store did not let write it.
//!
//! A word is written and read by itself: who reads an older one finds an older page of the same agent.

use super::{Arena, Word, at};

/// How many agents' sessions are noted: of those that wrote first.
pub(super) const COUNT: usize = 1024;

impl Arena {
    fn session(&self, writer: u16) -> Option<&Word> {
        let place = usize::from(writer);
        (place < COUNT).then(|| self.header(at::SESSIONS + place))?
    }

    /// Notes by which session the agent of that number among the writers commits.
    pub(crate) fn set_session(&self, writer: u16, session: u64) {
        if let Some(word) = self.session(writer) {
            word.store(session);
        }
    }

    /// The session that was noted for an agent; 0 where none was.
    #[inline]
    pub(crate) fn session_of(&self, writer: u16) -> u64 {
        self.session(writer).map_or(0, Word::load)
    }

    /// Whether any agent commits by that session.
    pub(crate) fn has_session(&self, session: u64) -> bool {
        (0..COUNT as u16).any(|writer| self.session_of(writer) == session)
    }
}
