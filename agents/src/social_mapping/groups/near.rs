//! Who is around a place, without asking everybody: people sorted into square cells.

use nalgebra::Point2;
use std::collections::BTreeMap;

/// People by the cell that they stand in.
#[derive(Debug)]
pub(super) struct Near<'a> {
    places: &'a [Point2<f64>],
    reach: f64,
    cells: BTreeMap<[i64; 2], Vec<usize>>,
}

impl<'a> Near<'a> {
    /// Sorts finite `places` into cells of the side `reach`, metres.
    pub(super) fn new(places: &'a [Point2<f64>], reach: f64) -> Self {
        let mut cells: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
        for (index, place) in places.iter().enumerate() {
            cells.entry(cell(*place, reach)).or_default().push(index);
        }
        Self {
            places,
            reach,
            cells,
        }
    }

    /// Everybody within the reach of `point`, in an order that depends on the places alone.
    pub(super) fn around(&self, point: Point2<f64>) -> impl Iterator<Item = usize> + '_ {
        self.block(cell(point, self.reach))
            .flatten()
            .copied()
            .filter(move |index| (self.places[*index] - point).norm() <= self.reach)
    }

    /// How many pairs of people there are who stand in one cell or in two that touch.
    pub(super) fn pairs(&self) -> usize {
        let ordered: usize = self
            .cells
            .iter()
            .map(|(cell, here)| here.len() * (self.block(*cell).map(Vec::len).sum::<usize>() - 1))
            .sum();
        ordered / 2
    }

    /// The greatest number of people who stand in a cell and those that touch it.
    pub(super) fn most(&self) -> usize {
        let blocks = self.cells.keys();
        let counts = blocks.map(|cell| self.block(*cell).map(Vec::len).sum());
        counts.max().unwrap_or_default()
    }

    /// The people of a cell and of those that touch it.
    fn block(&self, [column, row]: [i64; 2]) -> impl Iterator<Item = &Vec<usize>> + '_ {
        (row.saturating_sub(1)..=row.saturating_add(1))
            .flat_map(move |row| {
                (column.saturating_sub(1)..=column.saturating_add(1))
                    .map(move |column| [column, row])
            })
            .filter_map(|key| self.cells.get(&key))
    }
}

fn cell(point: Point2<f64>, side: f64) -> [i64; 2] {
    [point.x, point.y].map(|x| (x / side).floor() as i64)
}
