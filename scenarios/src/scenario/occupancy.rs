//! Occupancy maps as ROS keeps them: a description (YAML) and the image beside it (PGM). This file owns what
//! of such a map is solid, and guarantees that the walls it gives run around exactly that.
//!
//! Pixels are read as `nav2_map_server` reads them in each of its three modes.

use super::file::Read;
use super::{Unknown, Wall};
use image::codecs::pnm::PnmDecoder;
use image::{ColorType, ImageDecoder};
use nalgebra::{Isometry2, Point2, Vector2};
use serde::Deserialize;
use serde_saphyr::Spanned;
use std::io::Cursor;
use std::path::Path;
use thiserror::Error;

/// Cells of the largest map.
const MOST_CELLS: u64 = 16_000_000;
/// Walls through what is solid lie this close together, m: no body fits in between.
const FILLING: f64 = 0.3;

/// Why a map cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum MapError {
    /// The description is not what it must be.
    #[error("{message}")]
    Description {
        /// What, and in which line.
        message: String,
    },
    /// A value of the description is not what it must be.
    #[error("`{key}` in line {line} must be {expected}")]
    Value {
        /// Whose value.
        key: &'static str,
        /// The line, from 1.
        line: u64,
        /// What it must be.
        expected: &'static str,
    },
    /// The image cannot be read.
    #[error("cannot read its image `{image}`: {reason}")]
    Unreadable {
        /// The file, relative to the scenario's folder.
        image: String,
        /// What the system said.
        reason: String,
    },
    /// The image is not a portable grey map.
    #[error("its image `{image}` must be a portable grey map (P2 or P5): {reason}")]
    Image {
        /// The file, relative to the scenario's folder.
        image: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The image is too large, or empty.
    #[error(
        "its image `{image}` has {width} x {height} pixels; from 1 to {MOST_CELLS} can be used"
    )]
    Size {
        /// The file, relative to the scenario's folder.
        image: String,
        /// Pixels of a row.
        width: u32,
        /// Rows.
        height: u32,
    },
}

/// The description, but for what is read of the image.
#[derive(Debug, Deserialize)]
struct Description {
    image: String,
    mode: Option<Spanned<String>>,
    resolution: Spanned<f64>,
    /// x, y and heading of the lower left corner.
    origin: Spanned<[f64; 3]>,
    occupied_thresh: Spanned<f64>,
    free_thresh: Spanned<f64>,
    negate: Option<Spanned<i64>>,
}

/// How a pixel tells what is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mode {
    Trinary,
    Scale,
    Raw,
}

/// What a map says of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cell {
    Free,
    Occupied,
    Unknown,
}

/// The walls of the map that `file` describes.
pub(super) fn walls(file: &str, unknown: Unknown, read: Read<'_>) -> Result<Vec<Wall>, MapError> {
    let text = read(file)
        .and_then(|bytes| String::from_utf8(bytes).map_err(std::io::Error::other))
        .map_err(|error| MapError::Description {
            message: format!("cannot read it: {error}"),
        })?;
    let description: Description =
        serde_saphyr::from_str(&text).map_err(|error| MapError::Description {
            message: error.without_snippet().to_string(),
        })?;
    let mode = description.check()?;
    let image = Path::new(file).with_file_name(&description.image);
    let image = image.display().to_string();
    let bytes = read(&image).map_err(|error| MapError::Unreadable {
        image: image.clone(),
        reason: error.to_string(),
    })?;
    let (size, shades) = shades(&image, &bytes)?;
    let solid = shades
        .into_iter()
        .map(|shade| match description.cell(mode, shade) {
            Cell::Free => false,
            Cell::Occupied => true,
            Cell::Unknown => unknown == Unknown::Blocked,
        });
    let grid = Solid {
        width: size[0],
        height: size[1],
        cells: solid.collect(),
        beyond: unknown == Unknown::Blocked,
    };
    let [x, y, heading] = description.origin.value;
    let place = Isometry2::new(Vector2::new(x, y), heading);
    let resolution = description.resolution.value;
    let filling = (FILLING / resolution + 1e-9).floor().max(1.0) as usize;
    Ok(grid
        .walls(filling)
        .map(|wall| wall.map(|corner| place * (corner * resolution)))
        .collect())
}

impl Description {
    /// The mode, where all values are what they must be.
    fn check(&self) -> Result<Mode, MapError> {
        let wrong = |key, line, expected| {
            Err(MapError::Value {
                key,
                line,
                expected,
            })
        };
        if !(self.resolution.value.is_finite() && self.resolution.value > 0.0) {
            let line = self.resolution.referenced.line();
            return wrong("resolution", line, "more than 0 (metres)");
        }
        if self.origin.value.iter().any(|number| !number.is_finite()) {
            let line = self.origin.referenced.line();
            return wrong("origin", line, "[x, y, heading], each a finite number");
        }
        let thresholds = [
            ("occupied_thresh", &self.occupied_thresh),
            ("free_thresh", &self.free_thresh),
        ];
        for (key, threshold) in thresholds {
            if !(0.0..=1.0).contains(&threshold.value) {
                return wrong(key, threshold.referenced.line(), "from 0 to 1");
            }
        }
        if self.free_thresh.value > self.occupied_thresh.value {
            let line = self.free_thresh.referenced.line();
            return wrong("free_thresh", line, "at most `occupied_thresh`");
        }
        if let Some(negate) = self.negate.as_ref().filter(|n| !(0..=1).contains(&n.value)) {
            return wrong("negate", negate.referenced.line(), "0 or 1");
        }
        let Some(mode) = &self.mode else {
            return Ok(Mode::Trinary);
        };
        match mode.value.as_str() {
            "trinary" => Ok(Mode::Trinary),
            "scale" => Ok(Mode::Scale),
            "raw" => Ok(Mode::Raw),
            _ => wrong("mode", mode.referenced.line(), "trinary, scale or raw"),
        }
    }

    /// What a pixel means; `shade` is 0 where it is black and 1 where it is white.
    fn cell(&self, mode: Mode, shade: f64) -> Cell {
        let negated = self.negate.as_ref().is_some_and(|negate| negate.value == 1);
        let occupancy = if negated { shade } else { 1.0 - shade };
        match mode {
            Mode::Raw => match (shade * 255.0).round() as u8 {
                ..100 => Cell::Free,
                100 => Cell::Occupied,
                _ => Cell::Unknown,
            },
            _ if occupancy > self.occupied_thresh.value => Cell::Occupied,
            _ if occupancy < self.free_thresh.value => Cell::Free,
            Mode::Trinary => Cell::Unknown,
            // In between it is known, and can be driven through.
            Mode::Scale => Cell::Free,
        }
    }
}

/// Width and height of a grey map, and its pixels, the highest row first: 0 is black, 1 white.
fn shades(image: &str, bytes: &[u8]) -> Result<([usize; 2], Vec<f64>), MapError> {
    let broken = |reason: String| MapError::Image {
        image: image.to_owned(),
        reason,
    };
    let decoder = PnmDecoder::new(Cursor::new(bytes)).map_err(|error| broken(error.to_string()))?;
    let (width, height) = decoder.dimensions();
    if !(1..=MOST_CELLS).contains(&(u64::from(width) * u64::from(height))) {
        return Err(MapError::Size {
            image: image.to_owned(),
            width,
            height,
        });
    }
    let color = decoder.color_type();
    let mut pixels = vec![0; usize::try_from(decoder.total_bytes()).unwrap_or(usize::MAX)];
    decoder
        .read_image(&mut pixels)
        .map_err(|error| broken(error.to_string()))?;
    let shades = match color {
        ColorType::L8 => pixels.iter().map(|grey| f64::from(*grey) / 255.0).collect(),
        ColorType::L16 => {
            let greys = pixels.as_chunks::<2>().0.iter();
            greys
                .map(|grey| f64::from(u16::from_ne_bytes(*grey)) / 65535.0)
                .collect()
        }
        _ => return Err(broken("it is in colour".to_owned())),
    };
    Ok(([width as usize, height as usize], shades))
}

/// Which cells of a map are solid, the highest row first.
struct Solid {
    width: usize,
    height: usize,
    cells: Vec<bool>,
    /// Whether all beyond the map is.
    beyond: bool,
}

impl Solid {
    /// Whether the cell is solid; columns and rows are counted from 1, from the lower left.
    fn at(&self, column: usize, row: usize) -> bool {
        let inside = (1..=self.width).contains(&column) && (1..=self.height).contains(&row);
        if inside {
            self.cells[(self.height - row) * self.width + column - 1]
        } else {
            self.beyond
        }
    }

    /// Lines between what is solid and what is not, and through what is solid at every `filling`th row, in cells
    /// from the lower left corner.
    fn walls(&self, filling: usize) -> impl Iterator<Item = Wall> {
        let across = (0..=self.height).flat_map(move |row| {
            runs(self.width, move |column| {
                let (below, above) = (self.at(column, row), self.at(column, row + 1));
                let inner = (1..self.height).contains(&row) && row % filling == 0;
                below != above || inner && below && above
            })
            .into_iter()
            .map(move |ends| ends.map(|column| Point2::new(column as f64, row as f64)))
        });
        let along = (0..=self.width).flat_map(move |column| {
            runs(self.height, move |row| {
                self.at(column, row) != self.at(column + 1, row)
            })
            .into_iter()
            .map(move |ends| ends.map(|row| Point2::new(column as f64, row as f64)))
        });
        across.chain(along)
    }
}

/// The stretches of 1 to `length` where `is_wall` holds: where each begins and ends.
fn runs(length: usize, is_wall: impl Fn(usize) -> bool) -> Vec<[usize; 2]> {
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for at in (1..=length).filter(|at| is_wall(*at)) {
        match runs.last_mut() {
            Some([_, end]) if *end == at - 1 => *end = at,
            _ => runs.push([at - 1, at]),
        }
    }
    runs
}

#[cfg(test)]
mod tests;
