//! Multi-process and end-to-end tests of Cortex, in one binary.
#![forbid(unsafe_code)]
#![allow(
    clippy::unwrap_used,
    reason = "what the tests share ends the test where it cannot go on"
)]

mod algorithms;
mod architecture;
mod begin;
mod bench;
mod dependencies;
mod doctor;
mod documentation;
mod examples;
mod faults;
mod graph;
mod hostile;
mod hot;
mod inspect;
mod large;
mod large_rules;
mod leftovers;
mod live_rules;
mod missions;
mod nowhere;
mod path;
mod plan;
mod recording;
mod robocomp_rules;
mod rule_amounts;
mod rules;
mod run;
mod social;
mod social_input;
mod state;
mod store;
mod support;
mod tree;
mod verbs;
