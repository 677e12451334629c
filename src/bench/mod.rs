//! Measuring what Cortex is made of. It guarantees that a figure and the one it is compared with come
//! from the same run.

#![allow(
    clippy::disallowed_methods,
    reason = "measuring takes the host's clock"
)]

mod figure;
mod indoor;
mod plan;

pub(crate) use figure::{Figure, table};
pub(crate) use plan::plans;
