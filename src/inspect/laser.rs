//! What the robot's laser measures, as it comes: it is no part of the graph. It guarantees that nobody who
//! sends waits for who looks.

use crate::view::laser::beams;
use agents::messages::{LASER, LaserScan, ODOMETRY, Odometry};
use dsr::{InstanceError, Session, Subscriber};
use serde_json::Value as Json;

/// The laser of a running instance, and where its robot is.
pub(super) struct Laser {
    scans: Subscriber<LaserScan>,
    places: Subscriber<Odometry>,
    place: Option<Odometry>,
}

impl Laser {
    pub(super) fn open(session: &Session) -> Result<Self, InstanceError> {
        Ok(Self {
            scans: session.subscriber(LASER)?,
            places: session.subscriber(ODOMETRY)?,
            place: None,
        })
    }

    /// The newest scan on the map; `None` where there is none since the last look.
    pub(super) fn look(&mut self) -> Result<Option<Json>, InstanceError> {
        let scan = self.scans.newest()?;
        if let Some(place) = self.places.newest()? {
            self.place = Some(place);
        }
        let found = scan.zip(self.place.as_ref());
        Ok(found.map(|(scan, place)| beams(&scan, &place.world_from_robot)))
    }
}
