//! Fuzz target: see `entries::arena`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::arena(bytes));
