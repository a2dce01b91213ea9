//! The solver alone, on the numeric series of the peers' generator, from the same start as the peers.
//!
//! `cargo bench --bench ceres -- FOLDER MODE [START]` with MODE `poses`, `exact` or `joint` and START `guess` (as stated in the folder) or `images`
//! (free camera poses, then closed forms); see `benches/README.md`.
//! One thread; prints iterations, processor time of the solve, the cost reached, the RMS and the largest resident size of the process.

use std::error::Error;
use std::path::Path;

use nalgebra::{DMatrix, Matrix2, Matrix3, Vector2, Vector3};
use robotcal::fit::FreePose;
use robotcal::geom::{Pose, exp_so3};
use robotcal::identify::adjust_free_poses;
use robotcal::init::{PosePair, solve_hand_eye};
use robotcal::model::camera::{Camera, Lens};
use robotcal::model::robot::{Posture, Robot};
use robotcal::problem::{
    Adjustment, Image, JOINTS_IN_COMMON, Layout, Mark, MarkerObservation, Names, Noise, PlateShape, Problem, State,
    Stop, Tie,
};
use robotcal::series::{CameraMount, Edge, Marker, Plate, PlateKind};
use robotcal::solve::{Outcome, Settings, solve};

type Fallible<T> = Result<T, Box<dyn Error>>;

/// Sigma of the joint readings where the folder states none, rad.
const DEFAULT_JOINT_SIGMA: f64 = 2e-5;

#[derive(Clone, Copy, PartialEq)]
enum Mode {
    Poses,
    Exact,
    Joint,
}

fn table(path: &Path) -> Fallible<Vec<Vec<f64>>> {
    let mut reader = csv::Reader::from_path(path)?;
    let row =
        |r: Result<csv::StringRecord, csv::Error>| Ok(r?.iter().map(str::parse).collect::<Result<Vec<f64>, _>>()?);
    reader.records().map(row).collect()
}

fn pose(rows: &serde_json::Value) -> Fallible<Pose> {
    let rows: Vec<Vec<f64>> = serde_json::from_value(rows.clone())?;
    let m = DMatrix::from_fn(4, 4, |i, j| rows[i][j]);
    let rotation: Matrix3<f64> = m.fixed_view::<3, 3>(0, 0).into_owned();
    Ok(Pose::new(rotation, m.fixed_view::<3, 1>(0, 3).into_owned()))
}

/// Both sides' model: eight camera parameters, four parameters a joint axis, one free rigid motion, marker corrections with a
/// prior, and no prior else.
fn read(folder: &Path, mode: Mode) -> Fallible<Adjustment> {
    let guess: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(folder.join("guess.json"))?)?;
    let number = |key: &str| guess[key].as_f64().ok_or(format!("guess.json has no number '{key}'"));
    let size: Vec<u32> = serde_json::from_value(guess["image_size"].clone())?;
    let guessed: Vec<f64> = serde_json::from_value(guess["camera"].clone())?;
    let mut camera = Camera::pinhole(Lens::Brown, size[0], size[1], guessed[0]);
    camera.parameters[..8].copy_from_slice(&guessed);
    let sigma_m = number("marker_sigma")?;
    let mut plate = Plate::lattice(PlateKind::Points, 1, 1, 1.0, sigma_m);
    let marker = |row: &Vec<f64>| Marker {
        id: row[0] as u32,
        position_m: Vector3::new(row[1], row[2], row[3]),
        outer_radius_m: 0.0,
        inner_radius_m: 0.0,
        sigma_m,
    };
    plate.markers = table(&folder.join("plate.csv"))?.iter().map(marker).collect();
    let information = Matrix2::identity() * number("pixel_sigma")?.powi(-2);
    let mut observations: Vec<Vec<MarkerObservation>> = Vec::new();
    for row in table(&folder.join("observations.csv"))? {
        observations.resize(observations.len().max(row[0] as usize + 1), Vec::new());
        let uv = Vector2::new(row[2], row[3]);
        let marker = row[1] as usize;
        let own = MarkerObservation { marker, edge: Edge::Outer, mark: Mark::Corner, uv, information, rejected: None };
        observations[row[0] as usize].push(own);
    }
    let chain = robotcal::urdf::read(&folder.join("nominal.urdf"))?.chain(None, Some("tool0"))?;
    let readings = chain.readings.len();
    let joints = table(&folder.join("joints.csv"))?;
    let image = |(i, observations): (usize, Vec<MarkerObservation>)| Image {
        name: format!("{i}"),
        series: 0,
        stop: i,
        camera: 0,
        mounting: 0,
        placement: 0,
        plate: 0,
        mount: CameraMount::Hand,
        observations: observations.into(),
        rejected: None,
    };
    let images: Vec<Image> = observations.into_iter().enumerate().map(image).collect();
    let stop = |i: usize| Stop { series: 0, posture: Some(Posture::at(&joints[i][1..])), local_share: Vec::new() };
    let stops: Vec<Stop> = (0..images.len()).map(stop).collect();
    let ties = match mode {
        Mode::Poses => table(&folder.join("init_poses.csv"))?
            .iter()
            .map(|r| Tie::Free(Pose::new(exp_so3(&Vector3::new(r[1], r[2], r[3])), Vector3::new(r[4], r[5], r[6]))))
            .collect(),
        Mode::Exact | Mode::Joint => vec![Tie::Rigid; images.len()],
    };
    let joint_errors = vec![vec![0.0; if mode == Mode::Joint { readings } else { 0 }]; images.len()];
    let state = State {
        robot: Robot::nominal(chain),
        mountings: vec![pose(&guess["T_flange_cam"])?],
        placements: vec![pose(&guess["T_base_plate"])?],
        instruments: Vec::new(),
        bodies: Vec::new(),
        cameras: vec![camera],
        plates: vec![PlateShape::nominal(&plate)],
        joint_errors,
        ties,
    };
    let names = |name: &str| vec![name.to_owned()];
    let (hand, plate_name, front) = (names("hand"), names("plate"), names("camera"));
    let named =
        Names { mountings: &hand, placements: &plate_name, cameras: &front, plates: &plate_name, ..Names::default() };
    let mut layout = Layout::new(&state, &named);
    let joints = &state.robot.chain.joints;
    for (i, column) in layout.columns.iter_mut().enumerate() {
        column.prior_sigma = f64::INFINITY;
        column.free = mode != Mode::Poses && (layout.mountings[0].contains(&i) || layout.twists.contains(&i));
        column.free |= layout.cameras[0].clone().take(8).any(|c| c == i);
        if layout.twists.contains(&i) && joints[i / 6].axis[i % 3] != 0.0
            || joints.get(i / 6).is_some_and(|j| j.drive.is_none())
        {
            column.free = false;
        }
    }
    let stated = number("joint_sigma")?;
    let joint = vec![vec![if stated > 0.0 { stated } else { DEFAULT_JOINT_SIGMA }; readings]];
    let noise = Noise { pixel_factor: vec![1.0], joint, ..Noise::default() };
    let problem = Problem {
        layout,
        plates: vec![plate],
        placements: names("plate"),
        mountings: names("hand"),
        cameras: names("camera"),
        stops,
        fewest_in_common: JOINTS_IN_COMMON,
        images,
        instruments: Vec::new(),
        bodies: Vec::new(),
        body_measurements: Vec::new(),
        lengths: Vec::new(),
        noise,
        families: Vec::new(),
        moved_markers: std::collections::BTreeSet::new(),
        restraint: None,
        huber: f64::INFINITY,
        bounds: robotcal::assess::Limits::default().bounds(),
    };
    Ok(Adjustment { problem, state })
}

/// Starting values from the images alone: free camera poses, then hand-camera and plate pose in closed form.
fn start_from_images(mut guess: Adjustment) -> Fallible<Adjustment> {
    let focal_px = guess.state.cameras[0].parameters[0];
    let (_, free, _) = adjust_free_poses(
        guess.clone(),
        &[robotcal::identify::CameraStart::Focal(focal_px)],
        &robotcal::assess::Limits::default(),
    )?;
    let pair = |(i, free): (usize, &Option<FreePose>)| {
        let chain = guess.state.robot.base_from_tip(&guess.problem.posture(i)?.readings).inverse();
        Some(PosePair { camera_from_plate: free.as_ref()?.camera_from_plate, chain })
    };
    let pairs: Vec<PosePair> = free.poses.iter().enumerate().filter_map(pair).collect();
    let best = solve_hand_eye(&pairs).first().ok_or("no closed form has a solution")?.solution;
    (guess.state.mountings, guess.state.placements) = (vec![best.camera], vec![best.plate]);
    guess.state.cameras = free.state.cameras;
    Ok(guess)
}

/// Time that the processor spent on this thread, s: fair on a machine that others use, too.
fn processor_seconds() -> Fallible<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat")?;
    let nanoseconds: f64 = text.split_whitespace().next().ok_or("schedstat is empty")?.parse()?;
    Ok(1e-9 * nanoseconds)
}

/// Largest resident size of this process so far, MB; NaN where the system does not tell.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches("kB").trim().parse::<f64>().ok()).map_or(f64::NAN, |kb| kb / 1024.0)
}

fn report(mode: &str, outcome: &Outcome, seconds: f64) -> Fallible<()> {
    let lin = outcome.linearised.as_ref().ok_or("the start is bad: a marker lies behind its camera")?;
    let squares: f64 = lin.terms.iter().flat_map(|t| &t.residuals).map(|r| r.duv.norm_squared()).sum();
    let count: usize = lin.terms.iter().map(|t| t.residuals.len()).sum();
    println!(
        "robotcal mode={mode} iterations {} solve {seconds:.4} s, rms {:.5} px, cost {:.6}, {:?}, peak {:.0} MB",
        outcome.iterations,
        (squares / (2 * count) as f64).sqrt(),
        lin.cost,
        outcome.status,
        peak_mb()
    );
    Ok(())
}

fn main() -> Fallible<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let [folder, name, rest @ ..] = arguments.as_slice() else {
        println!("usage: cargo bench --bench ceres -- FOLDER poses|exact|joint [guess|images]");
        return Ok(());
    };
    let mode = match name.as_str() {
        "poses" => Mode::Poses,
        "exact" => Mode::Exact,
        "joint" => Mode::Joint,
        other => return Err(format!("no mode '{other}': poses, exact or joint").into()),
    };
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global()?;
    let guess = read(Path::new(folder), mode)?;
    let begin = processor_seconds()?;
    let start = match rest.first().map(String::as_str) {
        None | Some("guess") => guess,
        Some("images") => start_from_images(guess)?,
        Some(other) => return Err(format!("no start '{other}': guess or images").into()),
    };
    let outcome = solve(start, &Settings::default());
    report(name, &outcome, processor_seconds()? - begin)
}
