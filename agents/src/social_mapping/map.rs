//! From a scene to the grid, the outlines, the groups and what was rejected. This file owns what is drawn
//! for each thing of the scene, and makes anew only what belongs to things that changed.

use super::adaptation::Passage;
use super::config::{ConfigError, SocialConfig};
use super::drawn::{Drawn, inflation};
use super::found::{FoundGroup, found_groups};
use super::four_sided::FourSided;
use super::layers::Layer;
use super::object_space::UsageCurve;
use super::personal::{CooperationZone, passages_of, shape_of};
use super::rejection::Rejection;
use super::scene::{Object, Person, SceneError, SocialScene};
use super::stamps::Stamp;
use super::visibility::visible;
use super::zones::{Cuts, Zone};
use crate::grid::{CostGrid, Region};
use crate::names::suggestion;
use dsr::Time;
use nalgebra::{Isometry2, Point2};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Grid and graph carry R(t) to this many steps a unit, so that an approaching activity changes them
/// every few seconds and not at every turn.
const USAGE_STEPS: f64 = 100.0;

/// What one update brought.
#[derive(Debug, Clone, PartialEq)]
pub struct Update {
    /// The cost of each place for the robot's centre.
    pub grid: Arc<CostGrid>,
    /// Outside of it, each cost is that of the update before: all of the grid at first, and where
    /// walls, bounds or figures changed. Empty where no cost changed.
    pub dirty: Region,
    /// The zones of each person, in the scene's order. Empty without social behaviour.
    pub people: Vec<Arc<PersonSpaces>>,
    /// Who stands together. Empty without social behaviour.
    pub groups: Arc<[FoundGroup]>,
    /// The space and usage of each object that has one, in the scene's order. Empty without social
    /// behaviour.
    pub objects: Vec<ObjectUse>,
    /// What was left out or mended. Never silent.
    pub rejected: Vec<Rejection>,
}

/// The zones of one person as closed polylines, world frame, the first point not repeated.
#[derive(Debug, Clone, PartialEq)]
pub struct PersonSpaces {
    /// The person.
    pub name: String,
    /// Where the polylines were drawn.
    pub world_from_person: Isometry2<f64>,
    /// The widths of the density, as grid and outlines have it.
    pub shape: FourSided,
    /// Whether the robot passes between the person and the walls ahead, to the left, behind and to the
    /// right, where the configuration has space give way to walls (FD IV-C).
    pub passages: Option<[Passage; 4]>,
    /// Where the person wants the robot.
    pub open: Vec<CooperationZone>,
    /// Outline of the intimate zone.
    pub intimate: Vec<Point2<f64>>,
    /// Outline of the personal zone.
    pub personal: Vec<Point2<f64>>,
    /// Outline of the social zone.
    pub social: Vec<Point2<f64>>,
}

/// The space of one object.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectUse {
    /// The object.
    pub name: String,
    /// Where the polyline was drawn.
    pub world_from_object: Isometry2<f64>,
    /// Outline of the space as far as walls let it reach, a closed polyline like a person's.
    pub space: Arc<[Point2<f64>]>,
    /// R(t) now.
    pub usage: f64,
}

impl ObjectUse {
    /// R(t) to the hundredth, as the grid and the graph carry it; exact at the curve's ends.
    pub fn rounded_usage(&self) -> f64 {
        (self.usage * USAGE_STEPS).round() / USAGE_STEPS
    }
}

/// Makes the social map, and makes anew only what changed since the last update.
#[derive(Debug, Clone)]
pub struct SocialMapper {
    config: SocialConfig,
    drawn: Option<Drawn>,
}

impl SocialMapper {
    /// A mapper that has drawn nothing.
    ///
    /// # Errors
    /// All problems of the figures.
    pub fn new(config: SocialConfig) -> Result<Self, Vec<ConfigError>> {
        let problems = config.problems();
        if problems.is_empty() {
            Ok(Self {
                config,
                drawn: None,
            })
        } else {
            Err(problems)
        }
    }

    /// Its figures.
    pub fn config(&self) -> &SocialConfig {
        &self.config
    }

    /// The map of `scene` at `now`. It depends on these two alone: updates before it only make it
    /// faster. Whatever cell the robot itself is in, the map stays as it is.
    ///
    /// # Errors
    /// [`SceneError`] where no map can be made; the map before stays for the next update.
    pub fn update(&mut self, now: Time, scene: &SocialScene) -> Result<Update, SceneError> {
        scene.check(self.config.resolution)?;
        let mut rejected = scene.rejected.clone();
        let people = scene.sound_people(&mut rejected);
        let objects = scene.sound_objects(&mut rejected);
        scene.check_uses(&objects, &self.config, &mut rejected);

        let fresh = self.drawn.take().filter(|drawn| drawn.fits(scene));
        let first = fresh.is_none();
        let mut drawn = fresh.unwrap_or_else(|| Drawn::new(&self.config, scene));
        drawn.social = scene.social;

        let uses = if scene.social {
            self.object_uses(now, scene, &objects, &mut drawn)
        } else {
            Vec::new()
        };
        let spaces = self.person_spaces(scene, &people, &mut drawn, &mut rejected);
        let groups = drawn.groups.clone().unwrap_or_else(|crowd| {
            rejected.push(crowd.into());
            Arc::default()
        });
        let mut stamps = self.object_stamps(scene, &objects, &uses);
        stamps.extend(self.people_stamps(scene, &people, &spaces, &mut rejected));
        if self.config.group_space {
            let cuts = Cuts::new(&self.config.proxemics.levels);
            stamps.extend(groups.iter().map(|group| Stamp::Zones {
                world_from_person: group.entity.world_from_group,
                shape: group.widths,
                cuts,
                open: Vec::new(),
                shut: [false; 4],
            }));
        }
        let mut dirty = drawn.redraw(stamps);
        if first {
            dirty = drawn.grid.whole();
        }
        let update = Update {
            grid: Arc::clone(&drawn.grid),
            dirty,
            people: spaces,
            groups,
            objects: uses,
            rejected,
        };
        self.drawn = Some(drawn);
        Ok(update)
    }

    /// What an update would leave out or mend of a scene of which no map need be possible.
    pub fn problems(&self, scene: &SocialScene) -> Vec<Rejection> {
        let mut rejected = scene.rejected.clone();
        let people = scene.sound_people(&mut rejected);
        let objects = scene.sound_objects(&mut rejected);
        scene.check_uses(&objects, &self.config, &mut rejected);
        for person in people.iter().filter(|_| scene.social) {
            self.check_manner(person, &mut rejected);
        }
        rejected
    }

    /// A layer of the map as it was last updated; `None` before the first update. Drawn for whoever
    /// asks: the map itself needs no layers.
    pub fn layer(&self, layer: Layer) -> Option<CostGrid> {
        self.drawn.as_ref().map(|drawn| drawn.layer(layer))
    }

    /// The objects that have a space, each with its outline and usage.
    fn object_uses(
        &self,
        now: Time,
        scene: &SocialScene,
        objects: &[&Object],
        drawn: &mut Drawn,
    ) -> Vec<ObjectUse> {
        let mut uses = Vec::new();
        let mut kept = Vec::new();
        for object in objects {
            let Some(space) = self.config.spaces.get(&object.class) else {
                continue;
            };
            let outline = match drawn.spaces.iter().find(|(known, _)| known == *object) {
                Some((_, outline)) => Arc::clone(outline),
                None => visible(
                    &space.polygon(&object.outline, &object.world_from_object),
                    space.viewpoint(&object.outline, &object.world_from_object),
                    &scene.walls,
                )
                .into(),
            };
            kept.push(((*object).clone(), Arc::clone(&outline)));
            let curve = self.curve(&object.name);
            uses.push(ObjectUse {
                name: object.name.clone(),
                world_from_object: object.world_from_object,
                space: outline,
                usage: curve.usage(now, &scene.agenda(&object.name)),
            });
        }
        drawn.spaces = kept;
        uses
    }

    fn curve(&self, object: &str) -> &UsageCurve {
        let own = self.config.usage_of.get(object);
        own.unwrap_or(&self.config.usage)
    }

    /// R(t) of the objects of a scene that have a space, by name, at each of the times.
    pub fn usages(&self, scene: &SocialScene, times: &[Time]) -> BTreeMap<String, Vec<f64>> {
        let has_space = |object: &&&Object| self.config.spaces.contains_key(&object.class);
        let objects = scene.sound_objects(&mut Vec::new());
        let usages = objects.iter().filter(has_space).map(|object| {
            let (curve, agenda) = (self.curve(&object.name), scene.agenda(&object.name));
            let usages = times.iter().map(|time| curve.usage(*time, &agenda));
            (object.name.clone(), usages.collect())
        });
        usages.collect()
    }

    fn object_stamps(
        &self,
        scene: &SocialScene,
        objects: &[&Object],
        uses: &[ObjectUse],
    ) -> Vec<Stamp> {
        let inflation = inflation(&self.config, scene.robot_radius);
        let footprints = objects.iter().map(|object| Stamp::Footprint {
            outline: object.outline,
            world_from_object: object.world_from_object,
            inflation,
        });
        let spaces = uses.iter().map(|one| Stamp::Space {
            polygon: Arc::clone(&one.space),
            cost: one.rounded_usage() as f32,
        });
        footprints.chain(spaces).collect()
    }

    /// Bodies, and with social behaviour zones and the spaces between people.
    fn people_stamps(
        &self,
        scene: &SocialScene,
        people: &[Cow<'_, Person>],
        spaces: &[Arc<PersonSpaces>],
        rejected: &mut Vec<Rejection>,
    ) -> Vec<Stamp> {
        let cuts = Cuts::new(&self.config.proxemics.levels);
        let mut stamps = Vec::with_capacity(3 * people.len());
        for (at, person) in people.iter().enumerate() {
            stamps.push(Stamp::Body {
                centre: position(person),
                radius: person.radius,
                reach: scene.robot_radius,
            });
            // Without social behaviour nobody has spaces.
            stamps.extend(spaces.get(at).map(|spaces| {
                Stamp::Zones {
                    world_from_person: spaces.world_from_person,
                    shape: spaces.shape,
                    cuts,
                    open: spaces.open.clone(),
                    shut: spaces
                        .passages
                        .map_or([false; 4], |all| all.map(|one| !one.is_passable())),
                }
            }));
        }
        if scene.social {
            stamps.extend(self.between(scene, people, rejected));
        }
        stamps
    }

    /// Reports what the configuration does not know of a person.
    fn check_manner(&self, person: &Person, rejected: &mut Vec<Rejection>) {
        let mut unknown = |what: &'static str, given: &str, known: Vec<&str>| {
            rejected.push(Rejection::PersonManner {
                name: person.name.clone(),
                what,
                given: given.to_owned(),
                help: suggestion(given, known),
            });
        };
        let (activities, tasks) = (&self.config.activities, &self.config.cooperation);
        if let Some(given) = &person.manner.activity
            && !activities.contains_key(given)
        {
            let known = activities.keys().map(String::as_str).collect();
            unknown("activity", given, known);
        }
        if let Some(given) = &person.manner.task
            && !tasks.contains_key(given)
        {
            unknown("task", given, tasks.keys().map(String::as_str).collect());
        }
    }

    /// The spaces between people who interact. A pair named both ways has one.
    fn between(
        &self,
        scene: &SocialScene,
        people: &[Cow<'_, Person>],
        rejected: &mut Vec<Rejection>,
    ) -> Vec<Stamp> {
        let places: BTreeMap<&str, Point2<f64>> = people
            .iter()
            .map(|person| (person.name.as_str(), position(person)))
            .collect();
        let mut pairs: Vec<(&str, &str)> = scene
            .interactions
            .iter()
            .map(|(a, b)| {
                if a <= b {
                    (a.as_str(), b.as_str())
                } else {
                    (b.as_str(), a.as_str())
                }
            })
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        let mut stamps = Vec::with_capacity(pairs.len());
        for (a, b) in pairs {
            let names = || (a.to_owned(), b.to_owned());
            let (Some(from), Some(to)) = (places.get(a), places.get(b)) else {
                let missing = if places.contains_key(a) { b } else { a }.to_owned();
                let (name, other) = names();
                rejected.push(Rejection::Interaction {
                    name,
                    other,
                    missing,
                });
                continue;
            };
            let distance = (to - from).norm();
            if distance > self.config.between_reach {
                let (name, other) = names();
                rejected.push(Rejection::InteractionTooFar {
                    name,
                    other,
                    distance,
                });
                continue;
            }
            stamps.push(Stamp::Between {
                ends: [*from, *to],
                half_width: self.config.between_half_width,
                cost: Zone::Personal.cost(),
            });
        }
        stamps
    }

    /// The zones of everybody, and the groups; those of before where nobody changed.
    fn person_spaces(
        &self,
        scene: &SocialScene,
        people: &[Cow<'_, Person>],
        drawn: &mut Drawn,
        rejected: &mut Vec<Rejection>,
    ) -> Vec<Arc<PersonSpaces>> {
        if !scene.social {
            drawn.people.clear();
            drawn.groups = Ok(Arc::default());
            return Vec::new();
        }
        let mut same = drawn.people.len() == people.len();
        for (at, person) in people.iter().enumerate() {
            self.check_manner(person, rejected);
            match drawn.people.get(at) {
                Some((known, _)) if known == &**person => {}
                Some(_) | None => {
                    same = false;
                    let made = Arc::new(self.spaces_of(person, scene));
                    let entry = (person.clone().into_owned(), made);
                    match drawn.people.get_mut(at) {
                        Some(known) => *known = entry,
                        None => drawn.people.push(entry),
                    }
                }
            }
        }
        drawn.people.truncate(people.len());
        if !same {
            drawn.groups = found_groups(&self.config, people).map(Into::into);
        }
        drawn
            .people
            .iter()
            .map(|(_, spaces)| Arc::clone(spaces))
            .collect()
    }

    fn spaces_of(&self, person: &Person, scene: &SocialScene) -> PersonSpaces {
        let levels = &self.config.proxemics.levels;
        let pose = &person.world_from_person;
        let shape = shape_of(&self.config, person, &scene.walls);
        let contour = |level| shape.contour(pose, level, self.config.contour_points);
        let task = person.manner.task.as_ref();
        let open = task.and_then(|task| self.config.cooperation.get(task));
        PersonSpaces {
            name: person.name.clone(),
            world_from_person: *pose,
            shape,
            passages: passages_of(&self.config, person, &scene.walls),
            open: open.cloned().unwrap_or_default(),
            intimate: contour(levels.intimate),
            personal: contour(levels.personal),
            social: contour(levels.social),
        }
    }
}

fn position(person: &Person) -> Point2<f64> {
    person.world_from_person.translation.vector.into()
}

#[cfg(test)]
mod tests;
