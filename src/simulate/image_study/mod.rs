//! What the image stage reaches on rendered pictures with known truth.

mod precision;
mod view;

pub use precision::{Precision, PrecisionCell, precision, precision_cells};
