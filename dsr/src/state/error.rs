//! Why a state folder cannot be used. Each message says what to do about it, where something can be done.

use super::FORMAT;
use crate::{ReadError, Version};
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Why a state folder cannot be used.
#[derive(Debug, Error)]
pub enum StateError {
    /// The operating system said no.
    #[error("cannot use {path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What it said.
        source: io::Error,
    },
    /// The folder holds something else.
    #[error("{path} is not a state folder of cortex; give --state an empty or a new folder")]
    Foreign {
        /// The folder.
        path: PathBuf,
    },
    /// Other users may put another file in the place of the database.
    #[error(
        "others than its owner can write to {path}; `chmod go-w` it, or give --state another folder"
    )]
    Shared {
        /// The folder.
        path: PathBuf,
    },
    /// Another store has it open.
    #[error(
        "{path} is in use by another store; end that one first, or give --state another folder"
    )]
    InUse {
        /// The database.
        path: PathBuf,
    },
    /// It was written by a version of the program that gives its rows another meaning.
    #[error("{path} has format {found}, and this program reads format {FORMAT}")]
    Format {
        /// The database.
        path: PathBuf,
        /// Its format.
        found: u32,
    },
    /// It holds what no store writes.
    #[error("{path} is damaged: {reason}; restore it from a copy, or move it away to begin anew")]
    Damaged {
        /// The database.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The folder has a newer version than the graph that shall go on from it.
    #[error("{path} has version {saved}, and the graph only version {given}")]
    Newer {
        /// The database.
        path: PathBuf,
        /// Its version.
        saved: Version,
        /// The graph's.
        given: Version,
    },
    /// The graph's memory cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
}
