//! Maps of a few cells: where their walls are, in each mode, and what is said of broken ones.

use super::*;
use std::io::{Error, ErrorKind};

const HOUSE: &str = "image: house.pgm\nresolution: 0.5\norigin: [1, 2, 0]\nnegate: 0\n\
                     occupied_thresh: 0.65\nfree_thresh: 0.196\n";

fn read_with(text: &str, image: &[u8], unknown: Unknown) -> Result<Vec<Wall>, MapError> {
    walls("maps/house.yaml", unknown, &|name| match name {
        "maps/house.yaml" => Ok(text.as_bytes().to_vec()),
        "maps/house.pgm" => Ok(image.to_vec()),
        _ => Err(Error::from(ErrorKind::NotFound)),
    })
}

/// Each wall as its ends, in whole hundredths of a metre, sorted.
fn hundredths(walls: &[Wall]) -> Vec<[i64; 4]> {
    let round = |number: f64| (number * 100.0).round() as i64;
    let mut ends: Vec<_> = walls
        .iter()
        .map(|[a, b]| [a.x, a.y, b.x, b.y].map(round))
        .collect();
    ends.sort_unstable();
    ends
}

#[test]
fn walls_run_around_what_is_occupied_from_the_lower_left_up() {
    // The upper row first: one occupied cell in the upper left of 3 x 2.
    let image = b"P2\n# drawn by hand\n3 2\n255\n0 254 254\n254 254 254\n";
    let found = read_with(HOUSE, image, Unknown::Free).unwrap();
    let sides = [
        [100, 250, 100, 300],
        [100, 250, 150, 250],
        [100, 300, 150, 300],
        [150, 250, 150, 300],
    ];
    assert_eq!(hundredths(&found), sides);
    // Where the unknown is solid, so is all beyond the map, and the cell has no wall towards it.
    let found = read_with(HOUSE, image, Unknown::Blocked).unwrap();
    assert_eq!(found.len(), 6);
    assert!(!hundredths(&found).contains(&sides[2]));
}

#[test]
fn a_map_may_be_turned() {
    let text = HOUSE.replace("[1, 2, 0]", "[1, 2, 1.5707963267948966]");
    let found = read_with(&text, b"P5 2 1 255\n\x00\xfe", Unknown::Free).unwrap();
    assert!(hundredths(&found).contains(&[100, 200, 100, 250]));
    assert!(hundredths(&found).iter().all(|[x, ..]| *x <= 100));
}

#[test]
fn what_is_solid_is_filled_so_that_nothing_fits_inside() {
    let text = HOUSE.replace("0.5", "0.1");
    let mut image = b"P5 10 10 255\n".to_vec();
    image.resize(image.len() + 100, 0);
    let found = read_with(&text, &image, Unknown::Free).unwrap();
    let rows: Vec<i64> = hundredths(&found)
        .iter()
        .filter(|[_, from, _, to]| from == to)
        .map(|[_, row, ..]| *row)
        .collect();
    assert_eq!(rows, [200, 230, 260, 290, 300]);
}

#[test]
fn each_mode_reads_pixels_as_map_servers_do() {
    // How many walls one pixel has: 4 where it is solid.
    let solid = |mode: &str, bytes: &[u8], unknown| {
        let text = format!("{HOUSE}mode: {mode}\n");
        let image = [b"P5 1 1 255\n", bytes].concat();
        let free = read_with(&text, &image, Unknown::Free).unwrap().len();
        let blocked = read_with(&text, &image, Unknown::Blocked).unwrap().len();
        // Beyond the map all is solid: a free cell has its walls there.
        match unknown {
            Unknown::Free => free == 4,
            Unknown::Blocked => blocked == 0,
        }
    };
    for (mode, pixel, occupied, known) in [
        ("trinary", 0, true, true),
        ("trinary", 254, false, true),
        ("trinary", 205, false, false),
        ("scale", 205, false, true),
        ("scale", 10, true, true),
        ("raw", 100, true, true),
        ("raw", 99, false, true),
        ("raw", 255, false, false),
    ] {
        assert_eq!(
            solid(mode, &[pixel], Unknown::Free),
            occupied,
            "{mode} {pixel}"
        );
        let blocked = occupied || !known;
        assert_eq!(
            solid(mode, &[pixel], Unknown::Blocked),
            blocked,
            "{mode} {pixel}"
        );
    }
    let negated = HOUSE.replace("negate: 0", "negate: 1");
    assert_eq!(
        read_with(&negated, b"P5 1 1 255\n\xff", Unknown::Free)
            .unwrap()
            .len(),
        4
    );
    let deep = read_with(HOUSE, b"P5 1 1 65535\n\x00\x01", Unknown::Free).unwrap();
    assert_eq!(deep.len(), 4, "sixteen bits");
}

#[test]
fn what_is_wrong_is_told_with_its_line_and_what_it_must_be() {
    let told = |text: &str, image: &[u8]| {
        read_with(text, image, Unknown::Free)
            .unwrap_err()
            .to_string()
    };
    let pixel = b"P5 1 1 255\n\x00";
    for (from, to, message) in [
        (
            "resolution: 0.5",
            "resolution: 0",
            "`resolution` in line 2 must be more than 0 (metres)",
        ),
        (
            "negate: 0",
            "negate: 7",
            "`negate` in line 4 must be 0 or 1",
        ),
        (
            "free_thresh: 0.196",
            "free_thresh: 0.8",
            "`free_thresh` in line 6 must be at most `occupied_thresh`",
        ),
        (
            "negate: 0",
            "negate: 0\nmode: grey",
            "`mode` in line 5 must be trinary, scale or raw",
        ),
        (
            "house.pgm",
            "home.pgm",
            "cannot read its image `maps/home.pgm`: entity not found",
        ),
    ] {
        assert_eq!(told(&HOUSE.replace(from, to), pixel), message);
    }
    assert!(
        told(&HOUSE.replace("resolution: 0.5\n", ""), pixel).contains("missing field `resolution`")
    );
    assert!(
        told(HOUSE, b"P5 2 2 255\n\x00").contains("`maps/house.pgm` must be a portable grey map")
    );
    assert!(told(HOUSE, b"P6 1 1 255\nabc").contains("it is in colour"));
    assert!(told(HOUSE, b"P5 0 1 255\n").contains("has 0 x 1 pixels"));
}
