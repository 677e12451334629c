//! Fuzz target: see `entries::hot_page`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::hot_page(bytes));
