//! What people see of a recording in Foxglove: the map as entities of a scene, each written again when
//! it changed and taken away when it is gone. It guarantees that who played all updates up to a time
//! sees the map as of then.

use super::draw::{self, Colour};
use crate::view::map::{Group, Map, Object, Person, Robot};
use dsr::Time;
use foxglove::messages::scene_entity_deletion::Type as Deletion;
use foxglove::messages::{
    LinePrimitive, SceneEntity, SceneEntityDeletion, SceneUpdate, TextPrimitive,
};
use std::collections::BTreeMap;

const WALL: Colour = [0.25, 0.25, 0.3, 1.0];
const ROOM: Colour = [0.6, 0.6, 0.65, 1.0];
const PERSON: Colour = [0.2, 0.4, 0.8, 0.9];
const ROBOT: Colour = [0.1, 0.6, 0.3, 1.0];
const OBJECT: Colour = [0.55, 0.45, 0.35, 0.9];
const GROUP: Colour = [0.5, 0.2, 0.7, 0.9];
/// From the closest outwards.
const ZONES: [Colour; 3] = [
    [0.85, 0.2, 0.2, 0.9],
    [0.95, 0.6, 0.1, 0.8],
    [0.9, 0.85, 0.2, 0.6],
];

/// The scene as it was last written.
#[derive(Debug, Default)]
pub(super) struct Scene {
    entities: BTreeMap<String, SceneEntity>,
}

impl Scene {
    /// What brings the scene to the map as of now; `None` where nothing changed.
    pub(super) fn update(&mut self, map: &Map, now: Time) -> Option<SceneUpdate> {
        let mut update = SceneUpdate::default();
        let mut fresh = BTreeMap::new();
        for entity in entities(map) {
            fresh.insert(entity.id.clone(), entity);
        }
        let timestamp = Some(draw::timestamp(now));
        for (id, entity) in &fresh {
            if self.entities.get(id) != Some(entity) {
                update.entities.push(SceneEntity {
                    timestamp,
                    ..entity.clone()
                });
            }
        }
        for id in self.entities.keys().filter(|id| !fresh.contains_key(*id)) {
            update.deletions.push(SceneEntityDeletion {
                timestamp,
                r#type: Deletion::MatchingId as i32,
                id: id.clone(),
            });
        }
        self.entities = fresh;
        let changed = !update.entities.is_empty() || !update.deletions.is_empty();
        changed.then_some(update)
    }
}

fn entities(map: &Map) -> Vec<SceneEntity> {
    let entity = |id: String| SceneEntity {
        id,
        frame_id: map.frame.clone(),
        ..SceneEntity::default()
    };
    let mut all = Vec::new();
    if !map.walls.is_empty() {
        all.push(SceneEntity {
            lines: vec![draw::walls(&map.walls, WALL)],
            ..entity("walls".to_owned())
        });
    }
    for room in &map.rooms {
        let middle = draw::middle(&room.outline);
        all.push(SceneEntity {
            lines: vec![draw::ring(&room.outline, 0.02, ROOM)],
            texts: vec![draw::text(&room.name, middle, 0.0)],
            ..entity(format!("room/{}", room.name))
        });
    }
    all.extend(
        map.people
            .iter()
            .map(|person| self::person(person, entity(id("person", &person.name)))),
    );
    all.extend(
        map.groups
            .iter()
            .map(|group| self::group(group, entity(id("group", &group.name)))),
    );
    all.extend(
        map.objects
            .iter()
            .map(|object| self::object(object, entity(id("object", &object.name)))),
    );
    all.extend(
        map.robots
            .iter()
            .map(|robot| self::robot(robot, entity(id("robot", &robot.name)))),
    );
    all
}

fn id(kind: &str, name: &str) -> String {
    format!("{kind}/{name}")
}

fn label(name: &str, place: [f64; 3], height: f64) -> Vec<TextPrimitive> {
    vec![draw::text(name, [place[0], place[1]], height)]
}

fn rings<'a>(outlines: impl Iterator<Item = (&'a Vec<[f64; 2]>, Colour)>) -> Vec<LinePrimitive> {
    outlines
        .filter(|(outline, _)| outline.len() > 1)
        .map(|(outline, colour)| draw::ring(outline, 0.03, colour))
        .collect()
}

fn person(person: &Person, entity: SceneEntity) -> SceneEntity {
    SceneEntity {
        cylinders: vec![draw::cylinder(person.place, person.radius, 1.7, PERSON)],
        arrows: vec![draw::arrow(person.place, 2.0 * person.radius, PERSON)],
        lines: rings(person.zones.iter().zip(ZONES)),
        texts: label(&person.name, person.place, 1.9),
        ..entity
    }
}

fn group(group: &Group, entity: SceneEntity) -> SceneEntity {
    SceneEntity {
        lines: rings(std::iter::once((&group.outline, GROUP))),
        texts: label(&group.name, group.place, 0.1),
        ..entity
    }
}

fn object(object: &Object, entity: SceneEntity) -> SceneEntity {
    let space = std::iter::once((&object.space, draw::usage_colour(object.usage)));
    let mut drawn = SceneEntity {
        lines: rings(space),
        texts: label(&object.name, object.place, 1.0),
        ..entity
    };
    if object.circle {
        drawn.cylinders = vec![draw::cylinder(
            object.place,
            object.size[0] / 2.0,
            0.75,
            OBJECT,
        )];
    } else {
        drawn.cubes = vec![draw::cube(object.place, object.size, 0.75, OBJECT)];
    }
    drawn
}

fn robot(robot: &Robot, entity: SceneEntity) -> SceneEntity {
    SceneEntity {
        cylinders: vec![draw::cylinder(robot.place, robot.radius, 0.6, ROBOT)],
        arrows: vec![draw::arrow(robot.place, 2.0 * robot.radius, ROBOT)],
        texts: label(&robot.name, robot.place, 0.8),
        ..entity
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn person_at(x: f64) -> Map {
        Map {
            frame: "world".to_owned(),
            people: vec![Person {
                name: "ana".to_owned(),
                place: [x, 0.0, 0.0],
                radius: 0.25,
                zones: Default::default(),
                interacting: Vec::new(),
            }],
            ..Map::default()
        }
    }

    #[test]
    fn only_what_changed_is_written_again_and_what_is_gone_is_taken_away() {
        let mut scene = Scene::default();
        let first = scene.update(&person_at(0.0), Time::default()).unwrap();
        assert_eq!(first.entities.len(), 1);
        assert_eq!(first.entities[0].id, "person/ana");
        assert_eq!(scene.update(&person_at(0.0), Time::from_seconds(1.0)), None);
        let moved = scene.update(&person_at(1.0), Time::from_seconds(2.0));
        assert_eq!(moved.unwrap().entities.len(), 1);
        let gone = scene
            .update(&Map::default(), Time::from_seconds(3.0))
            .unwrap();
        assert!(gone.entities.is_empty());
        assert_eq!(gone.deletions[0].id, "person/ana");
    }
}
