//! A pose on the command line.

use std::path::Path;

use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::output::plan_start::read_pose;

/// `x,y,z[,roll,pitch,yaw]` in m and degrees; `None` where nothing is given.
///
/// # Errors
/// Another count of numbers.
pub fn pose(flag: &str, numbers: &[f64]) -> Result<Option<Pose>> {
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

/// A pose as [`pose`] takes it, or that of a file.
///
/// # Errors
/// Neither.
pub fn pose_or_file(flag: &str, text: &str) -> Result<Pose> {
    if Path::new(text).is_file() {
        return read_pose(Path::new(text));
    }
    let number = |part: &str| part.trim().parse().ok().filter(|v: &f64| v.is_finite());
    let numbers: Vec<f64> = text.split(',').map(number).collect::<Option<_>>().unwrap_or_default();
    pose(flag, &numbers)?.ok_or_else(|| {
        let remedy = "give x,y,z[,roll,pitch,yaw] in metres and degrees, or a file that exists";
        Error::new(
            Code::OptionRange,
            flag,
            format!("\"{text}\" is neither a file nor numbers with commas between"),
            remedy,
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_three_or_six_numbers_everywhere() {
        let place = Pose::from_xyz_rpy([0.6, 0.0, -0.1], [0.0; 3]);
        for text in ["0.6,0,-0.1", "0.6, 0, -0.1, 0, 0, 0"] {
            let (turn, way) = pose_or_file("--plate-pose", text).unwrap().distance(&place);
            assert!(turn < 1e-12 && way < 1e-12, "{text}");
        }
        let turned = pose_or_file("--plate-pose", "0,0,0,0,0,90").unwrap();
        assert!((turned.distance(&Pose::identity()).0 - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        for text in ["", "0.6", "0.6,0", "0.6,0,0,1", "a,b,c", "0.6,0,inf", "0,0,0,0,0,0,0"] {
            assert_eq!(pose_or_file("--plate-pose", text).unwrap_err().code, Code::OptionRange, "{text}");
        }
    }
}
