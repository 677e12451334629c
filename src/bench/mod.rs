//! Measuring what Cortex is made of: the shared graph beside raw iceoryx2 and a copy on the heap, the
//! planner from text to plan, rules beside other matchers, social maps beside numpy, path search beside
//! others, tracking beside the time of a frame. It guarantees that a figure and the one it is compared
//! with come from the same run, taken in turns where both are short.
//!
//! Who measures the graph starts a store and peers by executing the program again, in an instance of
//! its own, and ends and removes all of them.

#![allow(
    clippy::disallowed_methods,
    reason = "measuring takes the host's clock"
)]

mod beside;
mod chance;
mod commits;
mod figure;
mod hall;
mod indoor;
mod inspector;
mod path;
mod peer;
mod perception;
mod plan;
mod quantity;
mod reads;
mod replan;
mod replica;
mod rules;
mod social;
mod whole;

pub(crate) use chance::Chance;
pub(crate) use figure::{Figure, table};
pub(crate) use path::paths;
pub(crate) use peer::play;
pub(crate) use perception::perception;
pub(crate) use plan::plans;
pub(crate) use quantity::{Quantity, table as quantities_table};
pub(crate) use rules::rules;
pub(crate) use social::social;

use crate::Failure;
use hall::Hall;
use std::time::Duration;

/// Nodes of the graph that is read and written.
const NODES: u64 = 10_000;
/// Nodes of the graph that is joined.
const MANY: u64 = 100_000;
/// What a process may take for what it is asked to do.
const PATIENCE: Duration = Duration::from_mins(1);

/// How much is measured.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    /// Turns that ours and the peer take.
    turns: usize,
    /// Commits of which is measured when they are seen.
    stamps: u64,
    /// Requests that are sent flat out.
    batches: u64,
    /// Processes that join.
    joins: usize,
    /// Attributes that are read under full write load.
    reads: u64,
}

impl Effort {
    /// Figures that can be relied on.
    pub(crate) const NORMAL: Self = Self {
        turns: 20,
        stamps: 5000,
        batches: 2000,
        joins: 5,
        reads: 1_000_000,
    };
    /// A first look.
    pub(crate) const QUICK: Self = Self {
        turns: 3,
        stamps: 300,
        batches: 50,
        joins: 1,
        reads: 100_000,
    };
    /// With as many reads under load as the bar is set for.
    pub(crate) const THOROUGH: Self = Self {
        reads: 100_000_000,
        ..Self::NORMAL
    };
}

/// All figures of the shared graph.
pub(crate) fn graph(effort: Effort) -> Result<Vec<Figure>, Failure> {
    let mut figures = Vec::new();
    {
        let hall = Hall::open()?;
        let store = hall.store(NODES)?;
        let raw = commits::polling(&hall, effort, &mut figures)?;
        commits::visible(&hall, effort, raw, &mut figures)?;
        reads::all(&hall, effort, &mut figures)?;
        commits::flat_out(&hall, effort, raw, &mut figures)?;
        commits::hot(&hall, effort, raw, &mut figures)?;
        beside::all(&hall, effort, &mut figures)?;
        inspector::commits(&hall, effort, &mut figures)?;
        store.end()?;
    }
    {
        let hall = Hall::open()?;
        let store = hall.sleeping_store(NODES)?;
        commits::blocking(&hall, effort, &mut figures)?;
        store.end()?;
    }
    whole::joining(effort, &mut figures)?;
    whole::torn(effort, &mut figures)?;
    inspector::load(effort, &mut figures)?;
    figure::sort(&mut figures);
    Ok(figures)
}
