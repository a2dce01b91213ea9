//! Noise that neighbouring pixels have in common, told by what a fit of edges leaves: sharpening, smoothing, compression, demosaicing.
//!
//! ```text
//! residuals (what a fit left, and the odd part of it) -> response (what noise would leave it) -> unfollowed (the noise that left it)
//!     -> correlation (of noise by lag, and what it makes of a covariance); raster: pixels two by two
//! ```

mod correlation;
mod raster;
mod residuals;
mod response;
mod unfollowed;

pub use correlation::Correlation;
pub(super) use correlation::sound;
pub(super) use raster::{LAGS, NONE, Raster};
pub(super) use residuals::{LagProducts, OddPart, Residuals};
