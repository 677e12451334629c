//! `cortex social groups`: who stands together, frame by frame, and how well that was found out.

use super::refused;
use crate::commands::output::print;
use crate::{Answer, Failure};
use agents::social_mapping::groups::score::{self, Score, TOLERANCES, score};
use agents::social_mapping::groups::{Grouping, Method};
use agents::social_mapping::scene::{FARTHEST, is_pose};
use nalgebra::Isometry2;
use scenarios::scenes::{Frame, Recording, parse_recording};
use serde_json::json;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

type Groups = Vec<BTreeSet<u64>>;

pub(super) fn run(file: &Path, method: Method, json: bool) -> Result<Answer, Failure> {
    let text = crate::commands::read_text(file)?;
    let recording = parse_recording(&text).map_err(|error| refused(file, error))?;
    let found = find(&recording, method).map_err(|error| refused(file, error))?;
    let scores = scores(&recording, &found);
    let mut text = String::new();
    for (frame, groups) in recording.frames.iter().zip(&found) {
        let left_out = left_out(frame);
        // Writing to a string does not fail.
        let _ = if json {
            let mut line = json!({"t": frame.time, "groups": groups});
            if !left_out.is_empty() {
                line["left_out"] = json!(left_out);
            }
            writeln!(text, "{line}")
        } else {
            let one = |group: &BTreeSet<u64>| {
                let names: Vec<String> = group.iter().map(u64::to_string).collect();
                format!("{{{}}}", names.join(" "))
            };
            let groups: Vec<String> = groups.iter().map(one).collect();
            let mut line = groups.join(" ");
            if !left_out.is_empty() {
                let names: Vec<String> = left_out.iter().map(u64::to_string).collect();
                let names = names.join(" ");
                let _ = write!(
                    line,
                    "  left out, at no place within {FARTHEST:e} m: {names}"
                );
            }
            writeln!(text, "{:10}  {line}", frame.time)
        };
    }
    if let Some([loose, strict]) = scores {
        let _ = if json {
            let figures = json!({
                "method": method.name(),
                "f1_t2_3": loose.f1, "f1_t1": strict.f1,
                "precision": loose.precision, "recall": loose.recall,
                "precision_t1": strict.precision, "recall_t1": strict.recall,
                "pooled_f1_t2_3": loose.pooled_f1, "pooled_f1_t1": strict.pooled_f1,
            });
            writeln!(text, "{figures}")
        } else {
            let line = |tolerance: &str, score: &Score| {
                format!(
                    "tolerance {tolerance:3}  precision {:.3}  recall {:.3}  F1 {:.3}  (pooled F1 {:.3})",
                    score.precision, score.recall, score.f1, score.pooled_f1
                )
            };
            writeln!(
                text,
                "\nmethod {}\n{}\n{}",
                method.name(),
                line("2/3", &loose),
                line("1", &strict)
            )
        };
    }
    print(&text)?;
    Ok(Answer::Yes)
}

/// Whose pose is no place, by name: they are in no group.
fn left_out(frame: &Frame) -> Vec<u64> {
    let nowhere = frame.people.iter().filter(|one| !is_pose(&one.pose));
    nowhere.map(|one| one.id).collect()
}

/// The groups of every frame, by name.
fn find(
    recording: &Recording,
    method: Method,
) -> Result<Vec<Groups>, agents::social_mapping::groups::TooCrowded> {
    let grouping = Grouping::of(method);
    let frames = recording.frames.iter();
    frames
        .map(|frame| {
            let poses: Vec<Isometry2<f64>> = frame.people.iter().map(|one| one.pose).collect();
            let groups = grouping.groups(&poses)?;
            let named = |group: Vec<usize>| group.iter().map(|i| frame.people[*i].id).collect();
            Ok(groups.into_iter().map(named).collect())
        })
        .collect()
}

/// At both tolerances, over the frames whose groups are known; `None` where there are none.
fn scores(recording: &Recording, found: &[Groups]) -> Option<[Score; 2]> {
    let known: Vec<score::Frame<u64>> = recording
        .frames
        .iter()
        .zip(found)
        .filter_map(|(frame, found)| {
            let truth = frame.truth.as_ref()?;
            Some(score::Frame { found, truth })
        })
        .collect();
    (!known.is_empty()).then(|| TOLERANCES.map(|tolerance| score(&known, tolerance)))
}
