//! A group as one entity (TG 3.3.4, READING.md item 20): where it is, where it faces, how far it
//! reaches to its four sides, and a Gaussian of its own. A group has a place in all cases: where its members
//! face each other and no mean heading exists, the stated fall-back holds.

use super::super::four_sided::FourSided;
use nalgebra::{Isometry2, Point2, Vector2};
use std::f64::consts::FRAC_PI_4;

/// With a mean of the unit headings shorter than this, the members face no common way.
const NO_COMMON_HEADING: f64 = 0.1;

/// A group seen as one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroupEntity {
    /// The mean of the members' places, and the circular mean of their headings. Where that
    /// vanishes, the direction from the centre to the first member.
    pub world_from_group: Isometry2<f64>,
    /// From the centre to the farthest member ahead, to the left, behind and to the right, metres.
    /// A quarter without a member has 0.
    pub extent: FourSided,
    /// How far the members reach along the four directions, whichever quarter they are in, metres.
    reach: FourSided,
}

impl GroupEntity {
    /// The entity of members at these poses; `None` with nobody.
    pub fn new(members: &[Isometry2<f64>]) -> Option<Self> {
        let first = members.first()?;
        let count = members.len() as f64;
        let centre = members
            .iter()
            .map(|pose| pose.translation.vector)
            .sum::<Vector2<f64>>()
            / count;
        let mean = members
            .iter()
            .map(|pose| pose.rotation * Vector2::x())
            .sum::<Vector2<f64>>()
            / count;
        let towards_first = first.translation.vector - centre;
        let heading = if mean.norm() >= NO_COMMON_HEADING {
            mean
        } else if towards_first.norm() > 0.0 {
            towards_first
        } else {
            Vector2::x()
        };
        let world_from_group = Isometry2::new(centre, heading.y.atan2(heading.x));
        let mut extent = FourSided::from_sides([0.0; 4]);
        let mut reach = [0.0f64; 4];
        for member in members {
            let place =
                world_from_group.inverse_transform_point(&Point2::from(member.translation.vector));
            let angle = place.y.atan2(place.x);
            let side = if angle.abs() <= FRAC_PI_4 {
                &mut extent.front
            } else if angle.abs() >= 3.0 * FRAC_PI_4 {
                &mut extent.rear
            } else if angle > 0.0 {
                &mut extent.left
            } else {
                &mut extent.right
            };
            *side = side.max(place.coords.norm());
            for (most, along) in reach.iter_mut().zip([place.x, place.y, -place.x, -place.y]) {
                *most = most.max(along);
            }
        }
        Some(Self {
            world_from_group,
            extent,
            reach: FourSided::from_sides(reach),
        })
    }

    /// The widths of the group's own Gaussian: to each side a person's width beyond the extent, or beyond whoever of
    /// another quarter reaches further that way. So no side is without width where nobody stands, and who stands
    /// between two sides is not left outside. TG says that the shape follows the four points and prints no law; this
    /// one is ours.
    pub fn widths(&self, person: &FourSided) -> FourSided {
        let (extent, reach, person) = (self.extent.sides(), self.reach.sides(), person.sides());
        FourSided::from_sides(std::array::from_fn(|side| {
            extent[side].max(reach[side]) + person[side]
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::facing_centre;
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn at(x: f64, y: f64, heading: f64) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(x, y), heading)
    }

    #[test]
    fn three_abreast_who_walk_north_reach_to_both_sides() {
        let people = [
            at(0.0, 1.0, FRAC_PI_2),
            at(0.8, 1.0, FRAC_PI_2),
            at(1.6, 1.0, FRAC_PI_2),
        ];
        let group = GroupEntity::new(&people).unwrap();
        assert!(
            (group.world_from_group.translation.vector - Vector2::new(0.8, 1.0)).norm() < 1e-12
        );
        assert!((group.world_from_group.rotation.angle() - FRAC_PI_2).abs() < 1e-12);
        let FourSided {
            front,
            left,
            rear,
            right,
        } = group.extent;
        assert!((left - 0.8).abs() < 1e-12 && (right - 0.8).abs() < 1e-12);
        assert!(front.abs() < 1e-12 && rear.abs() < 1e-12);
        let widths = group.widths(&FourSided::HALL);
        assert!((widths.left - 1.55).abs() < 1e-12 && (widths.rear - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_side_without_anybody_has_a_persons_width_and_nobody_is_outside_of_the_groups_space() {
        // Two who look the same way, one ahead to the left of the other: just inside the quarter to the left.
        let people = [at(0.0, 0.0, 0.0), at(2.0, 2.1, 0.0)];
        let group = GroupEntity::new(&people).unwrap();
        assert_eq!(
            group.extent.sides().map(|side| side > 0.0),
            [false, true, false, true]
        );
        let widths = group.widths(&FourSided::HALL);
        for (side, least) in widths.sides().into_iter().zip(FourSided::HALL.sides()) {
            assert!(side >= least);
        }
        for one in &people {
            let place = Point2::from(one.translation.vector);
            assert!(widths.density(&group.world_from_group, place) > 0.5);
        }
    }

    #[test]
    fn headings_are_averaged_as_directions() {
        let people = [at(0.0, 0.0, PI - 0.1), at(1.0, 0.0, -PI + 0.1)];
        let group = GroupEntity::new(&people).unwrap();
        assert!((group.world_from_group.rotation.angle().abs() - PI).abs() < 1e-9);
    }

    #[test]
    fn who_face_each_other_look_to_the_first() {
        let people = facing_centre(2.0, 1.0, 0.6, 2);
        let group = GroupEntity::new(&people).unwrap();
        let first = people[0].translation.vector - Vector2::new(2.0, 1.0);
        let heading = group.world_from_group.rotation * Vector2::x();
        assert!((heading - first.normalize()).norm() < 1e-9);
        assert!((group.extent.front - 0.6).abs() < 1e-9);
        assert_eq!(GroupEntity::new(&[]), None);
    }
}
