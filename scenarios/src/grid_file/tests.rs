//! The formats, and what is said of files that break them.

use super::*;

const MAP: &str = "type octile\nheight 2\nwidth 3\nmap\n.@G\nSTW\n";

fn messages(invalid: &Invalid) -> Vec<String> {
    let problems = invalid.problems.iter();
    problems
        .map(|p| format!("{}:{} {}", p.line, p.column, p.kind))
        .collect()
}

#[test]
fn a_map_is_read_row_by_row() {
    let grid = parse_map("a.map", MAP).unwrap();
    assert_eq!((grid.width, grid.height), (3, 2));
    let b = BLOCKED;
    assert_eq!(grid.costs, [1.0, b, 1.0, 1.0, b, b]);
    let windows = MAP.replace('\n', "\r\n");
    assert_eq!(parse_map("a.map", &windows).unwrap(), grid);
}

#[test]
fn a_weighted_map_has_a_cost_a_cell() {
    let text = "type weighted_octile\nheight 1\nwidth 6\nmap\n.o2r4@\n";
    let grid = parse_map("a.wmap", text).unwrap();
    assert_eq!(grid.costs, [1.0, 1.5, 2.0, 3.5, 4.0, BLOCKED]);
}

#[test]
fn every_broken_row_of_a_map_is_told_with_its_place() {
    let text = "type octile\nheight 4\nwidth 3\nmap\n.x.\n..\n..2\n";
    let invalid = parse_map("a.map", text).unwrap_err();
    assert_eq!(
        messages(&invalid),
        [
            "5:2 `x` is no cell of type octile",
            "6:1 this row has 2 cells, the map is 3 wide",
            "7:3 `2` is no cell of type octile",
            "8:1 the map has 3 rows, its height is 4",
        ]
    );
}

#[test]
fn a_broken_header_is_told() {
    for (text, expected) in [
        ("", "1:1 expected `type ...` here"),
        (
            "type hexagonal\n",
            "1:1 `hexagonal` is no type of map: octile or weighted_octile",
        ),
        (
            "type octile\nheight -1\n",
            "2:1 the height must be a whole number from 1",
        ),
        (
            "type octile\nheight 100000\nwidth 100000\nmap\n",
            "2:1 100000 x 100000 cells are too many: at most 100000000",
        ),
        (
            "type octile\nheight 1\nwidth 1\n.\n",
            "4:1 expected `map ...` here",
        ),
    ] {
        assert_eq!(messages(&parse_map("a.map", text).unwrap_err()), [expected]);
    }
}

#[test]
fn problems_are_read_and_their_broken_lines_told() {
    let grid = parse_map("a.map", MAP).unwrap();
    let text = "version 1\n0 a.map 3 2 0 0 0 1 1.0\n";
    let read = parse_problems("a.scen", text, &grid).unwrap();
    let expected = GridProblem {
        line: 2,
        start: (0, 0),
        goal: (0, 1),
        length: 1.0,
    };
    assert_eq!(read, [expected]);
    let text = "version 1\n0 a.map 3 2 0 0 0 5 1.0\n0 a.map 4 2 0 0 0 1 1.0\n0 a.map\n0 a.map 3 2 0 0 0 1 -1\n";
    let invalid = parse_problems("a.scen", text, &grid).unwrap_err();
    let told = messages(&invalid);
    assert_eq!(told.len(), 4, "{told:?}");
    assert_eq!(told[0], "2:1 cell 0,5 lies outside the map");
    assert!(told[1].starts_with("3:1 this problem is for a map of 4 x 2 cells"));
    assert!(told[2].starts_with("4:1 expected 9 words"));
    assert_eq!(told[3], "5:1 `-1` must be a length");
}
