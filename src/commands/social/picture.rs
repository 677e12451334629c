//! `cortex social density` and `cortex social map`: one situation as a picture, or as a map for other
//! programs.

use super::refused;
use super::ros_map::DEAREST;
use crate::cli::{RosMode, SocialPicture as Arguments};
use crate::commands::output::print;
use crate::{Answer, Failure};
use agents::social_mapping::SocialConfig;
use dsr::Time;
use scenarios::Scenario;
use scenarios::picture::{Show, png, social};
use scenarios::scenario::parse_social;
use scenarios::scenes::parse_recording;
use scenarios::situation::{self, Situation};
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

/// Pixels of a PNG for each of the SVG's.
const SCALE: f32 = 1.5;
const DAY: f64 = 86_400.0;

pub(super) fn run(
    arguments: &Arguments,
    show: Show,
    ros: Option<RosMode>,
) -> Result<Answer, Failure> {
    let out = &arguments.out;
    let kind = out.extension().and_then(|kind| kind.to_str()).unwrap_or("");
    let known = match show {
        Show::Density => &["png", "svg"][..],
        Show::Costs(_) => &["png", "svg", "yaml"],
    };
    if !known.contains(&kind) {
        return Err(Failure::input_with_help(
            format!("{} is not the name of a picture", out.display()),
            format!("its ending decides what is written: .{}", known.join(", .")),
        ));
    }
    if ros.is_some() && kind != "yaml" {
        return Err(Failure::input_with_help(
            "`--ros-mode` is for a map for ROS",
            "name a .yaml file with `--out`",
        ));
    }
    let (situation, config, mut notes) = situation(arguments)?;
    let (mut update, mapper) = situation
        .map(&config)
        .map_err(|error| refused(&arguments.file, error))?;
    if let Show::Costs(layer) = show {
        update.grid = mapper.layer(layer).map_or(update.grid, Arc::new);
    }
    let mut too_dear = 0;
    let svg = || social(&situation, &update, &config, show);
    match kind {
        "svg" => write(out, svg().as_bytes())?,
        "png" => write(out, &png(&svg(), SCALE).map_err(Failure::internal)?)?,
        _ => {
            let (mode, image) = (ros.unwrap_or_default(), out.with_extension("pgm"));
            write(&image, &mode.image(&update.grid))?;
            write(out, mode.description(&update.grid, &image).as_bytes())?;
            too_dear = mode.too_dear(&update.grid);
        }
    }
    let mut text = format!(
        "{}, {}: people {}, groups {} -> {}\n",
        situation.name,
        situation.moment,
        update.people.len(),
        update.groups.len(),
        out.display()
    );
    if too_dear > 0 {
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{too_dear} cells cost more than {DEAREST}, the most that this scale has, and are written as that"
        );
    }
    notes.extend(update.rejected.iter().map(ToString::to_string));
    for note in &notes {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{note}");
    }
    print(&text)?;
    Ok(Answer::Yes)
}

/// The figures of social mapping as the flags have them.
fn with_flags(mut config: SocialConfig, arguments: &Arguments) -> SocialConfig {
    if let Some(method) = arguments.method {
        config.grouping.method = method;
    }
    config.proxemics = arguments.proxemics.unwrap_or(config.proxemics);
    config.proxemics.levels = arguments.levels.unwrap_or(config.proxemics.levels);
    if let Some(usage) = arguments.usage {
        // Of all objects, those included that have a curve of their own.
        config.usage = usage;
        config.usage_of.clear();
    }
    config
}

/// A recording's frame, or a scenario at a time, with the figures of social mapping, and what the picture does not show.
fn situation(arguments: &Arguments) -> Result<(Situation, SocialConfig, Vec<String>), Failure> {
    let file = &arguments.file;
    if file.is_dir() {
        let scenario: Scenario = crate::commands::load_scenario(file)?;
        let settings = settings(arguments, Some(&scenario))?;
        let now = match &arguments.at {
            Some(at) => time_of_day(at, scenario.start)?,
            None => scenario.start,
        };
        let situation = Situation::of_scenario(&scenario, now);
        let notes = unseen(&scenario, now);
        let config = with_flags(settings.unwrap_or(scenario.social), arguments);
        return Ok((situation, config, notes));
    }
    let settings = settings(arguments, None)?;
    let text = crate::commands::read_text(file)?;
    let recording = parse_recording(&text).map_err(|error| refused(file, error))?;
    let time = match &arguments.at {
        None => f64::NEG_INFINITY,
        Some(at) => at
            .parse()
            .ok()
            .filter(|t: &f64| t.is_finite())
            .ok_or_else(|| {
                Failure::input(format!(
                    "`{at}` is not a time of a recording: write a number"
                ))
            })?,
    };
    let frame = recording.at(time);
    let frame = frame.ok_or_else(|| refused(file, "the recording has no frames"))?;
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    // How far the picture goes is decided by them.
    let config = with_flags(settings.unwrap_or_default(), arguments);
    let situation = Situation::of_frame(&name, frame, &config);
    let mut notes = Vec::new();
    if arguments.at.is_some() && time < frame.time {
        let start = frame.time;
        notes.push(format!(
            "the recording starts at {start}: this is its first frame"
        ));
    }
    Ok((situation, config, notes))
}

/// What a scenario's schedules do not tell of a time.
fn unseen(scenario: &Scenario, now: Time) -> Vec<String> {
    let mut notes = Vec::new();
    if now < scenario.start {
        let start = situation::time_of_day(scenario.start);
        notes.push(format!(
            "the scenario starts at {start}: people are where they are then"
        ));
    }
    if !scenario.streams.is_empty() {
        let names: Vec<&str> = scenario.streams.iter().map(|s| s.name.as_str()).collect();
        notes.push(format!(
            "the people of {} are not shown: where they are is up to chance",
            names.join(", ")
        ));
    }
    notes
}

/// The figures of the file that `--settings` names, where it names one; rooms and objects are those of the scenario.
fn settings(
    arguments: &Arguments,
    scenario: Option<&Scenario>,
) -> Result<Option<SocialConfig>, Failure> {
    let Some(path) = &arguments.settings else {
        return Ok(None);
    };
    let text = crate::commands::read_text(path)?;
    let read = parse_social(&path.display().to_string(), &text, scenario);
    read.map(Some)
        .map_err(|invalid| Failure::Input((*invalid).into()))
}

/// `HH:MM` or `HH:MM:SS` of the scenario's day.
fn time_of_day(text: &str, start: Time) -> Result<Time, Failure> {
    let wrong = || {
        Failure::input(format!(
            "`{text}` is not a time of day: write HH:MM or HH:MM:SS"
        ))
    };
    let parts: Option<Vec<u32>> = text.split(':').map(|part| part.parse().ok()).collect();
    let (hours, minutes, seconds) = match parts.as_deref() {
        Some([h, m]) => (*h, *m, 0),
        Some([h, m, s]) => (*h, *m, *s),
        _ => return Err(wrong()),
    };
    if hours > 23 || minutes > 59 || seconds > 59 {
        return Err(wrong());
    }
    let midnight = (start.seconds() / DAY).floor() * DAY;
    let of_day = f64::from(hours * 3600 + minutes * 60 + seconds);
    Ok(Time::from_seconds(midnight + of_day))
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    std::fs::write(path, bytes)
        .map_err(|error| Failure::input(format!("cannot write {}: {error}", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_day_are_of_the_day_of_the_start() {
        let start = Time::from_seconds(3.0 * DAY + 40_000.0);
        let at = |text| time_of_day(text, start).map(|time| time.seconds() - 3.0 * DAY);
        assert!((at("09:30").unwrap() - 34_200.0).abs() < 1e-6);
        assert!((at("00:00:07").unwrap() - 7.0).abs() < 1e-6);
        for wrong in ["9", "24:00", "10:60", "a:b", "1:2:3:4"] {
            assert!(at(wrong).is_err(), "{wrong}");
        }
    }
}
