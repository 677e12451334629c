//! Social mapping on the shared graph: what it reads there and what it writes. This file owns the
//! names of the nodes and attributes, and guarantees that a turn in which nothing moved noticeably
//! writes nothing.

mod groups;
mod problems;
mod read;
mod settings;
mod usage;

use groups::GroupNodes;
pub use groups::{EXTENT, FEATURES, GROUP, MEMBER};
pub use problems::PROBLEMS;
pub use read::scene;
use settings::Settings;
pub use usage::usages;

use super::adaptation::Passage;
use super::config::{ConfigError, SocialConfig};
use super::map::{ObjectUse, PersonSpaces, SocialMapper, Update};
use super::rejection::Rejection;
use super::scene::SceneError;
use crate::grid::Region;
use crate::grid::shared::GridUpdate;
use dsr::{LargeError, Node, Operation, Owner, Snapshot, Time, Transaction, Value};
use nalgebra::Point2;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The attributes that hold a person's polylines, from the closest zone outwards: each a list
/// x, y, x, y, ... in the world frame, closed, the first point not repeated.
/// (`social` alone is the world's switch, and an attribute has one kind in the whole graph.)
pub const ZONES: [&str; 3] = ["intimate_zone", "personal_zone", "social_zone"];
/// The attribute that says whether the robot passes between a person and the walls ahead, to the left, behind and to
/// the right: `free`, `adapted` (the person's space gives way) or `blocked`. Absent where space does not give way to
/// walls.
pub const PASSAGES: &str = "passages";
/// The attribute that holds the polyline of an object's space, like a person's.
pub const SPACE: &str = "space";
/// The attribute that holds R(t).
pub const USAGE: &str = "usage";
/// The world's attribute that holds the figures of the social map, as JSON: those of
/// [`SocialConfig`], of which any may be missing: the scenario's hold for those. It may be set while running.
pub const SETTINGS: &str = "social_settings";
/// The world's attribute that holds the figures of the scenario, as JSON like [`SETTINGS`]: those that count for each key
/// that `SETTINGS` does not give.
pub const SCENARIO_SETTINGS: &str = "social_scenario_settings";

/// A polyline is written again when its person moved further than this, metres ...
const MOVED: f64 = 0.05;
/// ... or turned further than this, radians.
const TURNED: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// Why no scene could be read from the graph.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReadError {
    /// The snapshot cannot be read any more; take a new one.
    #[error(transparent)]
    Snapshot(#[from] dsr::ReadError),
    /// There is no node of a type that the map cannot be made without.
    #[error("the graph has no {type_name} yet")]
    Missing {
        /// The type.
        type_name: &'static str,
    },
    /// An attribute that the map cannot be made without is absent or malformed.
    #[error("the attribute {attribute} of {node} must be {expected}")]
    Attribute {
        /// The node's name.
        node: String,
        /// The attribute.
        attribute: &'static str,
        /// What it has to be.
        expected: &'static str,
    },
}

/// Why a turn made no map.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StepError {
    /// The graph does not tell enough.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The graph tells what cannot be.
    #[error(transparent)]
    Scene(#[from] SceneError),
}

/// What to write so that the graph shows `update`: a person's three polylines where the person
/// moved by more than 5 cm or 5 degrees, or their space grew or shrank so much to a side, since they were written, an object's space where a point of
/// it moved by more than 5 cm, R(t) to the hundredth. Polylines of whom the map does not have are
/// removed.
///
/// # Errors
/// [`dsr::ReadError`].
pub fn transaction(update: &Update, snapshot: &Snapshot) -> Result<Transaction, dsr::ReadError> {
    let mut transaction = Transaction::new();
    let people: BTreeMap<&str, &PersonSpaces> = update
        .people
        .iter()
        .map(|person| (person.name.as_str(), person.as_ref()))
        .collect();
    for node in snapshot.nodes_of("person") {
        let node = node?;
        match people.get(node.name()?.as_str()) {
            Some(person) => {
                write_zones(&mut transaction, &node, person)?;
                write_passages(&mut transaction, &node, person)?;
            }
            None => {
                remove(&mut transaction, &node, &ZONES)?;
                remove(&mut transaction, &node, &[PASSAGES])?;
            }
        }
    }
    let objects: BTreeMap<&str, &ObjectUse> = update
        .objects
        .iter()
        .map(|object| (object.name.as_str(), object))
        .collect();
    for node in snapshot.nodes_of("object") {
        let node = node?;
        match objects.get(node.name()?.as_str()) {
            Some(object) => write_use(&mut transaction, &node, object)?,
            None => remove(&mut transaction, &node, &[SPACE, USAGE])?,
        }
    }
    Ok(transaction)
}

fn write_zones(
    transaction: &mut Transaction,
    node: &Node<'_>,
    person: &PersonSpaces,
) -> Result<(), dsr::ReadError> {
    let rings = [&person.intimate, &person.personal, &person.social];
    let mut stale = false;
    for (name, ring) in ZONES.iter().zip(rings) {
        stale = stale || !polyline(node, name)?.is_some_and(|old| is_same_zone(&old, ring));
    }
    if stale {
        for (name, ring) in ZONES.iter().zip(rings) {
            transaction.set(node.id(), name, flat(ring));
        }
    }
    Ok(())
}

fn write_passages(
    transaction: &mut Transaction,
    node: &Node<'_>,
    person: &PersonSpaces,
) -> Result<(), dsr::ReadError> {
    let Some(passages) = person.passages else {
        return remove(transaction, node, &[PASSAGES]);
    };
    let text = Value::from(passages.map(Passage::name).join(", "));
    if node.value(PASSAGES)?.as_ref() != Some(&text) {
        transaction.set(node.id(), PASSAGES, text);
    }
    Ok(())
}

fn write_use(
    transaction: &mut Transaction,
    node: &Node<'_>,
    object: &ObjectUse,
) -> Result<(), dsr::ReadError> {
    if !polyline(node, SPACE)?.is_some_and(|old| is_near(&old, &object.space)) {
        transaction.set(node.id(), SPACE, flat(&object.space));
    }
    let usage = Value::F64(object.rounded_usage());
    if node.value(USAGE)?.as_ref() != Some(&usage) {
        transaction.set(node.id(), USAGE, usage);
    }
    Ok(())
}

fn remove(
    transaction: &mut Transaction,
    node: &Node<'_>,
    names: &[&str],
) -> Result<(), dsr::ReadError> {
    for name in names {
        if node.value(name)?.is_some() {
            transaction.push(Operation::RemoveAttribute {
                owner: Owner::Node(node.id().into()),
                name: (*name).to_owned(),
            });
        }
    }
    Ok(())
}

fn polyline(node: &Node<'_>, name: &str) -> Result<Option<Vec<Point2<f64>>>, dsr::ReadError> {
    let value = node.value(name)?;
    Ok(value.as_ref().and_then(Value::as_f64s).map(|row| {
        let (points, _) = row.as_chunks::<2>();
        points.iter().map(|[x, y]| Point2::new(*x, *y)).collect()
    }))
}

fn flat(polyline: &[Point2<f64>]) -> Value {
    Value::F64List(
        polyline
            .iter()
            .flat_map(|point| [point.x, point.y])
            .collect(),
    )
}

/// Whether two outlines of a zone are of the same shape at about the same pose. A contour starts at
/// the person's right and has the left half way round, so it tells its person's pose; what is furthest ahead and behind
/// lies half way between the two.
fn is_same_zone(old: &[Point2<f64>], new: &[Point2<f64>]) -> bool {
    let quarters = |ring: &[Point2<f64>]| {
        let at = |quarter: usize| ring.get(quarter * ring.len() / 4).copied();
        Some([at(0)?, at(1)?, at(2)?, at(3)?])
    };
    let (Some([old_right, old_front, old_left, old_rear]), Some([right, front, left, rear])) =
        (quarters(old), quarters(new))
    else {
        return old.is_empty() && new.is_empty();
    };
    let (was, is) = (old_left - old_right, left - right);
    let (old_middle, middle) = (old_right + was / 2.0, right + is / 2.0);
    let reaches = [(old_front, front), (old_rear, rear)];
    old.len() == new.len()
        && (middle - old_middle).norm() <= MOVED
        && was.perp(&is).atan2(was.dot(&is)).abs() <= TURNED
        && (was.norm() - is.norm()).abs() <= MOVED
        && reaches
            .iter()
            .all(|(was, is)| ((was - old_middle).norm() - (is - middle).norm()).abs() <= MOVED)
}

fn is_near(old: &[Point2<f64>], new: &[Point2<f64>]) -> bool {
    old.len() == new.len() && old.iter().zip(new).all(|(a, b)| (a - b).norm() <= MOVED)
}

/// What a turn brought.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Turn {
    /// The grid, where it changed.
    pub grid: Option<GridUpdate>,
    /// What to write into the graph; often nothing.
    pub transaction: Transaction,
    /// What was left out or mended, where that differs from the turn before.
    pub rejected: Vec<Rejection>,
    /// Why no map was made, where none was: the one given out last is all there is.
    pub stopped: Option<StepError>,
}

/// The agent's turns: reads the graph, updates the map, says what to write and send.
#[derive(Debug, Clone)]
pub struct SocialMapping {
    mapper: SocialMapper,
    settings: Settings,
    groups: GroupNodes,
    period: f64,
    updated: Option<Time>,
    /// Where the grid differs from the one given out last.
    unsent: Region,
    /// Why the grid could not be given out.
    withheld: Option<Rejection>,
    /// What was told last. As text: what is no number equals nothing, itself included.
    told: Vec<String>,
}

impl SocialMapping {
    /// An agent that updates its map at most once a `period`, seconds; 0 for each turn.
    ///
    /// # Errors
    /// All problems of the figures.
    pub fn new(config: SocialConfig, period: f64) -> Result<Self, Vec<ConfigError>> {
        let mapper = SocialMapper::new(config)?;
        Ok(Self {
            mapper,
            settings: Settings::default(),
            groups: GroupNodes::new(),
            period,
            updated: None,
            unsent: Region::default(),
            withheld: None,
            told: Vec::new(),
        })
    }

    /// Whether the grid of the last turn could be given out, and why not: the next turns tell.
    pub fn given_out(&mut self, failure: Option<&LargeError>) {
        self.withheld = failure.map(|error| Rejection::Grid {
            problem: error.to_string(),
        });
    }

    /// One turn at `now` on the graph as of `snapshot`. Where no map can be made the turn says why, and the next one
    /// starts where the last good one ended.
    ///
    /// # Errors
    /// The snapshot cannot be read any more.
    pub fn step(&mut self, now: Time, snapshot: &Snapshot) -> Result<Turn, dsr::ReadError> {
        if !is_due(self.updated, now, self.period) {
            return Ok(Turn::default());
        }
        match self.map(now, snapshot) {
            Ok(turn) => Ok(turn),
            Err(StepError::Read(ReadError::Snapshot(error))) => Err(error),
            Err(error) => {
                let mut turn = Turn::default();
                let mut known = read::contents(snapshot, self.mapper.config())?;
                known.rejected.extend(self.own_problems().cloned());
                let rejected = self.mapper.problems(&known);
                problems::write(&rejected, Some(&error), snapshot, &mut turn.transaction)?;
                turn.stopped = Some(error);
                Ok(turn)
            }
        }
    }

    /// What is wrong beside the scene.
    fn own_problems(&self) -> impl Iterator<Item = &Rejection> {
        self.settings.refused().iter().chain(&self.withheld)
    }

    fn map(&mut self, now: Time, snapshot: &Snapshot) -> Result<Turn, StepError> {
        if let Some(mapper) = self.settings.read(snapshot).map_err(ReadError::from)? {
            self.mapper = mapper;
        }
        let mut scene = scene(snapshot, self.mapper.config())?;
        scene.rejected.extend(self.own_problems().cloned());
        let update = self.mapper.update(now, &scene)?;
        // Reading may fail yet, and the next update would not call the change a change.
        self.unsent = self.unsent.joined(&update.dirty);
        let mut transaction = transaction(&update, snapshot).map_err(ReadError::from)?;
        self.groups
            .write(now, &update, snapshot, &mut transaction)
            .map_err(ReadError::from)?;
        problems::write(&update.rejected, None, snapshot, &mut transaction)
            .map_err(ReadError::from)?;
        self.updated = Some(now);
        let dirty = std::mem::take(&mut self.unsent);
        let grid = (!dirty.is_empty()).then(|| GridUpdate {
            dirty,
            grid: Arc::clone(&update.grid),
        });
        let told: Vec<String> = update.rejected.iter().map(ToString::to_string).collect();
        let rejected = if told == self.told {
            Vec::new()
        } else {
            self.told = told;
            update.rejected
        };
        Ok(Turn {
            grid,
            transaction,
            rejected,
            stopped: None,
        })
    }
}

/// Whether `period` has passed. A time before the last is another epoch, in which all is due.
fn is_due(last: Option<Time>, now: Time, period: f64) -> bool {
    last.is_none_or(|last| now < last || now.since(last) >= period - 1e-6)
}

#[cfg(test)]
mod tests;
