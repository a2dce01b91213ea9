//! Plain grids of dots without a code.
//!
//! ```text
//! dots (their sizes) -> missing (those that no contour showed) -> place (how the lattice lies on the grid)
//!      -> seen (how large the grid in the picture is) -> pipeline (the stages in their order)
//! ```

mod dots;
mod missing;
pub(super) mod pipeline;
mod place;
mod seen;
