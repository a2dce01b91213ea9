//! What the data contradict: one file a check.

mod focus;
mod gates;
mod loose;
mod moved;
mod plate_size;
mod shift;

pub use focus::find_focus_change;
pub use gates::{gates, left_out, remarks, undetermined};
pub use moved::{Move, find_move};
pub use plate_size::doubted_sizes;
pub use shift::{Shift, find_shifts};
