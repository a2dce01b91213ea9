//! Tool and work object of a robot that was identified, from touches and tracker points.
//!
//! | file | what |
//! |---|---|
//! | [`touch`] | what was measured: stops, bodies of the tip, places |
//! | [`robot`] | the corrected robot with its covariance and joint noise |
//! | `equations` | unknowns, columns, derivatives of one measurement |
//! | `absorbed` | what tool and work object take up of the robot's errors |
//! | `determined` | what touches cannot tell: too few, on a line, one orientation, another unit |
//! | `start` | closed forms that the adjustment starts from |
//! | [`mod@fit`] | generalised least squares, size of the errors, outliers by name |
//! | [`knowledge`] | what frames and covariance say of the tool at a target |
//! | [`plan`] | which touches tell most |
//!
//! The formulation is in the guide (`formulation.md`, "Tool and work object").

mod absorbed;
mod determined;
mod equations;
pub mod fit;
pub mod knowledge;
pub mod plan;
pub mod robot;
mod start;
pub mod touch;

pub use equations::Given;
pub use fit::{AsStated, FrameFit, Judged, closed_form, fit};
pub use knowledge::Knowledge;
pub use plan::{PlannedTouch, TouchPlan, TouchRequest, plan_touches};
pub use robot::KnownRobot;
pub use touch::{Touch, TouchPlace, TouchedMarker, Touches};
