//! Fuzz target: see `entries::agm`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::agm(bytes));
