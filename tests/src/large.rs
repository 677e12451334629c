//! Roles of the tests of large values.

use crate::{Outcome, PATIENCE, end_of_input};
use dsr::{Instance, LargeAttribute, Manifest, Owner, Schema, Session, Store, Time, Transaction};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Numbers of a picture.
const ROWS: u32 = 64;
const COLUMNS: u32 = 128;

/// A store whose graph has a camera, which may have a `picture`; `camera` may write it, `tool` all.
pub(crate) fn store(instance: &Instance) -> Outcome {
    let text = "[types]\ncamera = []\n[labels]\n[attributes]\n\
        picture = { kind = \"large\", of = \"u64\", max_bytes = 65536 }\n";
    let schema = Schema::from_toml("test", text)?;
    let manifest = "agent = \"camera\"\nattributes = [\"camera.picture\"]\n";
    let manifests = [
        Manifest::from_toml("camera.toml", manifest, &schema)?,
        Manifest::everything("store"),
        Manifest::everything("tool"),
    ];
    let mut store = Store::open(instance, schema)?;
    let mut transaction = Transaction::new();
    transaction.create_node("camera", "camera", vec![]);
    store.commit(&transaction, Time::default())?;
    store.graph_mut().set_rights(manifests);
    println!("ready");
    let ended = end_of_input();
    while !ended.load(Ordering::Acquire) {
        store.serve(Duration::from_millis(20))?;
    }
    Ok(())
}

fn picture(attribute: &mut LargeAttribute, n: u64) -> Result<Transaction, dsr::LargeError> {
    let mut transaction = Transaction::new();
    let mut loan = attribute.loan((ROWS * COLUMNS) as usize * size_of::<u64>())?;
    if let Some(numbers) = loan.numbers_mut() {
        numbers.fill(n);
    }
    loan.send_into(&mut transaction, &[ROWS, COLUMNS])?;
    Ok(transaction)
}

/// Takes one picture after the other, each full of its own number, from 1; says how many at the end.
pub(crate) fn camera(instance: &Instance) -> Outcome {
    let mut session = Session::attach(instance, "camera", PATIENCE)?;
    let mut attribute = session.large(Owner::Node("camera".into()), "picture")?;
    println!("ready");
    let ended = end_of_input();
    let mut n = 0;
    while !ended.load(Ordering::Acquire) {
        n += 1;
        let transaction = picture(&mut attribute, n)?;
        session.commit(&transaction, Time::from_nanoseconds(n.cast_signed()))?;
    }
    println!("{n}");
    Ok(())
}

/// Takes one picture, and goes on without another.
pub(crate) fn still(instance: &Instance) -> Outcome {
    let mut session = Session::attach(instance, "camera", PATIENCE)?;
    let mut attribute = session.large(Owner::Node("camera".into()), "picture")?;
    let transaction = picture(&mut attribute, 1)?;
    session.commit(&transaction, Time::default())?;
    println!("ready");
    let ended = end_of_input();
    while !ended.load(Ordering::Acquire) {
        session.snapshot()?;
        session.wait_for_tick(Duration::from_millis(1))?;
    }
    Ok(())
}

/// Looks at the pictures as they come and holds the last few, until it is told to end.
pub(crate) fn watch(instance: &Instance) -> Outcome {
    let mut session = Session::attach(instance, "watcher", PATIENCE)?;
    let ended = end_of_input();
    let mut held = std::collections::VecDeque::new();
    let mut seen = 0;
    while !ended.load(Ordering::Acquire) {
        let snapshot = session.snapshot()?;
        let camera = snapshot.find_node_by_name("camera")?.ok_or("no camera")?;
        let value = camera.value("picture")?;
        let Some(handle) = value.as_ref().and_then(dsr::Value::as_large) else {
            continue;
        };
        let Ok(sample) = session.read_large(handle, Duration::ZERO) else {
            continue;
        };
        seen += 1;
        if seen == 1 {
            println!("ready");
        }
        held.push_back(sample);
        if held.len() > 7 {
            held.pop_front();
        }
    }
    println!("{seen}");
    Ok(())
}
