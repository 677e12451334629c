//! The layers of the map in AP's order (AP 3, Fig. 4b). This file owns which thing belongs to which
//! layer. It guarantees that the last layer is the map itself, and that nothing a layer shows is missing
//! there: the master is the greater of inflation and social, cell by cell.

use super::stamps::{Inflation, Stamp};
use crate::grid::CostGrid;
use serde::{Deserialize, Serialize};

/// A layer, as far as the map is made of it.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Layer {
    /// What is known beforehand: the walls.
    Static,
    /// With what is perceived: the footprints of objects, and people's bodies.
    Obstacles,
    /// Without people, who are no mere obstacles; where nothing is social they stay.
    PeopleFilter,
    /// Grown by the robot's radius, and dearer beside that.
    Inflation,
    /// Alone what is social: people's zones, the spaces of groups, between people, and of objects, and
    /// bodies, grown by the robot.
    Social,
    /// All of it, as the robot plans on.
    #[default]
    Master,
}

impl Layer {
    /// The layers, each built on those before, but for the social one, which only the master takes in.
    pub const ALL: [Self; 6] = [
        Self::Static,
        Self::Obstacles,
        Self::PeopleFilter,
        Self::Inflation,
        Self::Social,
        Self::Master,
    ];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Static => "static",
            Self::Obstacles => "obstacles",
            Self::PeopleFilter => "people_filter",
            Self::Inflation => "inflation",
            Self::Social => "social",
            Self::Master => "master",
        }
    }
}

/// The layer of a scene that is `social` or not, on a grid that is free so far.
pub(super) fn draw<'a>(
    layer: Layer,
    social: bool,
    stamps: impl Iterator<Item = &'a Stamp>,
    grid: &mut CostGrid,
) {
    let (bare, whole) = (Inflation::none(grid.resolution), grid.whole());
    for stamp in stamps {
        let from = match stamp {
            Stamp::Wall { .. } => Layer::Static,
            Stamp::Footprint { .. } => Layer::Obstacles,
            Stamp::Body { .. } => {
                let filtered = social && matches!(layer, Layer::PeopleFilter | Layer::Inflation);
                if filtered {
                    continue;
                }
                Layer::Obstacles
            }
            Stamp::Zones { .. } | Stamp::Space { .. } | Stamp::Between { .. } => Layer::Social,
        };
        match layer {
            Layer::Static | Layer::Obstacles | Layer::PeopleFilter if from <= layer => {
                stamp.grown(bare).draw(grid, &whole);
            }
            Layer::Inflation if from < Layer::Social => stamp.draw(grid, &whole),
            Layer::Social => {
                let body = matches!(stamp, Stamp::Body { .. });
                if from == Layer::Social || social && body {
                    stamp.draw(grid, &whole);
                }
            }
            Layer::Master => stamp.draw(grid, &whole),
            _ => {}
        }
    }
}
