//! Fuzz target: see `entries::large_handle`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::entries::large_handle(bytes));
