//! Fuzz target: see `entries::grammar`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::grammar(bytes));
