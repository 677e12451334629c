//! Square cells in a picture: what costs the robot what, and the density of a crowd. This file
//! guarantees that a picture has no more cells than can be seen, however many the map has.

use super::super::canvas::{View, rectangle};
use super::{BANDS, cost_colour, density_colour};
use agents::grid::CostGrid;
use agents::social_mapping::Update;
use agents::social_mapping::density::{DensityField, Source};
use nalgebra::{Point2, Vector2};
use svg::node::element::Group;

/// With more people than this, nobody's outlines and body are drawn: they would cover each other.
const CROWD: usize = 2000;
/// Cells along the longer side, at most: about a pixel each.
const MOST: usize = 800;

/// How far a row of cells reaches into the one below, px.
const OVERLAP: f64 = 0.4;

/// Whether there are too many people to draw each.
pub(super) fn is_crowd(update: &Update) -> bool {
    update.people.len() > CROWD
}

/// A row of cells after the other, from the lowest y.
struct Cells {
    origin: Point2<f64>,
    side: f64,
    width: usize,
    values: Vec<f32>,
}

impl Cells {
    /// Neighbours of one colour in a row in one piece.
    fn draw(&self, view: &View, colour: impl Fn(f32) -> Option<String>) -> Group {
        let mut group = Group::new().set("shape-rendering", "crispEdges");
        for (row, values) in self.values.chunks(self.width).enumerate() {
            let mut column = 0;
            for run in values.chunk_by(|a, b| a.to_bits() == b.to_bits()) {
                let start = column;
                column += run.len();
                let Some(colour) = colour(run[0]) else {
                    continue;
                };
                let corner = |column: usize, row: usize| {
                    let step = Vector2::new(column as f64, row as f64) * self.side;
                    view.page(self.origin + step)
                };
                let (low, high) = (corner(start, row), corner(column, row + 1));
                let (width, height) = (high.x - low.x, low.y - high.y);
                // Into the row below, which is drawn already: rounded to pixels, rows may leave gaps.
                let piece = rectangle(low.x, high.y, width, height + OVERLAP);
                group = group.add(piece.set("fill", colour));
            }
        }
        group
    }
}

/// What places cost. Where there are more cells than can be seen, the dearest of several shows.
pub(super) fn costs(view: &View, grid: &CostGrid) -> Group {
    let step = grid.width.max(grid.height).div_ceil(MOST).max(1);
    let width = grid.width.div_ceil(step);
    let mut values = vec![0.0f32; width * grid.height.div_ceil(step)];
    for (at, cost) in grid.costs.iter().enumerate() {
        let (column, row) = (at % grid.width / step, at / grid.width / step);
        let value = &mut values[row * width + column];
        *value = value.max(*cost);
    }
    let cells = Cells {
        origin: grid.origin,
        side: grid.resolution * step as f64,
        width,
        values,
    };
    cells.draw(view, cost_colour)
}

/// The density of a crowd, in the bands that single people's have.
pub(super) fn density(view: &View, update: &Update) -> Group {
    let grid = &update.grid;
    let [across, up] = [grid.width, grid.height].map(|cells| cells as f64 * grid.resolution);
    let side = (across.max(up) / MOST as f64).max(f64::EPSILON);
    let size = [across, up].map(|length| ((length / side).ceil() as usize).clamp(1, MOST));
    let people = update.people.iter().map(|person| Source {
        world_from_person: person.world_from_person,
        shape: person.shape,
    });
    let people: Vec<Source> = people.collect();
    let field = DensityField::new(grid.origin, side, size, &people);
    let steps = (BANDS + 1) as f32;
    let cells = Cells {
        origin: grid.origin,
        side,
        width: size[0],
        values: field
            .densities()
            .iter()
            .map(|density| (density * steps).floor() / steps)
            .collect(),
    };
    cells.draw(view, |level| {
        (level > 0.0).then(|| density_colour(f64::from(level)))
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Show, social};
    use super::*;
    use crate::scenes::{Frame, Seen};
    use crate::situation::Situation;
    use agents::social_mapping::{Layer, SocialConfig};
    use nalgebra::Isometry2;

    fn picture(count: u32, show: Show) -> String {
        let seen = |id: u32| Seen {
            id: id.into(),
            pose: Isometry2::new(
                Vector2::new(f64::from(id % 50) * 2.0, f64::from(id / 50) * 2.0),
                f64::from(id),
            ),
            activity: None,
            features: None,
            task: None,
        };
        let frame = Frame {
            time: 0.0,
            people: (0..count).map(seen).collect(),
            truth: None,
        };
        let config = SocialConfig::default();
        let situation = Situation::of_frame("many", &frame, &config);
        let (update, _) = situation.map(&config).unwrap();
        social(&situation, &update, &config, show)
    }

    #[test]
    fn of_a_crowd_the_density_shows_and_nobody_by_themselves() {
        let few = picture(20, Show::Density);
        assert!(few.contains("person, facing") && few.contains("<circle"));
        let many = picture(2001, Show::Density);
        assert!(many.contains("too many to draw each") && !many.contains("<circle"));
        let densest = density_colour(0.9);
        assert!(many.matches(&format!("fill=\"{densest}\"")).count() > 2001);
    }

    #[test]
    fn what_is_smaller_than_can_be_seen_is_drawn_as_one() {
        let view = View::new([0.0, 0.0, 200.0, 1.0], 0.0, [0.0, 0.0], [800.0, 800.0]);
        let mut grid = CostGrid::covering([0.0, 0.0, 200.0, 1.0], 0.1);
        for cost in grid.costs.iter_mut().step_by(3) {
            *cost = 4.0;
        }
        let drawn = costs(&view, &grid).to_string();
        assert!(drawn.matches("<rect").count() <= 4, "{drawn}");
        let layer = picture(2001, Show::Costs(Layer::Master));
        assert!(layer.matches("<rect").count() < MOST * MOST);
    }
}
