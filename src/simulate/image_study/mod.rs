//! What the image stage reaches on rendered pictures with known truth.

mod bias;
mod precision;
mod view;

pub use bias::{Bias, BiasCase, Cause, bias, bias_cases};
pub use precision::{Precision, PrecisionCell, precision, precision_cells};
