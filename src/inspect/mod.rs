//! The inspector: one page, and what it asks, from within the program. One thread looks at the graph;
//! the server hands questions to it. It guarantees that nothing is changed unless that was allowed and
//! the asker has the token, and that only this host can connect unless another address was given.

mod api;
mod desk;
mod edit;
mod frame;
mod laser;
mod look;
mod metrics;
mod news;
mod page;
mod processes;
mod serve;
mod terminal;

pub(crate) use look::Source;
pub(crate) use serve::{Options, serve};
pub(crate) use terminal::show;
