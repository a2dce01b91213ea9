//! What to print and where to look: the design of the plate, the choice of poses.
//!
//! Poses: [`setting`] (what is roughly known) -> [`candidates`] (workable poses, with [`scene`] and [`visibility`]) ->
//! [`information`] -> [`relax`] (optimal weights with certificate), [`refine`] (further poses where they pay) -> [`rounding`] -> [`order`].

pub mod candidates;
pub mod criterion;
pub mod information;
pub mod inverse;
pub mod order;
pub mod plate_code;
pub mod plate_design;
pub mod refine;
pub mod relax;
pub mod rounding;
pub mod scene;
pub mod setting;
pub mod viewpoint;
pub mod visibility;
