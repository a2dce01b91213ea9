//! Corners of the square tags of an AprilGrid, of a grid of ArUco markers, or of a single tag.
//!
//! ```text
//! picture -> quadrilaterals -> codes -> do the neighbours agree -> tags that are missing -> sides -> corners
//! ```
//!
//! A code of few bits is read by chance now and then: such a tag counts only where the tags around it say that it stands there.
//!
//! ```text
//! quads (quadrilaterals) -> code, scan (what is written in them) -> layout (do the neighbours agree)
//!         -> edge_line, edge_sums, edge_shape, beside, misfit (sides, and what disturbs them) -> code_edges, growth (how far ink reaches beyond its place)
//!         -> clipped (what a smoothed copy hides)
//!         -> pipeline (the stages in their order) -> seen (what stands there instead)
//! ```

mod beside;
mod clipped;
pub(super) mod code;
mod code_edges;
mod edge_line;
mod edge_shape;
mod edge_sums;
mod growth;
pub(super) mod layout;
mod misfit;
mod pipeline;
pub(super) mod quads;
pub(super) mod scan;
mod seen;

pub use pipeline::detect;
pub(super) use pipeline::unseen_line;
