//! Cameras: one table of lenses, one file per lens.
//!
//! To add a lens: write `src/model/camera/<lens>.rs` with a type that is a `Formula` (the compiler says what it lacks), and add a row to
//! the table in `lens.rs`.

mod brown;
mod field;
mod field_directions;
mod fisheye;
mod fit;
mod formula;
mod lens;
mod parallax;
mod projection;
mod projections;
mod radial;
mod rational;
mod thin_prism;

pub use field::{Lattice, Touched};
pub use fit::{LensFit, fit_lens, fit_lens_holding, fit_lens_to};
pub use formula::MAX_PARAMETERS;
pub use lens::Lens;
pub use projection::{Camera, Projection};
pub use projections::{Projections, weighted_sum};
