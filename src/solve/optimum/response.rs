//! How the unknowns of a fit respond to columns that it does not have (score test: C. Rao 1948).
//!
//! With the whitened equations `J dx + E y = r` of all observations, `N = J' J` + priors and the columns `E` of what the model lacks, the fit
//! without them is where `J' r` = pull of the priors. There
//!
//! ```text
//! X = N^-1 J' E     M = E' (E - J X)     s = E' r     y = M^-1 s     dx = -X y
//! ```
//!
//! `s` is the score of `y = 0`, `M` its information with everything else estimated; `s' M^-1 s` is chi-squared where `y = 0`, and `y`, `dx`
//! are the step to the fit with the columns. Where the noise is not the same everywhere, `s` has the covariance `W = sum_p e_p e_p'` instead, with the
//! scores `e_p = (E - J X)_p' r_p` of the points (H. White 1980).

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector, Vector2, Vector6};
use rayon::prelude::*;

use super::covariance::Covariance;
use super::fit::Fit;
use crate::linalg::product;
use crate::problem::{E, Equations, Step};
use crate::solve::elimination::blocks::STOPS_A_PRODUCT;
use crate::solve::elimination::right_hand_sides::{OfImage, RightHandSides};
use crate::solve::elimination::seen_markers::SeenMarkers;
use crate::solve::elimination::system::Singular;
use crate::solve::linear::{LinearImage, LinearProblem};

/// Response to some columns.
#[derive(Debug, Clone)]
pub struct Response {
    /// `M`.
    pub information: DMatrix<f64>,
    /// `E' E`: what the columns would be worth by themselves.
    pub by_itself: DVector<f64>,
    /// `s`.
    pub score: DVector<f64>,
    /// `W`.
    pub scatter: DMatrix<f64>,
    /// `X`, one step a column.
    pub steps: Vec<Step>,
    /// Sum of the squares of the whitened residuals.
    pub squares: f64,
    /// Number of equations.
    pub equations: usize,
}

impl Fit {
    /// The covariance of its own system: what holds a robot near nominal is not in the covariance that is stated.
    ///
    /// # Errors
    /// Information that is not positive definite.
    pub fn own_covariance(&self) -> Result<Cow<'_, Covariance>, Singular> {
        match self.problem.restraint.is_some() {
            true => Ok(Cow::Owned(self.linear().covariance()?)),
            false => Ok(Cow::Borrowed(&self.covariance)),
        }
    }

    /// Response to columns that `of_image` gives, whitened, one row an equation.
    ///
    /// # Errors
    /// Information that is not positive definite.
    pub fn response<'a>(
        &'a self,
        count: usize,
        of_image: impl Fn(&LinearImage<'a>, &Equations) -> DMatrix<f64> + Sync,
    ) -> Result<Response, Singular> {
        let covariance = self.own_covariance()?;
        Ok(self.linear().response(&covariance, count, of_image))
    }
}

impl<'a> LinearProblem<'a> {
    fn response(
        self,
        covariance: &Covariance,
        count: usize,
        of_image: impl Fn(&LinearImage<'a>, &Equations) -> DMatrix<f64> + Sync,
    ) -> Response {
        let places: Vec<usize> = (0..self.images().len()).collect();
        let columns_of = |k: usize| {
            let image = self.image(k);
            let equations = image.equations()?;
            let columns = of_image(&image, &equations);
            Some((image, equations, columns))
        };
        let seen = SeenMarkers::of(self);
        let mut right_hand_sides = RightHandSides::none(self, &seen, count);
        for some in places.chunks(STOPS_A_PRODUCT) {
            let of = |&k: &usize| {
                let (image, equations, columns) = columns_of(k)?;
                Some((image, OfImage::new(&equations, &columns, self.lin.terms[k].be.len())))
            };
            let own: Vec<_> = some.par_iter().map(of).collect();
            own.iter().flatten().for_each(|(image, own)| right_hand_sides.add(&seen, image, own));
        }
        let steps = covariance.steps(self, &right_hand_sides);
        let parts: Vec<Sums> = places
            .par_iter()
            .filter_map(|&k| {
                let (image, equations, columns) = columns_of(k)?;
                Some(Sums::of(&image, &equations, &columns, &steps))
            })
            .collect();
        let mut all = Sums::none(count);
        parts.iter().for_each(|p| all.add(p));
        let information = (&all.information + all.information.transpose()) * 0.5;
        let Sums { by_itself, score, scatter, squares, equations, .. } = all;
        Response { information, by_itself, score, scatter, steps, squares, equations }
    }
}

/// Sums over equations.
struct Sums {
    information: DMatrix<f64>,
    by_itself: DVector<f64>,
    score: DVector<f64>,
    scatter: DMatrix<f64>,
    squares: f64,
    equations: usize,
}

impl Sums {
    fn none(count: usize) -> Self {
        let (zeros, none) = (DMatrix::zeros(count, count), DVector::zeros(count));
        Self {
            information: zeros.clone(),
            by_itself: none.clone(),
            score: none,
            scatter: zeros,
            squares: 0.0,
            equations: 0,
        }
    }

    fn of(image: &LinearImage, equations: &Equations, columns: &DMatrix<f64>, steps: &[Step]) -> Self {
        let count = steps.len();
        let own = image.columns();
        let dense = |k: usize, step: &Step| own[k].map_or(0.0, |c| step.dense[c]);
        let poses: Vec<Vector6<f64>> = steps.iter().map(|step| image.pose_step(step)).collect();
        let pose = DMatrix::from_fn(6, count, |k, c| poses[c][k]);
        let intrinsics = DMatrix::from_fn(E, count, |e, c| dense(e, &steps[c]));
        let mut left = columns - equations.along(&pose, &intrinsics);
        for (mut left, step) in left.column_iter_mut().zip(steps) {
            let markers = &step.markers[image.image.plate];
            let left = left.as_mut_slice().chunks_exact_mut(2);
            for ((sight, &marker), left) in equations.sights().zip(&equations.markers).zip(left) {
                let mut by = sight.by_marker().tr_mul(&markers[marker]);
                for (k, d) in sight.by_field() {
                    by += d * Vector2::new(dense(E + 2 * k, step), dense(E + 2 * k + 1, step));
                }
                left[0] -= by[0];
                left[1] -= by[1];
            }
        }
        let residuals = DVector::from_iterator(
            columns.nrows(),
            equations.sights().flat_map(|s| [s.residual()[0], s.residual()[1]]),
        );
        let of_points = DMatrix::from_fn(columns.nrows() / 2, count, |p, c| {
            left[(2 * p, c)] * residuals[2 * p] + left[(2 * p + 1, c)] * residuals[2 * p + 1]
        });
        Self {
            information: product(&columns.transpose(), &left),
            by_itself: DVector::from_iterator(count, columns.column_iter().map(|c| c.norm_squared())),
            score: columns.tr_mul(&residuals),
            scatter: product(&of_points.transpose(), &of_points),
            squares: residuals.norm_squared(),
            equations: columns.nrows(),
        }
    }

    fn add(&mut self, other: &Self) {
        self.information += &other.information;
        self.by_itself += &other.by_itself;
        self.score += &other.score;
        self.scatter += &other.scatter;
        self.squares += other.squares;
        self.equations += other.equations;
    }
}

impl LinearImage<'_> {
    /// How a step moves its camera pose, as a body twist.
    pub fn pose_step(&self, step: &Step) -> Vector6<f64> {
        let joints: &[f64] = if self.tie.is_free() { &[] } else { &step.joint_errors[self.image.stop] };
        self.chain.moved(&step.dense, joints.iter().chain(&step.ties[self.index]).copied())
    }
}
