//! `robotcal plan`: where to take images, and what they will be worth.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::ArgPredicate;
use nalgebra::Vector3;

use super::plan_targets::TargetArgs;
use super::plan_touches::{self, TouchArgs};
use super::simulate::Mount;
use crate::cli::Verdict;
use crate::cli::flags::arguments::{command_of_report, pair};
use crate::cli::flags::choices::Model;
use crate::cli::flags::pose_argument::pose_or_file;
use crate::cli::flags::robot::{noted_chain, read_chain, refuse_degrees, say_notices};
use crate::cli::results::show::read_solution;
use crate::cli::terminal::say::{say, say_line};
use crate::error::{Code, Error, Result};
use crate::geom::{OrientedBox, Pose};
use crate::identify::RobotModel;
use crate::model::camera::Camera;
use crate::model::robot::Robot;
use crate::output::camera_formats::read_camera_file;
use crate::output::restore::{self, entered_offsets};
use crate::output::solution_json::SolutionRecord;
use crate::output::{ResultFolder, plan_files, plan_html, plan_programs, plan_start, sigma_text};
use crate::plan::candidates::CandidateOptions;
use crate::plan::refine::USUAL_ROUNDS;
use crate::plan::scene::{self, SceneOptions};
use crate::plan::setting::{Beside, PlannedStop, Setting, images_of};
use crate::plan::viewpoint::ViewRange;
use crate::plan::visibility::VisibilityLimits;
use crate::plan::{
    Budget, Demand, Forecast, Gain, PlaceForecast, Plan, PlanRequest, check_demand, choose, compare_places, forecast,
    image_name, place_words, plan,
};
use crate::series::{CameraMount, read_plate};
use crate::simulate::typical_camera;
use crate::study::{PlanStudyRequest, plan_study};
use crate::urdf::{self, Chain, JointKind, RobotDescription};

/// Flags of `plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// Robot description (URDF) [default with --from: that of the result]
    #[arg(long, value_name = "FILE", required_unless_present = "from")]
    urdf: Option<PathBuf>,
    /// New folder for joints.csv, programs and plan.html, or one of an earlier plan that nobody has worked with
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Plate (plate.toml)
    #[arg(long, value_name = "FILE", required_unless_present_any = ["from", "study"])]
    plate: Option<PathBuf>,
    /// Number of images, or of touches [default: 50 images, 12 touches]
    #[arg(
        long,
        default_value_t = 50,
        default_value_if("touch", ArgPredicate::IsPresent, "12"),
        hide_default_value = true
    )]
    count: usize,
    /// Plan further images for this result: camera, poses and noise are taken from it
    #[arg(long, value_name = "solution.json", conflicts_with_all = [
        "plate", "camera", "camera_fov_deg", "image", "mount", "hand_camera", "pixel_noise_px", "joint_noise_mrad"])]
    from: Option<PathBuf>,
    /// Base link [default with --from: that of the result]
    #[arg(long, value_name = "LINK", help_heading = "Robot")]
    base: Option<String>,
    /// Tip link [default with --from: that of the result]
    #[arg(long, value_name = "LINK", help_heading = "Robot")]
    tip: Option<String>,
    /// Camera (ROS camera_info, or a file of OpenCV, Kalibr or mrcal)
    #[arg(long, value_name = "FILE", help_heading = "Camera and plate")]
    camera: Option<PathBuf>,
    /// Horizontal field of view, degrees
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = 60.0,
        conflicts_with = "camera",
        help_heading = "Camera and plate"
    )]
    camera_fov_deg: f64,
    /// Columns and rows of the images
    #[arg(long, value_name = "WxH", default_value = "1280x1024", value_parser = pair::<u32>, conflicts_with = "camera", help_heading = "Camera and plate")]
    image: [u32; 2],
    /// Where the camera is
    #[arg(long, value_enum, default_value_t = Mount::Hand, help_heading = "Camera and plate")]
    mount: Mount,
    /// Camera on the flange (for a fixed camera: in the base frame), roughly: x,y,z[,roll,pitch,yaw] in m and degrees, or a file
    /// like hand_camera.yaml [default: 80 mm before the flange, looking along its z; none for a fixed camera]
    #[arg(long, value_name = "POSE|FILE", allow_hyphen_values = true, help_heading = "Camera and plate")]
    hand_camera: Option<String>,
    /// Plate in the base frame (for a fixed camera: on the flange), roughly: x,y,z[,roll,pitch,yaw] in m and degrees, or a file;
    /// several times for several places [default: on the table before the robot; for a fixed camera 50 mm before the flange]
    #[arg(long, value_name = "POSE|FILE", allow_hyphen_values = true, help_heading = "Camera and plate")]
    plate_pose: Vec<String>,
    /// Joint terms that shall be found; auto plans for all of them [default: rigid; with --from those of the result]
    #[arg(long, value_enum, help_heading = "Robot")]
    robot_model: Option<Model>,
    #[command(flatten)]
    targets: TargetArgs,
    /// All parameters of the robot alike, not the flange
    #[arg(long, conflicts_with = "parameters", help_heading = "What is to be accurate")]
    d_optimal: bool,
    /// These parameters only: joint_2.gear, all of joint_1, joint_*.offset
    #[arg(long, value_name = "NAME", value_delimiter = ',', help_heading = "What is to be accurate")]
    parameters: Vec<String>,
    /// Noise of an observation (sigma per axis), px
    #[arg(long, value_name = "PX", default_value_t = 0.05, help_heading = "Camera and plate")]
    pixel_noise_px: f64,
    /// Joint noise (sigma), mrad; of a prismatic joint 0.1 mm for each mrad
    #[arg(long, value_name = "MRAD", default_value_t = 0.03, help_heading = "Camera and plate")]
    joint_noise_mrad: f64,
    /// Nearest and farthest distance from camera to plate, m
    #[arg(long, value_name = "NEARxFAR", default_value = "0.15x0.6", value_parser = pair::<f64>, help_heading = "Camera and plate")]
    distance_m: [f64; 2],
    /// Largest tilt of the view, degrees
    #[arg(long, value_name = "DEG", default_value_t = 55.0, help_heading = "Camera and plate")]
    tilt_deg: f64,
    /// Depths between which the image is sharp, m
    #[arg(long, value_name = "NEARxFAR", value_parser = pair::<f64>, help_heading = "Camera and plate")]
    focus_m: Option<[f64; 2]>,
    /// Markers that every view shows at least
    #[arg(long, value_name = "N", default_value_t = 20, help_heading = "Camera and plate")]
    markers: usize,
    /// Candidates to choose from
    #[arg(long, value_name = "N", default_value_t = 1000, help_heading = "Search")]
    candidates: usize,
    /// Rounds of search for further candidates near the best, at most (fewer when they gain little)
    #[arg(long, value_name = "N", default_value_t = USUAL_ROUNDS, help_heading = "Search")]
    rounds: usize,
    /// Images at most with the plate at one place
    #[arg(long, value_name = "N", help_heading = "Search")]
    per_placement: Option<usize>,
    /// Images at most in one posture of the arm (elbow, wrist)
    #[arg(long, value_name = "N", help_heading = "Search")]
    per_posture: Option<usize>,
    /// Travel at most: greatest joint motion from the middle posture, summed over the images, rad
    #[arg(long, value_name = "RAD", help_heading = "Search")]
    travel_rad: Option<f64>,
    /// Box that is in the way, in the base frame (where joints carry the base: of the link that carries them and the arm): middle and edges x,y,z,a,b,c, m
    #[arg(long, value_name = "BOX", allow_hyphen_values = true, help_heading = "What is in the way")]
    r#box: Vec<String>,
    /// Height of the table in the same frame, m [default: below plate and robot]
    #[arg(long, value_name = "M", allow_hyphen_values = true, help_heading = "What is in the way")]
    table_z_m: Option<f64>,
    /// Least distance between what must not touch, mm
    #[arg(long, value_name = "MM", default_value_t = 10.0, help_heading = "What is in the way")]
    clearance_mm: f64,
    /// Radius of links without collision geometry, mm [default: by the length of the arm]
    #[arg(long, value_name = "MM", help_heading = "What is in the way")]
    link_radius_mm: Option<f64>,
    /// Radius of the camera's body, mm
    #[arg(long, value_name = "MM", default_value_t = 30.0, help_heading = "What is in the way")]
    camera_radius_mm: f64,
    /// Seed of the candidates; of the first world of a study
    #[arg(long, default_value_t = 1, help_heading = "Search")]
    seed: u64,
    /// Study instead of a plan: 30 planned against 60 random poses in as many simulated worlds; writes study.md
    #[arg(long, value_name = "WORLDS", conflicts_with = "from", help_heading = "Search")]
    study: Option<u64>,
    #[command(flatten)]
    touches: TouchArgs,
}

impl PlanArgs {
    /// The URDF, which is required unless it is in the result from which further images or touches are planned.
    fn urdf(&self) -> &Path {
        self.urdf.as_deref().unwrap_or(Path::new(""))
    }
}

/// Numbers between commas.
fn numbers(flag: &str, text: &str, count: usize, remedy: &str) -> Result<Vec<f64>> {
    let all: Vec<f64> = text.split(',').filter_map(|p| p.trim().parse().ok()).filter(|v: &f64| v.is_finite()).collect();
    if all.len() != count || text.split(',').count() != count {
        return Err(Error::new(
            Code::OptionRange,
            flag,
            format!("\"{text}\" is not {count} numbers with commas between"),
            remedy,
        ));
    }
    Ok(all)
}

pub fn run(args: &PlanArgs) -> Result<Verdict> {
    if let (Some(points), Some(from)) = (&args.touches.touch, &args.from) {
        return plan_touches::run(&args.touches, points, from, &args.targets, args.count, &args.out);
    }
    check(args)?;
    if let Some(worlds) = args.study {
        return study(args, worlds);
    }
    let place = ResultFolder::claim(&args.out, plan_files::FILE_NAME)?;
    let record = args.from.as_deref().map(read_solution).transpose()?;
    let (description, chain) = robot(args, record.as_ref())?;
    let (capsules, meshes) = description.carried_capsules(&chain);
    let described = scene::described(&capsules, &chain);
    let mut request = request(args, record.as_ref(), chain)?;
    request.scene.described = described;
    let mut words = settle_place(args, &mut request)?;
    words.extend(noise_word(&request));
    if meshes > 0 {
        words.push(format!(
            "{meshes} collision meshes of the URDF were not read: their links are capsules from joint to joint \
             (--link-radius-mm sets how thick)"
        ));
    }
    let plan = plan(&request)?;
    let mut forecast = forecast(&request, &plan)?;
    if request.setting.placements.len() > 1 {
        words.extend(place_words(&compare_places(&request, &plan)?));
    }
    forecast.words.extend(words);
    check_demand(&request, &plan, &forecast)?;
    let command = command_of_report();
    let mut more = plan_programs::programs(&request, &plan);
    more.insert("plan.html".into(), plan_html(&request, &plan, &forecast, &command).into_bytes());
    let files = plan_files::plan_files(&request, &plan, &forecast, &command, more)?;
    place.write_all(&files)?;
    say!("{}", summary(&request, &plan, &forecast, &files, &args.out));
    Ok(Verdict::Good)
}

/// The robot description and the chain of it that is planned for: what is not given of them is that of the result.
fn robot(args: &PlanArgs, record: Option<&SolutionRecord>) -> Result<(RobotDescription, Chain)> {
    let given = args.urdf.as_deref().map(urdf::read).transpose()?;
    given.as_ref().map_or(Ok(()), refuse_degrees)?;
    let [base, tip] = [&args.base, &args.tip].map(Option::as_deref);
    match (record, given) {
        (Some(record), given) => {
            let ends = [base.unwrap_or(&record.robot.base), tip.unwrap_or(&record.robot.tip)];
            let description = match given {
                Some(urdf) if ends.iter().all(|end| urdf.links().any(|link| link == *end)) => urdf,
                Some(urdf) => description_of_cell(record, &urdf)?,
                None => restore::robot_description(record)?,
            };
            let chain = restore::chain(record, &description, ends[0], ends[1])?;
            say_notices(&description);
            Ok((description, chain))
        }
        (None, Some(given)) => {
            let chain = noted_chain(&given, base, tip)?;
            Ok((given, chain))
        }
        (None, None) => Err(Error::new(Code::OptionMissing, "--urdf", "is missing", "give the URDF of the robot")),
    }
}

/// That of the result, where the one that is given is of an arm of its cell.
fn description_of_cell(record: &SolutionRecord, given: &RobotDescription) -> Result<RobotDescription> {
    let arm = given.chain(None, None)?;
    let is_there = |name: &String| record.robot.readings.iter().any(|own| own == name);
    if let Some(other) = arm.readings.iter().find(|name| !is_there(name)) {
        return Err(Error::new(
            Code::SolutionDiffers,
            "--urdf",
            format!("has the joint \"{other}\", and neither base nor tip of the result: it is of another robot"),
            "give the URDF that the result was identified with, or none",
        ));
    }
    say_line!("robot     of the cell as the result has it: the URDF that was given is of one arm of it");
    restore::robot_description(record)
}

/// Says from which noise further images are planned: that of the result.
fn noise_word(request: &PlanRequest) -> Option<String> {
    let setting = &request.setting;
    let range = setting.joint_sigma.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), s| (l.min(*s), h.max(*s)));
    (!request.taken.is_empty()).then(|| {
        format!(
            "planned on top of {} images, with the noise found in them: joints {:.4} to {:.4} mrad (or mm), images {:.4} px",
            images_of(&request.taken),
            1e3 * range.0,
            1e3 * range.1,
            setting.pixel_sigma_px
        )
    })
}

/// A place for a plate before the robot in the base frame, so many lengths of its arm from its foot and above it, tilted towards it.
fn before_robot(chain: &Chain, far: f64, high: f64, tilt_deg: f64) -> Pose {
    let arm = chain.arm_length_m();
    let place = Pose::from_xyz_rpy([far * arm, 0.0, high * arm], [0.0, -tilt_deg.to_radians(), 0.0]);
    chain.base_from_foot().map_or(place, |foot| foot * place)
}

/// Candidates when places are compared before the plan.
const TRIAL_CANDIDATES: usize = 600;

/// Where the user names no place for the plate, several are compared and the best is taken; says so in words.
fn settle_place(args: &PlanArgs, request: &mut PlanRequest) -> Result<Vec<String>> {
    let free = args.plate_pose.is_empty() && args.from.is_none() && request.setting.mount == CameraMount::Hand;
    if !free {
        return Ok(Vec::new());
    }
    let chain = &request.setting.robot.chain;
    let arm = chain.arm_length_m();
    let of = chain.base_from_foot().map_or("", |_| " in the frame of the foot of the robot");
    let place = |name: &str, far: f64, high: f64, tilt_deg: f64| {
        let pose = before_robot(chain, far, high, tilt_deg);
        (format!("{name} (x {:.2} m, z {:.2} m{of}, tilted {tilt_deg:.0} degrees)", far * arm, high * arm), pose)
    };
    let places = vec![
        place("near", 0.4, 0.0, 0.0),
        place("middle", 0.5, 0.0, 0.0),
        place("far", 0.65, 0.0, 0.0),
        place("raised", 0.5, 0.3, 30.0),
    ];
    request.setting.placements = places;
    let mut trial = request.clone();
    trial.candidates.count = TRIAL_CANDIDATES.max(8 * trial.count);
    trial.budget = Budget::default();
    trial.rounds = 0;
    let places = compare_places(&trial, &choose(&trial)?)?;
    let error = |p: &&PlaceForecast| p.flange_m.unwrap_or(f64::INFINITY);
    let best = places.iter().min_by(|a, b| error(a).total_cmp(&error(b))).map_or(0, |p| p.placement);
    let mut words = vec![format!("no --plate-pose was given: the plate is planned {}", places[best].name)];
    words.extend(place_words(&places));
    request.setting.placements = vec![("placement_0".to_owned(), request.setting.placements[best].1)];
    Ok(words)
}

/// Images planned and drawn in a study.
const STUDIED: [usize; 2] = [30, 60];
/// File of their report.
const STUDY: &str = "study.md";

fn study(args: &PlanArgs, seeds: u64) -> Result<Verdict> {
    let place = ResultFolder::among(&args.out)?.for_files(&[STUDY])?;
    let chain = read_chain(args.urdf(), args.base.as_deref(), args.tip.as_deref())?;
    let robot = chain.robot.clone();
    let [planned, random] = STUDIED;
    let request = PlanStudyRequest {
        chain,
        mount: args.mount.into(),
        first: args.seed,
        seeds,
        planned,
        random,
        candidates: args.candidates,
        rounds: args.rounds,
    };
    let study = plan_study(&request, |seed| tracing::info!("world {seed} done"))?;
    let text = crate::study::study_table(&robot, &request, &study);
    place.write_beside(&[(STUDY.to_owned(), text.as_bytes())], &[args.urdf().to_path_buf()])?;
    say!("{text}");
    Ok(Verdict::Good)
}

fn check(args: &PlanArgs) -> Result<()> {
    let positive = [
        ("--pixel-noise-px", args.pixel_noise_px),
        ("--camera-fov-deg", args.camera_fov_deg),
        ("--distance-m", args.distance_m[0]),
        ("--tilt-deg", args.tilt_deg),
    ];
    if let Some((flag, value)) = positive.iter().find(|(_, v)| !(*v > 0.0 && v.is_finite())) {
        return Err(Error::new(Code::OptionRange, flag, format!("is {value}"), "give a positive number"));
    }
    if args.distance_m[1] < args.distance_m[0] {
        return Err(Error::new(
            Code::OptionRange,
            "--distance-m",
            "the farthest is nearer than the nearest",
            "give NEARxFAR",
        ));
    }
    if args.tilt_deg >= 85.0 || args.camera_fov_deg >= 170.0 {
        return Err(Error::new(
            Code::OptionRange,
            "--tilt-deg, --camera-fov-deg",
            "too large",
            "give less than 85 and 170 degrees",
        ));
    }
    if args.count == 0 {
        return Err(Error::new(Code::OptionRange, "--count", "is 0", "ask for one image at least"));
    }
    Ok(())
}

fn request(args: &PlanArgs, record: Option<&SolutionRecord>, chain: Chain) -> Result<PlanRequest> {
    let demand = demand(args, &chain)?;
    let (setting, taken) = setting(args, record, chain)?;
    let boxes = args.r#box.iter().map(|text| {
        let v = numbers("--box", text, 6, "give middle and edges: x,y,z,a,b,c in m")?;
        let half_m = Vector3::new(v[3], v[4], v[5]) / 2.0;
        Ok(OrientedBox { pose: Pose::from_xyz_rpy([v[0], v[1], v[2]], [0.0; 3]), half_m })
    });
    let tilt_rad = args.tilt_deg.to_radians();
    Ok(PlanRequest {
        taken,
        count: args.count,
        demand,
        budget: Budget {
            most_per_placement: args.per_placement,
            least_per_placement: None,
            most_per_posture: args.per_posture,
            travel_rad: args.travel_rad,
        },
        candidates: CandidateOptions {
            count: args.candidates.max(args.count),
            views: ViewRange {
                near_m: args.distance_m[0],
                far_m: args.distance_m[1],
                tilt_rad,
                ..ViewRange::default()
            },
            sight: VisibilityLimits {
                least_markers: args.markers,
                incidence_rad: (tilt_rad + 0.35).min(1.4),
                focus_m: args.focus_m.map_or((0.0, f64::INFINITY), |[a, b]| (a, b)),
            },
            seed: args.seed,
            ..CandidateOptions::default()
        },
        rounds: args.rounds,
        scene: SceneOptions {
            link_radius_m: args.link_radius_mm.map(|mm| mm / 1e3),
            camera_radius_m: args.camera_radius_mm / 1e3,
            clearance_m: args.clearance_mm / 1e3,
            table_z_m: args.table_z_m,
            boxes: boxes.collect::<Result<_>>()?,
            described: Vec::new(),
        },
        setting,
    })
}

fn demand(args: &PlanArgs, chain: &Chain) -> Result<Demand> {
    if let Some(targets) = args.targets.telling(chain)? {
        return Ok(Demand::Targets(targets));
    }
    Ok(match (args.d_optimal, args.parameters.is_empty()) {
        (true, _) => Demand::Parameters,
        (_, false) => Demand::Named(args.parameters.clone()),
        _ => Demand::Workspace,
    })
}

fn setting(args: &PlanArgs, record: Option<&SolutionRecord>, chain: Chain) -> Result<(Setting, Vec<PlannedStop>)> {
    let asked: Option<RobotModel> = args.robot_model.map(Into::into);
    match record {
        Some(record) => setting_of_solution(args, record, chain, asked),
        None => Ok((setting_of_flags(args, asked.unwrap_or(RobotModel::Rigid).robot(chain))?, Vec::new())),
    }
}

/// Setting and stops of a solution that further images are planned for.
fn setting_of_solution(
    args: &PlanArgs,
    record: &SolutionRecord,
    chain: Chain,
    asked: Option<RobotModel>,
) -> Result<(Setting, Vec<PlannedStop>)> {
    if entered_offsets(record)?.iter().any(|offset| *offset != 0.0) {
        say_line!(
            "readings  the joint values are those of the controller before the offsets of mastering.csv were entered, as those of the images before"
        );
    }
    let model = asked.unwrap_or_else(|| plan_start::model_of(record, &chain));
    let (mut setting, taken) = plan_start::from_solution(record, chain, model)?;
    let others = record.images.iter().filter(|i| i.is_used_on_robot()).count() - images_of(&taken);
    if others > 0 {
        say_line!(
            "images    {others} of other plates than that of the first image are not counted: the accuracy before and after is that without them"
        );
    }
    let new = args.plate_pose.iter().enumerate();
    let new = new.map(|(k, text)| Ok((format!("new_{k}"), pose_or_file("--plate-pose", text)?)));
    let taken = setting.with_further_placements(new.collect::<Result<_>>()?, taken);
    Ok((setting, taken))
}

fn setting_of_flags(args: &PlanArgs, robot: Robot) -> Result<Setting> {
    let plate = args
        .plate
        .as_ref()
        .ok_or_else(|| Error::new(Code::OptionMissing, "--plate", "is missing", "give plate.toml"))?;
    let plate = read_plate(plate, &mut Vec::new())?;
    let mount: CameraMount = args.mount.into();
    let joint_sigma = robot.chain.reading_kinds.iter().map(|kind| {
        let rad = args.joint_noise_mrad / 1e3;
        if *kind == JointKind::Prismatic { 0.1 * rad } else { rad }
    });
    Ok(Setting {
        joint_sigma: joint_sigma.collect(),
        mounting: mounting(args, mount)?,
        placements: placements(args, mount, &robot)?,
        camera: camera(args)?,
        mount,
        plate,
        pixel_sigma_px: args.pixel_noise_px,
        robot,
        beside: Beside::default(),
    })
}

/// Where the camera is on the tip, or stands in the base.
fn mounting(args: &PlanArgs, mount: CameraMount) -> Result<Pose> {
    match (&args.hand_camera, mount) {
        (Some(text), _) => pose_or_file("--hand-camera", text),
        (None, CameraMount::Hand) => Ok(Pose::from_xyz_rpy([0.0, 0.0, 0.08], [0.0; 3])),
        (None, CameraMount::Fixed) => {
            let remedy = "say where the fixed camera stands in the base frame";
            Err(Error::new(Code::OptionMissing, "--hand-camera", "is missing", remedy))
        }
    }
}

/// Where the plate stands in the base, or is on the tip; by default in the reach of the camera.
fn placements(args: &PlanArgs, mount: CameraMount, robot: &Robot) -> Result<Vec<(String, Pose)>> {
    if args.plate_pose.is_empty() {
        let place = match mount {
            CameraMount::Hand => before_robot(&robot.chain, 0.5, 0.0, 0.0),
            CameraMount::Fixed => Pose::from_xyz_rpy([0.0, 0.0, 0.05], [0.0; 3]),
        };
        return Ok(vec![("placement_0".to_owned(), place)]);
    }
    let given = args.plate_pose.iter().enumerate();
    given.map(|(k, text)| Ok((format!("placement_{k}"), pose_or_file("--plate-pose", text)?))).collect()
}

fn camera(args: &PlanArgs) -> Result<Camera> {
    match &args.camera {
        Some(path) => read_camera_file(path, None).map(|read| read.camera),
        None => Ok(typical_camera(args.image[0], args.image[1], args.camera_fov_deg.to_radians())),
    }
}

/// Poses whose gain is said on the terminal.
const GAINS_SHOWN: usize = 10;

fn gain_text(g: &Gain) -> String {
    format!(
        "helps     {} by itself: flange {:.4} -> {:.4} mm, {:.4} mm better; most by {}: sigma {} -> {}\n",
        image_name(g.leg),
        1e3 * g.flange_m[0],
        1e3 * g.flange_m[1],
        1e3 * g.gain_m(),
        g.parameter,
        sigma_text(g.sigma[0], g.unit),
        sigma_text(g.sigma[1], g.unit),
    )
}

fn summary(
    request: &PlanRequest,
    plan: &Plan,
    forecast: &Forecast,
    files: &BTreeMap<String, Vec<u8>>,
    folder: &Path,
) -> String {
    let mut text = format!(
        "plan      {} images of {} candidates, {} of them searched near the best ({} views tried)\n\
         certified {:.1} % of the best weights, {:.1} % after rounding\n\
         flange    {:.3} mm before, {:.3} mm expected (RMS over {} joint vectors, with\n\
         {:10}base frame and a point of the flange fitted, as frames by touches\n\
         {:10}do; identify states it relative to the plate, which is more)\n",
        plan.legs.len(),
        plan.pool.len(),
        plan.pool.len() - plan.drawn,
        plan.tally.views,
        1e2 * plan.efficiency[0],
        1e2 * plan.efficiency[1],
        1e3 * forecast.before_m,
        1e3 * forecast.flange_m,
        plan.targets.len(),
        "",
        ""
    );
    for point in &forecast.curve {
        let [planned_mm, random_mm] = [point.planned_m, point.random_m].map(|m| 1e3 * m);
        text += &format!("          {:4} images: {planned_mm:.3} mm ({random_mm:.3} mm at random)\n", point.images);
    }
    let taught = plan.legs.iter().filter(|l| !l.is_free).count();
    if taught > 0 {
        text += &format!(
            "ways      {taught} without a free straight way were found: the programs stop before them (the ROS trajectory lists them under pauses); teach a posture in between (plan.json)\n"
        );
    }
    let worst = plan.imbalance.iter().copied().fold(0.0, f64::max);
    text += &format!("approach  every joint from both sides (one-sidedness at most {:.0} %)\n", 1e2 * worst);
    for line in &forecast.words {
        text += &format!("remark    {line}\n");
    }
    if !request.taken.is_empty() {
        forecast.gains.iter().take(GAINS_SHOWN).for_each(|gain| text += &gain_text(gain));
    }
    let names: Vec<&str> = files.keys().map(String::as_str).collect();
    text += &format!("written   {}: {}\n", folder.display(), names.join(", "));
    text
}
