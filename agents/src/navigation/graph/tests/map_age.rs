//! What navigation makes of the age of the social grid.

use super::*;
use crate::grid::shared::SOCIAL_GRID_TIME;

fn set(home: &mut Home, node: &str, attribute: &str, value: f64) {
    let mut work = Transaction::new();
    work.set(node, attribute, value);
    home.commit(&work);
}

/// A turn in which the grid is so old.
fn at_age(home: &mut Home, age: f64) -> Effects {
    let held = home.now.seconds() - age;
    set(home, "home", SOCIAL_GRID_TIME, held);
    home.tick()
}

#[test]
fn by_an_old_grid_it_drives_slower_and_by_a_lost_one_it_stands() {
    let mut home = Home::new();
    home.dispatch("changeRoom", CHANGE_ROOM);
    let state = |home: &Home| home.text("shelly", MAP_STATE).unwrap();
    // The fastest of the last few of 3 seconds.
    let speed = |home: &mut Home, age: f64| {
        let speeds = (0..30).map(|_| at_age(home, age).command.linear);
        speeds.skip(25).fold(0.0, f64::max)
    };
    let full = speed(&mut home, 0.5);
    assert_eq!(state(&home), "current");
    let slow = speed(&mut home, 9.0);
    assert_eq!(state(&home), "old");
    assert!(slow > 0.01 && slow < 0.5 * full, "{slow} of {full}");
    let effects = at_age(&mut home, 12.0);
    let (map, age) = effects.map;
    assert_eq!(map, MapState::Lost);
    assert!((age.unwrap() - 12.0).abs() < 1e-3);
    assert!(speed(&mut home, 12.0).abs() < 1e-9);
    assert_eq!(state(&home), "lost");
    // Who works there may have it otherwise.
    set(&mut home, "shelly", MAP_HOLD_AFTER, 60.0);
    set(&mut home, "shelly", MAP_SLOW_AFTER, 30.0);
    assert!(speed(&mut home, 12.0) > 0.5 * full);
    assert_eq!(home.refused, []);
}

#[test]
fn a_grid_that_does_not_say_when_it_held_counts_as_current() {
    let mut home = Home::new();
    let effects = home.tick();
    assert_eq!(effects.map, (MapState::Current, None));
    assert_eq!(home.text("shelly", MAP_STATE).unwrap(), "current");
}
