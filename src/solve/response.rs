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
//! are the step to the fit with the columns.

use nalgebra::{DMatrix, DVector, SVector, Vector2, Vector3, Vector6};
use rayon::prelude::*;

use super::linear::{LinearImage, LinearProblem, Linearised};
use super::system::{Singular, System};
use crate::problem::{E, Equations, Step};

/// Response to some columns.
#[derive(Debug, Clone)]
pub struct Response {
    /// `M`.
    pub information: DMatrix<f64>,
    /// `E' E`: what the columns would be worth by themselves.
    pub by_itself: DVector<f64>,
    /// `s`.
    pub score: DVector<f64>,
    /// `X`, one step a column.
    pub steps: Vec<Step>,
    /// Sum of the squares of the whitened residuals.
    pub squares: f64,
    /// Number of equations.
    pub equations: usize,
}

impl<'a> LinearProblem<'a> {
    /// Response to columns that `of_image` gives, whitened, one row an equation.
    ///
    /// # Errors
    /// Information that is not positive definite.
    pub fn response(
        self,
        count: usize,
        of_image: impl Fn(&LinearImage<'a>, &Equations) -> DMatrix<f64> + Sync,
    ) -> Result<Response, Singular> {
        let mut system = System::new(self, 0.0);
        let factor = system.factor(self)?;
        let places: Vec<usize> = (0..self.images().len()).collect();
        let columns_of = |k: usize| {
            let image = self.image(k);
            let equations = image.equations()?;
            let columns = of_image(&image, &equations);
            Some((image, equations, columns))
        };
        // Right-hand sides are affine in what the pixels say: those of priors and of other measurements are taken off.
        let right_hand_sides: Vec<Vec<RightHandSide>> = places
            .par_iter()
            .map(|&k| {
                let Some((_, equations, columns)) = columns_of(k) else { return Vec::new() };
                columns
                    .column_iter()
                    .map(|c| RightHandSide::new(&equations, c.as_slice(), self.lin.terms[k].be.len()))
                    .collect()
            })
            .collect();
        let mut lin = self.lin.clone().without_equations();
        let mut solve = |put: &dyn Fn(&mut Linearised)| {
            put(&mut lin);
            let linear = self.adjustment.linear(&lin);
            system.take_gradient(linear);
            let x = factor.solve(&system.rhs);
            system.step(linear, &x)
        };
        let none = solve(&|lin| lin.terms.iter_mut().for_each(|t| RightHandSide::none(t.be.len()).put(t)));
        let mut steps = Vec::with_capacity(count);
        for c in 0..count {
            let step = solve(&|lin| {
                for (terms, own) in lin.terms.iter_mut().zip(&right_hand_sides) {
                    match own.get(c) {
                        Some(own) => own.put(terms),
                        None => RightHandSide::none(terms.be.len()).put(terms),
                    }
                }
            });
            steps.push(step.plus(-1.0, &none));
        }
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
        let Sums { by_itself, score, squares, equations, .. } = all;
        Ok(Response { information, by_itself, score, steps, squares, equations })
    }
}

/// What one column says in the place of the residuals of an image.
struct RightHandSide {
    bp: Vector6<f64>,
    be: DVector<f64>,
    /// Of every marker of the image.
    bm: Vec<Vector3<f64>>,
}

impl RightHandSide {
    fn none(intrinsics: usize) -> Self {
        Self { bp: Vector6::zeros(), be: DVector::zeros(intrinsics), bm: Vec::new() }
    }

    fn new(equations: &Equations, column: &[f64], intrinsics: usize) -> Self {
        let mut own = Self::none(intrinsics);
        let mut last = None;
        for ((sight, e), &marker) in equations.sights().zip(column.chunks_exact(2)).zip(&equations.markers) {
            let e = Vector2::new(e[0], e[1]);
            own.bp += sight.by_pose() * e;
            let mut formula = own.be.fixed_rows_mut::<E>(0);
            formula += sight.by_intrinsics() * e;
            for (k, d) in sight.by_field() {
                let mut field = own.be.fixed_rows_mut::<2>(E + 2 * k);
                field += d.transpose() * e;
            }
            if last != Some(marker) {
                own.bm.push(Vector3::zeros());
                last = Some(marker);
            }
            let of_marker = sight.by_marker() * e;
            own.bm.iter_mut().last().into_iter().for_each(|b| *b += of_marker);
        }
        own
    }

    fn put(&self, terms: &mut crate::problem::ImageTerms) {
        terms.bp = self.bp;
        terms.be.copy_from(&self.be);
        for (k, marker) in terms.markers.iter_mut().enumerate() {
            marker.bm = self.bm.get(k).copied().unwrap_or_default();
        }
    }
}

/// Sums over equations.
struct Sums {
    information: DMatrix<f64>,
    by_itself: DVector<f64>,
    score: DVector<f64>,
    squares: f64,
    equations: usize,
}

impl Sums {
    fn none(count: usize) -> Self {
        let (information, none) = (DMatrix::zeros(count, count), DVector::zeros(count));
        Self { information, by_itself: none.clone(), score: none, squares: 0.0, equations: 0 }
    }

    fn of(image: &LinearImage, equations: &Equations, columns: &DMatrix<f64>, steps: &[Step]) -> Self {
        let count = steps.len();
        let mut left = columns.clone();
        for (c, step) in steps.iter().enumerate() {
            let moved = image.pose_step(step);
            let of_intrinsics: Vec<f64> = image.columns().iter().map(|c| c.map_or(0.0, |c| step.dense[c])).collect();
            let formula = SVector::<f64, E>::from_iterator(of_intrinsics.iter().copied());
            let markers = &step.markers[image.image.plate];
            for (o, (sight, &marker)) in equations.sights().zip(&equations.markers).enumerate() {
                let mut by = sight.by_pose().tr_mul(&moved) + sight.by_intrinsics().tr_mul(&formula);
                by += sight.by_marker().tr_mul(&markers[marker]);
                for (k, d) in sight.by_field() {
                    by += d * Vector2::new(of_intrinsics[E + 2 * k], of_intrinsics[E + 2 * k + 1]);
                }
                left[(2 * o, c)] -= by[0];
                left[(2 * o + 1, c)] -= by[1];
            }
        }
        let residuals = DVector::from_iterator(
            columns.nrows(),
            equations.sights().flat_map(|s| [s.residual()[0], s.residual()[1]]),
        );
        Self {
            information: columns.tr_mul(&left),
            by_itself: DVector::from_iterator(count, columns.column_iter().map(|c| c.norm_squared())),
            score: columns.tr_mul(&residuals),
            squares: residuals.norm_squared(),
            equations: columns.nrows(),
        }
    }

    fn add(&mut self, other: &Self) {
        self.information += &other.information;
        self.by_itself += &other.by_itself;
        self.score += &other.score;
        self.squares += other.squares;
        self.equations += other.equations;
    }
}

impl LinearImage<'_> {
    /// How a step moves its camera pose, as a body twist.
    pub fn pose_step(&self, step: &Step) -> Vector6<f64> {
        let theta = self.chain.d_theta.ncols();
        let joints: &[f64] = if self.tie.is_free() { &[] } else { &step.joint_errors[self.image.stop] };
        let latents =
            DVector::from_iterator(self.chain.d_latent.ncols(), joints.iter().chain(&step.ties[self.index]).copied());
        let moved = &self.chain.d_theta * step.dense.rows(0, theta) + &self.chain.d_latent * latents;
        Vector6::from_column_slice(moved.as_slice())
    }
}
