//! What a plan starts from: camera.yaml, pose files, solution.json.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use nalgebra::{Matrix2, Vector2, Vector6};
use serde::Deserialize;

use crate::error::{Code, Error, Result};
use crate::files::{self, FileKind};
use crate::geom::Pose;
use crate::identify::RobotModel;
use crate::model::joint_terms::JointTerm;
use crate::model::robot::{Posture, Robot};
use crate::output::restore;
use crate::output::solution_json::{ImageRecord, ObservationColumns, PlacedRecord, SolutionRecord};
use crate::plan::setting::{Beside, PlannedStop, Setting};
use crate::problem::{Image, Mark, MarkerObservation};
use crate::series::{Marker, Plate};
use crate::urdf::Chain;

#[derive(Deserialize)]
struct PoseFile {
    xyz_m: [f64; 3],
    quat_xyzw: Option<[f64; 4]>,
    rpy_rad: Option<[f64; 3]>,
}

fn text(path: &Path) -> Result<String> {
    files::read_text(path, FileKind::Settings)
}

/// The pose of a file like hand_camera.yaml or plate_pose.yaml.
///
/// # Errors
/// Unreadable files, no rotation.
pub fn read_pose(path: &Path) -> Result<Pose> {
    let remedy = "give a file with xyz_m and quat_xyzw or rpy_rad, as identify writes hand_camera.yaml";
    let file: PoseFile =
        serde_saphyr::from_str(&text(path)?).map_err(|e| Error::new(Code::SettingSyntax, path.display(), e, remedy))?;
    match (file.quat_xyzw, file.rpy_rad) {
        (Some(q), _) => Ok(Pose::from_xyz_quaternion(file.xyz_m, q)),
        (None, Some(rpy)) => Ok(Pose::from_xyz_rpy(file.xyz_m, rpy)),
        (None, None) => Err(Error::new(Code::SettingMissing, path.display(), "has no rotation", remedy)),
    }
}

/// Setting and images of a solution: the robot as calibrated, its camera, mounting and placements, the images in use.
///
/// Of several cameras, mountings and plates the first image on the robot decides for which is planned, and so it does of the placements: those at
/// which its plate was seen by cameras that are mounted as its own. Of the images in use all count that show its plate. `chain` is that of the URDF given.
///
/// # Errors
/// A solution of another robot, or without images on the robot.
pub fn from_solution(record: &SolutionRecord, chain: Chain, model: RobotModel) -> Result<(Setting, Vec<PlannedStop>)> {
    let refuse = |what: String, remedy: &str| Error::new(Code::SolutionDiffers, "solution.json", what, remedy);
    if record.robot.readings != chain.readings {
        let what = format!("is of joints {}", record.robot.readings.join(", "));
        return Err(refuse(what, "leave out --urdf, --base and --tip, or give those with which it was made"));
    }
    let first = record.images.iter().find(|i| i.is_used_on_robot()).ok_or_else(|| {
        refuse(
            "has no image on the robot in use".into(),
            "plan without it: give --urdf with the corrected robot, --plate, --plate-pose and --hand-camera",
        )
    })?;
    let used: Vec<&ImageRecord> =
        record.images.iter().filter(|i| i.is_used_on_robot() && i.plate == first.plate).collect();
    let shows = |i: &ImageRecord| i.is_on_robot() && (i.camera_mount, i.plate) == (first.camera_mount, first.plate);
    let planned: Vec<usize> =
        (0..record.placements.len()).filter(|&k| record.images.iter().any(|i| shows(i) && i.placement == k)).collect();
    let columns = Columns {
        cameras: first_and_others(&[first.camera], used.iter().map(|i| i.camera)),
        mountings: first_and_others(&[first.mounting], used.iter().map(|i| i.mounting)),
        placements: first_and_others(&planned, used.iter().map(|i| i.placement)),
    };
    let stops = stops(&used, &columns, record);
    let placed = |all: &[PlacedRecord], which: &[usize]| {
        which.iter().map(|&k| (all[k].name.clone(), (&all[k].pose).into())).collect::<Vec<_>>()
    };
    let camera = |k: &usize| (record.cameras[*k].name.clone(), restore::camera(&record.cameras[*k]).without_field());
    let setting = Setting {
        robot: calibrated(record, chain, model),
        camera: camera(&first.camera).1,
        mount: first.camera_mount,
        mounting: (&record.mountings[first.mounting].pose).into(),
        placements: placed(&record.placements, &planned),
        plate: plate(record, first.plate),
        pixel_sigma_px: typical_sigma(&stops),
        joint_sigma: record.cameras[first.camera].joint_noise.clone(),
        beside: Beside {
            cameras: columns.cameras[1..].iter().map(camera).collect(),
            mountings: placed(&record.mountings, &columns.mountings[1..]),
            placements: placed(&record.placements, &columns.placements[planned.len()..]),
        },
    };
    Ok((setting, stops))
}

/// Which cameras, mountings and placements of a record have columns, in their order.
struct Columns {
    cameras: Vec<usize>,
    mountings: Vec<usize>,
    placements: Vec<usize>,
}

/// Those that are planned for, then the others that occur, in the order of the record.
fn first_and_others(planned: &[usize], used: impl Iterator<Item = usize>) -> Vec<usize> {
    let others: BTreeSet<usize> = used.filter(|k| !planned.contains(k)).collect();
    planned.iter().copied().chain(others).collect()
}

/// The stops at which these images were taken: those of one place in a run are of one stop.
fn stops(used: &[&ImageRecord], columns: &Columns, record: &SolutionRecord) -> Vec<PlannedStop> {
    let run = |image: &ImageRecord| {
        let series = record.series.iter().find(|s| s.name == image.series)?;
        series.run.clone().zip(image.row)
    };
    let mut places: BTreeMap<(String, usize), usize> = BTreeMap::new();
    let mut stops: Vec<PlannedStop> = Vec::new();
    for image in used {
        let Some(PlannedStop { posture, images }) = taken(image, columns, record) else { continue };
        let place = run(image);
        match place.as_ref().and_then(|place| places.get(place)).and_then(|&k| stops.get_mut(k)) {
            Some(stop) => stop.images.extend(images),
            None => {
                places.extend(place.map(|place| (place, stops.len())));
                stops.push(PlannedStop { posture, images });
            }
        }
    }
    stops
}

/// The smallest robot model that has all joint terms of a solution.
pub fn model_of(record: &SolutionRecord, chain: &Chain) -> RobotModel {
    let has_all = |model: &RobotModel| {
        let terms = model.robot(chain.clone()).terms.into_iter();
        let of_model: BTreeSet<(&str, String)> =
            terms.map(|t| (chain.readings[t.reading].as_str(), t.term.name())).collect();
        record.robot.terms.iter().all(|t| of_model.contains(&(t.reading.as_str(), t.term.clone())))
    };
    RobotModel::CHOICES.into_iter().find(has_all).unwrap_or(RobotModel::Full)
}

/// The robot with the twists and terms of the solution; terms of the model that it has not stand at zero.
fn calibrated(record: &SolutionRecord, chain: Chain, model: RobotModel) -> Robot {
    let mut robot = model.robot(chain);
    for (joint, twist) in robot.chain.joints.iter().zip(&mut robot.twists).filter(|(j, _)| j.states_origin()) {
        if let Some(found) = record.robot.joints.iter().rfind(|j| j.name == joint.name) {
            *twist = Vector6::from(found.twist);
        }
    }
    let readings = robot.chain.readings.clone();
    let value = |t: &JointTerm| {
        let same =
            |r: &&crate::output::solution_json::TermRecord| r.reading == readings[t.reading] && r.term == t.term.name();
        record.robot.terms.iter().find(same).map_or(0.0, |r| r.value)
    };
    let values: Vec<f64> = robot.terms.iter().map(value).collect();
    robot.terms.iter_mut().zip(values).for_each(|(t, v)| t.value = v);
    robot
}

fn plate(record: &SolutionRecord, index: usize) -> Plate {
    let p = &record.plates[index];
    let mut plate = Plate::lattice(p.kind, p.columns, p.rows, p.pitch_m, p.tolerance_m);
    plate.scale = p.scale;
    plate.markers = (0..p.id.len())
        .map(|k| Marker {
            id: p.id[k],
            position_m: p.position_m[k].into(),
            outer_radius_m: p.radii_m[k][0],
            inner_radius_m: p.radii_m[k][1],
            sigma_m: p.prior_sigma_m[k],
        })
        .collect();
    plate
}

/// A stop of the solution, with the observations in use at the place where they are predicted; `None` off the robot.
fn taken(image: &ImageRecord, columns: &Columns, record: &SolutionRecord) -> Option<PlannedStop> {
    let plate = &record.plates[image.plate];
    let pixel_factor = record.cameras[image.camera].pixel_factor;
    let column = |all: &[usize], own: usize| all.iter().position(|k| *k == own);
    let posture = Posture { readings: image.readings.clone()?, approach: image.approach.clone() };
    let image = Image {
        name: image.name.clone(),
        series: 0,
        stop: 0,
        camera: column(&columns.cameras, image.camera)?,
        mounting: column(&columns.mountings, image.mounting)?,
        placement: column(&columns.placements, image.placement)?,
        plate: 0,
        mount: image.camera_mount,
        observations: observations(&image.observations, pixel_factor, &plate.id).into(),
        rejected: None,
    };
    Some(PlannedStop { posture, images: vec![image] })
}

fn observations(columns: &ObservationColumns, pixel_factor: f64, ids: &[u32]) -> Vec<MarkerObservation> {
    let one = |k: usize| {
        if columns.reason[k].is_some() {
            return None;
        }
        let [uu, uv, vv] = columns.covariance[k];
        let information = (Matrix2::new(uu, uv, uv, vv) * pixel_factor.powi(2)).try_inverse()?;
        let uv = Vector2::from(columns.uv[k]) - columns.duv[k].map_or(Vector2::zeros(), Vector2::from);
        Some(MarkerObservation {
            marker: ids.iter().position(|id| *id == columns.marker[k])?,
            edge: columns.edge[k],
            mark: Mark::of_radius(columns.radius_m[k]),
            uv,
            information,
            rejected: None,
        })
    };
    let mut all: Vec<MarkerObservation> = (0..columns.marker.len()).filter_map(one).collect();
    all.sort_by_key(|o| (o.marker, o.edge));
    all
}

/// Median standard deviation of an observation of the camera that is planned for, px.
fn typical_sigma(stops: &[PlannedStop]) -> f64 {
    let mut all: Vec<f64> = stops
        .iter()
        .flat_map(|s| &s.images)
        .filter(|image| image.camera == 0)
        .flat_map(|image| image.observations.iter())
        .map(|o| (2.0 / o.information.trace().max(f64::MIN_POSITIVE)).sqrt())
        .collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.05)
}

#[cfg(test)]
mod tests {
    use super::from_solution;
    use crate::identify::RobotModel;
    use crate::output::restore::{chain, robot_description};
    use crate::output::solution_json::SolutionRecord;
    use crate::series::CameraMount;

    #[test]
    fn further_images_are_of_plates_that_the_camera_can_see() {
        let mut record = SolutionRecord::with_both_mounts();
        let own = chain(&record, &robot_description(&record).unwrap(), &record.robot.base, &record.robot.tip).unwrap();
        let of_first = |record: &SolutionRecord| {
            let (setting, stops) = from_solution(record, own.clone(), RobotModel::Rigid).unwrap();
            let names: Vec<String> = setting.placements.iter().map(|p| p.0.clone()).collect();
            let own = stops.iter().flat_map(|s| &s.images).filter(|i| i.mounting == 0);
            assert!(own.clone().all(|i| i.placement == 0 && i.mount == setting.mount));
            (setting.mount, names, own.count())
        };
        assert_eq!(of_first(&record), (CameraMount::Hand, vec!["placement_0".to_owned()], 12));
        record.images.rotate_left(12);
        assert_eq!(of_first(&record), (CameraMount::Fixed, vec!["carried".to_owned()], 12));
    }
}
