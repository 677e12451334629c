//! The flags of `cortex inspect`. Parsing a flag does nothing but parse it.

use clap::Args;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Where the page is, unless told otherwise: only this host can connect.
pub(super) const ADDRESS: &str = "127.0.0.1:7710";

#[derive(Debug, Clone, Args)]
pub(crate) struct Inspect {
    /// As a page in a browser, at this address; port 0 is one that is free
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = ADDRESS)]
    pub(crate) web: Option<SocketAddr>,
    /// In this terminal
    #[arg(long, conflicts_with = "web")]
    pub(crate) tui: bool,
    /// Allow changes to who has the token that is printed
    #[arg(long, requires = "web", conflicts_with = "file")]
    pub(crate) allow_edit: bool,
    /// Name of the running system on this host
    #[arg(
        long,
        value_name = "I",
        default_value = "default",
        conflicts_with = "file"
    )]
    pub(crate) instance: String,
    /// A recording instead of a running system
    #[arg(long, value_name = "FILE")]
    pub(crate) file: Option<PathBuf>,
    /// End when standard input ends
    #[arg(long, hide = true)]
    pub(crate) supervised: bool,
}
