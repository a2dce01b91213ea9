//! Covariance of every unknown from the factor of the reduced system.

use nalgebra::{DMatrix, Matrix3, Matrix6};

use crate::linalg::SymmetricFactor;
use crate::problem::{Problem, Step};
use crate::solve::elimination::right_hand_sides::RightHandSides;
use crate::solve::elimination::stop_covariance::StopCovariance;
use crate::solve::elimination::system::{Elimination, Singular, System};
use crate::solve::linear::{LinearProblem, LinearStop};

/// Covariance of the reduced unknowns (dense columns, then latents or markers), with what is needed for the eliminated family.
#[derive(Debug, Clone)]
pub struct Covariance {
    /// Covariance of the unknowns of the reduced system; fixed columns have zero variance.
    pub reduced: DMatrix<f64>,
    /// The undamped system that it is of.
    pub system: System,
    /// That system is of the linearisation that the covariance belongs to, and not of one near it.
    is_of_linearisation: bool,
    /// Factor of its information.
    factor: SymmetricFactor,
    /// Natural logarithm of the determinant of the reduced information.
    pub log_determinant: f64,
    /// What was added to the first unknowns.
    pub(super) added: Option<DMatrix<f64>>,
    /// Factors by which the sigmas of dense columns were enlarged after that.
    pub(super) enlarged: Vec<(usize, f64)>,
    /// How many of the first columns have another covariance than that of the system.
    pub(super) replaced: usize,
}

impl LinearProblem<'_> {
    /// Covariance of its unknowns.
    ///
    /// # Errors
    /// Information that is not positive definite.
    pub fn covariance(self) -> Result<Covariance, Singular> {
        self.covariance_by(Elimination::cheaper(self))
    }

    /// As [`LinearProblem::covariance`], by a given elimination.
    ///
    /// # Errors
    /// As [`LinearProblem::covariance`].
    pub fn covariance_by(self, which: Elimination) -> Result<Covariance, Singular> {
        let system = System::with(which, self, 0.0);
        let factor = system.factor(self)?;
        Ok(Covariance { is_of_linearisation: true, ..Covariance::of(&self.adjustment.problem, system, factor) })
    }
}

/// Fixed columns have no variance.
pub(in crate::solve) fn fixed_are_known(problem: &Problem, reduced: &mut DMatrix<f64>) {
    let columns = problem.layout.columns.iter().take(reduced.nrows());
    for (i, _) in columns.enumerate().filter(|(_, c)| !c.free) {
        reduced[(i, i)] = 0.0;
    }
}

/// Puts another covariance of the first columns, which go with no others then.
pub(super) fn put_first(covariance: &mut DMatrix<f64>, first: &DMatrix<f64>) {
    let n = first.nrows();
    covariance.rows_mut(0, n).fill(0.0);
    covariance.columns_mut(0, n).fill(0.0);
    covariance.view_mut((0, 0), (n, n)).copy_from(first);
}

impl Covariance {
    /// From the factor of a system, which may be of a linearisation near this one.
    pub(in crate::solve) fn of(problem: &Problem, system: System, factor: SymmetricFactor) -> Self {
        let mut reduced = factor.inverse();
        fixed_are_known(problem, &mut reduced);
        let log_determinant = factor.log_determinant();
        Self {
            reduced,
            log_determinant,
            system,
            is_of_linearisation: false,
            factor,
            added: None,
            enlarged: Vec::new(),
            replaced: 0,
        }
    }

    /// Its system, where that is the one of its linearisation.
    pub(super) fn own_system(&self) -> Option<&System> {
        (self.is_of_linearisation && self.replaced == 0).then_some(&self.system)
    }

    /// Steps for right-hand sides of their own.
    pub(in crate::solve) fn steps(&self, linear: LinearProblem, of: &RightHandSides) -> Vec<Step> {
        self.system.steps(linear, &self.factor, of)
    }

    /// Standard deviation of a dense column, in its unit.
    pub fn sigma(&self, column: usize) -> f64 {
        self.reduced[(column, column)].max(0.0).sqrt()
    }

    /// Adds to the covariance of the first unknowns, dense columns or all, in their units.
    pub fn add(&mut self, added: &DMatrix<f64>) {
        let mut first = self.reduced.view_mut((0, 0), added.shape());
        first += added;
        match &mut self.added {
            Some(all) => *all += added,
            None => self.added = Some(added.clone()),
        }
    }

    /// Enlarges the sigma of a dense column by a factor; correlations stay.
    pub fn enlarge(&mut self, column: usize, factor: f64) {
        self.reduced.row_mut(column).scale_mut(factor);
        self.reduced.column_mut(column).scale_mut(factor);
        self.enlarged.push((column, factor));
    }

    /// Takes another covariance of the first columns, which go with no others then, and says of each whether anything touches it.
    pub fn replace_first(&mut self, covariance: &DMatrix<f64>, touched: impl Fn(usize) -> bool) {
        put_first(&mut self.reduced, covariance);
        self.replaced = covariance.nrows();
        self.system.set_touched((0..self.replaced).map(touched));
    }

    /// The covariance of the first columns, where it is another than that of the system.
    pub(super) fn replaced_first(&self) -> Option<DMatrix<f64>> {
        let n = self.replaced;
        (n > 0).then(|| self.reduced.view((0, 0), (n, n)).into_owned())
    }

    /// 6x6 block of six dense columns from `start`.
    pub fn block(&self, start: usize) -> Matrix6<f64> {
        self.reduced.fixed_view::<6, 6>(start, start).into_owned()
    }

    /// Covariance of what is latent at each of some stops: errors of its readings, then the ties of its images. Cheaper for all than one by one.
    pub fn latents(&self, stops: &[LinearStop]) -> Vec<DMatrix<f64>> {
        self.at_stops(stops).into_iter().map(|own| own.latents).collect()
    }

    /// Covariances of what is latent and of measured bodies at each of some stops.
    pub(in crate::solve) fn at_stops(&self, stops: &[LinearStop]) -> Vec<StopCovariance> {
        self.system.stop_covariances(&self.reduced, stops)
    }

    /// Covariance of what moves the camera pose of each image in use: errors of its readings, then its tie.
    pub fn of_images(&self, linear: LinearProblem) -> Vec<DMatrix<f64>> {
        let of_stops = self.latents(&linear.stops().collect::<Vec<_>>());
        linear.images().map(|own| own.part_of(&of_stops[own.stop])).collect()
    }

    /// Covariance of the camera pose of every image in use, as its body twist, m and rad.
    pub fn camera_poses(&self, linear: LinearProblem) -> Vec<Matrix6<f64>> {
        let stops: Vec<LinearStop> = linear.stops().collect();
        let all = self.system.camera_poses(&self.reduced, &stops).into_iter();
        all.map(|own| Matrix6::from_column_slice(own.as_slice())).collect()
    }

    /// Covariance of the correction of every marker that was seen, m^2, per plate and marker, in the frame of the priors (the
    /// plate frame that nominal markers define up to their tolerance).
    pub fn markers(&self) -> Vec<Vec<Option<Matrix3<f64>>>> {
        self.system.marker_covariances(&self.reduced)
    }
}
