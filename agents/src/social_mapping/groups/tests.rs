//! Groups by each method: who is in one, who is not, and what does not change them.

use super::*;
use nalgebra::Vector2;
use proptest::prelude::*;
use std::f64::consts::{PI, TAU};

/// People on a circle who all face its centre.
pub(super) fn facing_centre(x: f64, y: f64, radius: f64, count: usize) -> Vec<Isometry2<f64>> {
    (0..count)
        .map(|i| {
            let angle = TAU * i as f64 / count as f64;
            let (sin, cos) = angle.sin_cos();
            Isometry2::new(Vector2::new(x + radius * cos, y + radius * sin), angle + PI)
        })
        .collect()
}

fn groups(method: Method, people: &[Isometry2<f64>]) -> Vec<Vec<usize>> {
    Grouping::of(method).groups(people).unwrap()
}

#[test]
fn two_groups_and_a_passer_by_are_told_apart() {
    let mut people = facing_centre(0.0, 0.0, 0.6, 3);
    people.extend(facing_centre(3.0, 0.0, 0.5, 2));
    people.push(Isometry2::new(Vector2::new(1.5, 1.5), 0.4));
    assert_eq!(groups(Method::Facing, &people), [vec![0, 1, 2], vec![3, 4]]);
    assert_eq!(
        groups(Method::GaussianClustering, &people),
        [vec![0, 1, 2], vec![3, 4]]
    );
    assert_eq!(groups(Method::TriangulationStrict, &people), [[0, 1, 2]]);
}

#[test]
fn whose_pose_is_no_place_is_in_no_group_and_takes_nobody_elses() {
    let far = |x: f64, y: f64| Isometry2::new(Vector2::new(x, y), 0.0);
    for nowhere in [
        far(f64::NAN, 0.0),
        far(0.0, f64::INFINITY),
        far(1e100, 0.0),
        far(0.0, -1e300),
        far(1.1e8, 0.0),
        Isometry2::new(Vector2::zeros(), f64::INFINITY),
    ] {
        let mut people = facing_centre(0.0, 0.0, 0.5, 3);
        people.insert(1, nowhere);
        for method in Method::ALL {
            assert_eq!(groups(method, &people), [[0, 2, 3]], "{}", method.name());
        }
    }
    // As far as there are places, there are groups.
    let people = facing_centre(-9.9e7, 9.9e7, 0.5, 3);
    for method in Method::ALL {
        assert_eq!(groups(method, &people), [[0, 1, 2]], "{}", method.name());
    }
}

#[test]
fn who_stands_on_the_very_spot_of_another_is_in_the_same_group() {
    let mut people = facing_centre(0.0, 0.0, 0.5, 3);
    people.extend([people[1], people[1]]);
    for method in Method::ALL {
        assert_eq!(
            groups(method, &people),
            [[0, 1, 2, 3, 4]],
            "{}",
            method.name()
        );
    }
}

/// Pairs face to face on a lattice, 2 m from pair to pair, and what they are: (0, 1), (2, 3) ...
fn pairs_on_a_lattice(count: usize) -> (Vec<Isometry2<f64>>, Vec<Vec<usize>>) {
    let people = (0..count).flat_map(|k| {
        let (column, row) = (k % 250, k / 250);
        facing_centre(2.0 * column as f64, 2.0 * row as f64, 0.3, 2)
    });
    let groups = (0..count).map(|k| vec![2 * k, 2 * k + 1]);
    (people.collect(), groups.collect())
}

#[test]
fn a_hundred_thousand_people_are_grouped() {
    let (people, expected) = pairs_on_a_lattice(50_000);
    assert_eq!(groups(Method::GaussianClustering, &people), expected);
    assert_eq!(groups(Method::Facing, &people), expected);
    // It knows no pairs; triangles of four people on such a lattice do not face their middle.
    assert!(groups(Method::TriangulationStrict, &people).is_empty());
}

/// How near is near depends on how many are around, and around the ends of a row there are half as many.
#[test]
fn of_an_even_row_at_most_the_ends_are_groups() {
    let row = |count: usize| -> Vec<Isometry2<f64>> {
        let place = |at: usize| Vector2::new(at as f64, 0.0);
        (0..count)
            .map(|at| Isometry2::new(place(at), PI / 2.0))
            .collect()
    };
    for count in [20, 100_000] {
        assert_eq!(
            groups(Method::Facing, &row(count)),
            [[0, 1], [count - 2, count - 1]]
        );
    }
}

#[test]
fn more_people_than_bodies_fit_are_refused() {
    let people = vec![Isometry2::identity(); 20_001];
    let error = Grouping::default().groups(&people).unwrap_err();
    assert_eq!(
        error.to_string(),
        "20001 people stand too close to look for groups among them: 200010000 pairs within some \
         8 m of each other, where at most 200000000 are compared"
    );
    let error = Grouping::default().groups(&people[..201]).unwrap_err();
    assert_eq!(error, TooCrowded::Spot { most: 201 });
    assert_eq!(groups(Method::Facing, &people[..200]).len(), 1);
    assert_eq!(groups(Method::GaussianClustering, &people[..201]).len(), 1);
}

#[test]
fn every_method_has_its_name_in_configuration() {
    for method in Method::ALL {
        let written = serde_json::to_string(&method).unwrap();
        assert_eq!(written, format!("\"{}\"", method.name()));
    }
    assert_eq!(Method::default(), Method::ALL[0]);
}

proptest! {
    #[test]
    fn groups_are_disjoint_and_move_with_their_people(
        people in prop::collection::vec((-4.0..4.0f64, -4.0..4.0f64, -4.0..4.0f64), 0..24),
        x in -50.0..50.0f64, y in -50.0..50.0f64, turn in -4.0..4.0f64,
    ) {
        let people: Vec<_> = people
            .into_iter()
            .map(|(x, y, heading)| Isometry2::new(Vector2::new(x, y), heading))
            .collect();
        let carried = Isometry2::new(Vector2::new(x, y), turn);
        let moved: Vec<_> = people.iter().map(|pose| carried * pose).collect();
        for method in Method::ALL {
            let found = groups(method, &people);
            let mut members: Vec<usize> = found.iter().flatten().copied().collect();
            members.sort_unstable();
            let count = members.len();
            members.dedup();
            prop_assert_eq!(count, members.len());
            prop_assert!(found.iter().all(|group| group.len() > 1 && group.is_sorted()));
            prop_assert_eq!(&found, &groups(method, &moved), "{}", method.name());
        }
    }
}
