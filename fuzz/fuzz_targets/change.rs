//! Fuzz target: see `entries::change`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::change(bytes));
