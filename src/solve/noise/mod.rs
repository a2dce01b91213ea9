//! How large noise is, decided by the data: variance components, and how well the data tell them.
//!
//! ```text
//! latent, latent_data, tally, body_components (what a fit tells of each size)
//!     -> components, with acceleration (fit and sizes by turns, until they stand)
//!     -> information -> unidentified (what the data do not tell from none), uncertainty (what that does to parameters)
//! ```

pub(super) mod acceleration;
mod body_components;
pub(super) mod components;
pub(super) mod information;
mod latent;
mod latent_data;
pub(super) mod tally;
pub(super) mod uncertainty;
pub(super) mod unidentified;
