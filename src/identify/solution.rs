//! What a mode returns: everything that outputs and reports are made from.

use serde::{Deserialize, Serialize};

use super::comparison::Comparison;
use super::estimator::Estimator;
use super::options::Options;
use super::start_verdict::StartVerdict;
use crate::assess::{Accuracy, ImageError, Uncertainty};
use crate::diagnose::Finding;
use crate::error::Notice;
use crate::fit::{Fit, FreePoses};
use crate::model::camera::Lens;
use crate::model::joint_terms::RobotModel;
use crate::model::robot::Robot;
use crate::problem::{Adjustment, MeasuredSeries};
use crate::solve::{InFrame, Status};

/// Evidence of a robot model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// The model.
    pub model: RobotModel,
    /// Logarithm of its evidence less that of the best model; 0 for the best.
    pub log_evidence: f64,
    /// Cost at its optimum.
    pub cost: f64,
    /// Free parameters of the robot.
    pub parameters: usize,
}

/// Evidence of a lens for one camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LensEvidence {
    /// Camera.
    pub camera: String,
    /// The lens.
    pub lens: Lens,
    /// Logarithm of its evidence less that of the best lens of this camera; 0 for the best.
    pub log_evidence: f64,
    /// Principal point, px.
    pub centre_px: [f64; 2],
    /// True for the one that was taken: the simplest that none beats decisively.
    pub taken: bool,
}

/// The result of a fit.
#[derive(Debug, Clone)]
pub struct Solution {
    /// What was asked for.
    pub options: Options,
    /// How it was fitted.
    pub estimator: Estimator,
    /// Data and estimates of the joint fit, where the result is that of two stages.
    pub joint: Option<Box<Adjustment>>,
    /// The fit.
    pub fit: Fit,
    /// The stand-alone camera poses.
    pub free_poses: FreePoses,
    /// What the solve went from.
    pub series: Vec<MeasuredSeries>,
    /// Identifiability, sigmas by clusters, workspace map.
    pub uncertainty: Uncertainty,
    /// The plates in the frames that their nominal markers define, with the covariance there.
    pub in_frame: InFrame,
    /// Evidence of the robot models where the data chose among them.
    pub evidences: Vec<Evidence>,
    /// Evidence of the lenses of cameras whose lens was open.
    pub lenses: Vec<LensEvidence>,
    /// Before and after, held out.
    pub accuracy: Accuracy,
    /// Errors of the images that the joint fit was held out of, with their indices, ascending; none for a result in two stages.
    pub held_out: Vec<(usize, ImageError)>,
    /// Two-stage fits beside the joint one, where asked for ([`super::beside_two_stages`]).
    pub two_stage: Option<Comparison>,
    /// Starting values with their verdicts.
    pub starts: Vec<StartVerdict>,
    /// What was found out about the data: notes, and gates that failed.
    pub findings: Vec<Finding>,
    /// How the last solve ended.
    pub status: Status,
    /// Steps tried in all.
    pub iterations: usize,
}

impl Solution {
    /// Quality gates that failed, in words; empty for a good result.
    pub fn failed_gates(&self) -> Vec<String> {
        self.findings.iter().filter(|f| f.fails()).map(ToString::to_string).collect()
    }

    /// What the user should know, though the result stands.
    pub fn notices(&self) -> Vec<Notice> {
        self.findings.iter().filter(|f| !f.fails()).map(Finding::notice).collect()
    }

    /// The identified robot as it is exported: without the local errors, which are latent noise of the series.
    pub fn exported_robot(&self) -> Robot {
        let mut robot = self.fit.state.robot.clone();
        robot.terms.truncate(self.fit.problem.layout.robot().end - self.fit.problem.layout.terms.start);
        robot
    }

    /// Data and estimates of the joint fit, be it the result or not.
    pub fn joint_fit(&self) -> &Adjustment {
        self.joint.as_deref().unwrap_or(&self.fit)
    }
}
