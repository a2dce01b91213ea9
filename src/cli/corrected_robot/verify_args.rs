//! Flags of `verify`, for both ways to judge a model.

use std::path::PathBuf;

use clap::Args;

use super::zeros::ReadingsArgs;
use crate::cli::flags::joint_table::Unit;
use crate::cli::flags::recording::RecordingArgs;

/// Flags of `verify`.
#[derive(Debug, Args)]
pub struct VerifyArgs {
    /// Robot description to judge (a corrected URDF)
    #[arg(long, value_name = "FILE")]
    pub(super) urdf: PathBuf,
    /// Its compensation.toml: gear scale, harmonics, gravity and backlash, which a URDF cannot hold
    #[arg(long, value_name = "FILE")]
    pub(super) compensation: Option<PathBuf>,
    /// Nominal robot description to compare with
    #[arg(long, value_name = "FILE")]
    pub(super) nominal: Option<PathBuf>,
    /// Points of one reflector on the tip: x_m, y_m, z_m and one column per joint
    #[arg(long, value_name = "FILE", required_unless_present = "series", requires = "joint_unit")]
    pub(super) points: Option<PathBuf>,
    /// Unit of the revolute joints in that file
    #[arg(long, value_enum)]
    pub(super) joint_unit: Option<Unit>,
    /// Sigma per axis of what measured those points, m: it is no error of the model
    #[arg(long, value_name = "METRES", requires = "points")]
    pub(super) point_sigma_m: Option<f64>,
    /// Another series of the robot: by how much the model misses it, in mm and px; several are judged together
    #[arg(long, value_name = "FOLDER", num_args = 1.., conflicts_with = "points")]
    pub(super) series: Vec<PathBuf>,
    /// Base link
    #[arg(long, value_name = "LINK")]
    pub(super) base: Option<String>,
    /// Tip link
    #[arg(long, value_name = "LINK")]
    pub(super) tip: Option<String>,
    #[command(flatten)]
    pub(super) readings: ReadingsArgs,
    #[command(flatten)]
    pub(super) recording: RecordingArgs,
}
