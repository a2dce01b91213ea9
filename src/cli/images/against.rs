//! Poses of another source, to compare with: truth.toml, a tracker's poses.csv, another program's.

use std::path::Path;

use crate::error::Result;
use crate::geom::Pose;
use crate::identify::{OtherBody, PoseComparison, PoseDifference, StandAlone, compare_poses};
use crate::series::read_named_poses;
use crate::simulate::truth::Truth;

/// Compares with the poses of a file.
pub(super) fn compare(found: &StandAlone, path: &Path) -> Result<PoseComparison> {
    let place = path.display().to_string();
    if path.extension().is_some_and(|e| e == "toml") {
        let truth = Truth::read(path)?;
        let poses: Vec<(String, Pose)> =
            truth.stops.iter().map(|s| (s.image.clone(), s.camera_from_plate.pose().inverse())).collect();
        return compare_poses(found, &poses, OtherBody::Camera, &place);
    }
    let named = read_named_poses(path)?;
    let body = if named.of_target { OtherBody::Unknown } else { OtherBody::Camera };
    compare_poses(found, &named.poses, body, &place)
}

/// What is printed.
pub(super) fn text(path: &Path, c: &PoseComparison) -> String {
    let arcmin = |rad: f64| 60.0 * rad.to_degrees();
    let length = |d: &PoseDifference| d.twist.fixed_rows::<3>(0).norm();
    let worst = c.differences.iter().max_by(|a, b| length(a).total_cmp(&length(b)));
    let worst = worst.map_or_else(String::new, |w| {
        let turn = w.twist.fixed_rows::<3>(3).norm();
        format!("; worst {:.4} mm and {:.3} arcmin ({})", 1e3 * length(w), arcmin(turn), w.image)
    });
    format!(
        "against   {}: {} poses, after the common frame {:.4} mm and {:.3} arcmin RMS per axis{worst}\n          \
         scale {:+.4} %, normalised error squared {:.2} by the stated covariances alone\n",
        path.display(),
        c.differences.len(),
        1e3 * c.rms[0],
        arcmin(c.rms[1]),
        100.0 * c.relative_scale,
        c.normalised
    )
}
