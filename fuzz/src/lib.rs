//! The entry functions of the fuzz targets.
#![forbid(unsafe_code)]

pub mod entries;
