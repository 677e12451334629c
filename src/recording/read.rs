//! Reading a recording, in one go from its beginning. It guarantees that of a file which was cut off
//! everything up to the cut is given, and that it is said.

use super::replayed::{CommitRow, RowError};
use super::{CHANNELS, CLOCK, COMMITS, DIGEST, SNAPSHOT};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dsr::{Image, ReadError, Refusal, Time};
use mcap::io::MessageReader;
use mcap::{MAGIC, McapError, Message};
use serde::Deserialize;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a recording cannot be played.
#[derive(Debug, Error)]
pub(crate) enum PlayError {
    #[error("cannot read {}: {source}", path.display())]
    Open {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{} is no whole MCAP file: {source}", path.display())]
    Damaged { path: PathBuf, source: McapError },
    #[error("message {sequence} of {topic}: {reason}")]
    Message {
        topic: String,
        sequence: u32,
        reason: String,
    },
    #[error("the recording has no graph; `cortex run --record` and `cortex record` write one")]
    NoGraph,
    #[error("version {version}: {source}")]
    Row { version: u64, source: RowError },
    #[error("version {version} was refused: {refusal}")]
    Refused { version: u64, refusal: Refusal },
    #[error("version {version}: {source}")]
    Commit {
        version: u64,
        source: dsr::CommitError,
    },
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error(transparent)]
    Attach(#[from] dsr::AttachError),
    #[error(transparent)]
    Instance(#[from] dsr::InstanceError),
    #[error(transparent)]
    Store(#[from] dsr::StoreError),
}

/// What stands in a recording, in order.
#[derive(Debug)]
pub(crate) enum Item {
    /// The whole graph, and whether commits before it are missing.
    Snapshot {
        image: Box<Image>,
        missed: bool,
    },
    Commit {
        time: Time,
        row: CommitRow,
    },
    /// The digest of the graph as of a version, and whether the recording was ended there.
    Digest(DigestRow),
    Tick,
    /// A message of that channel.
    Message(&'static str),
}

impl Item {
    /// When the graph became what the item says, where it says so.
    pub(crate) fn time(&self) -> Option<Time> {
        match self {
            Self::Snapshot { image, .. } => Some(image.time()),
            Self::Commit { time, .. } => Some(*time),
            Self::Digest(_) | Self::Tick | Self::Message(_) => None,
        }
    }
}

#[derive(Debug, Clone, Deserialize)]
struct SnapshotRow {
    missed: bool,
    image: String,
}

#[derive(Debug, Clone, Deserialize)]
pub(crate) struct DigestRow {
    pub(crate) version: u64,
    pub(crate) sha256: String,
    pub(crate) last: bool,
}

/// Whether a file is an MCAP file, by its first bytes.
pub(crate) fn is_recording(path: &Path) -> bool {
    let mut first = [0; MAGIC.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut first));
    read.is_ok() && first == *MAGIC
}

/// A recording that is being read.
pub(crate) struct Recording {
    path: PathBuf,
    messages: MessageReader<BufReader<File>>,
    is_cut: bool,
}

impl Recording {
    /// # Errors
    /// [`PlayError::Open`].
    pub(crate) fn open(path: &Path) -> Result<Self, PlayError> {
        let file = File::open(path).map_err(|source| PlayError::Open {
            path: path.to_owned(),
            source,
        })?;
        Ok(Self {
            path: path.to_owned(),
            messages: MessageReader::new(BufReader::new(file)),
            is_cut: false,
        })
    }

    /// Whether the file ended in the middle: whoever wrote it was killed.
    pub(crate) fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// The next item; `None` at the end.
    ///
    /// # Errors
    /// [`PlayError`].
    pub(crate) fn next(&mut self) -> Result<Option<Item>, PlayError> {
        loop {
            let message = match self.messages.next() {
                None => return Ok(None),
                Some(Err(McapError::UnexpectedEof)) => {
                    self.is_cut = true;
                    return Ok(None);
                }
                Some(Err(source)) => {
                    let path = self.path.clone();
                    return Err(PlayError::Damaged { path, source });
                }
                Some(Ok(message)) => message,
            };
            if let Some(item) = item(&message)? {
                return Ok(Some(item));
            }
        }
    }
}

fn item(message: &Message<'_>) -> Result<Option<Item>, PlayError> {
    let topic = message.channel.topic.as_str();
    let bad = |reason: String| PlayError::Message {
        topic: topic.to_owned(),
        sequence: message.sequence,
        reason,
    };
    let time = Time::from_nanoseconds(i64::try_from(message.log_time).unwrap_or(i64::MAX));
    match topic {
        SNAPSHOT => {
            let row: SnapshotRow = parse(message).map_err(bad)?;
            let image = STANDARD.decode(row.image);
            let image = image.map_err(|error| bad(error.to_string()))?;
            let image = dsr::decode_image(&image).map_err(|error| bad(error.to_string()))?;
            Ok(Some(Item::Snapshot {
                image: Box::new(image),
                missed: row.missed,
            }))
        }
        COMMITS => {
            let row = parse(message).map_err(bad)?;
            Ok(Some(Item::Commit { time, row }))
        }
        DIGEST => Ok(Some(Item::Digest(parse(message).map_err(bad)?))),
        CLOCK => Ok(Some(Item::Tick)),
        _ => {
            let channel = CHANNELS.iter().find(|(_, known)| *known == topic);
            Ok(channel.map(|(channel, _)| Item::Message(channel)))
        }
    }
}

fn parse<T: for<'a> Deserialize<'a>>(message: &Message<'_>) -> Result<T, String> {
    serde_json::from_slice(&message.data).map_err(|error| error.to_string())
}
