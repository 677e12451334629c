//! From a scene to the grid, the polylines and what was rejected. This file owns the updating: it
//! keeps the walls drawn, finds which stamps changed, and draws again only where they were and are.

use super::config::{ConfigError, SocialConfig};
use super::gaussian::AsymmetricGaussian;
use super::layers::{Inflation, Stamp, Window};
use super::scene::{Object, Person, Rejection, SceneError, SocialScene, Wall};
use super::visibility::visible;
use super::zones::{Cuts, Zone};
use crate::grid::CostGrid;
use dsr::Time;
use nalgebra::{Isometry2, Point2};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Grid and graph carry R(t) to this many steps a unit, so that an approaching activity changes them
/// every few seconds and not at every turn.
const USAGE_STEPS: f64 = 100.0;
/// With more changed windows than this, drawing everything is cheaper than comparing them.
const MOST_WINDOWS: usize = 256;

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
        let mut rejected = scene.rejected.clone();
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
            cost: one.rounded_usage() as f32,
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
