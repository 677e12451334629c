//! The description of the format in README.md is true: its example loads and names every key.

use scenarios::scenario::{Begin, Face};
use scenarios::{LoadError, Scenario};
use std::path::Path;

const README: &str = include_str!("../README.md");

fn example() -> &'static str {
    let from = README.find("```toml\n").expect("an example") + "```toml\n".len();
    let length = README[from..].find("\n```").expect("its end");
    &README[from..from + length]
}

fn parse(text: &str) -> Result<Scenario, String> {
    Scenario::parse("README.md", text, &|_| Ok(Vec::new()))
        .map_err(|invalid| format!("{:?}", miette::Report::new(*invalid)))
}

#[test]
fn the_example_loads() {
    let scenario = parse(example()).unwrap_or_else(|report| panic!("{report}"));
    let ana = &scenario.people[0];
    assert!(matches!(ana.schedule[0].begin, Begin::At(time) if time == scenario.start + 5.0));
    assert_eq!(ana.schedule[1].face, Some(Face::Person(1)));
    assert!(scenario.people[1].schedule[0].leave);
    assert_eq!(scenario.streams[0].people, 2);
}

#[test]
fn what_says_default_may_be_left_out_and_means_the_same() {
    let whole = parse(example()).unwrap_or_else(|report| panic!("{report}"));
    let mut left_out = 0;
    for line in example().lines().filter(|line| line.contains("efault: ")) {
        let key = line.split('=').next().unwrap_or_default().trim();
        let without = example().replacen(line, "", 1);
        let scenario = parse(&without).unwrap_or_else(|report| panic!("without {key}: {report}"));
        // These show something else than the default.
        if ![
            "bounds",
            "walls",
            "repeat",
            "width",
            "people",
            "translation",
            "heading_noise",
        ]
        .contains(&key)
        {
            assert_eq!(scenario, whole, "{key} has another default");
        }
        left_out += 1;
    }
    assert!(left_out > 25, "only {left_out} keys have a default");
}

#[test]
fn a_folder_without_a_scenario_says_what_one_is() {
    let error = Scenario::load(Path::new("/nonexistent")).expect_err("there is none");
    assert!(matches!(error, LoadError::Unreadable { .. }));
    assert!(format!("{:?}", miette::Report::new(error)).contains("scenario.toml"));
}
