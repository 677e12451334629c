//! The flags of `cortex completions`, `cortex man` and `cortex new`. Parsing a flag does nothing but parse
//! it.

use clap::{Args, Subcommand};
use std::path::PathBuf;

#[derive(Debug, Clone, Args)]
pub(crate) struct Completions {
    /// Whose
    pub(crate) shell: clap_complete::Shell,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Man {
    /// Folder for the pages, one a verb
    pub(crate) folder: PathBuf,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct New {
    #[command(subcommand)]
    pub(crate) what: NewThing,
}

#[derive(Debug, Clone, Subcommand)]
pub(crate) enum NewThing {
    /// A package with an agent, and its manifest
    #[command(after_help = "Example:\n  cortex new agent polite")]
    Agent {
        /// The agent's name, also that of its folder
        name: String,
        /// Folder of Cortex's source [default: above this folder, or above the program]
        #[arg(long, value_name = "DIR")]
        cortex: Option<PathBuf>,
    },
    /// A scenario with two rooms, a person and a mission
    #[command(after_help = "Example:\n  cortex new scenario flat")]
    Scenario {
        /// The scenario's name, also that of its folder
        name: String,
    },
}
