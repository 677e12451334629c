//! The grid as a map for ROS: an image and a description beside it, in each of the three modes that map servers
//! know. This file owns what a cost is in an image, and guarantees that it is the same in every map: a map
//! server that reads the image finds the occupancy which this file says, and a cost can be told from that.

use crate::cli::RosMode;
use agents::grid::{CostGrid, FREE};
use std::fmt::Write as _;
use std::path::Path;

/// What a step of occupancy, of which there are 100, costs.
const STEP: f32 = 0.05;
/// The highest occupancy of a place that may be entered.
const ENTERED: u8 = 99;
/// The occupancy of what is blocked.
const OCCUPIED: u8 = 100;
/// The highest cost that an occupancy tells.
pub(super) const DEAREST: f32 = FREE + ENTERED as f32 * STEP;

impl RosMode {
    /// The image: a portable grey map, the highest row first.
    pub(super) fn image(self, grid: &CostGrid) -> Vec<u8> {
        let mut bytes = format!("P5\n{} {}\n255\n", grid.width, grid.height).into_bytes();
        for row in (0..grid.height).rev() {
            let costs = &grid.costs[row * grid.width..(row + 1) * grid.width];
            bytes.extend(costs.iter().map(|cost| self.pixel(occupancy(*cost))));
        }
        bytes
    }

    fn pixel(self, occupancy: u8) -> u8 {
        match self {
            // As ROS's own map saver writes free and occupied.
            Self::Trinary if occupancy < OCCUPIED => 254,
            Self::Trinary => 0,
            // 255 greys for 101 values: each is told apart, whichever way a reader rounds.
            Self::Scale => 255 - (f32::from(occupancy) * 2.55).round() as u8,
            Self::Raw => occupancy,
        }
    }

    /// The occupancy above which a map server takes a pixel for occupied, and below which for free.
    fn thresholds(self) -> (f64, f64) {
        match self {
            Self::Trinary => (0.65, 0.25),
            // Between black and the darkest grey, and between white and the lightest.
            Self::Scale | Self::Raw => (0.999, 0.001),
        }
    }

    /// What a map server reads beside the image (YAML).
    pub(super) fn description(self, grid: &CostGrid, image: &Path) -> String {
        let image = image
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let (occupied, free) = self.thresholds();
        let mut text = format!(
            "image: {image}\nmode: {}\nresolution: {}\norigin: [{}, {}, 0]\nnegate: 0\n\
             occupied_thresh: {occupied}\nfree_thresh: {free}\n",
            self.name(),
            grid.resolution,
            grid.origin.x,
            grid.origin.y
        );
        let told = match self {
            Self::Trinary => "occupancy 0 may be entered at some cost, 100 is blocked".to_owned(),
            Self::Scale | Self::Raw => format!(
                "a place of occupancy 0 to {ENTERED} costs {FREE} + {STEP} x occupancy, and {ENTERED} also what is \
                 dearer; 100 is blocked"
            ),
        };
        // Writing to a string does not fail.
        let _ = writeln!(text, "# {told}");
        text
    }

    /// How many cells may be entered and cost more than the image can tell.
    pub(super) fn too_dear(self, grid: &CostGrid) -> usize {
        let dear = |cost: &&f32| cost.is_finite() && **cost > DEAREST + STEP / 2.0;
        match self {
            Self::Trinary => 0,
            Self::Scale | Self::Raw => grid.costs.iter().filter(dear).count(),
        }
    }
}

/// What a cost is on ROS's scale, the same in every map.
fn occupancy(cost: f32) -> u8 {
    if cost.is_finite() {
        // A float to integer cast saturates.
        (((cost - FREE) / STEP).round() as u8).min(ENTERED)
    } else {
        OCCUPIED
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use agents::grid::BLOCKED;

    /// One row of cells.
    fn grid(costs: &[f32]) -> CostGrid {
        let mut grid = CostGrid::covering([0.0, 0.0, costs.len() as f64, 1.0], 1.0);
        grid.costs.copy_from_slice(costs);
        grid
    }

    /// What `nav2_map_server` makes of a pixel, by its `map_io`; -1 is unknown.
    fn nav2(mode: RosMode, pixel: u8) -> i32 {
        let (occupied, free) = mode.thresholds();
        let shade = f64::from(pixel) / 255.0;
        let occ = 1.0 - shade;
        match mode {
            RosMode::Raw if pixel <= 100 => i32::from(pixel),
            RosMode::Raw => -1,
            _ if occ > occupied => 100,
            _ if occ < free => 0,
            RosMode::Trinary => -1,
            RosMode::Scale => ((occ - free) / (occupied - free) * 100.0).round() as i32,
        }
    }

    /// What the `map_server` of ROS 1 makes of a pixel, by its `image_loader`.
    fn ros1(mode: RosMode, pixel: u8) -> i32 {
        let (occupied, free) = mode.thresholds();
        let occ = f64::from(255 - pixel) / 255.0;
        match mode {
            RosMode::Raw => i32::from(pixel),
            _ if occ > occupied => 100,
            _ if occ < free => 0,
            RosMode::Trinary => -1,
            RosMode::Scale => (1.0 + 98.0 * (occ - free) / (occupied - free)) as i32,
        }
    }

    #[test]
    fn a_map_server_reads_every_cost_as_it_was_written() {
        let mut costs: Vec<f32> = (0..=99).map(|step| FREE + step as f32 * STEP).collect();
        costs.push(BLOCKED);
        let grid = grid(&costs);
        for mode in RosMode::ALL {
            let bytes = mode.image(&grid);
            let pixels = &bytes[bytes.len() - costs.len()..];
            for (pixel, cost) in pixels.iter().zip(&costs) {
                let (new, old) = (nav2(mode, *pixel), ros1(mode, *pixel));
                if mode == RosMode::Trinary {
                    let expected = if cost.is_finite() { 0 } else { 100 };
                    assert_eq!((new, old), (expected, expected), "{cost}");
                    continue;
                }
                assert_eq!(new == 100, *cost >= BLOCKED, "{cost}");
                if cost.is_finite() {
                    let read = FREE + new as f32 * STEP;
                    assert!((read - cost).abs() < 1e-5, "{read} for {cost}");
                }
                // ROS 1 stretches its scale from 1 to 99, and cuts what is between.
                assert!((old - new).abs() <= 2, "{old} for {new}");
            }
        }
    }

    #[test]
    fn a_cost_is_the_same_grey_in_every_map() {
        let pixel = |costs: &[f32]| {
            let bytes = RosMode::Scale.image(&grid(costs));
            bytes[bytes.len() - costs.len()]
        };
        assert_eq!(pixel(&[4.0, 1.0]), pixel(&[4.0, 3.5, 80.0]));
        assert_eq!(pixel(&[4.0]), 255 - 153);
        assert_eq!(RosMode::Scale.too_dear(&grid(&[4.0, 80.0, BLOCKED])), 1);
        assert_eq!(pixel(&[80.0]), pixel(&[5.95]));
    }

    #[test]
    fn a_map_has_north_up_and_says_what_its_greys_mean() {
        let mut grid = CostGrid::covering([0.0, 1.0, 0.3, 1.2], 0.1);
        grid.costs[0] = BLOCKED;
        grid.costs[1] = 4.0;
        let bytes = RosMode::Raw.image(&grid);
        let (header, cells) = bytes.split_at(bytes.len() - 6);
        assert_eq!(header, b"P5\n3 2\n255\n");
        assert_eq!(cells, [0, 0, 0, 100, 60, 0]);
        assert_eq!(
            RosMode::Scale.description(&grid, Path::new("maps/floor.pgm")),
            "image: floor.pgm\nmode: scale\nresolution: 0.1\norigin: [0, 1, 0]\nnegate: 0\n\
             occupied_thresh: 0.999\nfree_thresh: 0.001\n\
             # a place of occupancy 0 to 99 costs 1 + 0.05 x occupancy, and 99 also what is dearer; 100 is blocked\n"
        );
    }
}
