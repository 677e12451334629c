//! The flags of `cortex mission` and `cortex why`. Parsing a flag does nothing but parse it.

use super::seconds;
use clap::{Args, Subcommand};
use std::path::PathBuf;

#[derive(Debug, Clone, Args)]
pub(crate) struct Mission {
    #[command(subcommand)]
    pub(crate) action: MissionAction,
    /// For machines
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Name of the running system on this host
    #[arg(long, value_name = "I", default_value = "default", global = true)]
    pub(crate) instance: String,
}

#[derive(Debug, Clone, Subcommand)]
pub(crate) enum MissionAction {
    /// Give the executive a goal, or the missions of a file
    #[command(
        after_help = "Examples:\n  cortex mission submit fetch.aggt --priority 2 --wait\n  \
        cortex mission submit round.toml"
    )]
    Submit(SubmitMission),
    /// List all missions
    #[command(after_help = "Example:\n  cortex mission list --instance default")]
    List,
    /// Show one mission with the steps of its plans
    #[command(after_help = "Example:\n  cortex mission show invite")]
    Show {
        /// Which
        name: String,
    },
    /// End a mission that is not over
    #[command(after_help = "Example:\n  cortex mission cancel invite")]
    Cancel {
        /// Which
        name: String,
    },
    /// Let a mission wait; its step in hand is dropped
    #[command(after_help = "Example:\n  cortex mission pause invite")]
    Pause {
        /// Which
        name: String,
    },
    /// Let a paused mission go on
    #[command(after_help = "Example:\n  cortex mission resume invite")]
    Resume {
        /// Which
        name: String,
    },
}

#[derive(Debug, Clone, Args)]
pub(crate) struct SubmitMission {
    /// File with the goal, in AGGL, or with several missions (.toml), which brings all that the
    /// flags say
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// Its name, which no other node has [default: that of the file]
    #[arg(long, value_name = "N")]
    pub(crate) name: Option<String>,
    /// The larger, the sooner
    #[arg(
        long,
        value_name = "P",
        default_value_t = 0,
        allow_negative_numbers = true
    )]
    pub(crate) priority: i64,
    /// Seconds from now, in the time of the instance, after which it fails
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub(crate) deadline: Option<f64>,
    /// When it gives way to a mission of higher priority
    #[arg(long, value_name = "WHEN", default_value = "at_once", value_parser = ["at_once", "between_steps", "never"])]
    pub(crate) preemption: String,
    /// Wait until it is over; exit code 0 if it succeeded, 1 if not
    #[arg(long)]
    pub(crate) wait: bool,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Why {
    /// A mission, a step, NODE, NODE.ATTRIBUTE, FROM-LABEL->TO or FROM-LABEL->TO.ATTRIBUTE
    /// [default: all missions]
    pub(crate) what: Option<String>,
    /// For machines
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) instance: super::InstanceArgs,
}
