//! A pose on the command line.

use crate::error::{Code, Error, Result};
use crate::geom::Pose;

/// `x,y,z[,roll,pitch,yaw]` in m and degrees; `None` where nothing is given.
///
/// # Errors
/// Another count of numbers.
pub(super) fn pose(flag: &str, numbers: &[f64]) -> Result<Option<Pose>> {
    match *numbers {
        [] => Ok(None),
        [x, y, z] => Ok(Some(Pose::from_xyz_rpy([x, y, z], [0.0; 3]))),
        [x, y, z, roll, pitch, yaw] => Ok(Some(Pose::from_xyz_rpy([x, y, z], [roll, pitch, yaw].map(f64::to_radians)))),
        _ => {
            let what = format!("{} numbers", numbers.len());
            Err(Error::new(Code::OptionRange, flag, what, "give x,y,z or x,y,z,roll,pitch,yaw, in metres and degrees"))
        }
    }
}
