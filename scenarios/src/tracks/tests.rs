use super::*;

/// Somebody who walks 1.2 m/s along +y at 15 frames a second, observed every 6th frame.
fn walking_obsmat() -> String {
    let line = |step: i32| {
        let y = 0.48 * f64::from(step);
        format!("{}.0e+00 7.0 2.5 0.0 {y} 0.0 0.0 1.2", 1 + 6 * step)
    };
    (0..10).map(line).collect::<Vec<_>>().join(
        "
",
    )
}

#[test]
fn the_rate_of_an_obsmat_follows_from_its_velocities() {
    let tracks = Tracks::parse("obsmat.txt", &walking_obsmat()).expect("good lines");
    assert!((tracks.rate - 15.0).abs() < 1e-12);
    let person = &tracks.people_at(1.0)[0];
    assert_eq!(person.name, "person_7");
    assert!(
        (person.position - Point2::new(2.5, 1.2)).norm() < 1e-9,
        "{}",
        person.position
    );
    assert!((person.velocity - Vector2::new(0.0, 1.2)).norm() < 1e-9);
    assert!((person.heading - std::f64::consts::PI / 2.0).abs() < 1e-9);
}

#[test]
fn people_appear_stand_vanish_and_come_back() {
    let text = "# frame id x y\n0 1 0 0\n10 1 0 0\n20 1 1 0\n\n200 1 5 5\n210 1 5 5\n";
    let tracks = Tracks::parse("plain.txt", text).expect("good lines");
    assert_eq!(tracks.len(), 2);
    let names = |seconds| -> Vec<String> {
        tracks
            .people_at(seconds)
            .into_iter()
            .map(|person| person.name)
            .collect()
    };
    assert_eq!(names(0.0), ["person_1"]);
    assert_eq!(names(0.8), ["person_1"]);
    assert!(names(0.9).is_empty() && names(7.9).is_empty());
    assert_eq!(names(8.0), ["person_1_2"]);
    assert!(
        names(9.0).is_empty(),
        "the recording is over and the world goes on"
    );
    assert!((tracks.duration() - 8.4).abs() < 1e-9);
}

#[test]
fn position_and_velocity_are_continuous_and_pass_through_the_observations() {
    let text = "0 1 0 0\n10 1 1 0\n20 1 1.5 0.7\n30 1 1.5 1.5\n";
    let tracks = Tracks::parse("plain.txt", text).expect("good lines");
    let at = |time: f64| tracks.people_at(time).remove(0);
    assert!((at(0.8).position - Point2::new(1.5, 0.7)).norm() < 1e-9);
    let mut time = 0.0;
    while time < 1.19 {
        let (now, next) = (at(time), at(time + 0.001));
        let rate = (next.position - now.position) / 0.001;
        assert!(
            (rate - now.velocity).norm() < 0.05,
            "at {time}: {rate} {}",
            now.velocity
        );
        assert!(
            (next.velocity - now.velocity).norm() < 0.05,
            "a jump at {time}"
        );
        time += 0.001;
    }
}

#[test]
fn a_scenario_turns_moves_and_skips() {
    let tracks = Tracks::parse("obsmat.txt", &walking_obsmat()).expect("good lines");
    let frame = TracksFrame {
        translation: Some(Vector2::new(10.0, 0.0)),
        rotation: std::f64::consts::PI / 2.0,
        offset: 1.0,
    };
    let placed = tracks.placed(&frame, [0.0; 4]);
    let person = &placed.people_at(0.0)[0];
    assert!(
        (person.position - Point2::new(8.8, 2.5)).norm() < 1e-9,
        "{}",
        person.position
    );
    assert!((person.velocity - Vector2::new(-1.2, 0.0)).norm() < 1e-9);
    assert!((wrap(person.heading - std::f64::consts::PI)).abs() < 1e-9);
}

#[test]
fn a_recording_without_a_stated_place_comes_to_the_middle() {
    let tracks = Tracks::parse("plain.txt", "0 1 -90 4\n10 1 -89 4\n0 2 -90 8\n").expect("good");
    let placed = tracks.placed(&TracksFrame::default(), [0.0, 0.0, 10.0, 20.0]);
    let positions: Vec<_> = placed.people_at(0.0).iter().map(|p| p.position).collect();
    assert_eq!(positions, [Point2::new(4.5, 8.0), Point2::new(4.5, 12.0)]);
}

#[test]
fn every_broken_line_is_reported_with_its_number() {
    let text = "0 1 0 0\n0 2 oops 0\n1 2 3\n2.5 1 0 0\n3 1 nan 0\n";
    let invalid = Tracks::parse("bad.txt", text).expect_err("four bad lines");
    let lines: Vec<_> = invalid
        .problems
        .iter()
        .map(|p| (p.line, p.column))
        .collect();
    assert_eq!(lines, [(2, 5), (3, 1), (4, 1), (5, 5)]);
    assert!(Tracks::parse("empty.txt", "# nothing\n").is_err());
}
