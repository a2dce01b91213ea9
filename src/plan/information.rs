//! What one more image would tell: its information about the columns, joint noise eliminated.

use nalgebra::{DMatrix, Vector3};

use super::candidates::Candidate;
use super::criterion::Criterion;
use super::setting::{PlannedStop, Setting};
use crate::geom::skew;
use crate::linalg::{product, symmetric_eigen};
use crate::model::robot::{Posture, Robot};
use crate::problem::{self, Adjustment, Image, Problem, SeenAtStop, TakenFrom, Weighting, by_columns, linearise};

/// Information of the images of a stop about all columns; `None` where they show nothing.
///
/// Joint noise is eliminated (Schur complement); the corrections of single markers and the displacement field of a lens are taken as
/// known.
pub fn stop_information(planned: &Adjustment, stop: &PlannedStop) -> Option<DMatrix<f64>> {
    let (h, t) = condensed(planned, stop)?;
    Some(carried(&h, &t))
}

/// `T' H T`, symmetric to the last bit.
fn carried(h: &DMatrix<f64>, t: &DMatrix<f64>) -> DMatrix<f64> {
    let m = product(&t.transpose(), &product(h, t));
    (&m + m.transpose()) * 0.5
}

/// Information `H` of the images of a stop about their camera poses and intrinsics, and the derivatives `T` of these by all columns.
fn condensed(
    Adjustment { problem, state }: &Adjustment,
    PlannedStop { posture, images }: &PlannedStop,
) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let prior: Vec<f64> = problem.noise.joint[images.first()?.series].iter().map(|s| s.powi(-2)).collect();
    let exact = vec![0.0; prior.len()];
    let one = |image: &Image| {
        let chain = state.chained(&problem.layout, image, TakenFrom::rigid(posture, &exact))?;
        let terms = linearise(image, state, &chain.pose, &Weighting::of(problem, image))?;
        let t = by_columns(&problem.layout, image, &chain);
        Some((SeenAtStop::of_image(&terms, chain.d_latent), t))
    };
    let (seen, by_columns): (Vec<SeenAtStop>, Vec<DMatrix<f64>>) = images.iter().filter_map(one).unzip();
    let h = problem::condensed(&seen, &prior)?;
    Some((h, stacked(by_columns)?))
}

/// Rows of one matrix under those of the other; `None` without any.
fn stacked(mut parts: Vec<DMatrix<f64>>) -> Option<DMatrix<f64>> {
    if parts.len() == 1 {
        return parts.pop();
    }
    let mut all = DMatrix::zeros(parts.iter().map(DMatrix::nrows).sum(), parts.first()?.ncols());
    let mut row = 0;
    for part in &parts {
        all.rows_mut(row, part.nrows()).copy_from(part);
        row += part.nrows();
    }
    Some(all)
}

fn condensed_candidate(
    planned: &Adjustment,
    setting: &Setting,
    candidate: &Candidate,
) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let stop = setting.stop_of_middles(&planned.state, (&candidate.readings, candidate.placement, &candidate.seen))?;
    condensed(planned, &stop)
}

/// Directions in the space of the columns about which images tell something, and those about which none does.
///
/// Frames that lie fixed one behind the other, and all that is gauge, make up a third of the columns and more. With the prior scaled to
/// one, `U' D^-1/2 (sum M_i) D^-1/2 U` diagonal and `V = D^-1/2 U`, nothing is coupled with the columns `V_0` of vanishing eigenvalues:
///
/// ```text
/// tr(W M^-1) = tr(V_1' W V_1 (V_1' M V_1)^-1) + tr(V_0' W V_0)
/// ```
///
/// The second part stands in a last row of its own, of which the information is always one.
#[derive(Debug, Clone, PartialEq)]
pub struct Identified {
    /// `V_1`, columns by directions.
    identified: DMatrix<f64>,
    /// `V_0`; without columns where all directions count as told.
    unidentified: DMatrix<f64>,
}

/// Share of its prior variance that all candidates together must take from a direction for it to count as told.
const IDENTIFIED_FROM: f64 = 1e-3;

impl Identified {
    /// All columns as they are.
    pub fn everything(columns: usize) -> Self {
        Self { identified: DMatrix::identity(columns, columns), unidentified: DMatrix::zeros(columns, 0) }
    }

    /// What images of the information `sum` tell beside the variances `prior` of the columns.
    pub fn of(sum: &DMatrix<f64>, prior: &[f64]) -> Self {
        let n = prior.len();
        let scaled = DMatrix::from_fn(n, n, |i, j| sum[(i, j)] * (prior[i] * prior[j]).sqrt());
        let Some((values, vectors)) = symmetric_eigen(&scaled) else { return Self::everything(n) };
        let columns = |is_identified: bool| {
            let which: Vec<usize> = (0..n).filter(|&k| (values[k] > IDENTIFIED_FROM) == is_identified).collect();
            DMatrix::from_fn(n, which.len(), |i, k| vectors[(i, which[k])] * prior[i].sqrt())
        };
        Self { identified: columns(true), unidentified: columns(false) }
    }

    /// Number of rows of what is given back here.
    pub fn rows(&self) -> usize {
        self.identified.ncols() + usize::from(self.unidentified.ncols() > 0)
    }

    fn with_last(&self, identified: &DMatrix<f64>, last: f64) -> DMatrix<f64> {
        let (n, r) = (self.rows(), self.identified.ncols());
        DMatrix::from_fn(n, n, |i, j| match (i < r, j < r) {
            (true, true) => identified[(i, j)],
            (false, false) => last,
            _ => 0.0,
        })
    }

    /// Information before the first image, from that of the columns.
    pub fn known(&self, known: &DMatrix<f64>) -> DMatrix<f64> {
        self.with_last(&carried(known, &self.identified), 1.0)
    }

    /// Information of an image, from that of the columns.
    pub fn information(&self, information: &DMatrix<f64>) -> DMatrix<f64> {
        self.with_last(&carried(information, &self.identified), 0.0)
    }

    /// Information of a candidate; zero where its image would show nothing.
    pub fn of_candidate(&self, planned: &Adjustment, setting: &Setting, candidate: &Candidate) -> DMatrix<f64> {
        condensed_candidate(planned, setting, candidate).map_or_else(
            || DMatrix::zeros(self.rows(), self.rows()),
            |(h, t)| self.with_last(&carried(&h, &product(&t, &self.identified)), 0.0),
        )
    }

    /// A criterion of the columns; volumes need all columns told.
    pub fn criterion(&self, criterion: &Criterion) -> Criterion {
        match criterion {
            Criterion::MeanVariance(b) => {
                let [identified, unidentified] =
                    [&self.identified, &self.unidentified].map(|v| product(&v.transpose(), b));
                Criterion::weighted(
                    &self.with_last(&product(&identified, &identified.transpose()), unidentified.norm_squared()),
                )
            }
            volume => volume.clone(),
        }
    }

    /// Covariance of the columns.
    pub fn covariance(&self, covariance: &DMatrix<f64>) -> DMatrix<f64> {
        let r = self.identified.ncols();
        let identified = carried(&covariance.view((0, 0), (r, r)).into_owned(), &self.identified.transpose());
        identified + product(&self.unidentified, &self.unidentified.transpose())
    }
}

/// Information of a candidate; zero where its image would show nothing.
pub fn candidate_information(planned: &Adjustment, setting: &Setting, candidate: &Candidate) -> DMatrix<f64> {
    let n = planned.problem.layout.len();
    condensed_candidate(planned, setting, candidate).map_or_else(|| DMatrix::zeros(n, n), |(h, t)| carried(&h, &t))
}

/// `W = (P D)' (P D) / K`: the mean squared error of the flange's position over the targets is `tr(W cov)`, m^2.
///
/// `D` is the derivative of the position in the base frame; `P` takes out the rigid motion of that frame and the point on the
/// flange, which no measurement by another device could tell from errors of its own set-up.
pub fn flange_weight(problem: &Problem, robot: &Robot, targets: &[Vec<f64>]) -> DMatrix<f64> {
    let layout = &problem.layout;
    let mut d = DMatrix::zeros(3 * targets.len(), layout.len());
    for (k, readings) in targets.iter().enumerate() {
        let kinematics = robot.kinematics_at(&Posture::at(readings));
        let tip = kinematics.base_from_tip;
        for (i, twist) in kinematics.d_twists.iter().enumerate() {
            let moved = tip.rotation * twist.fixed_rows::<3>(0);
            d.view_mut((3 * k, layout.twists.start + 6 * i), (3, 6)).copy_from(&moved);
        }
        for (i, term) in kinematics.d_terms.iter().enumerate() {
            let moved: Vector3<f64> = tip.rotation * term.fixed_rows::<3>(0);
            d.view_mut((3 * k, layout.terms.start + i), (3, 1)).copy_from(&moved);
        }
    }
    let d = without_frames(robot, targets, d);
    product(&d.transpose(), &d) / targets.len().max(1) as f64
}

/// Displacements of the tip at targets, three rows each, without what base frame and a point of the flange take up: `P D`.
fn without_frames(robot: &Robot, targets: &[Vec<f64>], d: DMatrix<f64>) -> DMatrix<f64> {
    const GAUGE: usize = 9;
    let mut gauge = DMatrix::zeros(3 * targets.len(), GAUGE);
    for (k, readings) in targets.iter().enumerate() {
        let tip = robot.base_from_tip(readings);
        gauge.view_mut((3 * k, 0), (3, 3)).fill_with_identity();
        gauge.view_mut((3 * k, 3), (3, 3)).copy_from(&-skew(&tip.translation));
        gauge.view_mut((3 * k, 6), (3, 3)).copy_from(&tip.rotation);
    }
    let q = gauge.qr().q();
    let taken = &q * (q.transpose() * &d);
    d - taken
}

/// Share of the mean squared displacements at targets that base frame and a point of the flange leave, for errors of all origins of as many
/// mm as mrad.
pub fn share_left(robot: &Robot, targets: &[Vec<f64>]) -> f64 {
    let mut d = DMatrix::zeros(3 * targets.len(), 6 * robot.twists.len());
    for (k, readings) in targets.iter().enumerate() {
        let kinematics = robot.kinematics_at(&Posture::at(readings));
        for (i, twist) in kinematics.d_twists.iter().enumerate() {
            let moved = kinematics.base_from_tip.rotation * twist.fixed_rows::<3>(0);
            d.view_mut((3 * k, 6 * i), (3, 6)).copy_from(&moved);
        }
    }
    let all = d.norm_squared();
    without_frames(robot, targets, d).norm_squared() / all
}
