//! `cortex experiment`: the papers' tables and figures, ours beside what is printed. This module owns
//! the list of those there are, and guarantees that every one listed runs.

mod compare;
mod drawn;
mod drives;
mod flexible_density;
mod perception;
mod social_groups;
mod social_shapes;
mod table;
mod workers;

use drives::gains;

use super::output::{print, print_json};
use crate::cli::Experiment as Arguments;
use crate::progress::Progress;
use crate::{Answer, Failure};
use serde_json::json;
use std::fmt::Write as _;
use table::Table;

/// Something of the papers that can be done again.
struct Experiment {
    name: &'static str,
    /// What it shows, in a line.
    about: &'static str,
    /// Does it with so many seeds, where chance plays a part.
    run: fn(u64) -> Result<Table, Failure>,
}

/// Draws the figures of an experiment as ours are.
type Draw = fn() -> Result<Vec<drawn::Drawn>, Failure>;

/// The experiments that have pictures.
const PICTURES: &[(&str, Draw)] = &[
    ("tg-shapes", social_shapes::pictures),
    ("tg-groups", social_groups::pictures),
];

/// Every experiment, in the order of the papers.
const EXPERIMENTS: &[Experiment] = &[
    Experiment {
        name: "td-table1",
        about: "a way past a table and a television, in use or not (TD Table 1)",
        run: drives::table1,
    },
    Experiment {
        name: "td-table2",
        about: "the agenda changes while the robot is on its way (TD Table 2)",
        run: drives::table2,
    },
    Experiment {
        name: "td-table4",
        about: "a therapist at the television of a living room (TD Table 4)",
        run: drives::table4,
    },
    Experiment {
        name: gains::NAME,
        about: "the search for the gains of the elastic band (TD 5.4)",
        run: |seeds| Ok(gains::search(seeds, &Progress::new(gains::NAME, true))?.table()),
    },
    Experiment {
        name: perception::NAME,
        about: "people tracked through four cameras that err, beside SORT-style tracking",
        run: |seeds| perception::perception(seeds, None),
    },
    Experiment {
        name: "fd-table1",
        about: "personal space and passage with a wall ahead of a person (FD Table I)",
        run: |_| flexible_density::table1(),
    },
    Experiment {
        name: "fd-table2",
        about: "the same with a wall to the side (FD Table II)",
        run: |_| flexible_density::table2(),
    },
    Experiment {
        name: "fd-table3",
        about: "the same with a wall behind (FD Table III)",
        run: |_| flexible_density::table3(),
    },
    Experiment {
        name: "fd-table4",
        about: "three people in a corridor (FD Table IV)",
        run: |_| flexible_density::table4(),
    },
    Experiment {
        name: "fd-table5",
        about: "three people in an apartment (FD Table V)",
        run: |_| flexible_density::table5(),
    },
    Experiment {
        name: "tg-shapes",
        about: "shapes of personal space under socialization features (TG Figs 13 and 14)",
        run: |_| social_shapes::shapes(),
    },
    Experiment {
        name: "tg-groups",
        about: "groups by triangulation, and a group's own space (TG Figs 11, 12 and 15)",
        run: |_| social_groups::groups(),
    },
    Experiment {
        name: "ap-table1",
        about: "approaching somebody from ahead and going home, over and over (AP Table 1)",
        run: drives::approaches,
    },
    Experiment {
        name: "ap-escort",
        about: "escorting somebody through a door (AP Fig. 9)",
        run: drives::escort,
    },
    Experiment {
        name: compare::NAME,
        about: "other ways of driving in the same worlds: A*, social force, no social map, AP's zones",
        run: |seeds| {
            let progress = Progress::new(compare::NAME, true);
            Ok(compare::compare(seeds, None, &progress)?.table())
        },
    },
];

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    if arguments.name == "list" {
        list(arguments.json)?;
        return Ok(Answer::Yes);
    }
    let experiment = find(&arguments.name)?;
    if experiment.name == gains::NAME && arguments.tracks.is_none() {
        return search_gains(arguments, experiment.about);
    }
    let drawing = PICTURES.iter().find(|(name, _)| *name == experiment.name);
    let pictures = match (&arguments.pictures, drawing) {
        (None, _) => Vec::new(),
        (Some(folder), Some((_, draw))) => drawn::write(&draw()?, folder)?,
        (Some(_), None) => {
            let names = PICTURES.iter().map(|(name, _)| *name);
            let names: Vec<&str> = names.chain([gains::NAME]).collect();
            let what = format!("`{}` has no pictures", experiment.name);
            let help = format!("`--pictures` is for {}", names.join(", "));
            return Err(Failure::input_with_help(what, help));
        }
    };
    if experiment.name == compare::NAME {
        return hold_against_others(arguments, experiment.about);
    }
    let table = match &arguments.tracks {
        None => (experiment.run)(arguments.seeds)?,
        Some(tracks) if experiment.name == perception::NAME => {
            perception::perception(arguments.seeds, Some(tracks))?
        }
        Some(_) => {
            let what = format!("`{}` knows no recorded tracks", experiment.name);
            let help = format!(
                "`--tracks` is for `{}` and `{}`",
                perception::NAME,
                compare::NAME
            );
            return Err(Failure::input_with_help(what, help));
        }
    };
    if arguments.json {
        let mut json = table.json(experiment.name, experiment.about);
        if experiment.name == perception::NAME {
            perception::put_on_top(&mut json);
        }
        print_json(&json)?;
    } else {
        print_text(table.text(experiment.name, experiment.about), &pictures)?;
    }
    Ok(Answer::Yes)
}

/// The search for gains, which takes a minute and has a picture of what it found.
fn search_gains(arguments: &Arguments, about: &str) -> Result<Answer, Failure> {
    let progress = Progress::new(gains::NAME, false);
    let search = gains::search(arguments.seeds, &progress)?;
    drop(progress);
    let pictures = match &arguments.pictures {
        Some(folder) => drawn::write(&[search.picture()], folder)?,
        None => Vec::new(),
    };
    if arguments.json {
        print_json(&search.json(about))?;
    } else {
        print_text(search.table().text(gains::NAME, about), &pictures)?;
    }
    Ok(Answer::Yes)
}

/// Prints a table, and which pictures there are.
fn print_text(mut text: String, pictures: &[String]) -> Result<(), Failure> {
    if !pictures.is_empty() {
        // Writing to a string does not fail.
        let _ = writeln!(text, "\npictures: {}", pictures.join(", "));
    }
    print(&text)
}

/// The comparison, which takes minutes: it shows how far it is.
fn hold_against_others(arguments: &Arguments, about: &str) -> Result<Answer, Failure> {
    let progress = Progress::new(compare::NAME, false);
    let tracks = arguments.tracks.as_deref();
    let comparison = compare::compare(arguments.seeds, tracks, &progress)?;
    drop(progress);
    if arguments.json {
        print_json(&comparison.json(about))?;
    } else {
        print(&comparison.table().text(compare::NAME, about))?;
    }
    Ok(Answer::Yes)
}

fn find(name: &str) -> Result<&'static Experiment, Failure> {
    let found = EXPERIMENTS.iter().find(|one| one.name == name);
    found.ok_or_else(|| {
        let near = EXPERIMENTS
            .iter()
            .map(|one| (strsim::jaro(one.name, name), one.name))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        let help = match near {
            Some((likeness, near)) if likeness > 0.7 => format!("did you mean `{near}`?"),
            _ => "`cortex experiment list` names them all".to_owned(),
        };
        Failure::input_with_help(format!("there is no experiment `{name}`"), help)
    })
}

fn list(json: bool) -> Result<(), Failure> {
    if json {
        let all = EXPERIMENTS
            .iter()
            .map(|one| json!({"name": one.name, "about": one.about}));
        return print_json(&all.collect());
    }
    let mut text = String::new();
    for one in EXPERIMENTS {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{:12} {}", one.name, one.about);
    }
    print(&text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_experiment_runs_and_explains_what_differs() {
        for one in EXPERIMENTS {
            let table = (one.run)(1).unwrap();
            assert!(!table.rows.is_empty(), "{}", one.name);
            for row in &table.rows {
                assert!(
                    row.agrees() || row.note.is_some(),
                    "{}: {} differs and nothing says why",
                    one.name,
                    row.label
                );
                let driven = one.name.starts_with("td-") || one.name.starts_with("ap-");
                let length = one.name.starts_with("td-table") && row.label == "d_t, m";
                assert!(
                    !length || row.cells.last().is_some_and(table::Cell::agrees),
                    "{}: the way without social behaviour is not as long as printed",
                    one.name
                );
                assert!(
                    !driven || row.claims_hold(),
                    "{}: {} is not as the paper says",
                    one.name,
                    row.label
                );
            }
        }
    }
}
