//! Who stands together: groups from people's poses (papers TD and TG, READING.md items 5, 10, 19
//! and 20). This module owns the methods, how well each does, a group as one entity, and its name
//! over time. Groups are disjoint, each has at least two members, and they depend on the poses and
//! their order alone.

mod clustering;
mod crowd;
mod entity;
mod facing;
mod mesh;
mod near;
pub mod score;
mod tracking;
mod triangulation;
mod union;

pub use clustering::GaussianClustering;
pub use entity::GroupEntity;
pub use facing::Facing;
pub use tracking::GroupTracker;
pub use triangulation::Triangulation;

use self::near::Near;
use super::scene::is_pose;
use nalgebra::{Isometry2, Point2};
use serde::{Deserialize, Serialize};

/// Where more pairs of people than this stand within some [`NEARBY`] metres of each other, groups are
/// not looked for. A hundred thousand people who stand as close as a dense crowd does (five per square
/// metre) are well below; only places that no bodies could take have more.
pub const MOST_PAIRS: usize = 200_000_000;
/// The side of the square cells by which pairs are counted: pairs within a cell and its neighbours, metres.
pub const NEARBY: f64 = 8.0;
/// Where more people than this stand in three by three cells of half a metre, ninety to a square metre, [`Method::Facing`]
/// does not look for groups.
pub const MOST_ON_A_SPOT: usize = 200;
/// The side of those cells, metres.
const SPOT: f64 = 0.5;

/// How groups are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Ours: pairs that are near and face each other, on the Delaunay mesh. See [`Facing`].
    #[default]
    Facing,
    /// Paper TD's. See [`GaussianClustering`].
    GaussianClustering,
    /// Paper TG's. See [`Triangulation`].
    TriangulationStrict,
}

impl Method {
    /// All methods, the default first.
    pub const ALL: [Self; 3] = [
        Self::Facing,
        Self::GaussianClustering,
        Self::TriangulationStrict,
    ];

    /// Its name in configuration and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Facing => "facing",
            Self::GaussianClustering => "gaussian_clustering",
            Self::TriangulationStrict => "triangulation_strict",
        }
    }
}

/// How groups are found, with all figures.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Grouping {
    /// Which method.
    pub method: Method,
    /// The figures of [`Method::Facing`].
    pub facing: Facing,
    /// The figures of [`Method::GaussianClustering`].
    pub gaussian_clustering: GaussianClustering,
    /// The figures of [`Method::TriangulationStrict`].
    pub triangulation_strict: Triangulation,
}

/// People stand closer than bodies can, and too many of them, to look for groups among.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TooCrowded {
    /// Everywhere.
    #[error(
        "{count} people stand too close to look for groups among them: {pairs} pairs within some \
         {NEARBY} m of each other, where at most {MOST_PAIRS} are compared"
    )]
    Pairs {
        /// How many people there are.
        count: usize,
        /// How many pairs of them stand in one cell of [`NEARBY`] metres, or in two neighbouring ones.
        pairs: usize,
    },
    /// Somewhere, for [`Method::Facing`], which weighs each pair of them anew with each that joins.
    #[error(
        "{most} people stand within 1.5 m of each other, where {MOST_ON_A_SPOT} are at most looked at: no bodies stand so close \
         (`gaussian_clustering` takes them)"
    )]
    Spot {
        /// How many people stand in three by three cells of half a metre.
        most: usize,
    },
}

impl Grouping {
    /// That method with its default figures.
    pub fn of(method: Method) -> Self {
        Self {
            method,
            ..Self::default()
        }
    }

    /// Whether all figures are usable.
    pub fn is_valid(&self) -> bool {
        self.facing.is_valid()
            && self.gaussian_clustering.is_valid()
            && self.triangulation_strict.is_valid()
    }

    /// The groups among people at these poses (`world_from_person`), as indices in ascending order,
    /// the groups in the order of their first members. Whose pose is no place, as [`is_pose`] says, is in no group
    /// and changes nobody else's.
    ///
    /// # Errors
    /// [`TooCrowded`].
    pub fn groups(&self, people: &[Isometry2<f64>]) -> Result<Vec<Vec<usize>>, TooCrowded> {
        let sound: Vec<usize> = (0..people.len()).filter(|i| is_pose(&people[*i])).collect();
        let poses: Vec<Isometry2<f64>> = sound.iter().map(|i| people[*i]).collect();
        let places: Vec<Point2<f64>> = poses
            .iter()
            .map(|pose| pose.translation.vector.into())
            .collect();
        let pairs = Near::new(&places, NEARBY).pairs();
        if pairs > MOST_PAIRS {
            let count = poses.len();
            return Err(TooCrowded::Pairs { count, pairs });
        }
        if self.method == Method::Facing {
            let most = Near::new(&places, SPOT).most();
            if most > MOST_ON_A_SPOT {
                return Err(TooCrowded::Spot { most });
            }
        }
        let mut groups = match self.method {
            Method::Facing => self.facing.groups(&poses),
            Method::GaussianClustering => self.gaussian_clustering.groups(&poses),
            Method::TriangulationStrict => self.triangulation_strict.groups(&poses),
        };
        for member in groups.iter_mut().flatten() {
            *member = sound[*member];
        }
        Ok(groups)
    }
}

#[cfg(test)]
mod tests;
