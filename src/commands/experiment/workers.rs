//! Many drives at a time. This file guarantees that what comes back is in the order asked for, whoever was
//! done first.

use crate::Failure;
use crate::progress::Progress;
use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;

/// What `job` gives for each number below `count`, on as many threads as there are processors. After a failure
/// no other job is begun.
pub(super) fn each<T: Send>(
    count: usize,
    progress: &Progress,
    job: impl Fn(usize) -> Result<T, Failure> + Sync,
) -> Result<Vec<T>, Failure> {
    let next = AtomicUsize::new(0);
    let (sender, receiver) = mpsc::channel();
    let workers = thread::available_parallelism().map_or(1, NonZero::get);
    let mut done: Vec<Option<T>> = (0..count).map(|_| None).collect();
    thread::scope(|scope| {
        for _ in 0..workers.min(count) {
            let (job, next, sender) = (&job, &next, sender.clone());
            scope.spawn(move || {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= count || sender.send((index, job(index))).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        for (so_far, (index, outcome)) in receiver.iter().enumerate() {
            done[index] = Some(outcome.inspect_err(|_| next.store(count, Ordering::Relaxed))?);
            progress.count(so_far + 1, count);
        }
        Ok::<_, Failure>(())
    })?;
    Ok(done.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_is_done_in_order_and_a_failure_ends_it() {
        let quiet = Progress::new("test", true);
        let squares = each(100, &quiet, |index| Ok(index * index)).unwrap();
        assert_eq!(squares, (0..100).map(|k| k * k).collect::<Vec<_>>());
        let failed = each(100, &quiet, |index| match index {
            7 => Err(Failure::internal("seven")),
            _ => Ok(index),
        });
        assert!(failed.is_err());
    }
}
