//! Paper TG's groups, to the letter (TG 3.2, READING.md item 19): a triangle of the Delaunay mesh is
//! a group where its sides are short and all three orientation vectors end in it. Such a group cannot be
//! two people; that is the paper's rule, and this method is there to compare with.

use super::super::limits::{MOST_LENGTH, is_length};
use super::mesh::Mesh;
use super::union::Union;
use nalgebra::{Isometry2, Point2};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The paper's two rules. It gives its lengths in units of its pictures (0.40, 0.32 of their side)
/// and the vectors' length not at all; these are metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Triangulation {
    /// The longest side of a triangle (eq. 1), metres: Hall's far personal distance for two who reach
    /// out to each other, rounded up.
    pub longest_side: f64,
    /// The length of the orientation vectors (eq. 2), metres; with 0 only distances count.
    pub vector: f64,
}

impl Default for Triangulation {
    fn default() -> Self {
        Self {
            longest_side: 2.0,
            vector: 0.4,
        }
    }
}

impl Triangulation {
    pub(super) fn is_valid(&self) -> bool {
        self.longest_side > 0.0 && self.longest_side <= MOST_LENGTH && is_length(self.vector)
    }

    /// The groups of people with finite poses, as indices in order.
    pub(super) fn groups(&self, people: &[Isometry2<f64>]) -> Vec<Vec<usize>> {
        let places: Vec<Point2<f64>> = people
            .iter()
            .map(|pose| pose.translation.vector.into())
            .collect();
        let ends: Vec<Point2<f64>> = people
            .iter()
            .map(|pose| pose * Point2::new(self.vector, 0.0))
            .collect();
        let short = |t: &[usize; 3]| {
            let side = |a: usize, b: usize| (places[t[a]] - places[t[b]]).norm();
            side(0, 1).max(side(1, 2)).max(side(2, 0)) <= self.longest_side
        };
        let mesh = Mesh::new(&places);
        let triangles: Vec<[usize; 3]> = mesh.triangles.iter().copied().filter(short).collect();
        let ends_in =
            |person: usize, t: &[usize; 3]| contains(t.map(|corner| places[corner]), ends[person]);
        let (main, others): (Vec<[usize; 3]>, Vec<_>) = triangles
            .into_iter()
            .partition(|t| t.iter().all(|person| ends_in(*person, t)));
        let mut union = Union::new(people.len());
        for t in &main {
            union.join(t[0], t[1]);
            union.join(t[1], t[2]);
        }
        // Corners come in order, so a side has one name.
        let mut by_side: BTreeMap<[usize; 2], Vec<&[usize; 3]>> = BTreeMap::new();
        for t in &main {
            for side in [[t[0], t[1]], [t[0], t[2]], [t[1], t[2]]] {
                by_side.entry(side).or_default().push(t);
            }
        }
        // A peripheral triangle shares a side with a main one; its third corner comes in where that
        // person's vector ends in the peripheral triangle or in the main one.
        for t in &others {
            for outer in 0..3 {
                let [a, b] = [t[(outer + 1) % 3], t[(outer + 2) % 3]];
                let (person, base) = (t[outer], [a.min(b), a.max(b)]);
                let beside = by_side.get(&base).and_then(|beside| beside.first());
                if beside.is_some_and(|m| ends_in(person, t) || ends_in(person, m)) {
                    union.join(person, base[0]);
                }
            }
        }
        // On one spot with a member is in the group: the mesh, which has one corner there, cannot tell them apart.
        for (first, other) in mesh.on_one_spot {
            if union.is_joined(first) {
                union.join(first, other);
            }
        }
        union.groups()
    }
}

/// Whether the triangle, closed, contains the point.
fn contains(corners: [Point2<f64>; 3], point: Point2<f64>) -> bool {
    let side = |i: usize| {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        (b - a).perp(&(point - a))
    };
    let sides = [side(0), side(1), side(2)];
    sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0)
}

#[cfg(test)]
mod tests {
    use super::super::tests::facing_centre;
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn three_who_face_their_middle_are_a_group_and_two_never_are() {
        let rules = Triangulation::default();
        assert_eq!(
            rules.groups(&facing_centre(0.0, 0.0, 0.7, 3)),
            [vec![0, 1, 2]]
        );
        assert!(rules.groups(&facing_centre(0.0, 0.0, 0.7, 2)).is_empty());
        assert!(rules.groups(&facing_centre(0.0, 0.0, 1.5, 3)).is_empty());
    }

    #[test]
    fn a_fourth_belongs_to_it_where_facing_it() {
        // TG Figs 6 and 7.
        let mut people = facing_centre(0.0, 0.0, 0.7, 3);
        let beyond = Vector2::new(-0.9, 0.0);
        people.push(Isometry2::new(beyond, std::f64::consts::PI));
        assert_eq!(Triangulation::default().groups(&people), [vec![0, 1, 2]]);
        people[3] = Isometry2::new(beyond, 0.0);
        assert_eq!(Triangulation::default().groups(&people), [vec![0, 1, 2, 3]]);
    }
}
