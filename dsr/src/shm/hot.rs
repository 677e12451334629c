//! Pages of hot attributes between processes: every owner publishes one, every session sees all. It
//! guarantees that an owner that dies, stops or comes again holds nobody up, and that what is read of
//! its page was written so.

use super::arena::Current;
use super::page::{OwnPage, Pages};
use super::{InstanceError, IpcNode, MAX_PROCESSES};
use crate::arena::{Arena, Word};
use crate::hot::{self, PAGE_WORDS, Page};
use crate::{AttributeId, Epoch, Owner, SchemaError, Time, Transaction, Value};
use std::sync::Arc;
use thiserror::Error;

/// Why an attribute cannot be written hot.
#[derive(Debug, Error)]
pub enum HotError {
    /// The schema does not have the attribute, or not with this value.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// The schema does not say that it is hot.
    #[error("`{attribute}` is not hot: give it `hot = RATE` in the schema, or commit it")]
    NotHot {
        /// The attribute.
        attribute: String,
    },
    /// The graph does not have the node or the edge, or that has no such attribute yet.
    #[error("there is no `{attribute}` of {owner}: commit its first value")]
    NotFound {
        /// The attribute.
        attribute: String,
        /// Of what.
        owner: Owner,
    },
    /// The session has as many hot attributes as there can be.
    #[error("a session can have {} hot attributes", hot::SLOTS)]
    Full,
    /// The store does not let this agent write the attribute, or did not answer.
    #[error(transparent)]
    Commit(#[from] super::CommitError),
    /// The instance or its graph cannot be used.
    #[error(transparent)]
    Attach(#[from] super::AttachError),
}

impl From<InstanceError> for HotError {
    fn from(error: InstanceError) -> Self {
        Self::Attach(error.into())
    }
}

const HOT: &str = "graph/hot";

/// A page for the hot attributes of that session.
pub(super) fn page(node: &IpcNode, session: u64) -> Result<OwnPage, InstanceError> {
    let format = |words: &[Word]| hot::format(words, session);
    OwnPage::open(node, HOT, PAGE_WORDS, format)
}

/// An attribute that this process owns and writes as often as it likes, see
/// [`Session::hot`](super::Session::hot).
#[derive(Debug)]
pub struct HotAttribute {
    pub(super) page: Arc<OwnPage>,
    pub(super) slot: usize,
    pub(super) owner: Owner,
    pub(super) name: String,
    pub(super) schema: Arc<crate::Schema>,
    pub(super) attribute: AttributeId,
    pub(super) current: Current,
    /// Seconds between foldings.
    pub(super) interval: f64,
    pub(super) folded: Option<Time>,
    pub(super) last: Option<(Value, Time)>,
    pub(super) scratch: Vec<u64>,
}

impl HotAttribute {
    /// Gives out a value: whoever reads the attribute from now on reads this. It takes no message
    /// and waits for nobody.
    ///
    /// # Errors
    /// [`HotError::Schema`] where the schema forbids the value.
    pub fn set(&mut self, value: impl Into<Value>, time: Time) -> Result<(), HotError> {
        let value = value.into();
        self.schema.check_value(self.attribute, &value)?;
        let epoch = self.current.epoch().unwrap_or(Epoch(0));
        let written = (&value, time.nanoseconds());
        hot::write(
            self.page.words(),
            self.slot,
            epoch,
            written,
            &mut self.scratch,
        );
        self.page.serve_newcomers();
        self.last = Some((value, time));
        Ok(())
    }

    /// Adds the last value to a transaction that the owner is about to commit, where the rate that
    /// the schema gives says that it is time to fold it into the graph. Whether it did.
    pub fn fold_into(&mut self, transaction: &mut Transaction) -> bool {
        let Some((value, time)) = &self.last else {
            return false;
        };
        let due = self
            .folded
            .is_none_or(|before| time.seconds() - before.seconds() >= self.interval - 1e-9);
        if due && self.folded != Some(*time) {
            self.folded = Some(*time);
            transaction.push(crate::Operation::SetAttribute {
                owner: self.owner.clone(),
                name: self.name.clone(),
                value: value.clone(),
            });
            return true;
        }
        false
    }
}

/// The pages of all owners, as a session sees them.
#[derive(Debug)]
pub(super) struct HotSubscriber {
    arriving: Pages,
    pages: Arc<Vec<Page>>,
}

impl HotSubscriber {
    pub(super) fn open(node: &IpcNode) -> Result<Self, InstanceError> {
        Ok(Self {
            arriving: Pages::open(node, HOT)?,
            pages: Arc::default(),
        })
    }

    /// The pages that have come at the last [`Self::poll`]; `None` where there are none.
    pub(super) fn pages(&self) -> Option<Arc<Vec<Page>>> {
        (!self.pages.is_empty()).then(|| Arc::clone(&self.pages))
    }

    /// Takes what has come; the arena says which of it matters.
    pub(super) fn poll(&mut self, arena: Option<&Arena>) -> Result<(), InstanceError> {
        while let Some(segment) = self.arriving.receive()? {
            let Some(session) = hot::session_of(segment.words()) else {
                continue;
            };
            let segment = Arc::new(segment);
            let mut pages = Vec::clone(&self.pages);
            pages.push(Page { session, segment });
            if pages.len() > MAX_PROCESSES {
                // Of sessions that have ended; but what a dead owner gave out last stands.
                let stands = |page: &Page| arena.is_some_and(|a| a.has_session(page.session));
                let needless = pages.iter().position(|page| !stands(page));
                pages.remove(needless.unwrap_or(0));
            }
            self.pages = Arc::new(pages);
        }
        Ok(())
    }
}
