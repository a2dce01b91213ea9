//! What a joint does that its reading does not say, beyond rigid geometry.
//!
//! `qt = q + sum_t p_t phi_t(q)`: every term is a basis function `phi` of the reading (and of the posture and the approach)
//! times one parameter. To add a term: a file here with a type that is a `JointError` (the compiler says what it lacks), and a row of the
//! table in `table.rs`.

mod backlash;
mod gear;
mod gravity;
mod harmonics;
mod joint_error;
mod local;
mod offset;
mod robot_model;
mod sag;
mod table;

pub(super) use gravity::levers;
pub use harmonics::USUAL_HARMONICS;
pub use joint_error::{Exported, GRAVITY_TERMS, TermContext};
pub use local::LOCAL_RANGE;
pub use robot_model::RobotModel;
pub use table::{JointTerm, Term, TermKind, TermSizes};
