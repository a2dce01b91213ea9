//! robotcal: calibrates a robot, its camera and a plate of markers in one least-squares problem, directly from images.
//!
//! Data flows upwards through these rooms; each knows only those before it:
//!
//! | room | from -> to |
//! |---|---|
//! | [`error`], [`geom`], [`linalg`] | rotations, rigid motions, factorisations |
//! | [`files`] | a user's files -> bytes, text, pixels within limits |
//! | [`series`], [`urdf`] | files -> readings, images, plate, kinematic chain |
//! | [`detect`] | pixels -> identified observations with covariance |
//! | [`model`] | parameters -> predictions and Jacobians |
//! | [`problem`] | parameter blocks, priors, columns, residuals |
//! | [`plan`] | plate design, pose planning |
//! | [`programs`] | program text -> targets -> program text for the real robot |
//! | [`init`], [`solve`], [`assess`] | starting values, the solver, what the result is worth |
//! | [`simulate`], [`recipe`] | a world with known truth; the modes of the program |
//! | [`output`] | solution -> bytes |
//! | [`cli`] | the only room that prints |

pub mod assess;
pub mod cli;
pub mod detect;
pub mod error;
pub mod files;
pub mod geom;
pub mod guide;
pub mod init;
pub mod linalg;
pub mod model;
pub mod output;
pub mod plan;
pub mod problem;
pub mod programs;
pub mod recipe;
pub mod series;
pub mod simulate;
pub mod solve;
pub mod urdf;

pub use error::{Error, ErrorKind, Notice, Result, closest_name, plain_name};
