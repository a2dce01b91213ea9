//! Where camera and plate are, so that the robot can bring one before the other in many ways.

use nalgebra::{Matrix3, Vector3};
use rand::{Rng, RngExt};

use super::request::WorldRequest;
use crate::assess::Limits;
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::model::inverse;
use crate::model::one_direction::turns_about_one_direction;
use crate::model::robot::Robot;
use crate::plan::viewpoint::Viewpoint;
use crate::series::CameraMount;
use crate::urdf::JointKind;

/// Views tried for each candidate place.
const TRIALS: usize = 24;
/// Random starts of the inverse kinematics for each view.
const STARTS: usize = 6;
/// Share of the views that must be in reach.
const LEAST_SHARE: f64 = 0.15;
/// How far below the table or the robot's foot a joint may be, m.
const BELOW_TABLE_M: f64 = 0.05;

/// Poses of camera and plates, nominal and true alike, and what is needed to find postures.
#[derive(Clone)]
pub(super) struct Setup {
    /// `flange_from_camera` or `base_from_camera`.
    pub camera: Pose,
    /// `base_from_plate` or `flange_from_plate`, one for each placement.
    pub plates: Vec<Pose>,
    limits: Vec<(f64, f64)>,
    /// `base_from_foot` of a robot that stands aside of its base.
    foot: Option<Pose>,
    /// The robot up to each of its moving joints.
    stumps: Vec<Robot>,
}

/// Chooses the places: among a few distances and heights those where most views are in reach.
pub(super) fn set_up(request: &WorldRequest, robot: &Robot, rng: &mut impl Rng) -> Result<Setup> {
    let limits = inverse::reading_limits(&request.chain);
    let in_hand = near([0.03, -0.05, 0.08], [0.05, -0.04, 0.4], rng);
    let plate_in_hand = near([0.01, 0.02, 0.05], [0.02, -0.03, 0.3], rng);
    let foot = request.chain.base_from_foot();
    let mut setup = Setup { camera: in_hand, plates: Vec::new(), limits, foot, stumps: stumps(robot) };
    let reach = robot.chain.arm_length_m().max(0.2);
    if request.mount == CameraMount::Fixed {
        setup.plates = vec![plate_in_hand; request.placements.max(1)];
        for plate in setup.plates.iter_mut().skip(1) {
            *plate = *plate * near([0.0, 0.0, 0.02], [0.2, 0.3, 0.8], rng);
        }
        let candidates = setup.around_foot(fixed_cameras(reach));
        setup.camera =
            best(&candidates, request, robot, rng, |c| Setup { camera: *c, ..setup.clone_with(&setup.plates) })?;
        return Ok(setup);
    }
    for k in 0..request.placements.max(1) {
        let candidates = match request.chain.base_moves() {
            true => plates_on_the_link(k, rng),
            false => setup.around_foot(plates_on_tables(reach, k, rng)),
        };
        let plate = best(&candidates, request, robot, rng, |c| setup.clone_with(&[*c]))?;
        setup.plates.push(plate);
    }
    Ok(setup)
}

/// A pose near the given one: 5 mm and 0.05 rad about it.
fn near(xyz: [f64; 3], rpy: [f64; 3], rng: &mut impl Rng) -> Pose {
    Pose::from_xyz_rpy(xyz.map(|v| v + rng.random_range(-0.005..0.005)), rpy.map(|v| v + rng.random_range(-0.05..0.05)))
}

/// The robot cut off behind each moving joint.
fn stumps(robot: &Robot) -> Vec<Robot> {
    let joints = &robot.chain.joints;
    let moving = (0..joints.len()).filter(|&k| joints[k].kind != JointKind::Fixed);
    moving
        .map(|k| {
            let mut chain = robot.chain.clone();
            chain.joints.truncate(k + 1);
            Robot::nominal(chain)
        })
        .collect()
}

/// Plates that lie on tables around the robot; from the second placement on at other bearings and tilted.
fn plates_on_tables(reach: f64, placement: usize, rng: &mut impl Rng) -> Vec<Pose> {
    let bearing = [0.0, 1.0, -1.0, 2.0, -2.0][placement % 5] + rng.random_range(-0.1..0.1);
    let tilt = if placement == 0 { 0.0 } else { 0.35 };
    let turn = rng.random_range(-0.3..0.3);
    let mut all = Vec::new();
    for height in [0.0, 0.15, 0.3] {
        for distance in [0.5, 0.4, 0.6, 0.7] {
            let around = Pose::from_xyz_rpy([0.0; 3], [0.0, 0.0, bearing]);
            let place = Pose::from_xyz_rpy([distance * reach, 0.0, height * reach], [0.0, -tilt, turn]);
            all.push(around * place);
        }
    }
    all
}

/// Plates on the link that carries them, a positioner's table or a second arm's tip.
fn plates_on_the_link(placement: usize, rng: &mut impl Rng) -> Vec<Pose> {
    let aside = 0.05 * placement as f64;
    [0.02, 0.1].map(|above| near([aside, -aside, above], [0.02, -0.03, 0.3], rng)).to_vec()
}

/// Cameras on a stand before the robot that look back at it.
fn fixed_cameras(reach: f64) -> Vec<Pose> {
    // Optical axis along -x of the base, image down along -z.
    let looking_back = Matrix3::from_columns(&[Vector3::<f64>::y(), -Vector3::z(), -Vector3::x()]);
    let mut all = Vec::new();
    for height in [0.4, 0.6, 0.2] {
        for distance in [0.9, 1.1, 0.75] {
            let tilted = looking_back * crate::geom::matrix_from_rpy([-0.2, 0.05, 0.03]);
            all.push(Pose::new(tilted, Vector3::new(distance * reach, 0.05 * reach, height * reach)));
        }
    }
    all
}

/// The candidate with most views in reach; the first among equals.
fn best(
    candidates: &[Pose],
    request: &WorldRequest,
    robot: &Robot,
    rng: &mut impl Rng,
    with: impl Fn(&Pose) -> Setup,
) -> Result<Pose> {
    let mut winner = (0, candidates[0]);
    for candidate in candidates {
        let setup = with(candidate);
        let reached = (0..TRIALS).filter(|_| setup.random_posture(request, robot, 0, rng).is_some()).count();
        if reached > winner.0 {
            winner = (reached, *candidate);
        }
    }
    if (winner.0 as f64) < LEAST_SHARE * TRIALS as f64 {
        return Err(out_of_reach(robot));
    }
    Ok(winner.1)
}

fn out_of_reach(robot: &Robot) -> Error {
    let is_level = turns_about_one_direction(robot, Limits::default().hand_eye_rotation_rad);
    let (what, remedy) = if is_level {
        (
            "it turns its flange about one direction alone: no camera or plate on it is tilted, as images that tell the hand-eye transform ask for",
            "measure such an arm with a tracker (points.csv, poses.csv) or by touches (contacts.csv); only images are simulated",
        )
    } else {
        (
            "hardly any view of the plate is in reach, wherever the plate stands",
            "allow nearer views, or choose a plate that suits the robot's size",
        )
    };
    Error::new(Code::SimulationOutOfReach, format!("robot {}", robot.chain.robot), what, remedy)
}

impl Setup {
    fn clone_with(&self, plates: &[Pose]) -> Self {
        Self { plates: plates.to_vec(), ..self.clone() }
    }

    /// Poses about the robot's foot in the base frame.
    fn around_foot(&self, poses: Vec<Pose>) -> Vec<Pose> {
        let Some(foot) = self.foot else { return poses };
        poses.into_iter().map(|pose| foot * pose).collect()
    }

    /// Height of a pose in the base frame above the robot's foot, as the foot stands, m.
    fn height_m(&self, pose: &Pose) -> f64 {
        self.foot.map_or(pose.translation.z, |foot| (foot.inverse() * *pose).translation.z)
    }

    /// The camera pose that a pose of the tip gives.
    pub fn camera_from_plate(&self, mount: CameraMount, base_from_tip: &Pose, placement: usize) -> Pose {
        mount.camera_from_plate(&self.camera, base_from_tip, &self.plates[placement])
    }

    /// Readings that bring about a random view; `None` when it is out of reach.
    pub fn random_posture(
        &self,
        request: &WorldRequest,
        robot: &Robot,
        placement: usize,
        rng: &mut impl Rng,
    ) -> Option<Vec<f64>> {
        let plate_from_camera = Viewpoint::random(&request.plate, &request.views, rng).plate_from_camera();
        let plate = &self.plates[placement];
        let base_from_tip = match request.mount {
            CameraMount::Hand => *plate * plate_from_camera * self.camera.inverse(),
            CameraMount::Fixed => self.camera * plate_from_camera.inverse() * plate.inverse(),
        };
        let readings = inverse::solve(robot, &self.limits, &base_from_tip, STARTS, rng)?;
        let table = match request.mount {
            CameraMount::Hand => self.height_m(plate).min(0.0),
            CameraMount::Fixed => 0.0,
        };
        // No table stands still beside a base that moves.
        if request.chain.base_moves() {
            return Some(readings);
        }
        let above = |stump: &Robot| self.height_m(&stump.base_from_tip(&readings)) > table - BELOW_TABLE_M;
        self.stumps.iter().all(above).then_some(readings)
    }
}
