//! The shared graph of Cortex: a directed, typed, labelled property graph in memory that one
//! process writes and all read in place.
//!
//! [`Graph`] is its single writer, [`Snapshot`] its state as of one commit, [`Transaction`] what an
//! agent asks for, [`Change`] what a commit did. Only the module `shm` knows of processes and
//! shared memory; everything else is plain data and plain functions.

#![deny(unsafe_code)]

mod arena;
mod change;
mod desk;
mod difference;
mod graph;
mod hot;
mod ids;
pub mod interchange;
pub mod json;
mod large;
mod process;
mod rights;
mod schema;
#[allow(
    unsafe_code,
    reason = "the one module that maps memory of other processes"
)]
mod shm;
mod snapshot;
mod state;
mod time;
mod transaction;
mod value;
pub mod wire;

pub use arena::ReadError;
pub use change::{Change, EdgeChange, Filter, NodeChange, RuleApplication, Touch};
pub use difference::{Difference, bring_over, differences};
pub use graph::{Graph, Image, LeaseRefusal, Limits, RuleEngine, TransactionId, decode_image};
pub use ids::{AttributeId, EdgeKey, Epoch, LabelId, NodeId, TypeId, Version, WriterId};
pub use large::{LargeHandle, LargeType, Number, NumberKind};
pub use process::{Begin, Pace, TurnError, Turns, done_line, turn_line};
pub use rights::{Manifest, ManifestError, Rights};
pub use schema::{
    AttributeType, Label, NameKind, NodeType, Schema, SchemaError, SchemaFileError, suggest,
};
pub use shm::{
    AttachError, BareClient, BareServer, Changes, ClockError, CommitError, HotAttribute, HotError,
    Instance, InstanceError, LargeAttribute, LargeError, LargeLoan, LargeReadError, LargeSample,
    Lease, LeaseError, OrphanError, Orphaned, Publisher, Session, Store, StoreError, Subscriber,
    Tick, Update,
};
pub use snapshot::{
    Adjacency, Attribute, Edge, Edges, Element, Neighbors, Node, NodeIds, Snapshot, TransformError,
    TripleCount, TypedEdges, TypedIds, ValueRange,
};
pub use state::{State, StateError};
pub use time::Time;
pub use transaction::{
    Commit, Durability, EdgeRef, NodeRef, Operation, Owner, Precondition, Refusal, Transaction,
};
pub use value::{Pose, Value, ValueKind, planar_pose, pose_on_floor};
