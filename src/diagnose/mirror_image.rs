//! Do the data tell the arm from its mirror image?

use nalgebra::{Matrix3, Vector3};

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::{Accuracy, Limits};
use crate::error::Code;
use crate::fit::Fit;
use crate::model::mirror::mirror_images;
use crate::problem::{BodySeen, InstrumentKind, Problem};

/// Nothing that was measured tells the arm from its mirror image: places that are not known, and distances, are those of both.
#[derive(Debug, Clone, PartialEq)]
pub struct MirrorImageFits {
    /// Joints whose readings have the other sign in the mirror image.
    pub joints: Vec<String>,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Option<MirrorImageFits> {
    let (problem, chain, limits) = (&fit.problem, &fit.state.robot.chain, setting.limits);
    let is_measured = problem.used_bodies().next().is_some();
    if !is_measured || problem.used_on_robot().next().is_some() || is_told(problem, limits) {
        return None;
    }
    // An arm further from its mirror image than parameters may be off would be found out of tolerance.
    let tolerance = 1e-3 * limits.flange_sigma_mm * limits.sigmas_beyond_tolerance;
    let readings = mirror_images(chain, tolerance).into_iter().next()?;
    Some(MirrorImageFits { joints: readings.into_iter().map(|k| chain.readings[k].clone()).collect() })
}

/// True where poses, or points in space, were measured in a frame of their own. Points of one plane are their own mirror image.
fn is_told(problem: &Problem, limits: &Limits) -> bool {
    (0..problem.instruments.len()).filter(|k| problem.instruments[*k].kind != InstrumentKind::Socket).any(|k| {
        let own =
            || problem.used_bodies().map(|(_, measured)| measured).filter(move |measured| measured.instrument == k);
        let points: Vec<Vector3<f64>> = own().map(|measured| measured.seen.position()).collect();
        own().any(|measured| matches!(measured.seen, BodySeen::Pose(_))) || thickness(&points) > limits.flat_places_m
    })
}

/// What points extend across the plane that they are nearest to, m.
fn thickness(points: &[Vector3<f64>]) -> f64 {
    let middle = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let spread: Matrix3<f64> = points.iter().map(|p| (p - middle) * (p - middle).transpose()).sum();
    let eigen = spread.symmetric_eigen();
    let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let heights = points.iter().map(|p| normal.dot(&(p - middle)));
    let (low, high) = heights.fold((0.0, 0.0), |(low, high): (f64, f64), h| (low.min(h), high.max(h)));
    high - low
}

impl Kind for MirrorImageFits {
    fn code(&self) -> Code {
        Code::MirrorImageFits
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        self.joints.iter().cloned().map(Subject::Joint).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        Vec::new()
    }

    fn place(&self) -> String {
        self.joints.join(", ")
    }

    fn seen(&self) -> String {
        "nothing in these data tells the arm from its mirror image: were the readings of these joints of the wrong sign, all would fit alike, and the corrected robot would miss by far".into()
    }

    fn remedy(&self) -> String {
        "move the first of them alone to a larger reading, and see that it turns about its axis in the URDF as a right-hand screw (a slide: goes along it); four contacts at known places that lie not in one plane (x_m, y_m, z_m), a tracker or images tell it, too".into()
    }
}
