//! Recorded situations: people with their poses frame by frame, with the groups that somebody saw
//! in them where known; and single scenes around a robot. This file owns both file formats, and
//! guarantees that what it returns is finite and names nobody twice in one frame.

use agents::social_mapping::comfort::ComfortScene;
use nalgebra::{Isometry2, Point2, Vector2};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::FRAC_PI_2;

/// People over time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// In the order of the file.
    pub frames: Vec<Frame>,
}

/// People at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// As the file counts time.
    pub time: f64,
    /// The people.
    pub people: Vec<Seen>,
    /// Who stands together, where somebody has said; members need not be among the people.
    pub truth: Option<Vec<BTreeSet<u64>>>,
}

/// A person in a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// The name, a number in the file.
    pub id: u64,
    /// Where the person stands and faces, world frame.
    pub pose: Isometry2<f64>,
    /// What the person does, such as `cooking`, where somebody has said.
    pub activity: Option<String>,
    /// What the person feels and wants, such as `emotional_state=happy`.
    pub features: Option<String>,
    /// What the robot does with the person, such as `escort`.
    pub task: Option<String>,
}

/// One scene with a robot at the origin.
#[derive(Debug, Clone, PartialEq)]
pub struct RatedScene {
    /// Its name.
    pub identifier: String,
    /// What is around, in the robot's frame.
    pub scene: ComfortScene,
    /// What people think of the robot's place, 0 to 100, where somebody was asked.
    pub score: Option<f64>,
}

/// Why a file is no recording and no list of scenes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ScenesError {
    /// The text is not JSON, or lacks something.
    #[error("line {line}, column {column}: {problem}")]
    Json {
        /// From 1.
        line: usize,
        /// From 1.
        column: usize,
        /// What is wrong.
        problem: String,
    },
    /// A person is in a frame twice.
    #[error("frame {frame} has person {person} twice")]
    Twice {
        /// From 0.
        frame: usize,
        /// The name.
        person: u64,
    },
    /// A person stands in two groups of a frame.
    #[error("frame {frame} has person {person} in two groups")]
    TwoGroups {
        /// From 0.
        frame: usize,
        /// The name.
        person: u64,
    },
    /// There is nothing to look at.
    #[error("there are no {what}")]
    Empty {
        /// What there should be.
        what: &'static str,
    },
    /// Two in a scene have one name; the robot's is 0.
    #[error("line {line}: {name} is in the scene twice (the robot is {ROBOT})")]
    TwiceInScene {
        /// From 1.
        line: usize,
        /// The name.
        name: u64,
    },
    /// The robot has another name than the links of a scene have for it.
    #[error("line {line}: the robot is called {name}, where links call it {ROBOT}")]
    Robot {
        /// From 1.
        line: usize,
        /// The name.
        name: u64,
    },
    /// A link is of a kind that is not known.
    #[error("line {line}: a link is of the kind `{kind}`; there is `{INTERACT}`")]
    LinkKind {
        /// From 1.
        line: usize,
        /// As given.
        kind: String,
    },
    /// A link leads from somebody to themselves.
    #[error("line {line}: a link leads from {name} to {name}")]
    LinkToItself {
        /// From 1.
        line: usize,
        /// The name.
        name: u64,
    },
    /// A rating is none.
    #[error("line {line}: the score {score:?} is not from 0 to 100")]
    Score {
        /// From 1.
        line: usize,
        /// As given.
        score: f64,
    },
    /// A link leads from or to something that is not in the scene.
    #[error("line {line}: a link names {name}, which is not in the scene")]
    Link {
        /// From 1.
        line: usize,
        /// The name.
        name: u64,
    },
}

#[derive(Deserialize)]
struct RecordingFile {
    frames: Vec<FrameRecord>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FrameRecord {
    t: f64,
    people: Vec<PersonRecord>,
    groups: Option<Vec<BTreeSet<u64>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PersonRecord {
    id: u64,
    x_m: f64,
    y_m: f64,
    theta_rad: f64,
    activity: Option<String>,
    features: Option<String>,
    task: Option<String>,
}

/// Reads a recording of at least one frame: JSON with `frames`, each `{"t", "people": [{"id", "x_m", "y_m", "theta_rad"}],
/// "groups": [[id, ...]]}`; `groups` may be missing, and of people the texts `activity`, `features` and
/// `task`. Metres, radians counter-clockwise from +x. Beside `frames`, the file may say what it likes; unknown keys of a
/// frame or a person are errors.
///
/// # Errors
/// [`ScenesError`].
pub fn parse_recording(text: &str) -> Result<Recording, ScenesError> {
    let file: RecordingFile = serde_json::from_str(text).map_err(|e| json_error(&e, 0))?;
    if file.frames.is_empty() {
        return Err(ScenesError::Empty { what: "frames" });
    }
    let mut frames = Vec::with_capacity(file.frames.len());
    for (index, frame) in file.frames.into_iter().enumerate() {
        let mut seen = BTreeSet::new();
        let mut people = Vec::with_capacity(frame.people.len());
        for person in frame.people {
            if !seen.insert(person.id) {
                return Err(ScenesError::Twice {
                    frame: index,
                    person: person.id,
                });
            }
            people.push(Seen {
                id: person.id,
                pose: Isometry2::new(Vector2::new(person.x_m, person.y_m), person.theta_rad),
                activity: person.activity,
                features: person.features,
                task: person.task,
            });
        }
        let mut grouped = BTreeSet::new();
        let mut members = frame.groups.iter().flatten().flatten();
        if let Some(person) = members.find(|person| !grouped.insert(**person)) {
            return Err(ScenesError::TwoGroups {
                frame: index,
                person: *person,
            });
        }
        frames.push(Frame {
            time: frame.t,
            people,
            truth: frame.groups,
        });
    }
    Ok(Recording { frames })
}

impl Recording {
    /// The last frame that is not later than `time`; the first where all are.
    pub fn at(&self, time: f64) -> Option<&Frame> {
        let earlier = self.frames.iter().filter(|frame| frame.time <= time);
        earlier
            .max_by(|a, b| a.time.total_cmp(&b.time))
            .or_else(|| self.frames.iter().min_by(|a, b| a.time.total_cmp(&b.time)))
    }
}

fn json_error(error: &serde_json::Error, lines_before: usize) -> ScenesError {
    // serde_json ends its message with the place, which has a field here.
    let text = error.to_string();
    let problem = text
        .rsplit_once(" at line ")
        .map_or(text.as_str(), |(what, _)| what);
    ScenesError::Json {
        line: lines_before + error.line(),
        column: error.column(),
        problem: problem.to_owned(),
    }
}

/// A scene as the `SocNav1` data set has it.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct SceneRecord {
    identifier: String,
    score: Option<f64>,
    #[serde(default)]
    robot: RobotRecord,
    #[serde(default)]
    humans: Vec<EntityRecord>,
    #[serde(default)]
    objects: Vec<EntityRecord>,
    #[serde(default)]
    links: Vec<(u64, u64, String)>,
    #[serde(default)]
    room: Vec<[f64; 2]>,
}

/// The robot is at the origin, whatever its number.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotRecord {
    id: u64,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct EntityRecord {
    id: u64,
    x_pos: f64,
    y_pos: f64,
    orientation: f64,
}

/// Centimetres to metres.
const CM: f64 = 0.01;
/// The robot's number in the links of a scene.
const ROBOT: u64 = 0;
/// The only kind of link: the first attends to the second.
const INTERACT: &str = "interact";

/// Reads scenes, one JSON object a line, as the `SocNav1` data set has them: the robot at the
/// origin, centimetres, degrees, a heading being the orientation less 90; `links` of who attends to
/// whom or what; the room's outline. Empty lines are passed over, and at least one is a scene.
///
/// # Errors
/// [`ScenesError`].
pub fn parse_scenes(text: &str) -> Result<Vec<RatedScene>, ScenesError> {
    let mut scenes = Vec::new();
    for (before, line) in text.lines().enumerate() {
        if line.trim().is_empty() {
            continue;
        }
        let record: SceneRecord = serde_json::from_str(line).map_err(|e| json_error(&e, before))?;
        let line = before + 1;
        if let Some(score) = record.score.filter(|score| !(0.0..=100.0).contains(score)) {
            return Err(ScenesError::Score { line, score });
        }
        if record.robot.id != ROBOT {
            let name = record.robot.id;
            return Err(ScenesError::Robot { line, name });
        }
        let mut places = BTreeMap::from([(ROBOT, Point2::origin())]);
        for entity in record.humans.iter().chain(&record.objects) {
            let place = Point2::new(entity.x_pos * CM, entity.y_pos * CM);
            let name = entity.id;
            if places.insert(name, place).is_some() {
                return Err(ScenesError::TwiceInScene { line, name });
            }
        }
        let mut links = Vec::with_capacity(record.links.len());
        for (from, to, kind) in &record.links {
            let place = |name: &u64| {
                let missing = ScenesError::Link { line, name: *name };
                places.get(name).copied().ok_or(missing)
            };
            if kind != INTERACT {
                let kind = kind.clone();
                return Err(ScenesError::LinkKind { line, kind });
            }
            if from == to {
                return Err(ScenesError::LinkToItself { line, name: *from });
            }
            links.push([place(from)?, place(to)?]);
        }
        let people = record.humans.iter().map(|human| {
            let heading = human.orientation.to_radians() - FRAC_PI_2;
            Isometry2::new(Vector2::new(human.x_pos, human.y_pos) * CM, heading)
        });
        let mut room: Vec<Point2<f64>> = record
            .room
            .iter()
            .map(|[x, y]| Point2::new(x * CM, y * CM))
            .collect();
        if room.len() > 1 && room.first() == room.last() {
            room.pop();
        }
        scenes.push(RatedScene {
            identifier: record.identifier,
            scene: ComfortScene {
                people: people.collect(),
                links,
                room,
                walls: Vec::new(),
            },
            score: record.score,
        });
    }
    if scenes.is_empty() {
        return Err(ScenesError::Empty { what: "scenes" });
    }
    Ok(scenes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_has_frames_and_the_truth_where_known() {
        let text = r#"{"dataset": "two", "frames": [
            {"t": 1, "people": [{"id": 4, "x_m": 1.5, "y_m": -2, "theta_rad": 0.5,
              "features": "role=staff"}], "groups": [[4, 9]]},
            {"t": 3.5, "people": []}]}"#;
        let recording = parse_recording(text).unwrap();
        assert_eq!(recording.frames.len(), 2);
        let seen = &recording.frames[0].people[0];
        assert_eq!(
            (seen.id, seen.pose.translation.vector),
            (4, Vector2::new(1.5, -2.0))
        );
        assert_eq!(
            (seen.features.as_deref(), &seen.task),
            (Some("role=staff"), &None)
        );
        assert_eq!(
            recording.frames[0].truth,
            Some(vec![BTreeSet::from([4, 9])])
        );
        assert_eq!(recording.frames[1].truth, None);
        let times = [0.0, 1.0, 3.0, 9.0].map(|t| format!("{}", recording.at(t).unwrap().time));
        assert_eq!(times, ["1", "1", "1", "3.5"]);
        assert_eq!(Recording::default().at(1.0), None);
    }

    #[test]
    fn what_is_no_recording_is_refused_with_its_place() {
        let refused = |text: &str| parse_recording(text).unwrap_err().to_string();
        assert_eq!(
            refused("{\"frames\": [\n{\"t\": null, \"people\": []}]}"),
            "line 2, column 10: invalid type: null, expected f64"
        );
        assert_eq!(refused("{}"), "line 1, column 2: missing field `frames`");
        let person = r#"{"id": 4, "x_m": 1, "y_m": 2, "theta_rad": 0}"#;
        let twice = format!("{{\"frames\": [{{\"t\": 1, \"people\": [{person}, {person}]}}]}}");
        assert_eq!(refused(&twice), "frame 0 has person 4 twice");
        let vast = twice.replacen("1,", "1e999,", 1);
        assert!(refused(&vast).contains("number out of range"));
        assert_eq!(refused("{\"frames\": []}"), "there are no frames");
        assert_eq!(
            refused("{\"frames\": [{\"t\": 1, \"people\": [{\"id\": 4, \"mood\": 1}]}]}"),
            "line 1, column 48: unknown field `mood`, expected one of `id`, `x_m`, `y_m`, `theta_rad`, `activity`, \
             `features`, `task`"
        );
        let groups = |groups: &str| {
            format!("{{\"frames\": [{{\"t\": 1, \"people\": [], \"groups\": {groups}}}]}}")
        };
        assert_eq!(
            refused(&groups("[[1, 2], [3, 2]]")),
            "frame 0 has person 2 in two groups"
        );
    }

    #[test]
    fn a_scene_is_turned_into_metres_and_headings() {
        let text = r#"
{"identifier": "a", "score": 40, "robot": {"id": 0}, "humans": [{"id": 1, "xPos": 100, "yPos": -50, "orientation": 90}], "objects": [{"id": 2, "xPos": 0, "yPos": 200, "orientation": 0}], "links": [[1, 2, "interact"]], "room": [[-300, -300], [300, -300], [300, 300], [-300, -300]]}
{"identifier": "b"}
"#;
        let scenes = parse_scenes(text).unwrap();
        assert_eq!(scenes.len(), 2);
        let scene = &scenes[0].scene;
        let pose = &scene.people[0];
        assert_eq!(pose.translation.vector, Vector2::new(1.0, -0.5));
        assert!(pose.rotation.angle().abs() < 1e-12);
        assert_eq!(
            scene.links,
            [[Point2::new(1.0, -0.5), Point2::new(0.0, 2.0)]]
        );
        assert_eq!(scene.room.len(), 3);
        assert_eq!(scenes[1].scene, ComfortScene::default());
        for (from, to, problem) in [
            (
                "[[1, 2,",
                "[[1, 7,",
                "line 2: a link names 7, which is not in the scene",
            ),
            ("[[1, 2,", "[[1, 1,", "line 2: a link leads from 1 to 1"),
            (
                "\"interact\"",
                "\"hit\"",
                "line 2: a link is of the kind `hit`; there is `interact`",
            ),
            (
                "[{\"id\": 2",
                "[{\"id\": 1",
                "line 2: 1 is in the scene twice (the robot is 0)",
            ),
            (
                "[{\"id\": 1",
                "[{\"id\": 0",
                "line 2: 0 is in the scene twice (the robot is 0)",
            ),
            (
                "\"robot\": {\"id\": 0}",
                "\"robot\": {\"id\": 3}",
                "line 2: the robot is called 3, where links call it 0",
            ),
            (
                "\"yPos\": -50",
                "\"yPos\": -50, \"angle\": 3",
                "line 2, column 107: unknown field `angle`, expected one of `id`, `xPos`, `yPos`, `orientation`",
            ),
            (
                "\"room\"",
                "\"rooms\"",
                "line 2, column 225: unknown field `rooms`, expected one of `identifier`, `score`, `robot`, `humans`, \
                 `objects`, `links`, `room`",
            ),
            (
                "\"links\"",
                "\"room\": [], \"links\"",
                "line 2, column 236: duplicate field `room`",
            ),
            (
                "40",
                "-1e300",
                "line 2: the score -1e300 is not from 0 to 100",
            ),
        ] {
            let changed = text.replace(from, to);
            assert_ne!(changed, text);
            assert_eq!(parse_scenes(&changed).unwrap_err().to_string(), problem);
        }
        assert_eq!(
            parse_scenes("\n\n").unwrap_err().to_string(),
            "there are no scenes"
        );
    }
}
