//! Fuzz target: see `entries::scenario`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::scenario(bytes));
