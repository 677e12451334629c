//! Fuzz target: see `entries::robocomp`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::robocomp(bytes));
