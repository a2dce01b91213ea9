//! What a pattern in the residuals does to what is stated: how far the fit that has its columns lies from the fit that has not.

use nalgebra::{DMatrix, DVector, Matrix6, Vector3, Vector6};

use super::flange::FlangeModel;
use super::{Limits, stops};
use crate::fit::Fit;
use crate::geom::{adjoint, rigid_fit};
use crate::linalg::SymmetricFactor;
use crate::problem::Step;
use crate::solve::{InFrame, LinearImage, SeenMarkers};

/// Share of what the poses tell of the common frames that holds what they do not.
const HELD: f64 = 1e-9;

/// How far something is moved, RMS, beside its sigma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatternEffect {
    /// The flange relative to the plate, m, and the stated sigma; none without a robot.
    pub flange_m: Option<[f64; 2]>,
    /// The camera relative to the plate over the images, m, and the stated sigma.
    pub pose_m: [f64; 2],
    /// The same of its direction, rad.
    pub pose_rad: [f64; 2],
}

impl PatternEffect {
    /// The largest displacement in stated sigmas: of the flange where there is one, else of the poses.
    pub fn sigmas(&self) -> f64 {
        let ratio = |[moved, sigma]: [f64; 2]| if sigma > 0.0 { moved / sigma } else { 0.0 };
        self.flange_m.map_or_else(|| ratio(self.pose_m).max(ratio(self.pose_rad)), ratio)
    }
}

/// What effects are judged by: the images in use and the model of the flange.
pub(super) struct Effects<'a> {
    fit: &'a Fit,
    model: Option<FlangeModel<'a>>,
    /// Adjoint of the pose of each image.
    adjoints: Vec<Matrix6<f64>>,
    /// Stated sigma of their cameras relative to the plate, RMS: position, m, and direction, rad.
    sigmas: [f64; 2],
    /// Plate and index of the markers that were seen.
    markers: Vec<(usize, usize)>,
}

impl<'a> Effects<'a> {
    /// `framed` is what is stated with the plates in their frames: a step is measured from these, and the tolerance of the markers leaves the frame
    /// of the fit open. Without it the covariance of the fit counts.
    pub fn of(fit: &'a Fit, framed: Option<&InFrame>, stated: &'a DMatrix<f64>, limits: &Limits) -> Self {
        let linear = fit.linear();
        let of_poses = framed.map_or_else(|| fit.covariance.camera_poses(linear), |framed| framed.camera_poses(linear));
        let mut variances = [0.0f64; 2];
        let mut adjoints = Vec::with_capacity(linear.images().len());
        for (own, covariance) in linear.images().zip(of_poses) {
            let ad = adjoint(&own.chain.pose);
            let covariance = ad * covariance * ad.transpose();
            for (part, sum) in variances.iter_mut().enumerate() {
                *sum += (0..3).map(|k| covariance[(3 * part + k, 3 * part + k)]).sum::<f64>().max(0.0);
            }
            adjoints.push(ad);
        }
        let count = adjoints.len().max(1) as f64;
        let sigmas = variances.map(|sum| (sum / count).sqrt());
        let model = FlangeModel::of(fit, stated, limits).and_then(|model| {
            // The optical frame of a fixed camera turns with its principal point, and what it sees stays where it is.
            if model.is_relative_to_a_camera() { model.with_fitted_base(&stops(&fit.problem)) } else { Some(model) }
        });
        Self { fit, model, adjoints, sigmas, markers: SeenMarkers::of(linear).order }
    }

    /// What a step moves that shifts the markers as well, `shift(plate, marker)`, m. Of the camera poses counts what no common displacement of
    /// the camera frame or the plate frame takes up: with the body twist `w_i` of the camera, `w_i - a - Ad(T_i) b`, least squares over `a` and
    /// `b` in units of the stated sigmas. The flange counts relative to the frame of the nominal markers.
    pub fn moved(&self, step: &Step, shift: impl Fn(usize, usize) -> Vector3<f64>) -> PatternEffect {
        let count = self.adjoints.len().max(1) as f64;
        let twist = |(own, ad): (LinearImage, &Matrix6<f64>)| (*ad, ad * own.pose_step(step));
        let twists: Vec<(Matrix6<f64>, Vector6<f64>)> =
            self.fit.linear().images().zip(&self.adjoints).map(twist).collect();
        let left = without_frames(&twists, self.sigmas);
        let rms =
            |part: usize| (left.iter().map(|w| w.fixed_rows::<3>(3 * part).norm_squared()).sum::<f64>() / count).sqrt();
        PatternEffect {
            flange_m: self.model.as_ref().map(|m| m.moved_m(&self.of_frames(step, shift))),
            pose_m: [rms(0), self.sigmas[0]],
            pose_rad: [rms(1), self.sigmas[1]],
        }
    }

    /// The step of the columns that act through the camera poses, with placements that are those of the nominal markers: a plate that bends
    /// takes the frame along that its markers are given in.
    fn of_frames(&self, step: &Step, shift: impl Fn(usize, usize) -> Vector3<f64>) -> DVector<f64> {
        let (problem, state) = (&self.fit.problem, &self.fit.state);
        let layout = &problem.layout;
        let frames: Vec<Option<Vector6<f64>>> = (0..state.plates.len())
            .map(|k| {
                let (plate, modes) =
                    (&state.plates[k], step.dense.rows(layout.shapes[k].start, layout.shapes[k].len()));
                let seen = self.markers.iter().filter(|(p, _)| *p == k).map(|&(_, m)| {
                    let at = plate.position(m);
                    (at, at + plate.modes_at(m) * modes + step.markers[k][m] + shift(k, m))
                });
                Some(rigid_fit(&seen.collect::<Vec<_>>())?.log())
            })
            .collect();
        let mut of_poses = step.dense.rows(0, layout.theta_len()).into_owned();
        for (k, range) in layout.placements.iter().enumerate() {
            let plate = problem.used().find(|(_, image)| image.placement == k).map(|(_, image)| image.plate);
            if let Some(frame) = plate.and_then(|p| frames[p]) {
                of_poses.rows_mut(range.start, range.len()).zip_apply(&frame, |own, more| *own += more);
            }
        }
        of_poses
    }
}

fn without_frames(twists: &[(Matrix6<f64>, Vector6<f64>)], sigmas: [f64; 2]) -> Vec<Vector6<f64>> {
    let weight = Vector6::from_fn(|k, _| if sigmas[k / 3] > 0.0 { sigmas[k / 3].powi(-2) } else { 0.0 });
    let (mut n, mut rhs) = (DMatrix::<f64>::zeros(12, 12), DVector::<f64>::zeros(12));
    let rows = |ad: &Matrix6<f64>| {
        let mut a = DMatrix::identity(6, 12);
        a.fixed_view_mut::<6, 6>(0, 6).copy_from(ad);
        a
    };
    for (ad, twist) in twists {
        let a = rows(ad);
        let weighted = DMatrix::from_diagonal(&DVector::from_column_slice(weight.as_slice())) * &a;
        n += a.tr_mul(&weighted);
        rhs += weighted.tr_mul(twist);
    }
    let size = n.diagonal();
    (0..12).for_each(|k| n[(k, k)] += HELD * size[k]);
    let Ok(factor) = SymmetricFactor::new(&n) else { return twists.iter().map(|t| t.1).collect() };
    let x = factor.solve(&rhs);
    twists.iter().map(|(ad, twist)| twist - Vector6::from_column_slice((rows(ad) * &x).as_slice())).collect()
}
