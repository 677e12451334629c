//! Poses that are no places, as users of `cortex social` meet them: whoever is nowhere is told by name, and everybody
//! else has the groups and the map that they would have alone.

use crate::social::{cortex, lines, person, save};
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::fs;

#[test]
fn whoever_is_nowhere_is_left_out_by_name_and_changes_nothing_for_others() {
    let folder = tempfile::tempdir().unwrap();
    let people = [
        person(1, 0.0, 0.0, 0.0),
        person(2, 1.2, 0.0, PI),
        person(3, 1e100, 0.0, 0.0),
    ];
    let frame = |people: &[Value]| json!({"t": 0.5, "people": people});
    let file = json!({"frames": [frame(&people)]}).to_string();
    let file = save(&folder, "far.json", &file);
    for method in ["facing", "gaussian_clustering"] {
        let (code, out, err) = cortex(&["social", "groups", &file, "--method", method, "--json"]);
        assert_eq!(code, 0, "{err}");
        assert_eq!(
            lines(&out)[0],
            json!({"t": 0.5, "groups": [[1, 2]], "left_out": [3]})
        );
    }
    let (_, out, _) = cortex(&["social", "groups", &file]);
    assert_eq!(
        out.trim(),
        "0.5  {1 2}  left out, at no place within 1e8 m: 3"
    );
    let map = |name: &str, file: &str| {
        let out = folder.path().join(name);
        let path = out.display().to_string();
        let (code, text, err) = cortex(&["social", "map", file, "--out", &path]);
        assert_eq!(code, 0, "{err}");
        (text, fs::read(out.with_extension("pgm")).unwrap())
    };
    let (said, costs) = map("far.yaml", &file);
    assert!(
        said.contains("person 3 is ignored: the pose is no place within 1e8 m"),
        "{said}"
    );
    let near = json!({"frames": [frame(&people[..2])]}).to_string();
    let near = save(&folder, "near.json", &near);
    assert!(map("near.yaml", &near).1 == costs);
}
