//! The flags of `cortex bench`. Parsing a flag does nothing but parse it.

use clap::{Args, Subcommand};
use std::path::PathBuf;

#[derive(Debug, Clone, Args)]
pub(crate) struct Bench {
    #[command(subcommand)]
    pub(crate) action: BenchAction,
    /// For machines
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

#[derive(Debug, Clone, Subcommand)]
pub(crate) enum BenchAction {
    /// The shared graph: commits, reads, joining, memory
    #[command(after_help = "Takes less than a minute where the machine is idle.\n\n\
        Example:\n  cortex bench graph")]
    Graph {
        /// A first look: little of everything
        #[arg(long)]
        quick: bool,
        /// Read 100 million attributes under full write load, instead of a million
        #[arg(long, conflicts_with = "quick")]
        thorough: bool,
    },
    /// Rules: matches, changes of matches, rewriting, parsing
    #[command(
        after_help = "Takes a minute or two, most of it for other engines.\n\n\
        Example:\n  cortex bench rules"
    )]
    Rules,
    /// Social maps: people's density, updates, crowds, outlines
    #[command(after_help = "Takes a few seconds.\n\nExample:\n  cortex bench social --json")]
    Social,
    /// The human observer among a thousand people
    #[command(after_help = "Takes a few seconds.\n\nExample:\n  cortex bench perception")]
    Perception,
    /// The planner: from the text of rules, world and goal to the plan
    #[command(after_help = "Takes a few seconds.\n\nExample:\n  cortex bench plan --tasks tasks")]
    Plan {
        /// Write the tasks into this folder, for other planners
        #[arg(long, value_name = "DIR")]
        tasks: Option<PathBuf>,
    },
    /// Path search and the elastic band
    #[command(after_help = "Takes about half a minute.\n\nExample:\n  cortex bench path")]
    Path,
}

/// A process that a measurement starts.
#[derive(Debug, Clone, Args)]
pub(crate) struct BenchPeer {
    pub(crate) role: String,
    pub(crate) instance: String,
    pub(crate) numbers: Vec<u64>,
}
