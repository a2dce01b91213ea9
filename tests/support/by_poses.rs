//! Poses of a controller in the place of the readings of a series folder.

use std::fmt::Write;
use std::path::Path;

use robotcal::calibration::{Ends, Inputs};
use robotcal::model::robot::Robot;

/// Writes controller.csv in the place of joints.csv: the poses that the robot of the URDF has there; the angles of the first stop, to ten
/// degrees, where they are `stated`. What joints.csv said, rad.
pub fn with_poses(folder: &Path, urdf: &Path, stated: bool) -> Vec<Vec<f64>> {
    let Inputs { chain, series, .. } = Inputs::read(urdf, &[folder.to_owned()], Ends::default()).unwrap();
    let all = series[0].readings_for(&chain).unwrap().into_iter();
    let readings: Vec<Vec<f64>> = all.map(Option::unwrap).collect();
    let robot = Robot::nominal(chain);
    let mut table = String::from("image,placement,x_m,y_m,z_m,qx,qy,qz,qw\n");
    for (stop, readings) in series[0].stops.stops.iter().zip(&readings) {
        let pose = robot.base_from_tip(readings);
        let cells: Vec<String> = pose.xyz().iter().chain(&pose.quaternion_xyzw()).map(|v| format!("{v:.12}")).collect();
        writeln!(table, "{},{},{}", stop.image, stop.placement, cells.join(",")).unwrap();
    }
    std::fs::write(folder.join("controller.csv"), table).unwrap();
    std::fs::remove_file(folder.join("joints.csv")).unwrap();
    let path = folder.join("series.toml");
    let mut settings: String = std::fs::read_to_string(&path)
        .unwrap()
        .lines()
        .filter(|l| !l.starts_with("joint_unit"))
        .fold(String::new(), |text, line| text + line + "\n");
    settings += "[controller]\nrotation = \"quaternion\"\n";
    if stated {
        let tens: Vec<String> =
            readings[0].iter().map(|q| format!("{:.1}", 10.0 * (q.to_degrees() / 10.0).round())).collect();
        writeln!(settings, "first_stop_deg = [{}]", tens.join(", ")).unwrap();
    }
    std::fs::write(path, settings).unwrap();
    readings
}
