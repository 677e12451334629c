//! Fuzz target: see `entries::schema`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::schema(bytes));
