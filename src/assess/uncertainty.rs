//! How far a solution can be trusted: identifiability, the covariance by clusters of images, the workspace map.

use nalgebra::DMatrix;

use super::used_stops::{on_robot_sigmas, shares_of_series, stops};
use crate::assess::{
    Clustered, FlangeErrors, FlangeModel, Identifiability, Limits, NoiseAtStop, WorkspacePoint, clustered_covariance,
    identifiability, urdf_alone, usual_joint_sigma,
};
use crate::error::Result;
use crate::model::robot::Robot;
use crate::problem::{Adjustment, Noise};
use crate::solve::{Covariance, Fit, InFrame, NoiseInformation, NoiseUncertainty, noise_information};

/// Sigmas of a 95 % interval.
pub const NORMAL_95: f64 = 1.96;

/// How far a solution can be trusted.
#[derive(Debug, Clone, Default)]
pub struct Uncertainty {
    /// What the data tell; none without stops.
    pub identifiability: Option<Identifiability>,
    /// Covariance of the dense columns with the plates in the frames of their nominal markers ([`Fit::in_frame`]): what the tolerance of the
    /// markers leaves open of the frame of a plate is no error of the robot.
    pub covariance: DMatrix<f64>,
    /// Sigmas of the dense columns by the noise model alone.
    pub model_sigma: Vec<f64>,
    /// Sigmas of the dense columns by clusters of images; none for too few images.
    pub clustered_sigma: Option<Vec<f64>>,
    /// Sigma of the flange by clusters over that by the noise model, over the region of the stops.
    pub clustered_ratio: Option<f64>,
    /// True where the sigmas by clusters are the ones stated.
    pub larger_stated: bool,
    /// 95 % interval of the joint noise of every series and reading, rad or m; empty where it is not identifiable.
    pub joint_noise: Vec<Vec<[f64; 2]>>,
    /// What the data tell of the joint noise, also of that which counts as none; none where it was given.
    pub noise_information: Option<NoiseInformation>,
    /// Expected error of the flange in the region of the stops, before and after; none without stops.
    pub flange: Option<FlangeErrors>,
    /// The origins that do best by themselves; none without stops, or where nothing beside origins and offsets was found.
    pub alone: Option<Robot>,
    /// Workspace map; empty where plate (or fixed camera) and robot are not tied.
    pub workspace: Vec<WorkspacePoint>,
}

/// Judges a fit. Its covariance is made larger by what the uncertainty of an estimated joint noise adds, and where the scatter
/// between images says clearly more than the noise model. What was `told_before` some joint noise was set to none is what is stated.
/// Beside it the plates in their frames, with that covariance.
///
/// # Errors
/// As [`Fit::in_frame`].
pub fn judge(
    fit: &mut Fit,
    joint_noise_is_estimated: bool,
    told_before: Option<NoiseInformation>,
    limits: &Limits,
) -> Result<(Uncertainty, InFrame)> {
    let told = if joint_noise_is_estimated { noise_information(fit) } else { None };
    let uncertainty = told.as_ref().and_then(|told| NoiseUncertainty::of(told, fit));
    let clustered = clustered_covariance(fit.linear(), limits).filter(|_| images_know_the_robot(fit));
    let Fit { adjustment, covariance, .. } = fit;
    let Adjustment { problem, state } = &*adjustment;
    let layout = &problem.layout;
    let n = layout.len();
    let stops = stops(problem);
    let sigmas = |c: &DMatrix<f64>| (0..n).map(|k| c[(k, k)].max(0.0).sqrt()).collect::<Vec<f64>>();
    let mut found = Uncertainty {
        identifiability: identifiability(&state.robot, layout, &stops, &covariance.reduced, limits),
        ..Uncertainty::default()
    };
    uncertainty.iter().for_each(|u| covariance.add(&u.added()));
    if let Some(told) = told_before.or(told) {
        found.set_joint_noise(&problem.noise, told.of_sizes());
    }
    found.model_sigma = sigmas(&covariance.reduced);
    if let Some(clustered) = clustered {
        found.set_clustered(&clustered, adjustment, limits);
        if let Some(by_clusters) = found.clustered_sigma.as_ref().filter(|_| found.larger_stated) {
            enlarge(covariance, &found.model_sigma, by_clusters, problem.layout.theta_len());
            found.identifiability = identifiability(&state.robot, layout, &stops, &covariance.reduced, limits);
        }
    }
    let fit = &*fit;
    let in_frame = fit.in_frame()?;
    let stated = in_frame.dense(n);
    found.take_frames_of_plates(&sigmas(&fit.covariance.reduced), &sigmas(&stated));
    let Adjustment { problem, state } = &fit.adjustment;
    let model = FlangeModel::of(&fit.adjustment, &stated, limits);
    let joint_sigma = &usual_joint_sigma(&on_robot_sigmas(problem));
    let shares = shares_of_series(problem);
    // Beside images the joint noise is known well.
    let told = found.noise_information.as_ref().filter(|_| problem.used_on_robot().next().is_none());
    let noise = NoiseAtStop { joint_sigma, told: told.map(|told| (told, &shares[..])) };
    found.alone = model.as_ref().and_then(|m| urdf_alone(&state.robot, &problem.layout, &m.region()));
    let robots = (&state.robot, found.alone.as_ref());
    let promise = |m: &FlangeModel| FlangeErrors::new(m, robots, noise, &stops);
    found.flange = model.as_ref().and_then(promise);
    found.workspace = model.map(|m| m.workspace()).unwrap_or_default();
    found.covariance = stated;
    Ok((found, in_frame))
}

impl Uncertainty {
    /// What the scatter between images says of the sigmas, and whether they are to be stated by it.
    fn set_clustered(&mut self, clustered: &Clustered, adjustment: &Adjustment, limits: &Limits) {
        let model = FlangeModel::of(adjustment, &clustered.model, limits);
        self.clustered_ratio = model.map(|m| m.ratio_of(&clustered.sandwich));
        self.larger_stated = self.clustered_ratio.is_some_and(|ratio| ratio > limits.scatter_ratio);
        let by_clusters = self.model_sigma.iter().zip(clustered.ratios()).map(|(s, r)| s * r).collect();
        self.clustered_sigma = Some(by_clusters);
    }

    /// Brings sigmas of single origins to the frames of the plates, as the stated ones are: before and after of the dense columns.
    fn take_frames_of_plates(&mut self, before: &[f64], after: &[f64]) {
        for own in std::iter::once(&mut self.model_sigma).chain(&mut self.clustered_sigma) {
            for (sigma, (before, after)) in own.iter_mut().zip(before.iter().zip(after)).filter(|(_, (b, _))| **b > 0.0)
            {
                *sigma *= after / before;
            }
        }
    }

    /// 95 % interval of the joint noise of a reading, root mean square over some series, rad or m; none where it is not identifiable.
    pub fn joint_noise_of(&self, noise: &Noise, series: &[usize], reading: usize) -> Option<[f64; 2]> {
        Some(self.noise_information.as_ref()?.joint_noise(noise, series, &[reading], NORMAL_95).1)
    }

    /// Takes over what is known of the joint noise.
    fn set_joint_noise(&mut self, noise: &Noise, told: NoiseInformation) {
        let interval = |series: usize, reading: usize| told.joint_noise(noise, &[series], &[reading], NORMAL_95).1;
        let of_series = |(s, own): (usize, &Vec<f64>)| (0..own.len()).map(|r| interval(s, r)).collect();
        self.joint_noise = noise.joint.iter().enumerate().map(of_series).collect();
        self.noise_information = Some(told);
    }
}

/// Scales rows and columns of what acts through the camera poses so that no sigma is below that by clusters; correlations stay.
fn enlarge(covariance: &mut Covariance, model: &[f64], clusters: &[f64], theta: usize) {
    for k in 0..theta {
        if model[k] > 0.0 && clusters[k] > model[k] {
            covariance.enlarge(k, clusters[k] / model[k]);
        }
    }
}

/// False where every image has a pose of its own that does not know of the robot, and where not only images tell of it.
fn images_know_the_robot(fit: &Adjustment) -> bool {
    fit.problem.body_measurements.is_empty() && fit.used().any(|(i, _, tie)| fit.problem.on_robot(i) && !tie.is_free())
}
