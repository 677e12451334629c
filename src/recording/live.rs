//! Playing a recording as a running system: a store of its own, and a session for each agent that
//! committed, so that every commit is by whom it was. It guarantees that its store has ended when it is
//! dropped.

use super::play::Target;
use super::read::PlayError;
use super::replayed::RecordedRules;
use dsr::{
    Image, Instance, Schema, Session, Snapshot, Store, StoreError, Time, Transaction, Version,
};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// How long the store may take to show its graph.
const PATIENCE: Duration = Duration::from_secs(5);
/// How long the store waits for requests before it looks whether it shall end.
const LOOK: Duration = Duration::from_millis(25);
/// No agent may go by the store's own name.
const STORE: &str = "store";

/// A running system that a recording is played into.
pub(crate) struct Live {
    instance: Instance,
    sessions: BTreeMap<String, Session>,
    store: Option<StoreThread>,
}

struct StoreThread {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for StoreThread {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // It says by itself what went wrong.
            drop(thread.join());
        }
    }
}

impl StoreThread {
    fn start(instance: &Instance, image: &Image) -> Result<Self, StoreError> {
        let stop = Arc::new(AtomicBool::new(false));
        let (said, begun) = channel();
        let thread = {
            let (instance, image, stop) = (instance.clone(), image.clone(), Arc::clone(&stop));
            std::thread::Builder::new()
                .name("store".to_owned())
                .spawn(move || serve(&instance, &image, &stop, &said))
        };
        let thread = Some(thread.map_err(StoreError::Thread)?);
        let started = Self { stop, thread };
        // A store that ended before it said anything has said why.
        begun.recv().unwrap_or(Ok(())).map(|()| started)
    }
}

fn serve(
    instance: &Instance,
    image: &Image,
    stop: &AtomicBool,
    said: &Sender<Result<(), StoreError>>,
) {
    let opened = Store::open(instance, Schema::open()).and_then(|mut store| {
        store.graph_mut().set_rules(Arc::new(RecordedRules));
        store.restore(image)?;
        store.serve(Duration::ZERO)?;
        Ok(store)
    });
    let mut store = match opened {
        Ok(store) => store,
        Err(error) => {
            // Who asked may have gone.
            drop(said.send(Err(error)));
            return;
        }
    };
    drop(said.send(Ok(())));
    while !stop.load(Ordering::Acquire) {
        if let Err(error) = store.serve(LOOK) {
            tracing::error!("{error}");
            return;
        }
    }
}

impl Live {
    /// For an instance that is not running.
    pub(crate) fn new(instance: Instance) -> Self {
        Self {
            instance,
            sessions: BTreeMap::new(),
            store: None,
        }
    }

    fn session(&mut self, agent: &str) -> Result<&mut Session, PlayError> {
        let name = if agent == STORE {
            "store-recorded"
        } else {
            agent
        };
        match self.sessions.entry(name.to_owned()) {
            Entry::Occupied(known) => Ok(known.into_mut()),
            Entry::Vacant(place) => {
                let session = Session::attach(&self.instance, name, PATIENCE)?;
                Ok(place.insert(session))
            }
        }
    }
}

impl Target for Live {
    fn snapshot(&mut self) -> Result<Snapshot, PlayError> {
        Ok(self.session("replay")?.snapshot()?)
    }

    fn restore(&mut self, image: &Image) -> Result<(), PlayError> {
        // As where a store died: the next one has another graph, and sessions find it by themselves.
        self.store = None;
        self.store = Some(StoreThread::start(&self.instance, image)?);
        self.sessions.clear();
        Ok(())
    }

    fn commit(
        &mut self,
        transaction: &Transaction,
        agent: &str,
        time: Time,
        version: u64,
    ) -> Result<Version, PlayError> {
        let commit = self.session(agent)?.commit(transaction, time);
        let made = commit.map_err(|source| PlayError::Commit { version, source })?;
        Ok(made.version)
    }
}
