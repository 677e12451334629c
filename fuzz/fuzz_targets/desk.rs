//! Fuzz target: see `entries::desk`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::desk(bytes));
