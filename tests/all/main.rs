//! Multi-process and end-to-end tests of Cortex.
#![forbid(unsafe_code)]
