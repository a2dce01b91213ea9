//! Noise that the pixels of a band have in common, in the covariance of the centres (`circles.md` of the guide has the formulas).

use nalgebra::{DMatrix, Matrix4, SMatrix};

use super::model::Pixels;
use super::normal::Normal;
use super::solved::Solved;
use super::state::{ANNULUS, CENTRE, INNER};
use crate::detect::correlated::{Correlation, OddPart, Raster, Residuals, sound};

/// What a covariance in `N` places of the parameters needs of a fit.
pub struct Influences<const N: usize> {
    /// For white noise, over the mean square of the residuals, which is `scale`.
    white: SMatrix<f64, N, N>,
    scale: f64,
    /// The part of the even pixels beside the band.
    beside: SMatrix<f64, N, N>,
    /// Column and row of the pixels of the band, and their influences.
    at: Vec<[i32; 2]>,
    psi: [Vec<f32>; N],
}

impl<const N: usize> Influences<N> {
    fn of(solved: &Solved, places: [usize; N], pixels: &Pixels) -> Self {
        let inverse = places.map(|place| solved.column(place));
        let even = solved.even(&pixels.flat);
        Self {
            white: SMatrix::from_fn(|i, j| inverse[i][places[j]]),
            scale: solved.scale,
            beside: SMatrix::from_fn(|i, j| quadratic(&even, &inverse[i], &inverse[j])),
            at: pixels.places(),
            psi: inverse.map(|column| pixels.combination(&column[..solved.state.parameters()])),
        }
    }

    fn covariance(&self, correlation: &Correlation) -> SMatrix<f64, N, N> {
        let beyond = correlation.less_white();
        let raster = Raster::new(&self.at);
        let in_band = beyond.covariance(&raster, |k| self.psi.each_ref().map(|psi| f64::from(psi[k])));
        sound(self.white, self.white + in_band + self.beside * beyond.of_a_mean()) * self.scale
    }
}

/// Of the centre of a disc, or the two centres of an annulus.
pub enum OfCentres {
    Disc(Influences<2>),
    Annulus(Box<Influences<4>>),
}

impl OfCentres {
    pub fn of(solved: &Solved, pixels: &Pixels) -> Self {
        match solved.state.inner {
            None => Self::Disc(Influences::of(solved, [CENTRE, CENTRE + 1], pixels)),
            Some(_) => Self::Annulus(Box::new(Influences::of(solved, [CENTRE, CENTRE + 1, INNER, INNER + 1], pixels))),
        }
    }

    /// Of both centres; zero for that of a disc's inner circle.
    pub fn covariance(&self, correlation: &Correlation) -> Matrix4<f64> {
        match self {
            Self::Disc(of) => of.covariance(correlation).fixed_resize(0.0),
            Self::Annulus(of) => of.covariance(correlation),
        }
    }
}

fn quadratic(m: &Normal, a: &[f64; ANNULUS], b: &[f64; ANNULUS]) -> f64 {
    m.iter().zip(a).map(|(row, a)| a * row.iter().zip(b).map(|(m, b)| m * b).sum::<f64>()).sum()
}

/// The odd part of what a fit left on its pixels, over its scale.
pub fn left(solved: &Solved, pixels: &Pixels) -> OddPart {
    OddPart::of(residuals(solved, pixels), solved.state.centre)
}

fn residuals(solved: &Solved, pixels: &Pixels) -> Residuals {
    let level = solved.scale.sqrt().max(f64::MIN_POSITIVE);
    let values = pixels.weighted[..pixels.count].iter().map(|v| f64::from(*v) / level).collect();
    Residuals { at: pixels.places(), values, followed: Vec::new(), beside: None }
}

/// The same with what the fit follows of noise; `None` for a factor without inverse.
pub fn left_and_followed(solved: &Solved, pixels: &Pixels) -> Option<OddPart> {
    let (count, factor) = (solved.state.parameters(), &solved.factor);
    let lower = DMatrix::from_fn(count, count, |i, j| if j <= i { factor[j][i] } else { 0.0 });
    let even = solved.even(&pixels.flat);
    let half = lower.solve_lower_triangular(&DMatrix::from_fn(count, count, |i, j| even[i][j]))?;
    let beside = lower.solve_lower_triangular(&half.transpose())?;
    let mut followed: Vec<Vec<f64>> = Vec::with_capacity(count);
    for i in 0..count {
        let mut column = pixels.column(i);
        for (j, other) in followed.iter().enumerate() {
            column.iter_mut().zip(other).for_each(|(v, u)| *v -= lower[(i, j)] * u);
        }
        column.iter_mut().for_each(|v| *v /= lower[(i, i)]);
        followed.push(column);
    }
    Some(OddPart::of(Residuals { followed, beside: Some(beside), ..residuals(solved, pixels) }, solved.state.centre))
}
