//! `cortex social`: people and the space they need, from recordings and scenes.

mod comfort;
mod folds;
mod groups;
mod picture;
mod ros_map;
mod schedule;

use crate::cli::{Social as Arguments, SocialAction};
use crate::{Answer, Failure};
use scenarios::picture::Show;
use std::path::Path;

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    match &arguments.action {
        SocialAction::Groups { file, method, json } => groups::run(file, *method, *json),
        SocialAction::Comfort { file, folds, json } => match folds {
            Some(folds) => folds::run(file, usize::from(*folds), *json),
            None => comfort::run(file, *json),
        },
        SocialAction::Schedule { file, instance } => schedule::run(file, instance),
        SocialAction::Density(arguments) => picture::run(arguments, Show::Density, None),
        SocialAction::Map {
            picture,
            layer,
            ros_mode,
        } => picture::run(picture, Show::Costs(*layer), *ros_mode),
    }
}

/// What a reader of `file` said, as bad input.
fn refused(file: &Path, problem: impl std::fmt::Display) -> Failure {
    Failure::input(format!("{}: {problem}", file.display()))
}
