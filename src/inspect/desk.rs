//! The thread that looks at the graph: takes questions one after the other, and puts a frame together
//! in between where somebody listens. It guarantees that a session is only ever used by one thread.

use super::frame::Frames;
use super::look::{Looker, Source};
use crate::Failure;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;
use tokio::sync::{oneshot, watch};

/// The time between two frames at the least,
const PERIOD: Duration = Duration::from_millis(33);
/// and so many times as long as the last one took, so that a large graph does not take a processor.
const REST: u32 = 8;

/// What opens the graph, in the thread that looks at it.
pub(super) type Opener = Box<dyn FnOnce() -> Result<Source, Failure> + Send>;
type Job = Box<dyn FnOnce(&mut Looker) + Send>;

/// Where questions are handed in, and frames come out.
#[derive(Clone)]
pub(super) struct Desk {
    jobs: Sender<Job>,
    frames: watch::Receiver<Arc<str>>,
}

impl Desk {
    /// Starts the thread; what kept the graph from being opened is told.
    pub(super) fn open(opener: Opener) -> Result<Self, Failure> {
        let (jobs, taken) = channel();
        let (send, frames) = watch::channel(Arc::from(""));
        let (said, begun) = channel();
        let thread = std::thread::Builder::new().name("look".to_owned());
        let started = thread.spawn(move || match opener() {
            Ok(source) => {
                // Who asked waits for this.
                drop(said.send(Ok(())));
                work(&mut Looker::new(source), &taken, &send);
            }
            Err(failure) => drop(said.send(Err(failure))),
        });
        started.map_err(Failure::internal)?;
        match begun.recv() {
            Ok(opened) => opened.map(|()| Self { jobs, frames }),
            Err(_) => Err(Failure::internal(
                "the thread that looks at the graph ended",
            )),
        }
    }

    /// Has the thread do something; `None` where it has ended.
    pub(super) async fn ask<T: Send + 'static>(
        &self,
        job: impl FnOnce(&mut Looker) -> T + Send + 'static,
    ) -> Option<T> {
        let (reply, answer) = oneshot::channel();
        let job = Box::new(move |looker: &mut Looker| {
            // Who asked may have gone.
            drop(reply.send(job(looker)));
        });
        self.jobs.send(job).ok()?;
        answer.await.ok()
    }

    /// The frames from now on.
    pub(super) fn frames(&self) -> watch::Receiver<Arc<str>> {
        self.frames.clone()
    }
}

fn work(looker: &mut Looker, jobs: &Receiver<Job>, send: &watch::Sender<Arc<str>>) {
    let mut frames: Option<Frames> = None;
    let mut due = crate::supervise::now();
    loop {
        let wait = due.saturating_duration_since(crate::supervise::now());
        match jobs.recv_timeout(wait) {
            Ok(job) => {
                job(looker);
                continue;
            }
            Err(RecvTimeoutError::Disconnected) => return,
            Err(RecvTimeoutError::Timeout) => {}
        }
        let began = crate::supervise::now();
        due = (due + PERIOD).max(began);
        // The desk itself holds one.
        if send.receiver_count() < 2 {
            frames = None;
            continue;
        }
        match tell(looker, &mut frames) {
            Ok(Some(frame)) => drop(send.send(frame)),
            Ok(None) => {}
            Err(failure) => tracing::debug!("{:?}", failure.into_report()),
        }
        let taken = crate::supervise::now().saturating_duration_since(began);
        due = due.max(began + REST * taken);
    }
}

fn tell(looker: &mut Looker, frames: &mut Option<Frames>) -> Result<Option<Arc<str>>, Failure> {
    if frames.is_none() {
        *frames = Frames::follow(looker)?;
    }
    let Some(following) = frames else {
        return Ok(None);
    };
    let frame = following.next(looker)?;
    Ok(frame.map(|frame| frame.to_string().into()))
}
