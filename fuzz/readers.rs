//! Every reader from bytes: the entry points of the fuzz targets and of the corpus in tests/.

use std::path::Path;

use robotcal::detect::load_bytes;
use robotcal::geom::Pose;
use robotcal::identify::RobotModel;
use robotcal::output::{parse_compensation, plan_start, restore, solution_json};
use robotcal::programs::{self, Language, TextFile};
use robotcal::series::{
    Manifest, Plate, PlateKind, RecordingOptions, RotationKind, Stops, extract, parse_controller, parse_observations,
    parse_plate,
};
use robotcal::urdf::{Chain, RobotDescription, patch_origins};

const ROBOT: &str = "<robot name='r'><link name='a'/><link name='b'/><link name='c'/><link name='d'/><link name='e'/>\
    <link name='f'/><link name='g'/>\
    <joint name='1' type='revolute'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/></joint>\
    <joint name='2' type='revolute'><parent link='b'/><child link='c'/><origin xyz='0 0 1'/><axis xyz='0 1 0'/></joint>\
    <joint name='3' type='revolute'><parent link='c'/><child link='d'/><origin xyz='0 0 1'/><axis xyz='0 1 0'/></joint>\
    <joint name='4' type='revolute'><parent link='d'/><child link='e'/><origin xyz='1 0 0'/><axis xyz='1 0 0'/></joint>\
    <joint name='5' type='revolute'><parent link='e'/><child link='f'/><axis xyz='0 1 0'/></joint>\
    <joint name='6' type='revolute'><parent link='f'/><child link='g'/><axis xyz='1 0 0'/></joint></robot>";

fn chain() -> Chain {
    let robot = RobotDescription::from_text(Path::new("robot.urdf"), ROBOT.into());
    robot.and_then(|r| r.chain(None, None)).unwrap_or_else(|_| Chain::empty())
}

/// Names of the readers: those of the targets and of the folders of the corpus.
pub const NAMES: [&str; 14] = [
    "urdf",
    "series",
    "joints",
    "controller",
    "plate",
    "observations",
    "solution",
    "compensation",
    "mcap",
    "image",
    "krl",
    "rapid",
    "urscript",
    "points",
];

/// Gives bytes to the reader of that name; the answer does not matter, but there is one.
pub fn read(name: &str, bytes: &[u8]) {
    let text = || String::from_utf8_lossy(bytes).into_owned();
    let path = Path::new(name);
    match name {
        "urdf" => urdf(&text()),
        "series" => drop(Manifest::parse(path, &text())),
        "joints" => drop(Stops::parse(path, &text())),
        "controller" => {
            for kind in RotationKind::ALL {
                drop(parse_controller(path, &text(), kind));
            }
        }
        "plate" => {
            // plate.toml, then the marker file behind a line of its own.
            let text = text();
            let (toml, csv) = text.split_once("\n---\n").unwrap_or((&text, ""));
            drop(parse_plate(path, toml, csv));
        }
        "observations" => {
            let plate = Plate::lattice(PlateKind::CircleGrid, 4, 3, 0.01, 1e-4);
            drop(parse_observations(path, &text(), &plate, Some((640, 480))));
        }
        "solution" => solution(bytes),
        "compensation" => drop(parse_compensation(path, &text(), chain())),
        "mcap" => recording(bytes),
        "image" => drop(load_bytes(path, bytes, None)),
        "krl" => program(Language::Krl, bytes),
        "rapid" => program(Language::Rapid, bytes),
        "urscript" => program(Language::UrScript, bytes),
        _ => program(Language::Csv, bytes),
    }
}

fn urdf(text: &str) {
    let Ok(robot) = RobotDescription::from_text(Path::new("robot.urdf"), text.into()) else { return };
    let Ok(chain) = robot.chain(None, None) else { return };
    drop(robot.carried_capsules(&chain));
    let new = chain.joints.iter().map(|j| (j.name.clone(), Pose::from_xyz_rpy([0.1, 0.2, 0.3], [0.1, 0.2, 0.3])));
    drop(patch_origins(text, &new.collect()));
}

fn solution(bytes: &[u8]) {
    let Ok(record) = solution_json::read(bytes) else { return };
    drop(restore::measured_series(&record));
    drop(restore::found_model(&record));
    drop(robotcal::cli::summary_of(&record));
    let robot = restore::robot_description(&record);
    if let Ok(chain) = robot.and_then(|r| restore::chain(&record, &r, &record.robot.base, &record.robot.tip)) {
        drop(plan_start::from_solution(&record, chain, RobotModel::Rigid));
    }
}

fn recording(bytes: &[u8]) {
    let memory = Path::new("/dev/shm");
    let folder = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
    let folder = folder.join(format!("robotcal-reader-{}", std::process::id()));
    let file = folder.join("run.mcap");
    if std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&file, bytes)).is_ok() {
        drop(extract(&file, &folder.join("images"), &RecordingOptions::default()));
    }
    drop(std::fs::remove_dir_all(folder));
}

fn program(language: Language, bytes: &[u8]) {
    let chain = chain();
    let axes: Vec<usize> = (0..chain.readings.len()).collect();
    let setting = programs::ProgramSetting {
        chain: &chain,
        axes: &axes,
        rad_per_unit: Some(1.0),
        base: Pose::identity(),
        tool: None,
        work: None,
        axes_apart: false,
    };
    let file = TextFile { name: "program".into(), bytes: bytes.to_vec() };
    drop(programs::read(language, vec![file], &setting));
}
