//! robotcal: calibrates a robot, its camera and a plate of markers in one least-squares problem, directly from images.
//!
//! Data flows upwards through these rooms; each knows only those before it:
//!
//! | room | from -> to |
//! |---|---|
//! | [`error`], [`stage`] | what went wrong; what is being done |
//! | [`geom`], [`linalg`] | rotations, rigid motions, factorisations |
//! | [`files`] | a user's files -> bytes, text, pixels within limits |
//! | [`series`], [`urdf`] | files -> readings, images, plate, kinematic chain |
//! | [`detect`] | pixels -> identified observations with covariance |
//! | [`model`] | parameters -> predictions and Jacobians |
//! | [`problem`] | parameter blocks, priors, columns, residuals |
//! | [`init`], [`solve`] | starting values; the solver |
//! | [`fit`], [`assess`] | an adjustment at its optimum; what it is worth |
//! | [`plan`], [`programs`] | plate design, pose planning; program text -> targets -> program text for the real robot |
//! | [`simulate`], [`diagnose`], [`frames`] | a world with known truth; what the data contradict; touches -> tool and work object |
//! | [`identify`] | series -> solution |
//! | [`output`] | solution -> bytes |
//! | [`calibration`] | the front door: robot and series -> calibration |
//! | [`study`] | what the program reaches where the truth is known |
//! | [`cli`] | the only room that prints |
//!
//! Features, all on by default: `cli` (the program; it takes the others along), `report` (report.html, plan.html, [`study`]), `draw` (plates as
//! PDF, SVG and PNG, marks on pictures), `mcap` (recordings in MCAP; those in sqlite are always read). Without them
//! (`default-features = false`) nothing of clap, maud, pdf-writer, tiny-skia and mcap is compiled.

pub mod assess;
pub mod calibration;
#[cfg(feature = "cli")]
pub mod cli;
pub mod detect;
pub mod diagnose;
pub mod error;
pub mod files;
pub mod fit;
pub mod frames;
pub mod geom;
pub mod guide;
pub mod identify;
pub mod init;
pub mod linalg;
pub mod model;
pub mod output;
pub mod plan;
pub mod problem;
pub mod programs;
pub mod series;
pub mod simulate;
pub mod solve;
pub mod stage;
#[cfg(feature = "report")]
pub mod study;
pub mod urdf;

pub use calibration::{Calibration, calibrate};
pub use error::{Code, Error, ErrorKind, Notice, Result, closest_name, plain_name};
pub use identify::Options;
