//! Paper TD's Tables 1, 2 and 4, and paper AP's approaches and escort, driven again: the robot among people,
//! with and without social behaviour. The geometry of each scene is set so that the way without social behaviour is as long as
//! printed; everything else follows from planning and control.

mod company;
pub(super) mod gains;
mod tables;

pub(super) use company::{approaches, escort};
pub(super) use tables::{table1, table2, table4};

use crate::Failure;
use scenarios::Scenario;

/// The scenario of that text.
pub(super) fn scene(name: &str, text: &str) -> Result<Scenario, Failure> {
    let no_file = |_: &str| Ok(Vec::new());
    Scenario::parse(name, text, &no_file).map_err(Failure::internal)
}

/// Mean and standard deviation; of one value there is none.
pub(super) fn spread(values: &[f64]) -> (f64, f64) {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0).max(1.0)).sqrt())
}
