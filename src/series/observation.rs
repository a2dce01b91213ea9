//! Identified image observations: what the detector writes and the problem reads.

use serde::{Deserialize, Serialize};

/// Which contour of a marker was observed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, Default)]
#[serde(rename_all = "lowercase")]
pub enum Edge {
    /// The outer circle of a disc or annulus; also a corner or point.
    #[default]
    Outer,
    /// The inner circle of an annulus.
    Inner,
}

/// One identified feature in one image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Observation {
    /// Marker id on the plate.
    pub marker: u32,
    /// Contour.
    pub edge: Edge,
    /// Column and row, px; (0, 0) is the centre of the top-left pixel.
    pub uv: [f64; 2],
    /// Covariance (uu, uv, vv) in px^2 where the source states one.
    pub covariance: Option<[f64; 3]>,
}

/// All observations of one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageObservations {
    /// File name of the image (the key of joints.csv).
    pub image: String,
    /// Observations, ordered by marker id and edge.
    pub observations: Vec<Observation>,
}
