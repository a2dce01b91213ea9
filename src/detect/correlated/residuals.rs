//! What a fit leaves at its pixels.

use nalgebra::DMatrix;

use super::raster::{LAGS, NONE, Raster};

/// Residuals of a fit.
pub(in crate::detect) struct Residuals {
    /// Column and row of every pixel.
    pub at: Vec<[i32; 2]>,
    /// Of every pixel: counts, or in units of the noise, as the fit has them.
    pub values: Vec<f64>,
    /// Columns `U`, a value a pixel: `U U'` has the derivatives of fitted values by pixel values.
    pub followed: Vec<Vec<f64>>,
    /// `K` of the covariance `U K U'` of what white noise of even pixels beside these adds to their fitted values; none where there are no such.
    pub beside: Option<DMatrix<f64>>,
}

/// A fit with the odd part of what it left: where the pixels opposite are taken off, another shape of the edges than that of the model, which is
/// the same on both sides and moves no centre and no corner, is gone; noise is not.
pub(in crate::detect) struct OddPart {
    pub all: Residuals,
    /// Every pixel that has one opposite, and that one.
    pub opposites: Vec<[usize; 2]>,
    /// Of these pixels, less those opposite, over the root of two.
    pub odd: Residuals,
}

impl OddPart {
    /// About a place, px.
    pub fn of(all: Residuals, centre: [f64; 2]) -> Self {
        let opposites = opposites(&all.at, centre);
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let odd = |values: &Vec<f64>| opposites.iter().map(|&[k, other]| half * (values[k] - values[other])).collect();
        let at = opposites.iter().map(|&[k, _]| all.at[k]).collect();
        let odd =
            Residuals { at, values: odd(&all.values), followed: all.followed.iter().map(odd).collect(), beside: None };
        Self { all, opposites, odd }
    }

    /// Adds the products of every two values, times `scale`.
    pub fn add_to(&self, seen: &mut LagProducts, scale: f64) {
        let raster = Raster::new(&self.odd.at);
        raster.add_products(&mut seen.products, scale, &raster.plane(|k| self.odd.values[k]));
        raster.add_products(&mut seen.counts, 1.0, &raster.plane(|_| 1.0));
    }

    /// Adds what a pixel's noise adds to the fitted value of another.
    pub fn add_followed(&self, sums: &mut [f64; LAGS]) {
        let raster = Raster::new(&self.odd.at);
        self.odd.followed.iter().for_each(|column| raster.add_products(sums, 1.0, &raster.plane(|k| column[k])));
    }
}

/// Sums over the pairs of pixels at every lag.
#[derive(Debug, Clone, Copy)]
pub(in crate::detect) struct LagProducts {
    /// Products of residuals.
    pub products: [f64; LAGS],
    /// How many.
    pub counts: [f64; LAGS],
}

impl LagProducts {
    pub const NOTHING: Self = Self { products: [0.0; LAGS], counts: [0.0; LAGS] };

    /// Adds those of other pixels.
    pub fn add(&mut self, other: &Self) {
        self.products.iter_mut().zip(&other.products).for_each(|(sum, more)| *sum += more);
        self.counts.iter_mut().zip(&other.counts).for_each(|(sum, more)| *sum += more);
    }

    /// Number of pixels.
    pub fn pixels(&self) -> f64 {
        self.counts[NONE]
    }
}

fn opposites(at: &[[i32; 2]], centre: [f64; 2]) -> Vec<[usize; 2]> {
    let raster = Raster::new(at);
    let [sum_x, sum_y] = centre.map(|c| (2.0 * c).round() as i32);
    let other = |(k, [x, y]): (usize, &[i32; 2])| Some([k, raster.find([sum_x - x, sum_y - y])?]);
    at.iter().enumerate().filter_map(other).collect()
}
