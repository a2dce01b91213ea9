//! An image in a line: what a person reads when pointing at it.

use super::words::fixed;
use crate::geom::Pose;
use crate::output::photogrammetry::Photogrammetry;
use crate::output::solution_json::{ImageRecord, RobotRecord};
use crate::urdf::JointKind;

/// Name, pose of the camera towards the plate, joint readings, residual or reason.
pub(in crate::output::report) fn describe(p: Photogrammetry, image: &ImageRecord) -> String {
    let mut parts = vec![name(p, image)];
    parts.extend(image.camera_from_plate.as_ref().map(|plate| pose(&Pose::from(plate))));
    parts.extend(p.robot.zip(image.readings.as_ref()).map(|(robot, q)| readings(robot, q)));
    match (&image.reason, image.rms_px) {
        (Some(reason), _) => parts.push(format!("left out: {reason}")),
        (None, Some(px)) => parts.push(format!("{} px RMS", fixed(px, 3))),
        (None, None) => {}
    }
    parts.join("; ")
}

/// The name, with that of the series where there are several.
pub(in crate::output::report) fn name(p: Photogrammetry, image: &ImageRecord) -> String {
    if p.series.len() > 1 { format!("{} ({})", image.name, image.series) } else { image.name.clone() }
}

fn pose(camera_from_plate: &Pose) -> String {
    let tilt = camera_from_plate.rotation[(2, 2)].abs().min(1.0).acos().to_degrees();
    format!("plate {:.2} m away, tilted by {tilt:.0}°", camera_from_plate.translation.norm())
}

fn readings(robot: &RobotRecord, q: &[f64]) -> String {
    let shown = |(q, kind): (&f64, &JointKind)| match kind {
        JointKind::Prismatic => format!("{} mm", fixed(1e3 * q, 1)),
        _ => format!("{}°", fixed(q.to_degrees(), 1)),
    };
    format!("joints {}", q.iter().zip(&robot.reading_kinds).map(shown).collect::<Vec<_>>().join(" "))
}
