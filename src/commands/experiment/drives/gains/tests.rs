//! The search is held against surfaces that are known, and the default of the band against the search's result,
//! which is kept beside this file as `cortex experiment td-gains --json` wrote it.

use super::*;

const RESULT: &str = include_str!("result.json");

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

#[test]
fn the_default_is_what_the_search_found() {
    let result: Value = serde_json::from_str(RESULT).unwrap();
    let gain = |name: &str| result["stochastic_gradient"][name].as_f64().unwrap();
    assert!(close(default().0, gain("contraction")) && close(default().1, gain("repulsion")));
    assert!(gain("penalty") < FAILURE);
    let surface = result["surface"].as_array().unwrap();
    assert_eq!(surface.len(), VALUES.len() * VALUES.len());
    let penalties = surface.iter().map(|cell| cell["penalty"].as_f64().unwrap());
    assert!(penalties.fold(f64::INFINITY, f64::min) >= gain("penalty") - 1.0);
}

#[test]
fn the_default_still_earns_the_penalty_that_was_found() {
    let result: Value = serde_json::from_str(RESULT).unwrap();
    let count = result["targets"].as_u64().unwrap() as usize;
    let found = Course::new(count).unwrap().all(default()).unwrap();
    let expected = result["stochastic_gradient"]["penalty"].as_f64().unwrap();
    assert!(
        (found - expected).abs() < 0.5,
        "{found}, {expected} when it was searched for"
    );
}

#[test]
fn direct_search_goes_to_the_least_of_a_bowl() {
    let bowl =
        |row: usize, column: usize| (row as f64 - 4.0).powi(2) + (column as f64 - 1.0).powi(2);
    let row = |row| (0..VALUES.len()).map(|column| bowl(row, column)).collect();
    let surface: Vec<Vec<f64>> = (0..VALUES.len()).map(row).collect();
    assert_eq!(direct(&surface), (4, 1));
}
