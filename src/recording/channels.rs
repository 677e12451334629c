//! What agents hear and say beside the graph: the messages of the channels, and the ticks. It guarantees that
//! each is written as it was sent, so that it can be sent again; of numbers, all that are finite.

use super::file::{RecordError, RecordFile};
use super::{CHANNELS, CLOCK};
use agents::messages::{
    CameraFrame, DETECTIONS, LASER, LaserScan, ODOMETRY, Odometry, SPEECH, Speech, VELOCITY,
    VelocityCommand,
};
use dsr::{InstanceError, Session, Subscriber, Tick, Time};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// The channels as a recorder hears them.
pub(super) struct Channels {
    /// Where a supervisor gives the turns, nobody announces ticks.
    ticks: Subscriber<Tick>,
    detections: Subscriber<CameraFrame>,
    laser: Subscriber<LaserScan>,
    odometry: Subscriber<Odometry>,
    velocity: Subscriber<VelocityCommand>,
    speech: Subscriber<Speech>,
    /// The newest of the laser's turns.
    pub(super) scan: Option<LaserScan>,
}

/// The topic of a channel.
pub(super) fn topic(channel: &str) -> &'static str {
    let known = CHANNELS.iter().find(|(name, _)| *name == channel);
    known.map_or("", |(_, topic)| topic)
}

fn write<T: Serialize + DeserializeOwned>(
    file: &mut RecordFile,
    channel: &str,
    messages: &mut Subscriber<T>,
    mut when: impl FnMut(&T) -> Time,
) -> Result<(), RecordError> {
    while let Some(message) = messages.receive()? {
        file.json(topic(channel), when(&message), &message)?;
    }
    Ok(())
}

impl Channels {
    pub(super) fn open(session: &Session) -> Result<Self, InstanceError> {
        Ok(Self {
            ticks: session.ticks()?,
            detections: session.subscriber(DETECTIONS)?,
            laser: session.subscriber(LASER)?,
            odometry: session.subscriber(ODOMETRY)?,
            velocity: session.subscriber(VELOCITY)?,
            speech: session.subscriber(SPEECH)?,
            scan: None,
        })
    }

    /// Writes all that has come. A tick stands after everything that was sent before it was announced.
    pub(super) fn take(&mut self, file: &mut RecordFile) -> Result<(), RecordError> {
        let ticks = self.ticks.drain()?;
        write(file, DETECTIONS, &mut self.detections, |frame| frame.time)?;
        let newest = &mut self.scan;
        write(file, LASER, &mut self.laser, |scan| {
            *newest = Some(scan.clone());
            scan.time
        })?;
        write(file, ODOMETRY, &mut self.odometry, |odometry| odometry.time)?;
        write(file, VELOCITY, &mut self.velocity, |command| command.time)?;
        write(file, SPEECH, &mut self.speech, |speech| speech.time)?;
        for tick in ticks {
            self::tick(file, tick)?;
        }
        Ok(())
    }
}

/// Writes that a tick came.
pub(super) fn tick(file: &mut RecordFile, tick: Tick) -> Result<(), RecordError> {
    file.json(CLOCK, tick.time, &tick)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry2;
    use proptest::prelude::*;

    fn finite() -> impl Strategy<Value = f64> {
        prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO
    }

    proptest! {
        #[test]
        fn messages_come_out_of_json_as_they_went_in(
            x in finite(), y in finite(), heading in -7.0..7.0f64,
            ranges in prop::collection::vec(prop::num::f32::POSITIVE, 0..20),
        ) {
            let time = Time::from_seconds(1000.25);
            let scan = LaserScan { time, angle_min: heading, angle_step: x, range_max: y, ranges };
            let text = serde_json::to_string(&scan).unwrap();
            let finite = scan.ranges.iter().all(|range| range.is_finite());
            prop_assert_eq!(serde_json::from_str(&text).ok(), finite.then_some(scan));
            let odometry = Odometry {
                time, world_from_robot: Isometry2::new([x, y].into(), heading),
                linear: x, lateral: y, angular: heading,
            };
            let text = serde_json::to_string(&odometry).unwrap();
            prop_assert_eq!(serde_json::from_str::<Odometry>(&text).unwrap(), odometry);
        }
    }

    #[test]
    fn every_channel_has_a_topic() {
        for channel in [DETECTIONS, LASER, ODOMETRY, VELOCITY, SPEECH] {
            assert!(topic(channel).ends_with(channel), "{channel}");
        }
    }
}
