//! The world as a process: keeps the clock, senses for the agents, and moves the robot as they
//! command. It guarantees that a tick is announced only after everything measured in it was sent.

use crate::world::{Inputs, Truth, World};
use agents::messages::{
    CameraFrame, DETECTIONS, LASER, LaserScan, ODOMETRY, Odometry, SPEECH, Speech, VELOCITY,
    VelocityCommand,
};
use dsr::{Begin, InstanceError, Publisher, Session, Subscriber, Tick, Time, TurnError};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Channel of [`Truth`], for reports only.
pub const TRUTH: &str = "truth";
/// Simulated seconds from one tick to the next.
pub const TICK: f64 = 0.05;

/// Why the world cannot go on.
#[derive(Debug, Error)]
pub enum ProcessError {
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// The supervisor cannot be followed.
    #[error(transparent)]
    Turn(#[from] TurnError),
}

/// The world's channels.
struct Ports {
    frames: Publisher<CameraFrame>,
    scans: Publisher<LaserScan>,
    odometry: Publisher<Odometry>,
    truth: Publisher<Truth>,
    velocity: Subscriber<VelocityCommand>,
    speech: Subscriber<Speech>,
}

impl Ports {
    fn open(session: &Session) -> Result<Self, InstanceError> {
        Ok(Self {
            frames: session.publisher(DETECTIONS)?,
            scans: session.publisher(LASER)?,
            odometry: session.publisher(ODOMETRY)?,
            truth: session.publisher(TRUTH)?,
            velocity: session.subscriber(VELOCITY)?,
            speech: session.subscriber(SPEECH)?,
        })
    }

    /// Moves the world on by a tick and sends what its sensors measure.
    fn step(&mut self, world: &mut World) -> Result<(), InstanceError> {
        let inputs = Inputs {
            velocity: self.velocity.newest()?,
            speech: self.speech.drain()?,
        };
        let outputs = world.step(TICK, &inputs);
        for frame in &outputs.frames {
            self.frames.send(frame)?;
        }
        if let Some(scan) = &outputs.scan {
            self.scans.send(scan)?;
        }
        if let Some(odometry) = &outputs.odometry {
            self.odometry.send(odometry)?;
        }
        self.truth.send(&outputs.truth)
    }
}

/// When tick `index` of a world that began at `start` is.
pub fn tick_time(start: Time, index: u64) -> Time {
    start + index as f64 * TICK
}

/// Runs the world until it shall end: `speed` simulated seconds per second where it keeps the
/// clock, or as it is told in lockstep.
///
/// # Errors
/// [`ProcessError`].
#[allow(
    clippy::disallowed_methods,
    reason = "the world's process is the clock of its instance"
)]
pub fn run(
    mut session: Session,
    begin: Begin,
    mut world: World,
    speed: f64,
) -> Result<(), ProcessError> {
    let mut ports = Ports::open(&session)?;
    let announce = session.clock()?;
    let mut turns = begin()?;
    if turns.in_lockstep() {
        while turns.next(&mut session)?.is_some() {
            ports.step(&mut world)?;
        }
        return Ok(());
    }
    let period = Duration::from_secs_f64(TICK / speed);
    let mut due = Instant::now();
    let mut index = 0;
    while !turns.ended() {
        ports.step(&mut world)?;
        index += 1;
        announce(Tick {
            index,
            time: world.time(),
        })?;
        // Where the machine is too slow for the speed, time is lost, not caught up in a rush.
        due = (due + period).max(Instant::now().checked_sub(period).unwrap_or(due));
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }
    Ok(())
}
