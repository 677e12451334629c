//! Fuzz target: see `entries::lease`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::lease(bytes));
