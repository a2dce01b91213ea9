//! What the image stage reaches on rendered pictures with known truth.

mod bias;
mod identity;
mod identity_view;
mod precision;
pub mod tables;
mod view;

pub use bias::{Bias, BiasCase, BiasCause, COMA_CONTRAST_TO_NOISE, bias, bias_cases};
pub use identity::{
    Appearance, DISPLACED_PX, DISPLACED_SIGMAS, Identity, IdentityRequest, IdentityView, MirrorAnswer, Plates,
    identity, identity_view,
};
pub use precision::{MAP_OFF_PX, Precision, PrecisionCell, precision, precision_cells};
