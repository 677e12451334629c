//! From a scene to the grid, the polylines and what was rejected. This file owns the updating: it
//! keeps the walls drawn, finds which stamps changed, and draws again only where they were and are.

use super::gaussian::AsymmetricGaussian;
use super::layers::{Inflation, Stamp, Window};
use super::object_space::{Space, UsageCurve};
use super::scene::{Object, Person, Rejection, SceneError, SocialScene, Wall};
use super::visibility::visible;
use super::zones::{Cuts, Proxemics, Zone};
use crate::grid::CostGrid;
use dsr::Time;
use nalgebra::{Isometry2, Point2};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The grid carries R(t) in steps of this size, so that an approaching activity changes it every
/// few seconds and not at every turn.
const USAGE_STEP: f64 = 0.01;
/// With more changed windows than this, drawing everything is cheaper than comparing them.
const MOST_WINDOWS: usize = 256;

/// All figures of the social map; every one has the papers' or our documented default.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SocialConfig {
    /// Side of a cell, metres.
    pub resolution: f64,
    /// People's density and zones. Preset `hall` with levels .9/.5/.1.
    pub proxemics: Proxemics,
    /// Whether the space of walking people reaches further ahead on the grid, by
    /// [`AsymmetricGaussian::walking`]. Polylines and metrics keep the standing shape.
    pub stretch: bool,
    /// What a place right beside an obstacle costs more than a free one. The default stays below
    /// the cheapest space of an object, so the order of READING.md item 7 holds; 0 turns it off.
    pub clearance_cost: f64,
    /// Over which distance from the blocked cells that falls to nothing, metres.
    pub clearance_width: f64,
    /// Half the width of the space between two who interact, metres. It costs as much as personal
    /// space: a robot passes between two who talk only where there is no other way.
    pub between_half_width: f64,
    /// Two who interact from further than this leave no space between them, metres (the outer end
    /// of Hall's social distance).
    pub between_reach: f64,
    /// The space of each class of objects; a class not named has none.
    pub spaces: BTreeMap<String, Space>,
    /// R(t).
    pub usage: UsageCurve,
    /// R(t) of single objects, by name.
    pub usage_of: BTreeMap<String, UsageCurve>,
    /// Points of a person's polylines.
    pub contour_points: usize,
}

impl Default for SocialConfig {
    fn default() -> Self {
        let viewed = ["tv", "board"].map(|class| (class.to_owned(), Space::VIEWED));
        let around = ["table", "bed", "stretcher"].map(|c| (c.to_owned(), Space::USED_AROUND));
        Self {
            resolution: 0.1,
            proxemics: Proxemics::default(),
            stretch: true,
            clearance_cost: 0.4,
            clearance_width: 0.3,
            between_half_width: 0.5,
            between_reach: 3.6,
            spaces: viewed.into_iter().chain(around).collect(),
            usage: UsageCurve::default(),
            usage_of: BTreeMap::new(),
            contour_points: 24,
        }
    }
}

/// A configuration that makes no map.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("social mapping: {field} {requirement}")]
pub struct ConfigError {
    /// The field at fault.
    pub field: String,
    /// What it has to be.
    pub requirement: &'static str,
}

impl SocialConfig {
    /// Everything that is wrong with the figures.
    pub fn problems(&self) -> Vec<ConfigError> {
        let not_negative = |x: f64| x.is_finite() && x >= 0.0;
        let length = "must be a finite length, not negative";
        let curve = "needs 1 <= least <= most, a ramp longer than 0 s and steps larger than 0";
        let mut checks = vec![
            (
                "resolution".to_owned(),
                self.resolution.is_finite() && self.resolution > 0.0,
                "must be a finite length greater than 0",
            ),
            (
                "proxemics.shape".to_owned(),
                self.proxemics.shape.is_valid(),
                "needs three finite widths greater than 0",
            ),
            (
                "proxemics.levels".to_owned(),
                self.proxemics.levels.is_valid(),
                "must satisfy 0 < social < personal < intimate < 1",
            ),
            (
                "clearance_cost".to_owned(),
                not_negative(self.clearance_cost),
                "must be finite and not negative",
            ),
            (
                "clearance_width".to_owned(),
                not_negative(self.clearance_width),
                length,
            ),
            (
                "between_half_width".to_owned(),
                not_negative(self.between_half_width),
                length,
            ),
            (
                "between_reach".to_owned(),
                not_negative(self.between_reach),
                length,
            ),
            ("usage".to_owned(), self.usage.is_valid(), curve),
        ];
        checks.extend(
            self.usage_of
                .iter()
                .map(|(o, c)| (format!("usage_of.{o}"), c.is_valid(), curve)),
        );
        checks.extend(self.spaces.iter().map(|(class, space)| {
            let requirement = "needs finite lengths greater than 0 and an opening below pi";
            (format!("spaces.{class}"), space.is_valid(), requirement)
        }));
        checks
            .into_iter()
            .filter(|(_, sound, _)| !sound)
            .map(|(field, _, requirement)| ConfigError { field, requirement })
            .collect()
    }
}

/// What one update brought.
#[derive(Debug, Clone, PartialEq)]
pub struct Update {
    /// The cost of each place for the robot's centre.
    pub grid: Arc<CostGrid>,
    /// Whether any cost differs from the update before.
    pub changed: bool,
    /// The zones of each person, in the scene's order. Empty without social behaviour.
    pub people: Vec<PersonSpaces>,
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
    pub space: Vec<Point2<f64>>,
    /// R(t) now.
    pub usage: f64,
}

/// Makes the social map, and makes anew only what changed since the last update.
#[derive(Debug, Clone)]
pub struct SocialMapper {
    config: SocialConfig,
    drawn: Option<Drawn>,
}

/// What stands on the grid.
#[derive(Debug, Clone)]
struct Drawn {
    bounds: [f64; 4],
    walls: Vec<Wall>,
    robot_radius: f64,
    /// The walls alone.
    base: CostGrid,
    stamps: Vec<Stamp>,
    /// Clipping by walls is the dearest step, so spaces are kept while their object rests.
    spaces: Vec<(Object, Vec<Point2<f64>>)>,
    grid: Arc<CostGrid>,
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
        let mut rejected = Vec::new();
        let people = scene.sound_people(&mut rejected);
        let objects = scene.sound_objects(&mut rejected);
        scene.check_activities(
            |name| {
                objects
                    .iter()
                    .any(|o| o.name == name && self.config.spaces.contains_key(&o.class))
            },
            &mut rejected,
        );

        let fresh = self.drawn.take().filter(|drawn| drawn.fits(scene));
        let first = fresh.is_none();
        let mut drawn = fresh.unwrap_or_else(|| Drawn::new(&self.config, scene));

        let uses = if scene.social {
            self.object_uses(now, scene, &objects, &mut drawn)
        } else {
            Vec::new()
        };
        let mut stamps = self.object_stamps(scene, &objects, &uses);
        stamps.extend(self.people_stamps(scene, &people, &mut rejected));
        let changed = drawn.redraw(stamps) || first;

        let update = Update {
            grid: Arc::clone(&drawn.grid),
            changed,
            people: if scene.social {
                self.person_spaces(&people)
            } else {
                Vec::new()
            },
            objects: uses,
            rejected,
        };
        self.drawn = Some(drawn);
        Ok(update)
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
                Some((_, outline)) => outline.clone(),
                None => visible(
                    &space.polygon(&object.outline, &object.world_from_object),
                    space.viewpoint(&object.outline, &object.world_from_object),
                    &scene.walls,
                ),
            };
            kept.push(((*object).clone(), outline.clone()));
            let curve = self
                .config
                .usage_of
                .get(&object.name)
                .unwrap_or(&self.config.usage);
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
            polygon: one.space.clone(),
            cost: ((one.usage / USAGE_STEP).round() * USAGE_STEP) as f32,
        });
        footprints.chain(spaces).collect()
    }

    /// Bodies, and with social behaviour zones and the spaces between people.
    fn people_stamps(
        &self,
        scene: &SocialScene,
        people: &[Person],
        rejected: &mut Vec<Rejection>,
    ) -> Vec<Stamp> {
        let mut stamps = Vec::with_capacity(3 * people.len());
        let cuts = Cuts::new(&self.config.proxemics.levels);
        for person in people {
            stamps.push(Stamp::Body {
                centre: position(person),
                radius: person.radius + scene.robot_radius,
            });
            if scene.social {
                stamps.push(Stamp::Zones {
                    world_from_person: person.world_from_person,
                    shape: self.shape(person),
                    cuts,
                });
            }
        }
        if scene.social {
            stamps.extend(self.between(scene, people, rejected));
        }
        stamps
    }

    /// The shape of a person's space on the grid.
    fn shape(&self, person: &Person) -> AsymmetricGaussian {
        let standing = self.config.proxemics.shape;
        if self.config.stretch {
            let own = person.world_from_person.rotation.inverse() * person.velocity;
            standing.walking(own.x)
        } else {
            standing
        }
    }

    /// The spaces between people who interact. A pair named both ways has one.
    fn between(
        &self,
        scene: &SocialScene,
        people: &[Person],
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

    fn person_spaces(&self, people: &[Person]) -> Vec<PersonSpaces> {
        let model = &self.config.proxemics;
        people
            .iter()
            .map(|person| {
                let pose = &person.world_from_person;
                let contour = |zone| model.contour(zone, pose, self.config.contour_points);
                PersonSpaces {
                    name: person.name.clone(),
                    world_from_person: *pose,
                    intimate: contour(Zone::Intimate),
                    personal: contour(Zone::Personal),
                    social: contour(Zone::Social),
                }
            })
            .collect()
    }
}

impl Drawn {
    fn new(config: &SocialConfig, scene: &SocialScene) -> Self {
        let mut base = CostGrid::covering(scene.bounds, config.resolution);
        let inflation = inflation(config, scene.robot_radius);
        for wall in &scene.walls {
            Stamp::Wall {
                wall: *wall,
                inflation,
            }
            .draw(&mut base);
        }
        Self {
            bounds: scene.bounds,
            walls: scene.walls.clone(),
            robot_radius: scene.robot_radius,
            grid: Arc::new(base.clone()),
            base,
            stamps: Vec::new(),
            spaces: Vec::new(),
        }
    }

    /// Whether the walls of `scene` are the ones drawn.
    #[expect(
        clippy::float_cmp,
        reason = "asks for the same scene, not for a similar one"
    )]
    fn fits(&self, scene: &SocialScene) -> bool {
        self.bounds == scene.bounds
            && self.walls == scene.walls
            && self.robot_radius == scene.robot_radius
    }

    /// Replaces the stamps; true where a cost changed.
    fn redraw(&mut self, stamps: Vec<Stamp>) -> bool {
        let windows: Vec<Window> = stamps.iter().map(|s| s.window(&self.base)).collect();
        let dirty = self.dirty(&stamps, &windows);
        if dirty.is_empty() {
            self.stamps = stamps;
            return false;
        }
        let width = self.base.width;
        let grid = Arc::make_mut(&mut self.grid);
        let ranges = || dirty.iter().flat_map(|window| window.row_ranges(width));
        let before: Vec<f32> = ranges().flat_map(|r| &grid.costs[r]).copied().collect();
        for range in ranges() {
            grid.costs[range.clone()].copy_from_slice(&self.base.costs[range]);
        }
        for (stamp, window) in stamps.iter().zip(&windows) {
            if dirty.iter().any(|d| d.meets(window)) {
                stamp.draw(grid);
            }
        }
        self.stamps = stamps;
        ranges().flat_map(|r| &grid.costs[r]).ne(&before)
    }

    /// The windows of stamps that are new or gone. Stamps are compared place by place: when one is
    /// inserted, those after it count as changed once, which costs time and nothing else.
    fn dirty(&self, stamps: &[Stamp], windows: &[Window]) -> Vec<Window> {
        let mut dirty = Vec::new();
        for i in 0..stamps.len().max(self.stamps.len()) {
            let (old, new) = (self.stamps.get(i), stamps.get(i));
            if old == new {
                continue;
            }
            let was = old
                .map(|stamp| stamp.window(&self.base))
                .filter(|w| !w.is_empty());
            let is = windows.get(i).copied().filter(|w| !w.is_empty());
            match (was, is) {
                (Some(was), Some(is)) if was.meets(&is) => dirty.push(was.joined(&is)),
                (was, is) => dirty.extend(was.into_iter().chain(is)),
            }
        }
        if dirty.len() > MOST_WINDOWS {
            dirty = dirty
                .into_iter()
                .reduce(|all, one| all.joined(&one))
                .into_iter()
                .collect();
        }
        dirty
    }
}

/// How obstacles grow for this robot. However slim it is, a wall blocks each cell it passes
/// through, so no path slips through a wall.
fn inflation(config: &SocialConfig, robot_radius: f64) -> Inflation {
    Inflation {
        reach: robot_radius.max(config.resolution * std::f64::consts::FRAC_1_SQRT_2),
        extra: config.clearance_cost,
        width: config.clearance_width,
    }
}

fn position(person: &Person) -> Point2<f64> {
    person.world_from_person.translation.vector.into()
}

#[cfg(test)]
mod tests;
