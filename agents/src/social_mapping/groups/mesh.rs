//! Who stands next to whom: the Delaunay mesh of people's places (TG 3.2). This file guarantees
//! that the mesh depends on the places alone: people on one spot are its one vertex.

use nalgebra::Point2;
use spade::{
    DelaunayTriangulation, HasPosition, HierarchyHintGenerator, Triangulation as _,
    mitigate_underflow, validate_coordinate,
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

/// Finds its way from place to place through a pyramid of ever fewer of them.
type Triangles = DelaunayTriangulation<Vertex, (), (), (), HierarchyHintGenerator<f64>>;

impl Mesh {
    /// The mesh of `places`; O(n log n) wherever they are, also in a row. A place beyond spade's range (2^201 m) is none: it has no
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
        let mut edges = on_one_spot.clone();
        let Some(mesh) = triangles(&mut vertices) else {
            edges.extend(row(&mut vertices));
            edges.sort_unstable();
            return Self {
                edges,
                on_one_spot,
                triangles: Vec::new(),
            };
        };
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

/// The triangles of vertices on different spots; `None` where all are exactly in a row.
///
/// Who comes in the order of the places would have to look past everybody before them, and as long as all are in a row
/// there is no shorter way to one of them. So the first three span a triangle, and the others come as if by chance.
fn triangles(vertices: &mut [Vertex]) -> Option<Triangles> {
    vertices.sort_by_key(|vertex| scattered(vertex.position));
    let first = vertices.first()?.position;
    let far = farthest(vertices, |place| {
        (place.x - first.x).hypot(place.y - first.y)
    })?;
    let mut mesh = Triangles::new();
    mesh.insert(vertices[0]).ok()?;
    mesh.insert(vertices[far]).ok()?;
    let line = mesh.directed_edges().next()?;
    let way = line.positions();
    let aside = farthest(vertices, |place| {
        let (x, y) = (way[1].x - way[0].x, way[1].y - way[0].y);
        let aside = (x * (place.y - way[0].y) - y * (place.x - way[0].x)).abs();
        // The sum above rounds; the query is exact.
        if line.side_query(place).is_on_line() {
            0.0
        } else {
            aside.max(f64::MIN_POSITIVE)
        }
    })?;
    mesh.insert(vertices[aside]).ok()?;
    let first = [0, far, aside];
    for (at, vertex) in vertices.iter().enumerate() {
        if !first.contains(&at) {
            mesh.insert(*vertex).ok()?;
        }
    }
    Some(mesh)
}

/// Which vertex has the greatest distance, where one has any.
fn farthest(vertices: &[Vertex], distance: impl Fn(spade::Point2<f64>) -> f64) -> Option<usize> {
    let distances = vertices.iter().map(|vertex| distance(vertex.position));
    let (at, most) = distances
        .enumerate()
        .max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    (most > 0.0).then_some(at)
}

/// A number for a place, as unlike those of its neighbours as if drawn (the finalizer of `SplitMix64`).
fn scattered(place: spade::Point2<f64>) -> u64 {
    let mixed = |mut z: u64| {
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    mixed(mixed(place.x.to_bits()).wrapping_add(place.y.to_bits()))
}

/// Neighbours among vertices that are all in a row.
fn row(vertices: &mut [Vertex]) -> Vec<(usize, usize)> {
    vertices.sort_by(|a, b| {
        let (a, b) = (a.position, b.position);
        a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y))
    });
    let pairs = vertices
        .windows(2)
        .map(|pair| (pair[0].index, pair[1].index));
    pairs.map(|(a, b)| (a.min(b), a.max(b))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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

    /// Places without any structure, in [0, 1) each way.
    fn chance(count: u64) -> impl Iterator<Item = f64> {
        let place = |at: u64| spade::Point2::new(at as f64, 0.0);
        (0..count).map(move |at| (scattered(place(at)) >> 11) as f64 / (1u64 << 53) as f64)
    }

    /// Where each new place is looked for past all that are there already, this takes minutes.
    #[test]
    fn rows_of_a_hundred_thousand_have_a_mesh() {
        const MANY: usize = 100_000;
        let chance: Vec<f64> = chance(MANY as u64).collect();
        let place = |at: usize, kind: usize| {
            let along = at as f64;
            match kind {
                0 => Point2::new(0.5 * along, 0.0),
                1 => Point2::new(0.0, -2.0 * along),
                // Beside the line by what rounding leaves.
                2 => Point2::new(0.3 * along, 0.1 * along),
                3 => Point2::new(0.5 * along, 1e-9 * chance[at]),
                // Two rows, and one beside everybody.
                4 => Point2::new((at / 2) as f64, (at % 2) as f64),
                _ => Point2::new(0.5 * along, if at == 7 { 3.0 } else { 0.0 }),
            }
        };
        let counts: Vec<[usize; 2]> = (0..6)
            .map(|kind| {
                let places: Vec<_> = (0..MANY).map(|at| place(at, kind)).collect();
                let mesh = Mesh::new(&places);
                [mesh.edges.len(), mesh.triangles.len()]
            })
            .collect();
        assert_eq!(counts[..2], [[MANY - 1, 0]; 2]);
        assert_eq!(counts[4], [2 * MANY - 3, MANY - 2]);
        assert_eq!(counts[5], [2 * MANY - 3, MANY - 2]);
        for [edges, triangles] in counts {
            // Euler: no crossing, no hole.
            assert!(triangles == 0 || edges == MANY - 1 + triangles);
        }
    }

    proptest! {
        #[test]
        fn no_place_is_within_the_circle_of_a_triangle(
            places in prop::collection::btree_set((-9i32..9, -9i32..9), 0..40),
        ) {
            let places: Vec<_> = places
                .into_iter()
                .map(|(x, y)| Point2::new(f64::from(x), f64::from(y)))
                .collect();
            let mesh = Mesh::new(&places);
            for corners in &mesh.triangles {
                let [a, b, c] = corners.map(|corner| places[corner]);
                for place in &places {
                    let [a, b, c] = [a, b, c].map(|corner| corner - place);
                    let square = |v: nalgebra::Vector2<f64>| v.norm_squared();
                    let within = square(a) * b.perp(&c) + square(b) * c.perp(&a) + square(c) * a.perp(&b);
                    let turn = (b - a).perp(&(c - a));
                    prop_assert!(within * turn.signum() <= 0.0, "{place} in {corners:?}");
                }
            }
            let mut reversed = places.clone();
            reversed.reverse();
            let mut renamed: Vec<(usize, usize)> = Mesh::new(&reversed)
                .edges
                .into_iter()
                .map(|(a, b)| (places.len() - 1 - b, places.len() - 1 - a))
                .collect();
            renamed.sort_unstable();
            prop_assert_eq!(mesh.edges, renamed);
        }
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
