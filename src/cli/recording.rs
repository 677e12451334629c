//! The flags of `cortex record` and `cortex replay`. Parsing a flag does nothing but parse it.

use super::InstanceArgs;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Clone, Args)]
pub(crate) struct Record {
    /// The recording; where one is there already, the next goes beside it
    pub(crate) file: PathBuf,
    /// Take turns as a supervisor on standard input gives them
    #[arg(long, hide = true)]
    pub(crate) lockstep: bool,
    /// End when standard input ends
    #[arg(long, hide = true)]
    pub(crate) supervised: bool,
    #[command(flatten)]
    pub(crate) instance: InstanceArgs,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Replay {
    /// A recording (.mcap)
    pub(crate) file: PathBuf,
    /// Play it as the running system of this name, for `cortex graph` and the others to look at
    /// [default: default, where --speed or --keep is given]
    #[arg(long, value_name = "I")]
    pub(crate) instance: Option<String>,
    /// Recorded seconds per second [default: as fast as the machine can]
    #[arg(long, value_name = "X", value_parser = super::speed)]
    pub(crate) speed: Option<f64>,
    /// Keep the graph there at the end, until interrupted
    #[arg(long)]
    pub(crate) keep: bool,
    /// For machines
    #[arg(long)]
    pub(crate) json: bool,
}
