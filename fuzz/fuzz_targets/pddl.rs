//! Fuzz target: see `entries::pddl`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::pddl(bytes));
