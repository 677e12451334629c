//! What the graph says about the world, the missions and itself, as people look at it: the same for
//! recordings, for the inspector's page and for the terminal. Pure functions of a snapshot; they
//! guarantee that a graph without people, robots or missions is only an emptier picture.

pub(crate) mod agenda;
pub(crate) mod graph;
pub(crate) mod grid;
pub(crate) mod laser;
pub(crate) mod layout;
pub(crate) mod map;
pub(crate) mod mission;
pub(crate) mod sight;
