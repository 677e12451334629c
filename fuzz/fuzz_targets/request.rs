//! Fuzz target: see `entries::request`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::request(bytes));
