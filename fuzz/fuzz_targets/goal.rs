//! Fuzz target: see `entries::goal`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::goal(bytes));
