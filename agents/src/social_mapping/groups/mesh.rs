//! Who stands next to whom: the Delaunay mesh of people's places (TG 3.2). This file guarantees
//! that the mesh depends on the places alone: people on one spot are its one vertex.

use nalgebra::Point2;
use spade::{
    DelaunayTriangulation, HasPosition, Triangulation as _, mitigate_underflow, validate_coordinate,
};
use std::collections::BTreeMap;

/// The mesh, in indices of the places given.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Mesh {
    /// Pairs of neighbours, the smaller index first, in order. People on one spot are neighbours.
    pub(super) edges: Vec<(usize, usize)>,
    /// Who stands where somebody before them does, after the first of those on the spot.
    pub(super) on_one_spot: Vec<(usize, usize)>,
    /// Triangles, the smallest index first, in order; each vertex stands for one person, the first
    /// of those on the spot.
    pub(super) triangles: Vec<[usize; 3]>,
}

#[derive(Debug, Clone, Copy)]
struct Vertex {
    position: spade::Point2<f64>,
    index: usize,
}

impl HasPosition for Vertex {
    type Scalar = f64;
    fn position(&self) -> spade::Point2<f64> {
        self.position
    }
}

impl Mesh {
    /// The mesh of `places`; O(n log n). A place beyond spade's range (2^201 m) is none: it has no
    /// neighbours, and everybody else the mesh that they would have without it.
    pub(super) fn new(places: &[Point2<f64>]) -> Self {
        let mut spots: BTreeMap<[u64; 2], usize> = BTreeMap::new();
        let mut vertices = Vec::with_capacity(places.len());
        let mut on_one_spot = Vec::new();
        for (index, place) in places.iter().enumerate() {
            // Adding zero makes one zero of both.
            let key = [(place.x + 0.0).to_bits(), (place.y + 0.0).to_bits()];
            match spots.get(&key) {
                Some(first) => on_one_spot.push((*first, index)),
                None => {
                    spots.insert(key, index);
                    let position = mitigate_underflow(spade::Point2::new(place.x, place.y));
                    if [position.x, position.y]
                        .into_iter()
                        .all(|x| validate_coordinate(x).is_ok())
                    {
                        vertices.push(Vertex { position, index });
                    }
                }
            }
        }
        let Ok(mesh) = DelaunayTriangulation::<Vertex>::bulk_load_stable(vertices) else {
            // Every vertex is within its range.
            return Self::default();
        };
        let mut edges = on_one_spot.clone();
        edges.extend(mesh.undirected_edges().map(|edge| {
            let [a, b] = edge.vertices().map(|vertex| vertex.data().index);
            (a.min(b), a.max(b))
        }));
        edges.sort_unstable();
        let mut triangles: Vec<[usize; 3]> = mesh
            .inner_faces()
            .map(|face| {
                let mut corners = face.vertices().map(|vertex| vertex.data().index);
                corners.sort_unstable();
                corners
            })
            .collect();
        triangles.sort_unstable();
        Self {
            edges,
            on_one_spot,
            triangles,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_with_somebody_in_the_middle_has_four_triangles() {
        let places = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (1.0, 1.0)];
        let mesh = Mesh::new(&places.map(|(x, y)| Point2::new(x, y)));
        let expected = [[0, 1, 4], [0, 3, 4], [1, 2, 4], [2, 3, 4]];
        assert_eq!(mesh.triangles, expected);
        assert_eq!(mesh.edges.len(), 8);
    }

    #[test]
    fn few_people_people_in_a_row_and_on_one_spot_have_a_mesh() {
        let row = |places: &[f64]| {
            let places: Vec<_> = places.iter().map(|x| Point2::new(*x, 0.0)).collect();
            Mesh::new(&places)
        };
        assert_eq!(row(&[]), Mesh::default());
        assert_eq!(row(&[1.0]), Mesh::default());
        assert_eq!(row(&[2.0, 1.0]).edges, [(0, 1)]);
        assert_eq!(row(&[3.0, 1.0, 2.0]).edges, [(0, 2), (1, 2)]);
        assert_eq!(row(&[0.0, 1.0, -0.0]).edges, [(0, 1), (0, 2)]);
        assert_eq!(row(&[1e300, 1.0]).edges, []);
    }

    #[test]
    fn who_is_nowhere_takes_no_neighbours_from_others() {
        let mut places = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)]
            .map(|(x, y)| Point2::new(x, y))
            .to_vec();
        let alone = Mesh::new(&places);
        for far in [1e100, f64::INFINITY, f64::NAN] {
            places.push(Point2::new(far, 0.0));
            assert_eq!(Mesh::new(&places), alone);
        }
    }
}
