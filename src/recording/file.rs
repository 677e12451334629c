//! The file of a recording as it is written: channels with their schemas, and chunks that reach the
//! file whole. It guarantees that what was flushed can be read whatever becomes of the process.

use super::{
    CHANNELS, CLOCK, COMMITS, DIGEST, LASER_SCAN, LOG, MISSIONS, PATH, SCENE, SNAPSHOT,
    SOCIAL_GRID, TRANSFORMS,
};
use dsr::Time;
use foxglove::Encode;
use foxglove::messages::{FrameTransforms, Grid, LaserScan, Log, PosesInFrame, SceneUpdate};
use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a recording cannot go on.
#[derive(Debug, Error)]
pub(crate) enum RecordError {
    /// The file cannot be written to.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        path: PathBuf,
        source: mcap::McapError,
    },
    /// The file cannot be made.
    #[error("cannot make {}: {source}", path.display())]
    Make {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error(transparent)]
    Instance(#[from] dsr::InstanceError),
    #[error(transparent)]
    Attach(#[from] dsr::AttachError),
    #[error(transparent)]
    Read(#[from] dsr::ReadError),
    #[error(transparent)]
    Turn(#[from] dsr::TurnError),
}

/// The topics whose messages are JSON, each with the name and the text of its schema.
const JSON_TOPICS: [(&str, &str, &str); 10] = [
    (
        SNAPSHOT,
        "cortex.Snapshot",
        include_str!("schemas/snapshot.json"),
    ),
    (
        COMMITS,
        "cortex.Commit",
        include_str!("schemas/commit.json"),
    ),
    (DIGEST, "cortex.Digest", include_str!("schemas/digest.json")),
    (
        MISSIONS,
        "cortex.Missions",
        include_str!("schemas/missions.json"),
    ),
    (CLOCK, "cortex.Tick", include_str!("schemas/tick.json")),
    (
        CHANNELS[0].1,
        "cortex.Detections",
        include_str!("schemas/detections.json"),
    ),
    (
        CHANNELS[1].1,
        "cortex.Laser",
        include_str!("schemas/laser.json"),
    ),
    (
        CHANNELS[2].1,
        "cortex.Odometry",
        include_str!("schemas/odometry.json"),
    ),
    (
        CHANNELS[3].1,
        "cortex.Velocity",
        include_str!("schemas/velocity.json"),
    ),
    (
        CHANNELS[4].1,
        "cortex.Speech",
        include_str!("schemas/speech.json"),
    ),
];

/// A recording that is being written.
pub(super) struct RecordFile {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    channels: BTreeMap<&'static str, (u16, u32)>,
    scratch: Vec<u8>,
}

impl RecordFile {
    /// A new file; what was in one of that name is gone.
    pub(super) fn create(path: &Path) -> Result<Self, RecordError> {
        let made = File::create(path).map_err(|source| RecordError::Make {
            path: path.to_owned(),
            source,
        })?;
        let options = WriteOptions::new()
            .library(concat!("cortex ", env!("CARGO_PKG_VERSION")))
            .compression_level(1)
            // One thread compresses all that comes in a second in milliseconds.
            .compression_threads(0)
            // A chunk is put together in memory and reaches the file whole.
            .disable_seeking(true);
        let failed = |source| RecordError::Write {
            path: path.to_owned(),
            source,
        };
        let writer = options.create(BufWriter::new(made)).map_err(failed)?;
        let mut file = Self {
            path: path.to_owned(),
            writer,
            channels: BTreeMap::new(),
            scratch: Vec::new(),
        };
        file.declare().map_err(failed)?;
        Ok(file)
    }

    fn declare(&mut self) -> Result<(), mcap::McapError> {
        for (topic, name, schema) in JSON_TOPICS {
            let schema = self
                .writer
                .add_schema(name, "jsonschema", schema.as_bytes())?;
            self.channel(topic, schema, "json")?;
        }
        self.typed::<FrameTransforms>(TRANSFORMS)?;
        self.typed::<SceneUpdate>(SCENE)?;
        self.typed::<Grid>(SOCIAL_GRID)?;
        self.typed::<PosesInFrame>(PATH)?;
        self.typed::<LaserScan>(LASER_SCAN)?;
        self.typed::<Log>(LOG)
    }

    fn typed<T: Encode>(&mut self, topic: &'static str) -> Result<(), mcap::McapError> {
        let schema = match T::get_schema() {
            Some(schema) => self
                .writer
                .add_schema(&schema.name, &schema.encoding, &schema.data)?,
            None => 0,
        };
        self.channel(topic, schema, &T::get_message_encoding())
    }

    fn channel(
        &mut self,
        topic: &'static str,
        schema: u16,
        encoding: &str,
    ) -> Result<(), mcap::McapError> {
        let none = BTreeMap::new();
        let channel = self.writer.add_channel(schema, topic, encoding, &none)?;
        self.channels.insert(topic, (channel, 0));
        Ok(())
    }

    /// Adds a JSON message.
    pub(super) fn json(
        &mut self,
        topic: &'static str,
        time: Time,
        message: &impl Serialize,
    ) -> Result<(), RecordError> {
        self.scratch.clear();
        // Writing JSON to memory does not fail.
        drop(serde_json::to_writer(&mut self.scratch, message));
        self.write(topic, time)
    }

    /// Adds a message of one of Foxglove's types.
    pub(super) fn message<T: Encode>(
        &mut self,
        topic: &'static str,
        time: Time,
        message: &T,
    ) -> Result<(), RecordError> {
        self.scratch.clear();
        // Encoding to memory that grows does not fail.
        drop(message.encode(&mut self.scratch));
        self.write(topic, time)
    }

    fn write(&mut self, topic: &'static str, time: Time) -> Result<(), RecordError> {
        let Some((channel_id, sequence)) = self.channels.get_mut(topic) else {
            return Ok(());
        };
        *sequence += 1;
        let log_time = u64::try_from(time.nanoseconds()).unwrap_or(0);
        let header = MessageHeader {
            channel_id: *channel_id,
            sequence: *sequence,
            log_time,
            publish_time: log_time,
        };
        let written = self.writer.write_to_known_channel(&header, &self.scratch);
        written.map_err(|source| self.failed(source))
    }

    /// Brings all that was added to the file.
    pub(super) fn flush(&mut self) -> Result<(), RecordError> {
        let flushed = self.writer.flush();
        flushed.map_err(|source| self.failed(source))
    }

    /// Ends the file with its index.
    pub(super) fn finish(mut self) -> Result<(), RecordError> {
        let finished = self.writer.finish();
        finished.map(drop).map_err(|source| self.failed(source))?;
        self.flush_buffer()
    }

    fn flush_buffer(self) -> Result<(), RecordError> {
        let path = self.path;
        let flushed = self.writer.into_inner().into_inner();
        flushed.map(drop).map_err(|error| RecordError::Make {
            path,
            source: error.into_error(),
        })
    }

    fn failed(&self, source: mcap::McapError) -> RecordError {
        RecordError::Write {
            path: self.path.clone(),
            source,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mcap::{MessageStream, Summary};
    use serde_json::{Value as Json, json};

    fn written(finish: bool) -> (tempfile::TempDir, Vec<u8>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let mut file = RecordFile::create(&path).unwrap();
        let time = Time::from_seconds(1000.5);
        file.json(DIGEST, time, &json!({"version": 1})).unwrap();
        file.message(LOG, time, &Log::default()).unwrap();
        file.flush().unwrap();
        file.json(DIGEST, time, &json!({"version": 2})).unwrap();
        if finish {
            file.finish().unwrap();
        } else {
            // As if the process had been killed here: what it would still write is not looked at.
            let bytes = std::fs::read(path).unwrap();
            return (folder, bytes);
        }
        let bytes = std::fs::read(path).unwrap();
        (folder, bytes)
    }

    #[test]
    fn a_finished_file_has_an_index_and_every_channel_a_schema() {
        let (_folder, bytes) = written(true);
        let summary = Summary::read(&bytes).unwrap().unwrap();
        assert_eq!(summary.stats.unwrap().message_count, 3);
        assert_eq!(summary.channels.len(), JSON_TOPICS.len() + 6);
        let mut channels = summary.channels.values();
        let described = |schema: &std::sync::Arc<mcap::Schema<'_>>| !schema.data.is_empty();
        assert!(channels.all(|channel| channel.schema.as_ref().is_some_and(described)));
        let messages: Vec<_> = MessageStream::new(&bytes)
            .unwrap()
            .map(Result::unwrap)
            .collect();
        assert_eq!(messages.len(), 3);
        assert_eq!(messages[0].log_time, 1_000_500_000_000);
    }

    #[test]
    fn what_was_flushed_is_there_without_an_end() {
        let (_folder, bytes) = written(false);
        let messages = MessageStream::new(&bytes).unwrap();
        assert_eq!(messages.flatten().count(), 2);
    }

    #[test]
    fn every_schema_is_json_and_names_itself() {
        for (topic, name, schema) in JSON_TOPICS {
            let schema: Json = serde_json::from_str(schema).unwrap();
            assert_eq!(schema["title"], name, "{topic}");
        }
    }
}
