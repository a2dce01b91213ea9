//! hand_camera.yaml, plate_pose.yaml and poses.csv.

use nalgebra::Matrix6;

use crate::files::word;
use crate::fit::{FreePoses, PlacedCamera};
use crate::geom::Pose;
use crate::identify::Solution;
use crate::output::gauge::Gauge;
use crate::output::names::{ImageNames, file_names};
use crate::output::solution::estimates::determined;
use crate::output::text::{list, quoted};
use crate::problem::Image;
use crate::series::{CameraMount, to_csv};

/// Name of the covariance of all stand-alone poses together.
pub const TOGETHER: &str = "poses_covariance.npy";

const PERTURBATION: &str = "\
# The pose maps coordinates in child to coordinates in parent (m, rad; rpy: R = Rz(yaw) Ry(pitch) Rx(roll)).
# covariance: 6x6, row by row, of the body-fixed perturbation parent_from_child * Exp([rho, phi]), translation rho (m) first,
# then rotation phi (rad).
";

const INNER: &str = "\
# It refers to the plate frame that the nominal markers define (inner constraints).
";

const OPTICAL: &str = "\
# The camera frame is optical: z forward, x right, y down.
";

const TO_ROS: &str = "\
# In ROS 2 this command publishes it (the name of the child is free to choose):
";

struct PoseFile<'a> {
    parent: &'a str,
    child: &'a str,
    pose: &'a Pose,
    covariance: Matrix6<f64>,
    remark: &'a str,
}

impl PoseFile<'_> {
    fn text(&self) -> String {
        let c = &self.covariance;
        format!(
            "{PERTURBATION}{}{TO_ROS}# {}\nparent: {}\nchild: {}\nxyz_m: {}\nquat_xyzw: {}\nrpy_rad: {}\ncovariance: {}\n",
            self.remark,
            self.publisher(),
            quoted(self.parent),
            quoted(self.child),
            list(self.pose.xyz()),
            list(self.pose.quaternion_xyzw()),
            list(self.pose.rpy()),
            list((0..36).map(|k| 0.5 * (c[(k / 6, k % 6)] + c[(k % 6, k / 6)]))),
        )
    }

    /// The command by which ROS 2 publishes the pose to tf: `child` in `parent`, quaternion with its scalar last.
    fn publisher(&self) -> String {
        let [x, y, z] = self.pose.xyz();
        let [qx, qy, qz, qw] = self.pose.quaternion_xyzw();
        let numbers = [("x", x), ("y", y), ("z", z), ("qx", qx), ("qy", qy), ("qz", qz), ("qw", qw)];
        let numbers = numbers.map(|(name, value)| format!("--{name} {value:?}")).join(" ");
        let (parent, child) = (word(self.parent), word(self.child));
        format!("ros2 run tf2_ros static_transform_publisher {numbers} --frame-id {parent} --child-frame-id {child}")
    }
}

fn first_on_robot(solution: &Solution, which: impl Fn(&Image) -> bool) -> Option<&Image> {
    let problem = &solution.fit.problem;
    problem.used_on_robot().map(|i| &problem.images[i]).find(|i| which(i))
}

/// `flange_from_camera` (or `base_from_camera`) of every mounting that the robot's images determine.
pub fn mountings(solution: &Solution) -> Vec<(String, String)> {
    let problem = &solution.fit.problem;
    let chain = &solution.fit.state.robot.chain;
    let mut out = Vec::new();
    for (k, file) in file_names("hand_camera", "yaml", &problem.mountings).into_iter().enumerate() {
        let start = problem.layout.mountings[k].start;
        let Some(image) = first_on_robot(solution, |i| i.mounting == k).filter(|_| determined(solution, start)) else {
            continue;
        };
        let parent = match image.mount {
            CameraMount::Hand => &chain.tip,
            CameraMount::Fixed => &chain.base,
        };
        let text = PoseFile {
            parent,
            child: &problem.cameras[image.camera],
            pose: &solution.fit.state.mountings[k],
            covariance: solution.fit.covariance.block(start),
            remark: OPTICAL,
        };
        out.push((file, text.text()));
    }
    out
}

/// `base_from_plate` (or `flange_from_plate`) of every placement that the robot's images determine.
pub fn placements(solution: &Solution, gauge: &Gauge) -> Vec<(String, String)> {
    let problem = &solution.fit.problem;
    let chain = &solution.fit.state.robot.chain;
    let mut out = Vec::new();
    for (k, file) in file_names("plate_pose", "yaml", &problem.placements).into_iter().enumerate() {
        let start = problem.layout.placements[k].start;
        let Some(image) = first_on_robot(solution, |i| i.placement == k).filter(|_| determined(solution, start)) else {
            continue;
        };
        let parent = match image.mount {
            CameraMount::Hand => &chain.base,
            CameraMount::Fixed => &chain.tip,
        };
        let text = PoseFile {
            parent,
            child: if problem.placements.len() == 1 { "plate" } else { &problem.placements[k] },
            pose: &gauge.placements[k],
            covariance: gauge.placed[k],
            remark: INNER,
        };
        out.push((file, text.text()));
    }
    out
}

/// Text of poses.csv.
pub fn poses_csv(names: &ImageNames, free_poses: &FreePoses) -> String {
    let upper = || (0..6).flat_map(|i| (i..6).map(move |j| (i, j)));
    let mut header: Vec<String> = ["image", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"].map(String::from).to_vec();
    header.extend(upper().map(|(i, j)| format!("c{}{}", i + 1, j + 1)));
    let mut rows = vec![header];
    for (k, free) in free_poses.poses.iter().enumerate() {
        let Some(PlacedCamera { plate_from_camera: pose, covariance }) = free.as_ref().map(|f| &f.in_frame) else {
            continue;
        };
        let mut row = vec![names.of(k).to_owned()];
        row.extend(pose.xyz().iter().chain(&pose.quaternion_xyzw()).map(|v| format!("{v:?}")));
        row.extend(upper().map(|at| format!("{:?}", covariance[at])));
        rows.push(row);
    }
    to_csv(&rows)
}
