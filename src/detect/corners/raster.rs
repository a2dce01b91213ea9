//! The pixels of a window by their places, two by two by their lag.

use super::fit::{Saddle, Term};
use super::model::Vector;

/// Lags looked at, px.
pub(super) const REACH: i32 = 3;
pub(super) const SIDE: usize = 2 * REACH as usize + 1;
/// Rows 0 to `REACH`, columns from -`REACH`: the lag of none is number `REACH`, those before it stand for their opposites.
pub(super) const LAGS: usize = (REACH as usize + 1) * SIDE;
/// Number of the lag of none.
pub(super) const NONE: usize = REACH as usize;

/// A window's pixels on their raster.
pub(super) struct Raster<'a> {
    terms: &'a [Term],
    low: [i32; 2],
    width: i32,
    /// Index of the term plus one; 0 where the window has no pixel.
    cells: Vec<u32>,
}

impl<'a> Raster<'a> {
    pub fn new(terms: &'a [Term]) -> Self {
        let least = |axis: usize| terms.iter().map(|t| t.at[axis]).min().unwrap_or(0);
        let most = |axis: usize| terms.iter().map(|t| t.at[axis]).max().unwrap_or(0);
        // A margin on every side: no lag leaves the raster.
        let low = [least(0) - REACH, least(1)];
        let (width, height) = (most(0) - low[0] + REACH + 1, most(1) - low[1] + REACH + 1);
        let mut cells = vec![0; (width * height) as usize];
        for (k, term) in terms.iter().enumerate() {
            cells[((term.at[1] - low[1]) * width + term.at[0] - low[0]) as usize] = k as u32 + 1;
        }
        Self { terms, low, width, cells }
    }

    /// Index of the term of a pixel.
    pub fn find(&self, [x, y]: [i32; 2]) -> Option<usize> {
        let (i, j) = (x - self.low[0], y - self.low[1]);
        let inside = (0..self.width).contains(&i) && j >= 0;
        let cell = inside.then(|| self.cells.get((j * self.width + i) as usize)).flatten()?;
        (*cell as usize).checked_sub(1)
    }

    /// A value of every term at its place, 0 where the window has no pixel: two planes, the second from `ahead(lag)` on, hold the values of every
    /// two terms at that lag beside each other.
    pub fn plane(&self, value: impl Fn(usize) -> f64) -> Vec<f64> {
        self.cells.iter().map(|cell| (*cell as usize).checked_sub(1).map_or(0.0, &value)).collect()
    }

    /// Places from a term to that at a lag, not before that of none.
    pub fn ahead(&self, lag: usize) -> usize {
        lag / SIDE * self.width as usize + lag % SIDE - NONE
    }

    /// Calls `pair` with the index of a lag that is not zero and those of every two terms at it.
    pub fn for_pairs(&self, mut pair: impl FnMut(usize, usize, usize)) {
        for (k, term) in self.terms.iter().enumerate() {
            let cell = (term.at[1] - self.low[1]) * self.width + term.at[0] - self.low[0];
            for lag in REACH as usize + 1..LAGS {
                let (down, right) = ((lag / SIDE) as i32, (lag % SIDE) as i32 - REACH);
                let other = self.cells[(cell + down * self.width + right) as usize] as usize;
                if other > 0 {
                    pair(lag, k, other - 1);
                }
            }
        }
    }
}

/// A fitted corner with the odd part of what its fit left: where the pixels opposite are taken off, another shape of the edges than that of
/// the model, which is the same on both sides and does not move the corner, is gone; noise is not.
pub(super) struct OddPart {
    /// Terms and leverages of all pixels.
    pub all: (Vec<Term>, Vec<Vector>),
    /// Every pixel that has one opposite, and that one.
    pub opposites: Vec<[usize; 2]>,
    /// Residuals of these pixels less those opposite, and the same of the leverages.
    pub terms: Vec<Term>,
    pub leverages: Vec<Vector>,
}

impl OddPart {
    pub fn of(corner: &Saddle) -> Self {
        let all = (corner.terms(), corner.leverages());
        let opposites = if all.1.is_empty() { Vec::new() } else { opposites(corner, &all.0) };
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let odd = opposites.iter().map(|&[k, other]| {
            let (terms, leverages) = &all;
            let residual = half * (terms[k].residual - terms[other].residual);
            (Term { residual, ..terms[k] }, half * (leverages[k] - leverages[other]))
        });
        let (terms, leverages) = odd.unzip();
        Self { all, opposites, terms, leverages }
    }
}

fn opposites(corner: &Saddle, terms: &[Term]) -> Vec<[usize; 2]> {
    let raster = Raster::new(terms);
    let [sum_x, sum_y] = corner.uv.map(|c| (2.0 * c).round() as i32);
    let other = |(k, term): (usize, &Term)| Some([k, raster.find([sum_x - term.at[0], sum_y - term.at[1]])?]);
    terms.iter().enumerate().filter_map(other).collect()
}
