//! Fuzz target: see `entries::world`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::world(bytes));
