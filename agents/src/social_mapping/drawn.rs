//! What stands on the grid, and how it becomes what shall stand there. This file owns the updating:
//! it finds which stamps came, went or changed, clears the cells that these may touch, and draws in them
//! what belongs there. What it leaves equals, bit for bit, what drawing anew would give.

use super::config::SocialConfig;
use super::found::FoundGroup;
use super::groups::TooCrowded;
use super::layers::{self, Layer};
use super::map::PersonSpaces;
use super::scene::{Object, Person, SocialScene, Wall};
use super::stamps::{Inflation, Stamp};
use crate::grid::{CostGrid, Region};
use nalgebra::Point2;
use std::ops::Range;
use std::sync::Arc;

/// All that an update starts from.
#[derive(Debug, Clone)]
pub(super) struct Drawn {
    bounds: [f64; 4],
    walls: Vec<Wall>,
    robot_radius: f64,
    pub(super) social: bool,
    wall_stamps: Vec<Stamp>,
    /// The walls alone.
    base: CostGrid,
    stamps: Vec<Stamp>,
    windows: Vec<Region>,
    pub(super) grid: Arc<CostGrid>,
    /// Clipping by walls is the dearest step, so spaces are kept while their object rests,
    pub(super) spaces: Vec<(Object, Arc<[Point2<f64>]>)>,
    /// outlines while their person does,
    pub(super) people: Vec<(Person, Arc<PersonSpaces>)>,
    /// and groups while everybody does.
    pub(super) groups: Result<Arc<[FoundGroup]>, TooCrowded>,
}

impl Drawn {
    pub(super) fn new(config: &SocialConfig, scene: &SocialScene) -> Self {
        let mut base = CostGrid::covering(scene.bounds, config.resolution);
        let inflation = inflation(config, scene.robot_radius);
        let stamp = |wall: &Wall| Stamp::Wall {
            wall: *wall,
            inflation,
        };
        let wall_stamps: Vec<Stamp> = scene.walls.iter().map(stamp).collect();
        let whole = base.whole();
        for wall in &wall_stamps {
            wall.draw(&mut base, &whole);
        }
        Self {
            bounds: scene.bounds,
            walls: scene.walls.clone(),
            robot_radius: scene.robot_radius,
            social: scene.social,
            wall_stamps,
            grid: Arc::new(base.clone()),
            base,
            stamps: Vec::new(),
            windows: Vec::new(),
            spaces: Vec::new(),
            people: Vec::new(),
            groups: Ok(Arc::default()),
        }
    }

    /// Whether the walls of `scene` are the ones drawn.
    #[expect(
        clippy::float_cmp,
        reason = "asks for the same scene, not for a similar one"
    )]
    pub(super) fn fits(&self, scene: &SocialScene) -> bool {
        self.bounds == scene.bounds
            && self.walls == scene.walls
            && self.robot_radius == scene.robot_radius
    }

    /// Replaces the stamps; the region in which costs changed.
    pub(super) fn redraw(&mut self, stamps: Vec<Stamp>) -> Region {
        let windows: Vec<Region> = stamps.iter().map(|s| s.window(&self.base)).collect();
        let dirty = self.dirty(&stamps, &windows);
        if dirty.is_empty() {
            (self.stamps, self.windows) = (stamps, windows);
            return Region::default();
        }
        let grid = Arc::make_mut(&mut self.grid);
        let width = grid.width;
        let mut changed = Region::default();
        let mut before = Vec::new();
        // Two regions may overlap: what is cleared for the one is drawn again before the other.
        for region in &dirty {
            before.clear();
            for range in region.row_ranges(width) {
                before.extend_from_slice(&grid.costs[range.clone()]);
                grid.costs[range.clone()].copy_from_slice(&self.base.costs[range]);
            }
            for (stamp, window) in stamps.iter().zip(&windows) {
                if window.meets(region) {
                    stamp.draw(grid, region);
                }
            }
            changed = changed.joined(&differing(region, grid, &before));
        }
        self.stamps = stamps;
        self.windows = windows;
        changed
    }

    /// The regions of stamps that are new or gone.
    fn dirty(&self, stamps: &[Stamp], windows: &[Region]) -> Vec<Region> {
        // Where something came or went, what is before and after it stands as it did.
        let (same_before, same_after) = if stamps.len() == self.stamps.len() {
            (0, 0)
        } else {
            let shorter = stamps.len().min(self.stamps.len());
            let pairs = || self.stamps.iter().zip(stamps);
            let before = pairs().take_while(|(was, is)| was == is).count();
            let backwards = self.stamps.iter().rev().zip(stamps.iter().rev());
            let after = backwards.take_while(|(was, is)| was == is).count();
            (before, after.min(shorter - before))
        };
        let was = same_before..self.stamps.len() - same_after;
        let is = same_before..stamps.len() - same_after;
        let mut dirty = Vec::new();
        let mut area = 0;
        for at in 0..was.len().max(is.len()) {
            let place = |range: &Range<usize>| Some(range.start + at).filter(|i| range.contains(i));
            let (was, is) = (place(&was), place(&is));
            if was.map(|i| &self.stamps[i]) == is.map(|i| &stamps[i]) {
                continue;
            }
            let was = was.map_or_else(Region::default, |i| self.windows[i]);
            let is = is.map_or_else(Region::default, |i| windows[i]);
            area += was.area() + is.area();
            if was.meets(&is) {
                dirty.push(was.joined(&is));
            } else {
                dirty.extend([was, is].into_iter().filter(|region| !region.is_empty()));
            }
        }
        // Where most of the grid is touched, going over it once is the least.
        if 2 * area > self.base.whole().area() {
            let all = dirty.into_iter().reduce(|all, one| all.joined(&one));
            dirty = all.into_iter().collect();
        }
        dirty
    }

    /// A layer of what stands on the grid.
    pub(super) fn layer(&self, layer: Layer) -> CostGrid {
        let mut grid = CostGrid::covering(self.bounds, self.base.resolution);
        let stamps = self.wall_stamps.iter().chain(&self.stamps);
        layers::draw(layer, self.social, stamps, &mut grid);
        grid
    }
}

/// How obstacles grow for this robot. However slim it is, a wall blocks each cell it passes
/// through, so no path slips through a wall.
pub(super) fn inflation(config: &SocialConfig, robot_radius: f64) -> Inflation {
    let bare = Inflation::none(config.resolution);
    Inflation {
        reach: robot_radius.max(bare.reach),
        extra: config.clearance_cost,
        width: config.clearance_width,
    }
}

/// The smallest region around the cells of `region` that cost something else than `before`.
fn differing(region: &Region, grid: &CostGrid, before: &[f32]) -> Region {
    let (first, last) = region.columns;
    let mut changed = Region::default();
    let rows = (region.rows.0..).zip(region.row_ranges(grid.width));
    for ((row, range), before) in rows.zip(before.chunks_exact((last - first).max(1))) {
        let now = &grid.costs[range];
        if now == before {
            continue;
        }
        let differs = |column: &usize| now[*column].to_bits() != before[*column].to_bits();
        let low = (0..now.len()).find(differs);
        let high = (0..now.len()).rfind(differs);
        if let (Some(low), Some(high)) = (low, high) {
            changed = changed.joined(&Region {
                columns: (first + low, first + high + 1),
                rows: (row, row + 1),
            });
        }
    }
    changed
}
