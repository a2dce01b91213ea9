//! A fit that has ended.

use super::flat_zone::Flat;
use super::normal::{Normal, solve};
use super::state::{ANNULUS, State};

/// A fit that has ended on its pixels.
#[derive(Debug, Clone, Copy)]
pub struct Solved {
    pub state: State,
    /// Of its normal matrix.
    pub(super) factor: Normal,
    /// Variance of a pixel on paper and on ink, counts^2.
    pub noise: [f64; 2],
    /// Mean square of the residuals in units of the noise.
    pub scale: f64,
}

impl Solved {
    /// Column of the inverse of the normal matrix.
    pub(super) fn column(&self, place: usize) -> [f64; ANNULUS] {
        let mut column = [0.0; ANNULUS];
        column[place] = 1.0;
        solve(&self.factor, self.state.parameters(), &mut column);
        column
    }

    /// Normal matrix of the even paper and ink beside the band.
    pub(super) fn even(&self, flat: &Flat) -> Normal {
        let mut even = [[0.0; ANNULUS]; ANNULUS];
        flat.add_normal(&self.state, self.noise, &mut even);
        std::array::from_fn(|i| std::array::from_fn(|j| even[i.max(j)][i.min(j)]))
    }
}
