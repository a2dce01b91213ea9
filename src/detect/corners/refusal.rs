//! What a fit may end in but a corner.

/// Why no corner came out of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Refusal {
    NoNeighbours,
    Oblique,
    AtTheEdge,
    TooFewPixels,
    /// The pixels show something else than two crossing edges.
    NoCrossing,
    /// The fit was still on its way when its steps were used up: nothing is known about the corner.
    NotConverged,
    OffTheLattice,
}

impl Refusal {
    pub fn reason(self) -> &'static str {
        match self {
            Self::NoNeighbours => "no neighbours",
            Self::Oblique => "seen too obliquely",
            Self::AtTheEdge => "at the edge of the picture",
            Self::TooFewPixels => "too few pixels",
            Self::NoCrossing => "no crossing of two edges",
            Self::NotConverged => "fit not converged",
            Self::OffTheLattice => "off the lattice",
        }
    }

    /// Whether a better start may end otherwise.
    pub fn may_pass(self) -> bool {
        matches!(self, Self::NoCrossing | Self::NotConverged | Self::OffTheLattice)
    }
}
