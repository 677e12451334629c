//! How a process of an instance lives: it joins, takes turns, and ends when its supervisor does.
//! This file owns the protocol between a supervisor and its processes, and guarantees that a
//! process whose supervisor is gone ends by itself.
//!
//! A process says `ready` on its standard output when it has joined. Its standard input is its
//! lifeline: when that ends, the process ends. Running free, it takes a turn at each tick of the
//! world's clock. In lockstep it takes a turn for each line `turn INDEX NANOSECONDS` on its input,
//! and says `done INDEX` when everything it did in it has been done.

use crate::{ClockError, Session, Tick, Time};
use std::io::{BufRead, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Duration;
use thiserror::Error;

/// Who decides when a process takes its turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// The world's clock, with nobody on standard input: the process ends by a signal.
    Alone,
    /// The world's clock; a process that is slow misses ticks.
    Free,
    /// The supervisor, one process after the other, so that a run can be repeated to the bit.
    Lockstep,
}

/// Why a process cannot take turns.
#[derive(Debug, Error)]
pub enum TurnError {
    /// The clock cannot be heard.
    #[error(transparent)]
    Clock(#[from] ClockError),
    /// The supervisor cannot be spoken to.
    #[error("cannot speak to the supervisor: {0}")]
    Supervisor(#[from] std::io::Error),
    /// The supervisor said something else than `turn INDEX NANOSECONDS`.
    #[error("the supervisor said `{0}`, which is no turn")]
    BadTurn(String),
}

/// Says that the process is ready, and gives its turns: to be called when all that a turn needs is
/// open, so that nothing that is sent in the first turn is missed.
pub type Begin = Box<dyn FnOnce() -> Result<Turns, TurnError>>;

/// What a supervisor says to give a process its turn.
pub fn turn_line(tick: Tick) -> String {
    format!("turn {} {}\n", tick.index, tick.time.nanoseconds())
}

/// What a process says when it has taken its turn.
pub fn done_line(index: u64) -> String {
    format!("done {index}\n")
}

fn parse_turn(line: &str) -> Option<Tick> {
    let mut words = line.strip_prefix("turn ")?.split(' ');
    let index = words.next()?.parse().ok()?;
    let time = Time::from_nanoseconds(words.next()?.parse().ok()?);
    words.next().is_none().then_some(Tick { index, time })
}

/// A process's turns.
#[derive(Debug)]
pub struct Turns {
    pace: Pace,
    lines: Receiver<String>,
    stop: Arc<AtomicBool>,
    taking: Option<u64>,
}

impl Turns {
    /// Says `ready`, and takes turns at that pace from now on, until `stop` is set (by a signal,
    /// say). To be called once, after everything that a turn needs is open.
    ///
    /// # Errors
    /// [`TurnError::Supervisor`].
    pub fn begin(pace: Pace, stop: Arc<AtomicBool>) -> Result<Self, TurnError> {
        let (send, lines) = channel();
        if pace == Pace::Alone {
            return Ok(Self {
                pace,
                lines,
                stop,
                taking: None,
            });
        }
        std::thread::Builder::new()
            .name("lifeline".to_owned())
            .spawn(move || {
                for line in std::io::stdin().lock().lines() {
                    let Ok(line) = line else { return };
                    if send.send(line).is_err() {
                        return;
                    }
                }
            })?;
        say("ready\n")?;
        Ok(Self {
            pace,
            lines,
            stop,
            taking: None,
        })
    }

    /// Waits for the next turn; `None` when the process shall end.
    ///
    /// # Errors
    /// [`TurnError`].
    pub fn next(&mut self, session: &mut Session) -> Result<Option<Tick>, TurnError> {
        match self.pace {
            Pace::Alone | Pace::Free => loop {
                if self.ended() {
                    return Ok(None);
                }
                if let Some(tick) = session.wait_for_tick(Duration::from_millis(50))? {
                    return Ok(Some(tick));
                }
            },
            Pace::Lockstep => {
                if let Some(index) = self.taking.take() {
                    say(&done_line(index))?;
                }
                let Ok(line) = self.lines.recv() else {
                    return Ok(None);
                };
                let tick = parse_turn(&line).ok_or(TurnError::BadTurn(line))?;
                self.taking = Some(tick.index);
                Ok(Some(tick))
            }
        }
    }

    /// Whether a supervisor gives the turns.
    pub fn in_lockstep(&self) -> bool {
        self.pace == Pace::Lockstep
    }

    /// Whether the process shall end; for processes that take no turns.
    pub fn ended(&mut self) -> bool {
        if self.stop.load(Ordering::Acquire) {
            return true;
        }
        if self.pace == Pace::Alone {
            return false;
        }
        loop {
            match self.lines.try_recv() {
                Ok(_) => {}
                Err(TryRecvError::Empty) => return false,
                Err(TryRecvError::Disconnected) => return true,
            }
        }
    }
}

fn say(line: &str) -> std::io::Result<()> {
    let mut output = std::io::stdout().lock();
    output.write_all(line.as_bytes())?;
    output.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_is_read_as_it_was_said() {
        let tick = Tick {
            index: 7,
            time: Time::from_seconds(12.25),
        };
        assert_eq!(parse_turn(turn_line(tick).trim_end()), Some(tick));
        for bad in ["turn", "turn 1", "turn 1 x", "turn 1 2 3", "end"] {
            assert_eq!(parse_turn(bad), None, "{bad}");
        }
    }
}
