//! `truth.toml`: everything that was put into a simulated series, for judging what comes out of it.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Vector6;
use serde::{Deserialize, Serialize};

use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::model::joint_terms::{JointTerm, Term};
use crate::model::robot::Robot;
use crate::series::CameraMount;
use crate::urdf::Chain;

/// A pose as in the other files of the program.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TruePose {
    /// Translation, m.
    pub xyz_m: [f64; 3],
    /// Unit quaternion.
    pub quat_xyzw: [f64; 4],
}

impl From<&Pose> for TruePose {
    fn from(pose: &Pose) -> Self {
        Self { xyz_m: pose.xyz(), quat_xyzw: pose.quaternion_xyzw() }
    }
}

impl TruePose {
    /// The pose.
    pub fn pose(&self) -> Pose {
        Pose::from_xyz_quaternion(self.xyz_m, self.quat_xyzw)
    }
}

/// One joint term: `value` times the basis function `term` of the reading of `joint`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrueTerm {
    /// Name of the joint's reading.
    pub joint: String,
    /// Which term.
    pub term: Term,
    /// Parameter, rad (m for a prismatic joint; a share for the gear).
    pub value: f64,
}

/// One stop as it really was.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrueStop {
    /// Image.
    pub image: String,
    /// Where the plate stood.
    pub placement: String,
    /// True position minus reading and terms, rad or m, in the order of `joints`.
    pub joint_noise: Vec<f64>,
    /// True camera pose.
    pub camera_from_plate: TruePose,
}

/// A joint vector that took no part, for judging the accuracy of a calibrated model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOutRecord {
    /// Readings, rad or m, in the order of `joints`.
    pub readings: Vec<f64>,
    /// True pose of the tip there, without joint noise and backlash.
    pub base_from_tip: TruePose,
}

/// Everything that was put in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Truth {
    /// Version of the format: 1.
    pub format: u32,
    /// Seed of the world.
    pub seed: u64,
    /// Base link.
    pub base: String,
    /// Tip link.
    pub tip: String,
    /// Names of the readings.
    pub joints: Vec<String>,
    /// Where the camera is.
    pub camera_mount: CameraMount,
    /// Standard deviation of the joint noise, rad or m, in the order of `joints`.
    pub joint_noise_sigma: Vec<f64>,
    /// Standard deviation of observations per axis, px; absent for rendered images.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_sigma_px: Option<f64>,
    /// The camera.
    pub camera: Camera,
    /// `flange_from_camera` (camera in the hand) or `base_from_camera` (fixed camera).
    pub camera_pose: TruePose,
    /// `base_from_plate` (camera in the hand) or `flange_from_plate` (fixed camera) of each placement.
    pub plate_poses: BTreeMap<String, TruePose>,
    /// Body twist `[rho (m), phi (rad)]` on the origin of each joint of the chain that has one.
    pub twists: BTreeMap<String, [f64; 6]>,
    /// Joint terms.
    #[serde(default)]
    pub terms: Vec<TrueTerm>,
    /// True minus nominal position of each marker in the plate frame, m, in the order of the ids.
    #[serde(default)]
    pub marker_errors_m: Vec<[f64; 3]>,
    /// Images that do not fit the rest on purpose, if any: the fault that was put in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<String>,
    /// The stops.
    pub stops: Vec<TrueStop>,
    /// Joint vectors for judging the accuracy.
    pub held_out: Vec<HeldOutRecord>,
}

impl Truth {
    /// Reads truth.toml.
    ///
    /// # Errors
    /// A missing file, unknown keys, wrong values, another version of the format.
    pub fn read(path: &Path) -> Result<Self> {
        let text = crate::files::read_text(path, crate::files::FileKind::Settings)?;
        let truth: Self = toml::from_str(&text).map_err(|e| {
            Error::new(
                Code::SettingSyntax,
                path.display(),
                e.message(),
                "write it with robotcal simulate of this version",
            )
        })?;
        if truth.format != 1 {
            let what = format!("format = {}", truth.format);
            return Err(Error::new(Code::SettingVersion, path.display(), what, "this program reads format = 1"));
        }
        Ok(truth)
    }

    /// Text of truth.toml.
    ///
    /// # Errors
    /// None in practice: every field can be written as TOML.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|e| Error::new(Code::OutputFailed, "truth.toml", e, "report this"))
    }

    /// The true robot on its nominal chain.
    ///
    /// # Errors
    /// A joint that the chain does not have.
    pub fn robot(&self, chain: &Chain) -> Result<Robot> {
        let mut robot = Robot::nominal(chain.clone());
        let unknown = |name: &str| {
            Error::new(
                Code::JointUnknown,
                "truth.toml",
                format!("joint \"{name}\" is not in the chain"),
                "give the URDF that it was made with",
            )
        };
        for (name, twist) in &self.twists {
            let index = chain.origin_of(name).ok_or_else(|| unknown(name))?;
            robot.twists[index] = Vector6::from(*twist);
        }
        for t in &self.terms {
            let reading = chain.readings.iter().position(|r| *r == t.joint).ok_or_else(|| unknown(&t.joint))?;
            robot.terms.push(JointTerm { reading, term: t.term, value: t.value });
        }
        Ok(robot)
    }
}
