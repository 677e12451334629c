//! Fuzz target: see `entries::graph_json`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::graph_json(bytes));
