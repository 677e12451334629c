//! [`Association::Nearest`](super::Association::Nearest): the tracker that others are measured
//! against. Each frame's nearest pairs of prediction and detection first, and no memory of who was lost.

use super::Observer;
use super::config::Nearest;
use super::track::{Sighting, Track};
use dsr::Time;

impl Observer {
    /// Gives each of the frame's sightings to the track nearest to it, or to a new one.
    pub(super) fn take_nearest(&mut self, sightings: &[Sighting]) {
        let config = &self.config;
        let mut pairs = Vec::new();
        for (row, track) in self.tracks.iter().enumerate() {
            let place = track.position();
            let first = sightings.partition_point(|s| s.position.x < place.x - config.nearest.gate);
            for (column, sighting) in sightings.iter().enumerate().skip(first) {
                if sighting.position.x > place.x + config.nearest.gate {
                    break;
                }
                let distance = (sighting.position - place).norm();
                if distance <= config.nearest.gate {
                    pairs.push((distance, row, column));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut taken = vec![false; sightings.len()];
        for (_, row, column) in pairs {
            let (track, sighting) = (&mut self.tracks[row], &sightings[column]);
            if taken[column] || track.last_frame == self.frame {
                continue;
            }
            if let Some(innovation) = track.innovation(sighting, config) {
                track.hit(sighting, &innovation, self.frame, config);
                taken[column] = true;
            }
        }
        for (sighting, _) in sightings.iter().zip(&taken).filter(|(_, taken)| !**taken) {
            self.tracks.push(Track::new(sighting, self.frame, config));
        }
        for track in &mut self.tracks {
            if track.id.is_none() && track.hits() >= config.nearest.hits {
                track.id = Some(self.next_id);
                self.next_id += 1;
            }
        }
    }
}

/// Whether it has been unseen for too long at `now`.
pub(super) fn is_dead(track: &Track, now: Time, config: &Nearest) -> bool {
    now.since(track.last_seen) > config.greatest_age
}
