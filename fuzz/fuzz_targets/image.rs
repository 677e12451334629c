//! Fuzz target: see `entries::image`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::image(bytes));
