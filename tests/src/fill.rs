//! A process that fills the shared memory of its host until nothing goes in any more: it must be told
//! so, each time, and go on.

use super::{Outcome, PATIENCE};
use dsr::{Instance, InstanceError, Schema, Session, Store, Time, Transaction, Value};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Fills the shared memory: by nodes, then with a file of somebody else's; both must be refusals.
pub(super) fn fill(instance: &Instance) -> Outcome {
    let mut store = Store::open(instance, Schema::open())?;
    let done = Arc::new(AtomicBool::new(false));
    let asking = {
        let (instance, done) = (instance.clone(), Arc::clone(&done));
        std::thread::spawn(move || {
            let outcome = fill_up(&instance).map_err(|error| error.to_string());
            done.store(true, Ordering::Release);
            outcome
        })
    };
    while !done.load(Ordering::Acquire) {
        store.serve(Duration::from_millis(5))?;
    }
    asking.join().map_err(|_| "the client panicked")??;
    drop(store);
    instance.remove()?;
    Ok(())
}

/// A node of a megabyte.
fn large(name: &str) -> Transaction {
    let mut transaction = Transaction::new();
    let bytes = Value::U8List(vec![1; 1 << 20]);
    transaction.create_node("thing", name, vec![("bytes".into(), bytes)]);
    transaction
}

fn fill_up(instance: &Instance) -> Outcome {
    let mut session = Session::attach(instance, "filler", PATIENCE)?;
    let sender = session.publisher::<Vec<u8>>("large")?;
    let mut count = 0;
    loop {
        match session.commit(&large(&format!("n{count}")), Time::default()) {
            Ok(_) => count += 1,
            Err(dsr::CommitError::Refused(dsr::Refusal::OutOfMemory { .. })) => break,
            Err(other) => return Err(other.into()),
        }
        if count > 100 {
            return Err("it never is full".into());
        }
    }
    if count < 20 || session.snapshot()?.node_count() != count {
        return Err(format!("full after {count}").into());
    }
    println!("full by the graph");
    // Somebody else takes all that is left.
    let other = "/dev/shm/somebody-else";
    let mut file = std::fs::File::create(other)?;
    while std::io::Write::write(&mut file, &[1; 4096]).is_ok_and(|n| n > 0) {}
    for i in 0..200 {
        let mut transaction = Transaction::new();
        transaction.create_node("thing", &format!("m{i}"), vec![]);
        transaction.set("n0", "x", f64::from(i));
        match session.commit(&transaction, Time::default()) {
            Ok(_) | Err(dsr::CommitError::Refused(dsr::Refusal::OutOfMemory { .. })) => {}
            Err(other) => return Err(other.into()),
        }
        session.snapshot()?.node_count();
    }
    println!("full by others");
    let late = match session.commit(&large("late"), Time::default()) {
        Err(dsr::CommitError::Attach(dsr::AttachError::Instance(error))) => Err(error),
        other => return Err(format!("{other:?}").into()),
    };
    for attempt in [
        late,
        Session::join(instance, "late").map(|_| ()),
        session.subscriber::<u64>("late").map(|_| ()),
        sender.send(&vec![1; 1 << 20]),
    ] {
        match attempt {
            Err(InstanceError::Full { .. }) => {}
            other => return Err(format!("{other:?}").into()),
        }
    }
    println!("nobody joins");
    drop(file);
    std::fs::remove_file(other)?;
    let mut transaction = Transaction::new();
    for i in 0..10 {
        transaction.delete_node(format!("n{i}"));
    }
    session.commit(&transaction, Time::default())?;
    session.commit(&large("again"), Time::default())?;
    println!("room again");
    Ok(())
}
