//! A laser's scans in the graph: one session gives them out, another reads them in place.
//!
//! `cargo run -p dsr --example scan`; it brings a store of its own.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout, reason = "what it found is its result")]

use dsr::{
    Instance, LargeAttribute, Owner, Schema, Session, Store, StoreError, Time, Transaction, Value,
};
use std::error::Error;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const SCHEMA: &str = r#"
[types]
robot = []
[labels]
[attributes]
scan = { kind = "large", of = "f32", unit = "m", max_bytes = 65536 }
"#;

/// The laser's part.
fn give_out(
    ranges: &[f32],
    scans: &mut LargeAttribute,
    session: &mut Session,
) -> Result<(), Box<dyn Error>> {
    let mut loan = scans.loan(size_of_val(ranges))?;
    let numbers = loan.numbers_mut::<f32>().ok_or("no whole numbers")?;
    numbers.copy_from_slice(ranges);
    let mut transaction = Transaction::new();
    loan.send_into(&mut transaction, &[ranges.len() as u32])?;
    session.commit(&transaction, Time::default())?;
    Ok(())
}

/// Anybody's part: the least range of the newest scan.
fn nearest(session: &mut Session) -> Result<f32, Box<dyn Error>> {
    let snapshot = session.snapshot()?;
    let robot = snapshot.find_node_by_name("robot")?.ok_or("no robot")?;
    let scan = robot.value("scan")?;
    let handle = scan.as_ref().and_then(Value::as_large).ok_or("no scan")?;
    let sample = session.read_large(handle, Duration::ZERO)?;
    let ranges: &[f32] = sample.numbers().ok_or("no whole numbers")?;
    Ok(ranges.iter().copied().fold(f32::INFINITY, f32::min))
}

fn serve(mut store: Store, ended: &AtomicBool) -> Result<(), StoreError> {
    while !ended.load(Ordering::Acquire) {
        store.serve(Duration::from_millis(5))?;
    }
    Ok(())
}

fn run(instance: &Instance) -> Result<(), Box<dyn Error>> {
    let mut laser = Session::attach(instance, "laser", Duration::from_secs(20))?;
    let mut reader = Session::attach(instance, "reader", Duration::from_secs(20))?;
    let mut scans = laser.large(Owner::Node("robot".into()), "scan")?;
    for turn in 1..=3 {
        let ranges = vec![turn as f32; 720];
        give_out(&ranges, &mut scans, &mut laser)?;
        match nearest(&mut reader) {
            Ok(range) => println!("turn {turn}: nothing is nearer than {range} m"),
            Err(error) => println!("turn {turn}: {error}"),
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let instance = Instance::new(&format!("scan-{}", std::process::id()))?;
    let mut store = Store::open(&instance, Schema::from_toml("schema.toml", SCHEMA)?)?;
    let mut transaction = Transaction::new();
    transaction.create_node("robot", "robot", vec![]);
    store.commit(&transaction, Time::default())?;
    let ended = AtomicBool::new(false);
    let (ran, served) = std::thread::scope(|scope| {
        let serving = scope.spawn(|| serve(store, &ended));
        let ran = run(&instance).map_err(|error| error.to_string());
        ended.store(true, Ordering::Release);
        (ran, serving.join())
    });
    served.map_err(|_| "the store panicked")??;
    instance.remove()?;
    Ok(ran?)
}
