//! The kinematic tree: where nodes are, seen from each other, at a time. It guarantees that a transform
//! is either composed of what the graph says of that time or refused: nothing is extrapolated.
//!
//! An edge `pose` from a parent to a child has the attribute `transform`, the isometry
//! `parent_from_child` in metres. Where the schema gives that attribute a `history`, its last
//! values are samples with the times of their commits; between two samples the translation runs in a
//! straight line and the rotation along the shortest arc. What was written once only is fixed, and
//! holds at any time.
//!
//! A node without such an edge may hang on an edge `RT` of RoboComp: `rt_translation` in
//! millimetres, `rt_rotation_euler_xyz` as angles about the moving axes x, y, z, the samples of the
//! times `rt_timestamps` in milliseconds; or on one of AGM, with `tx` to `rz` as texts.

use super::{Edge, Snapshot};
use crate::arena::ReadError;
use crate::{Attribute, EdgeKey, NodeId, Pose, Time, Value, pose_on_floor};
use nalgebra::{Isometry2, Translation3, UnitQuaternion, Vector3};
use thiserror::Error;

/// Rotations that are half a turn apart, to this cosine of half the angle, have no shortest arc.
const HALF_TURN: f64 = 1e-9;

/// Why there is no transform.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TransformError {
    /// The node is not in the graph.
    #[error("there is no node {0}")]
    UnknownNode(NodeId),
    /// No way leads from one node to the other along poses.
    #[error(
        "`{target}` and `{source_node}` hang on different trees of poses: \
         on `{target_root}` and on `{source_root}`"
    )]
    Disconnected {
        /// The node to look from,
        target: String,
        /// and the root that it hangs on.
        target_root: String,
        /// The node to look at,
        source_node: String,
        /// and the root that it hangs on.
        source_root: String,
    },
    /// Poses that lead in a circle.
    #[error("the poses that `{0}` hangs on lead in a circle")]
    Cycle(String),
    /// A node that hangs on two others.
    #[error("`{node}` has two poses, from `{first}` and from `{second}`")]
    TwoParents {
        /// The node.
        node: String,
        /// One parent,
        first: String,
        /// and the other.
        second: String,
    },
    /// An edge that should have a pose and has none that can be read.
    #[error("{edge} has no pose in `{attribute}`")]
    NoPose {
        /// The edge.
        edge: String,
        /// Where it should be.
        attribute: &'static str,
    },
    /// The time is before or after all that the graph knows of an edge.
    #[error(
        "{edge} is known from {earliest} to {latest}, not at {time}; poses are not extrapolated"
    )]
    Extrapolation {
        /// The edge.
        edge: String,
        /// The time asked for.
        time: Time,
        /// The first known.
        earliest: Time,
        /// The last known.
        latest: Time,
    },
    /// The graph keeps the newest pose only.
    #[error(
        "{edge} is known at {known} only, not at {time}: the schema gives `transform` no `history`"
    )]
    NoHistory {
        /// The edge.
        edge: String,
        /// The time asked for.
        time: Time,
        /// The time of the newest.
        known: Time,
    },
    /// Between two samples that are half a turn apart there is no shortest arc.
    #[error("{edge} turned by half a turn between two samples around {time}: which way is unknown")]
    HalfTurn {
        /// The edge.
        edge: String,
        /// The time asked for.
        time: Time,
    },
    /// The graph cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
}

/// What the graph knows of one edge, newest first.
struct Samples {
    known: Vec<(Time, Pose)>,
    /// Whether there never were others.
    complete: bool,
    /// Whether others would have been kept.
    kept: bool,
}

/// Why two samples do not give a pose; the caller knows the edge.
enum Between {
    Outside { earliest: Time, latest: Time },
    HalfTurn,
    NoHistory(Time),
}

impl Samples {
    fn at(&self, time: Time) -> Option<Result<Pose, Between>> {
        let (&(latest, newest), &(earliest, _)) = (self.known.first()?, self.known.last()?);
        if self.known.len() == 1 && self.complete {
            return Some(Ok(newest));
        }
        if let Some(&(_, pose)) = self.known.iter().find(|(known, _)| *known == time) {
            return Some(Ok(pose));
        }
        if !self.kept {
            return Some(Err(Between::NoHistory(latest)));
        }
        let before = self.known.iter().position(|&(known, _)| known <= time);
        // Index 0 is before the time only where the time is after all.
        let Some(before) = before.filter(|&index| index > 0) else {
            return Some(Err(Between::Outside { earliest, latest }));
        };
        let ((t0, a), (t1, b)) = (self.known[before], self.known[before - 1]);
        Some(interpolate(&a, &b, time.since(t0) / t1.since(t0)).ok_or(Between::HalfTurn))
    }
}

fn interpolate(a: &Pose, b: &Pose, share: f64) -> Option<Pose> {
    let translation = a.translation.vector.lerp(&b.translation.vector, share);
    // The scalar product of the quaternions is the cosine of half the angle between them.
    if a.rotation.coords.dot(&b.rotation.coords).abs() < HALF_TURN {
        return None;
    }
    let slerp = a.rotation.try_slerp(&b.rotation, share, 0.0);
    let rotation = slerp.unwrap_or(a.rotation);
    Some(Pose::from_parts(Translation3::from(translation), rotation))
}

impl Snapshot {
    /// `target_from_source`: where `source` is, seen from `target`, as of the newest poses.
    ///
    /// # Errors
    /// [`TransformError`].
    ///
    /// # Example
    /// ```
    /// use dsr::{EdgeRef, Graph, Operation, Pose, Schema, Time, Transaction};
    ///
    /// let mut transaction = Transaction::new();
    /// for name in ["world", "robot", "laser", "cup"] {
    ///     transaction.create_node("thing", name, vec![]);
    /// }
    /// for (parent, child, x) in [("world", "robot", 2.0), ("robot", "laser", 0.25), ("world", "cup", 5.0)] {
    ///     let edge = EdgeRef::new(parent, "pose", child);
    ///     let attributes = vec![("transform".into(), Pose::translation(x, 0.0, 0.0).into())];
    ///     transaction.push(Operation::CreateEdge { edge, attributes });
    /// }
    /// let mut graph = Graph::in_memory(Schema::open());
    /// graph.commit(&transaction, "me", Time::default())?;
    ///
    /// let snapshot = graph.snapshot();
    /// let id = |name| snapshot.find_node_by_name(name).unwrap().unwrap().id();
    /// let laser_from_cup = snapshot.transform(id("laser"), id("cup"))?;
    /// assert_eq!(laser_from_cup.translation.x, 2.75);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn transform(&self, target: NodeId, source: NodeId) -> Result<Pose, TransformError> {
        self.transform_when(target, source, None)
    }

    /// `target_from_source` at a time, interpolated in the history of each pose on the way.
    ///
    /// # Errors
    /// [`TransformError`].
    pub fn transform_at(
        &self,
        target: NodeId,
        source: NodeId,
        time: Time,
    ) -> Result<Pose, TransformError> {
        self.transform_when(target, source, Some(time))
    }

    fn transform_when(
        &self,
        target: NodeId,
        source: NodeId,
        time: Option<Time>,
    ) -> Result<Pose, TransformError> {
        let (mut target_up, mut source_up) = (self.climb(target)?, self.climb(source)?);
        if target_up.root != source_up.root {
            return Err(TransformError::Disconnected {
                target: self.called(target)?,
                target_root: self.called(target_up.root)?,
                source_node: self.called(source)?,
                source_root: self.called(source_up.root)?,
            });
        }
        // What is above both does not matter, however little is known of it.
        while let (Some(a), Some(b)) = (target_up.edges.last(), source_up.edges.last())
            && a.key() == b.key()
        {
            target_up.edges.pop();
            source_up.edges.pop();
        }
        let common_from_target = self.compose(&target_up.edges, time)?;
        let common_from_source = self.compose(&source_up.edges, time)?;
        // A product with the identity could differ in the last bit.
        Ok(match (common_from_target, common_from_source) {
            (None, None) => Pose::identity(),
            (None, Some(common_from_source)) => common_from_source,
            (Some(common_from_target), None) => common_from_target.inverse(),
            (Some(target), Some(source)) => target.inv_mul(&source),
        })
    }

    /// Where `node` is in the world, on the floor: seen from the root of its kinematic tree. `None`
    /// where no pose leads to it.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn world_from(&self, node: NodeId) -> Result<Option<Isometry2<f64>>, ReadError> {
        Ok(self.pose_in_world(node)?.as_ref().map(pose_on_floor))
    }

    /// Where `node` is in the world, in space; see [`Self::world_from`].
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn pose_in_world(&self, node: NodeId) -> Result<Option<Pose>, ReadError> {
        let known = self.climb(node);
        match known.and_then(|up| self.compose(&up.edges, None)) {
            Ok(pose) => Ok(pose),
            Err(TransformError::Read(error)) => Err(error),
            Err(_) => Ok(None),
        }
    }

    /// The edge of the kinematic tree that `node` hangs on; `None` for a root.
    ///
    /// # Errors
    /// [`TransformError::TwoParents`], [`TransformError::UnknownNode`].
    pub fn parent_pose(&self, node: NodeId) -> Result<Option<Edge<'_>>, TransformError> {
        let found = self.find_node(node)?;
        let found = found.ok_or(TransformError::UnknownNode(node))?;
        for label in ["pose", "RT"] {
            let Some(label) = self.schema.find_label(label) else {
                continue;
            };
            let mut parents = found.in_edges_of(label);
            let Some(key) = parents.next().transpose()? else {
                continue;
            };
            if let Some(second) = parents.next().transpose()? {
                return Err(TransformError::TwoParents {
                    node: found.name()?,
                    first: self.called(key.from)?,
                    second: self.called(second.from)?,
                });
            }
            return Ok(self.find_edge(key)?);
        }
        Ok(None)
    }

    /// The pose that an edge of the kinematic tree gives: `parent_from_child`, the newest.
    ///
    /// # Errors
    /// [`TransformError::NoPose`].
    pub fn pose_of(&self, edge: &Edge<'_>) -> Result<Pose, TransformError> {
        self.sample(edge, None)
    }

    fn climb(&self, node: NodeId) -> Result<Climb<'_>, TransformError> {
        let mut climb = Climb {
            edges: Vec::new(),
            root: node,
        };
        while let Some(edge) = self.parent_pose(climb.root)? {
            climb.root = edge.key().from;
            climb.edges.push(edge);
            if climb.edges.len() as u64 >= self.node_count() {
                return Err(TransformError::Cycle(self.called(node)?));
            }
        }
        Ok(climb)
    }

    /// The product of edges that lead up, `top_from_bottom`; `None` for no edges.
    fn compose(
        &self,
        edges: &[Edge<'_>],
        time: Option<Time>,
    ) -> Result<Option<Pose>, TransformError> {
        let mut top_from_bottom: Option<Pose> = None;
        for edge in edges {
            let step = self.sample(edge, time)?;
            top_from_bottom = Some(top_from_bottom.map_or(step, |below| step * below));
        }
        Ok(top_from_bottom)
    }

    fn sample(&self, edge: &Edge<'_>, time: Option<Time>) -> Result<Pose, TransformError> {
        let key = edge.key();
        let is_pose = self.schema.label_name(key.label) == "pose";
        let samples = if is_pose {
            self.recorded(edge, time.is_some())?
        } else {
            robocomp(edge)?
        };
        let sampled = match time {
            None => samples.known.first().map(|&(_, pose)| Ok(pose)),
            Some(time) => samples.at(time),
        };
        let attribute = if is_pose {
            "transform"
        } else {
            "rt_translation"
        };
        let named = || self.edge_called(key);
        let time = time.unwrap_or_default();
        match sampled {
            Some(Ok(pose)) => Ok(pose),
            None => Err(TransformError::NoPose {
                edge: named()?,
                attribute,
            }),
            Some(Err(Between::HalfTurn)) => Err(TransformError::HalfTurn {
                edge: named()?,
                time,
            }),
            Some(Err(Between::NoHistory(known))) => Err(TransformError::NoHistory {
                edge: named()?,
                time,
                known,
            }),
            Some(Err(Between::Outside { earliest, latest })) => {
                Err(TransformError::Extrapolation {
                    edge: named()?,
                    time,
                    earliest,
                    latest,
                })
            }
        }
    }

    /// The samples of a `pose` edge: the newest, or all.
    fn recorded(&self, edge: &Edge<'_>, all: bool) -> Result<Samples, ReadError> {
        let name = self.schema.find_attribute("transform");
        let (found, limit) = match name {
            None => (Vec::new(), 0),
            Some(name) if all => (edge.history(name)?, self.schema.history(name)),
            Some(name) => (edge.attribute(name)?.into_iter().collect(), 0),
        };
        let pose = |a: &Attribute| a.value.as_pose().map(|pose| (a.time, *pose));
        let complete = found.len() < limit;
        Ok(Samples {
            known: found.iter().filter_map(pose).collect(),
            complete,
            kept: limit > 0,
        })
    }

    /// A node as messages name it.
    fn called(&self, node: NodeId) -> Result<String, ReadError> {
        let found = self.find_node(node)?;
        let name = found.map(|node| node.name()).transpose()?;
        Ok(name.unwrap_or_else(|| format!("node {node}")))
    }

    fn edge_called(&self, key: EdgeKey) -> Result<String, ReadError> {
        let label = self.schema.label_name(key.label);
        let (from, to) = (self.called(key.from)?, self.called(key.to)?);
        Ok(format!("`{from}` -{label}-> `{to}`"))
    }
}

/// The edges from a node up to the root that it hangs on.
struct Climb<'a> {
    edges: Vec<Edge<'a>>,
    root: NodeId,
}

fn numbers(value: Option<Value>) -> Vec<f64> {
    match value {
        Some(Value::Vector(row) | Value::F64List(row)) => row,
        Some(Value::F32Vector(row) | Value::F32List(row)) => {
            row.into_iter().map(f64::from).collect()
        }
        _ => Vec::new(),
    }
}

/// A pose from millimetres and angles about the moving axes.
fn from_millimetres(translation: &[f64], angles: &[f64]) -> Option<Pose> {
    let (&[x, y, z], &[a, b, c]) = (translation.first_chunk()?, angles.first_chunk()?);
    let turn = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
    let rotation =
        turn(Vector3::x_axis(), a) * turn(Vector3::y_axis(), b) * turn(Vector3::z_axis(), c);
    let translation = Translation3::new(x / 1000.0, y / 1000.0, z / 1000.0);
    Some(Pose::from_parts(translation, rotation))
}

/// The samples of an edge `RT` of RoboComp or AGM.
fn robocomp(edge: &Edge<'_>) -> Result<Samples, ReadError> {
    let either = |new, old| {
        Ok::<_, ReadError>(match numbers(edge.value(new)?) {
            row if row.is_empty() => numbers(edge.value(old)?),
            row => row,
        })
    };
    let translation = either("rt_translation", "translation")?;
    let angles = either("rt_rotation_euler_xyz", "rotation_euler_xyz")?;
    let times = match edge.value("rt_timestamps")? {
        Some(Value::U64List(times)) => times,
        _ => Vec::new(),
    };
    let blocks = translation.chunks(3).zip(angles.chunks(3));
    let stamped = times.iter().zip(blocks).filter(|(time, _)| **time > 0);
    let mut known: Vec<(Time, Pose)> = stamped
        .filter_map(|(&time, (translation, angles))| {
            let time = i64::try_from(time).ok()?.checked_mul(1_000_000)?;
            let pose = from_millimetres(translation, angles)?;
            Some((Time::from_nanoseconds(time), pose))
        })
        .collect();
    known.sort_by_key(|&(time, _)| std::cmp::Reverse(time));
    let moving = !known.is_empty();
    if !moving {
        let pose = from_millimetres(&translation, &angles);
        let pose = match pose {
            Some(pose) => Some(pose),
            None => agm(edge)?,
        };
        known.extend(pose.map(|pose| (Time::default(), pose)));
    }
    Ok(Samples {
        known,
        complete: !moving,
        kept: true,
    })
}

fn agm(edge: &Edge<'_>) -> Result<Option<Pose>, ReadError> {
    let mut row = Vec::new();
    for name in ["tx", "ty", "tz", "rx", "ry", "rz"] {
        let value = edge.value(name)?;
        let number = value.and_then(|v| v.as_str()?.trim().parse::<f64>().ok());
        row.extend(number.filter(|number| number.is_finite()));
    }
    Ok(row
        .get(..6)
        .and_then(|row| from_millimetres(&row[..3], &row[3..])))
}

#[cfg(test)]
mod tests;
