//! What is known of people that shapes their space, in words: what they do, feel and want, and what the robot does with
//! them. Only what acts is told.

use crate::situation::Situation;
use agents::social_mapping::SocialConfig;
use agents::social_mapping::personal::activity_of;
use agents::social_mapping::scene::Manner;

/// At most so many characters stand in a line of the column beside the map.
const LINE: usize = 34;
/// Of more people than this, the number of the others is told.
const PEOPLE: usize = 12;

/// A name for a place where a long one has no room.
pub(super) fn short(name: &str, most: usize) -> String {
    if name.chars().count() <= most {
        return name.to_owned();
    }
    let kept: String = name.chars().take(most.saturating_sub(1)).collect();
    kept + "…"
}

/// What somebody does, where the figures have a shape for it.
fn activity<'a>(manner: &'a Manner, config: &'a SocialConfig) -> Option<&'a str> {
    let name = activity_of(config, manner)?;
    config.activities.contains_key(name).then_some(name)
}

/// What is written beside somebody on the map.
pub(super) fn label(name: &str, situation: &Situation, config: &SocialConfig) -> String {
    let mut people = situation.scene.people.iter();
    let does = people
        .find(|person| person.name == name)
        .and_then(|person| activity(&person.manner, config));
    match does {
        Some(activity) => short(&format!("{name}, {activity}"), LINE),
        None => short(name, LINE),
    }
}

/// All that is known of a person; empty where nothing is.
fn told(manner: &Manner, config: &SocialConfig) -> String {
    let mut parts: Vec<String> = Vec::new();
    parts.extend(activity(manner, config).map(str::to_owned));
    for (name, value) in &manner.features {
        let levels = config.features.known.get(name).map(|one| &one.levels);
        let mut levels = levels.into_iter().flatten();
        let level = levels.find(|(_, known)| known.to_bits() == value.to_bits());
        parts.push(level.map_or_else(
            || format!("{name} {value:.2}"),
            |(level, _)| format!("{name} {level}"),
        ));
    }
    let task = manner.task.as_ref();
    let task = task.filter(|task| config.cooperation.contains_key(*task));
    parts.extend(task.map(|task| format!("task {task}")));
    parts.join(", ")
}

/// The lines of the column: a person in each, or several lines for one of whom much is known.
pub(super) fn lines(situation: &Situation, config: &SocialConfig) -> Vec<String> {
    let people = situation.scene.people.iter();
    let known: Vec<(&str, String)> = people
        .map(|person| (person.name.as_str(), told(&person.manner, config)))
        .filter(|(_, told)| !told.is_empty())
        .collect();
    let mut lines = Vec::new();
    for (name, told) in known.iter().take(PEOPLE) {
        lines.extend(wrapped(&format!("{}: {told}", short(name, LINE / 2))));
    }
    if known.len() > PEOPLE {
        lines.push(format!("and {} more", known.len() - PEOPLE));
    }
    lines
}

/// Lines of at most [`LINE`] characters, broken between words; those after the first are indented.
fn wrapped(content: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in content.split(' ') {
        let word = short(word, LINE - 2);
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= LINE => {
                line.push(' ');
                line.push_str(&word);
            }
            Some(_) => lines.push(format!("\u{a0}\u{a0}{word}")),
            None => lines.push(word),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::{Frame, Seen};
    use nalgebra::Isometry2;

    #[test]
    fn what_acts_on_somebodys_space_is_told_in_lines_that_fit() {
        let seen = |id, activity: Option<&str>, features: Option<&str>, task: Option<&str>| Seen {
            id,
            pose: Isometry2::identity(),
            activity: activity.map(str::to_owned),
            features: features.map(str::to_owned),
            task: task.map(str::to_owned),
        };
        let people = vec![
            seen(1, Some("cooking"), None, None),
            seen(
                2,
                None,
                Some("emotional_state=happy, role=0.3"),
                Some("escort"),
            ),
            seen(3, Some("yodelling"), None, Some("sing")),
        ];
        let frame = Frame {
            time: 0.0,
            people,
            truth: None,
        };
        let config = SocialConfig::default();
        let situation = Situation::of_frame("three", &frame, &config);
        assert_eq!(
            lines(&situation, &config),
            [
                "1: cooking",
                "2: emotional_state happy, role",
                "\u{a0}\u{a0}resident, task escort",
            ]
        );
        assert_eq!(label("1", &situation, &config), "1, cooking");
        assert_eq!(label("3", &situation, &config), "3");
        assert_eq!(short("a name that goes on", 6), "a nam…");
        assert!(
            wrapped(&"word ".repeat(40))
                .iter()
                .all(|line| line.chars().count() <= LINE)
        );
    }
}
