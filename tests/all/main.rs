//! Multi-process and end-to-end tests of Cortex, in one binary.
#![forbid(unsafe_code)]

mod graph;
mod support;
