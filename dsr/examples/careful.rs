//! An agent of one's own: while anybody is near the robot, it may go at half its speed at most.
//!
//! Start a scenario, and then in a second terminal `cargo run -p dsr --example careful`.
#![forbid(unsafe_code)]

use dsr::{Instance, Pace, Session, Transaction, Turns};
use std::error::Error;
use std::sync::Arc;
use std::time::Duration;

const FAST: f64 = 0.7;
const CAREFUL: f64 = 0.35;

fn main() -> Result<(), Box<dyn Error>> {
    let name = std::env::args().nth(1).unwrap_or("default".to_owned());
    let instance = Instance::new(&name)?;
    let mut session = Session::attach(&instance, "careful", Duration::from_secs(20))?;
    let mut turns = Turns::begin(Pace::Alone, Arc::default())?;
    while let Some(tick) = turns.next(&mut session)? {
        let snapshot = session.snapshot()?;
        let near = snapshot.schema().label_id("is_near")?;
        let allowed = match snapshot.edges_of_label(near).next().transpose()? {
            Some(_) => CAREFUL,
            None => FAST,
        };
        let Some(robot) = snapshot.find_node_by_name("robot")? else {
            continue;
        };
        if robot.value("max_speed")? != Some(allowed.into()) {
            let mut transaction = Transaction::new();
            transaction.set("robot", "max_speed", allowed);
            session.submit(&transaction, tick.time)?;
        }
    }
    Ok(())
}
