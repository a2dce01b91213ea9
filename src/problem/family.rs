//! Families of parameters: how large they are is told by the data, not by a prior.

use nalgebra::{DMatrix, DVector};

use super::{Layout, State};
use crate::model::joint_terms::Term;
use crate::model::robot::Robot;

/// Sigma with which directions of a family are held at zero, as a share of its base sigma: far below anything that counts.
const HELD: f64 = 1e-4;

/// Smallest factor of a family: with it, its parameters are as good as left out.
const SMALLEST_FACTOR: f64 = 1e-3;

/// Weight, in parameters, with which the size of twists is drawn to what is stated: a scaled inverse chi-squared prior with so many
/// degrees of freedom has 95 % of the factor between 1/2 and 2 (`1.96 / sqrt(2 n) = ln 2`).
const TWISTS_DRAWN: f64 = 4.0;

/// The same of sag: as much as three joints say that carry an arm, for stops that are few tell hardly any of it, and what they tell is of the twists, too.
const GRAVITY_DRAWN: f64 = 12.0;

/// What the parameters of a family are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FamilyKind {
    /// The displacement field of a camera, by its index.
    Field(usize),
    /// Origins of the joints.
    Twists,
    /// Sag of joints whose masses are not known.
    Gravity,
}

impl FamilyKind {
    /// Weight with which the factor is drawn to 1, and the smallest factor.
    const fn bounds(self) -> (f64, f64) {
        match self {
            Self::Field(_) => (0.0, SMALLEST_FACTOR),
            Self::Twists => (TWISTS_DRAWN, SMALLEST_FACTOR),
            Self::Gravity => (GRAVITY_DRAWN, 1.0),
        }
    }
}

/// Parameters alike whose prior sigmas have one factor in common, a variance component.
#[derive(Debug, Clone, PartialEq)]
pub struct Family {
    /// What they are.
    pub kind: FamilyKind,
    /// Columns.
    pub columns: Vec<usize>,
    /// Prior sigma of each column at the factor 1, in its unit.
    pub base: Vec<f64>,
    /// The factor.
    pub factor: f64,
    /// Weight, in parameters, with which the factor is drawn to 1; 0 leaves it to the data alone.
    pub drawn: f64,
    /// The smallest factor.
    pub least: f64,
    /// Directions that are held at zero because other parameters say the same: orthonormal, one row per column of the family.
    pub held: DMatrix<f64>,
}

impl Family {
    /// The displacement field of camera `camera`, across what lens formula and pose can say; `None` for a lens without one.
    pub fn of_field(layout: &Layout, state: &State, camera: usize) -> Option<Self> {
        let held = state.cameras[camera].parametric_directions()?;
        Some(Self { held, ..Self::new(FamilyKind::Field(camera), layout, layout.fields[camera].clone().collect()) })
    }

    /// The twists of the joints whose priors nobody has stated: how far robots are from nominal is known to a factor of two.
    pub fn of_twists(layout: &Layout, is_stated: impl Fn(usize) -> bool) -> Option<Self> {
        let columns: Vec<usize> =
            layout.twists.clone().filter(|c| !is_stated(*c) && !layout.is_between_bases(*c)).collect();
        (!columns.is_empty()).then(|| Self::new(FamilyKind::Twists, layout, columns))
    }

    /// Sag of the joints where masses are not known and whose priors nobody has stated; `None` without. It may be more than what is usual, and not less:
    /// few stops tell little of an arm that sags little.
    pub fn of_gravity(layout: &Layout, robot: &Robot, is_stated: impl Fn(usize) -> bool) -> Option<Self> {
        let terms = layout.terms.clone().zip(&robot.terms);
        let of_gravity = terms.filter(|(c, t)| matches!(t.term, Term::Gravity { .. }) && !is_stated(*c));
        let columns: Vec<usize> = of_gravity.map(|(c, _)| c).collect();
        (!columns.is_empty()).then(|| Self::new(FamilyKind::Gravity, layout, columns))
    }

    /// The factor that sums of squares and the number of determined parameters ask for.
    pub fn asked(&self, squares: f64, determined: f64) -> f64 {
        ((squares + self.drawn) / (determined + self.drawn)).sqrt().max(self.least)
    }

    /// A family of columns at their present priors.
    pub fn new(kind: FamilyKind, layout: &Layout, columns: Vec<usize>) -> Self {
        let base = columns.iter().map(|&c| layout.columns[c].prior_sigma).collect();
        let (drawn, least) = kind.bounds();
        Self { kind, held: DMatrix::zeros(columns.len(), 0), columns, base, factor: 1.0, drawn, least }
    }

    /// Takes the factor of the family of the same kind, where there is one.
    pub fn take_factor(&mut self, others: &[Self]) {
        self.factor = others.iter().find(|f| f.kind == self.kind).map_or(self.factor, |f| f.factor);
    }

    /// Gives the columns the priors of the present factor.
    pub fn hold(&self, layout: &mut Layout) {
        for (&c, base) in self.columns.iter().zip(&self.base) {
            layout.columns[c].prior_sigma = self.factor * base;
        }
    }

    /// Information that holds directions at zero; nothing where there are none.
    pub fn information(&self) -> Option<DMatrix<f64>> {
        let sigma = HELD * self.base.first()?;
        (self.held.ncols() > 0).then(|| &self.held * self.held.transpose() / (sigma * sigma))
    }

    /// What holding the directions adds to the logarithm of the density of the prior at zero: half of `ln(1 + (sigma / sigma_held)^2)` each.
    pub fn log_density_of_held(&self) -> f64 {
        0.5 * self.held.ncols() as f64 * (1.0 + (self.factor / HELD).powi(2)).ln()
    }

    /// Sum of squares of what is held, in units of its sigma, at values of all columns.
    pub fn squares(&self, values: &DVector<f64>) -> f64 {
        let Some(base) = self.base.first().filter(|_| self.held.ncols() > 0) else { return 0.0 };
        let own = DVector::from_iterator(self.columns.len(), self.columns.iter().map(|&c| values[c]));
        self.held.tr_mul(&own).norm_squared() / (HELD * base).powi(2)
    }
}
