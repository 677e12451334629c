//! Which detection belongs to which track. Guarantees the matching of greatest total benefit, and
//! the same one on every run.

use pathfinding::kuhn_munkres::kuhn_munkres;
use pathfinding::matrix::Matrix;

/// That `row` may be matched with `column`, and how much is gained by it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Index of the first, such as a track.
    pub row: usize,
    /// Index of the second, such as a detection.
    pub column: usize,
    /// What is gained over leaving both unmatched. A pair that gains nothing is never matched.
    pub benefit: f64,
}

/// Benefits are compared in whole millionths: Kuhn-Munkres stops for certain on integers only.
const UNITS: f64 = 1e6;
/// Larger benefits count as this one, so that no sum of them overflows.
const GREATEST: f64 = 1e6;

/// The pairs (row, column) of the matching with the greatest sum of benefits, in order of row. Rows
/// and columns may stay unmatched.
///
/// # Complexity
/// Solved apart for each connected component of the graph that `pairs` span, O(k^3) for one of k
/// rows and columns: gated tracks of many people fall into small components.
///
/// # Panics
/// Where a row is not below `rows` or a column not below `columns`.
pub fn assign(rows: usize, columns: usize, pairs: &[Pair]) -> Vec<(usize, usize)> {
    let mut useful: Vec<(usize, usize, i64)> = pairs
        .iter()
        .map(|p| {
            (
                p.row,
                p.column,
                (p.benefit.min(GREATEST) * UNITS).round() as i64,
            )
        })
        .filter(|&(_, _, weight)| weight > 0)
        .collect();
    let component = components(rows, columns, &useful);
    useful.sort_unstable_by_key(|&(row, column, _)| (component[row], row, column));
    let mut matched = Vec::new();
    for group in useful.chunk_by(|a, b| component[a.0] == component[b.0]) {
        match group {
            [(row, column, _)] => matched.push((*row, *column)),
            _ => solve(group, &mut matched),
        }
    }
    matched.sort_unstable();
    matched
}

/// For each row, the least row of its connected component.
fn components(rows: usize, columns: usize, pairs: &[(usize, usize, i64)]) -> Vec<usize> {
    fn root(parent: &mut [usize], mut node: usize) -> usize {
        while parent[node] != node {
            parent[node] = parent[parent[node]];
            node = parent[node];
        }
        node
    }
    let mut parent: Vec<usize> = (0..rows + columns).collect();
    for &(row, column, _) in pairs {
        let (a, b) = (root(&mut parent, row), root(&mut parent, rows + column));
        parent[a.max(b)] = a.min(b);
    }
    (0..rows).map(|row| root(&mut parent, row)).collect()
}

/// Solves one component and adds its pairs to `matched`.
fn solve(group: &[(usize, usize, i64)], matched: &mut Vec<(usize, usize)>) {
    let mut row_names: Vec<usize> = group.iter().map(|g| g.0).collect();
    let mut column_names: Vec<usize> = group.iter().map(|g| g.1).collect();
    for names in [&mut row_names, &mut column_names] {
        names.sort_unstable();
        names.dedup();
    }
    // Kuhn-Munkres wants at least as many columns as rows. Weight 0 stands for "not matched".
    let transposed = row_names.len() > column_names.len();
    let (height, width) = if transposed {
        (column_names.len(), row_names.len())
    } else {
        (row_names.len(), column_names.len())
    };
    let mut weights = Matrix::new(height, width, 0i64);
    for &(row, column, weight) in group {
        let row = row_names.partition_point(|&name| name < row);
        let column = column_names.partition_point(|&name| name < column);
        weights[if transposed {
            (column, row)
        } else {
            (row, column)
        }] = weight;
    }
    let (_, columns) = kuhn_munkres(&weights);
    for (i, j) in columns.into_iter().enumerate() {
        if weights[(i, j)] > 0 {
            let (row, column) = if transposed { (j, i) } else { (i, j) };
            matched.push((row_names[row], column_names[column]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The greatest sum, by trying every matching.
    fn best(row: usize, rows: usize, free: &mut [bool], benefit: &[Vec<f64>]) -> f64 {
        if row == rows {
            return 0.0;
        }
        let mut greatest = best(row + 1, rows, free, benefit);
        for column in 0..free.len() {
            if free[column] && benefit[row][column] > 0.0 {
                free[column] = false;
                greatest = greatest.max(benefit[row][column] + best(row + 1, rows, free, benefit));
                free[column] = true;
            }
        }
        greatest
    }

    proptest! {
        #[test]
        fn no_matching_gains_more(
            rows in 0usize..6, columns in 0usize..6,
            cells in prop::collection::vec(prop_oneof![Just(0.0), 0.01f64..10.0], 36),
        ) {
            let benefit: Vec<Vec<f64>> = (0..rows).map(|r| cells[r * 6..][..columns].to_vec()).collect();
            let pairs: Vec<Pair> = (0..rows)
                .flat_map(|row| (0..columns).map(move |column| (row, column)))
                .map(|(row, column)| Pair { row, column, benefit: benefit[row][column] })
                .collect();
            let matched = assign(rows, columns, &pairs);
            let mut seen_columns: Vec<usize> = matched.iter().map(|m| m.1).collect();
            seen_columns.sort_unstable();
            seen_columns.dedup();
            prop_assert_eq!(seen_columns.len(), matched.len());
            prop_assert!(matched.windows(2).all(|w| w[0].0 < w[1].0));
            let sum: f64 = matched.iter().map(|&(r, c)| benefit[r][c]).sum();
            let expected = best(0, rows, &mut vec![true; columns], &benefit);
            prop_assert!((sum - expected).abs() < 1e-4, "{sum} of {expected}");
        }
    }

    #[test]
    fn two_fair_matches_beat_one_good_one_only_where_they_sum_to_more() {
        let pairs = |outer: f64| {
            [(0, 0, 5.0), (0, 1, outer), (1, 0, outer)].map(|(row, column, benefit)| Pair {
                row,
                column,
                benefit,
            })
        };
        assert_eq!(assign(2, 2, &pairs(2.0)), [(0, 0)]);
        assert_eq!(assign(2, 2, &pairs(3.0)), [(0, 1), (1, 0)]);
    }

    #[test]
    fn a_pair_that_gains_nothing_is_left_alone() {
        assert_eq!(
            assign(
                1,
                1,
                &[Pair {
                    row: 0,
                    column: 0,
                    benefit: -1.0
                }]
            ),
            []
        );
    }
}
