//! Fuzz target: see `entries::recording`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::recording(bytes));
