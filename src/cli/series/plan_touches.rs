//! `robotcal plan --touch`: which points to touch, and with which joint values, to find tool and work object.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::Vector3;

use super::plan_targets::TargetArgs;
use crate::assess::Limits;
use crate::cli::Verdict;
use crate::cli::flags::pose_argument::pose;
use crate::cli::results::show::read_solution;
use crate::cli::terminal::say::{say, say_line};
use crate::error::{Code, Error, Result, plain_name};
use crate::frames::{KnownRobot, PlannedTouch, TouchPlan, TouchRequest, plan_touches};
use crate::geom::Pose;
use crate::model::robot::Posture;
use crate::output::restore::{entered_offsets, exported_model};
use crate::output::touch_plan::{TouchStop, touch_files};
use crate::output::{ResultFolder, plan_files};
use crate::series::{AngleUnit, CameraMount, ContactSection, Manifest, Row, Table};
use crate::urdf::{Chain, JointKind};

/// Flags of `plan` for touches.
#[derive(Debug, Args)]
#[command(next_help_heading = "Touches (with --from)")]
pub(super) struct TouchArgs {
    /// Plan touches instead of images: points of the work object (CSV: name,x_m,y_m,z_m), for `robotcal frames`
    #[arg(long, value_name = "FILE", requires_all = ["from", "touch_work"])]
    pub touch: Option<PathBuf>,
    /// Work object in the base, roughly: x,y,z[,roll,pitch,yaw] in m and degrees
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', allow_hyphen_values = true, requires = "touch")]
    touch_work: Vec<f64>,
    /// Tool on the tip, roughly: x,y,z[,roll,pitch,yaw] in m and degrees [default: the tip]
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', allow_hyphen_values = true, requires = "touch")]
    touch_tool: Vec<f64>,
    /// Name of the work object
    #[arg(long, value_name = "NAME", default_value = "work")]
    touch_frame: String,
    /// Sigma of a touch per axis, mm
    #[arg(long, value_name = "MM", default_value_t = 0.05)]
    touch_sigma_mm: f64,
    /// Largest tilt of the tool's z axis from straight down on the work object, degrees
    #[arg(long, value_name = "DEG", default_value_t = 45.0)]
    touch_tilt_deg: f64,
}

/// Postures that are tried at each point.
const TRIES: usize = 60;

/// Plans the touches.
pub(super) fn run(
    args: &TouchArgs,
    points: &Path,
    from: &Path,
    targets: &TargetArgs,
    count: usize,
    out: &Path,
) -> Result<Verdict> {
    let place = ResultFolder::claim(out, plan_files::FILE_NAME)?;
    let record = read_solution(from)?;
    let found = exported_model(&record)?;
    let robot = found.known_robot(None)?;
    let chain = &robot.exported().chain;
    let wanted = targets.read(chain)?.unwrap_or_default();
    let request = request(args, read_points(points, &found.limits)?, &wanted, count)?;
    plain_name("frame", &args.touch_frame, "--touch-frame")?;
    let fewest = found.limits.fewest_touches;
    if count < fewest {
        let what = format!("{count} touches");
        return Err(Error::new(Code::OptionRange, "--count", what, format!("plan {fewest} or more")));
    }
    let TouchPlan { touches: planned, unreached } = plan_touches(&robot, &request, &found.limits)?;
    let files = [
        ("series.toml", manifest(args, chain)?),
        ("joints.csv", joints(&planned, chain)),
        ("contacts.csv", contacts(&planned, &request)),
    ];
    let files = files.map(|(name, text)| (name.to_owned(), text.into_bytes()));
    let stops: Vec<TouchStop> =
        planned.iter().enumerate().map(|(k, t)| TouchStop { stop: stop(k), readings: t.readings.clone() }).collect();
    place.write_all(&touch_files(files.into(), (&chain.readings, &stops), &crate::cli::command_text())?)?;
    say!("{}", text(&planned, (&request, fewest), &robot, out));
    if entered_offsets(&record)?.iter().any(|offset| *offset != 0.0) {
        say_line!("readings  the joint values are those of the controller with the offsets of mastering.csv entered");
    }
    if !unreached.is_empty() {
        let names: Vec<&str> = unreached.iter().map(|k| request.points[*k].0.as_str()).collect();
        say_line!(
            "note      no posture touches {}: out of reach, or further tilted than --touch-tilt-deg",
            names.join(", ")
        );
    }
    Ok(Verdict::Good)
}

fn request(
    args: &TouchArgs,
    points: Vec<(String, Vector3<f64>)>,
    targets: &[Vec<f64>],
    count: usize,
) -> Result<TouchRequest> {
    let positive = |flag: &str, value: f64, most: f64| match value > 0.0 && value <= most {
        true => Ok(value),
        false => {
            Err(Error::new(Code::OptionRange, flag, format!("{value}"), format!("give a number between 0 and {most}")))
        }
    };
    Ok(TouchRequest {
        points,
        tool: pose("--touch-tool", &args.touch_tool)?.unwrap_or_else(Pose::identity),
        work: pose("--touch-work", &args.touch_work)?.unwrap_or_else(Pose::identity),
        count,
        sigma_m: 1e-3 * positive("--touch-sigma-mm", args.touch_sigma_mm, 10.0)?,
        tilt_rad: positive("--touch-tilt-deg", args.touch_tilt_deg, 90.0)?.to_radians(),
        targets: targets.iter().map(|q| Posture::at(q)).collect(),
        tries: TRIES,
    })
}

/// Points of a work object.
fn read_points(path: &Path, limits: &Limits) -> Result<Vec<(String, Vector3<f64>)>> {
    let table = Table::read(path, &mut Vec::new())?;
    let name = table.require("name")?;
    let columns = [table.require("x_m")?, table.require("y_m")?, table.require("z_m")?];
    let point = |row: Row<'_>| {
        let [x, y, z] = columns.map(|c| table.number(row, c));
        let at = Vector3::new(x?, y?, z?);
        if at.amax() > limits.touches_apart_m {
            let what = format!("a point at ({}, {}, {}) m", at.x, at.y, at.z);
            return Err(Error::new(Code::TouchUnit, table.place(row), what, "write metres, not mm"));
        }
        Ok((row.cell(name).to_owned(), at))
    };
    let points = table.rows().map(point).collect::<Result<Vec<_>>>()?;
    let refuse = |code, what: String, remedy: &str| Err(Error::new(code, table.place_of_header(), what, remedy));
    match points.len() {
        0 => refuse(Code::FileEmpty, "has no points".into(), "write one row a point"),
        few if few < limits.fewest_places => {
            let remedy = format!("a work object takes {} or more that are not on a line", limits.fewest_places);
            refuse(Code::TouchesFew, format!("has {few} points"), &remedy)
        }
        _ => Ok(points),
    }
}

fn manifest(args: &TouchArgs, chain: &Chain) -> Result<String> {
    let manifest = Manifest {
        joint_unit: Some(AngleUnit::Deg),
        base: Some(chain.base.clone()),
        tip: Some(chain.tip.clone()),
        camera_mount: None,
        plate: None,
        contact: Some(ContactSection {
            sigma_m: Some(1e-3 * args.touch_sigma_mm),
            frame: Some(args.touch_frame.clone()),
        }),
        ..Manifest::plain(CameraMount::Hand, "")
    };
    let head = "# Planned touches: replace the joint values by those at which the tool touches the point.\n";
    Ok(head.to_owned() + &manifest.to_toml()?)
}

fn stop(k: usize) -> String {
    format!("touch_{:02}", k + 1)
}

/// Readings as joints.csv has them.
fn shown(readings: &[f64], chain: &Chain) -> Vec<String> {
    let one = |(q, kind): (f64, &JointKind)| match kind {
        JointKind::Prismatic => format!("{q:.6}"),
        _ => format!("{q:.4}"),
    };
    plan_files::written(readings, &chain.reading_kinds).into_iter().zip(&chain.reading_kinds).map(one).collect()
}

fn joints(planned: &[PlannedTouch], chain: &Chain) -> String {
    let rows =
        planned.iter().enumerate().map(|(k, t)| format!("{},{}\n", stop(k), shown(&t.readings, chain).join(",")));
    format!("stop,{}\n", chain.readings.join(",")) + &rows.collect::<String>()
}

fn contacts(planned: &[PlannedTouch], request: &TouchRequest) -> String {
    let row = |(k, t): (usize, &PlannedTouch)| {
        let (name, p) = &request.points[t.point];
        format!("{},{name},{},{},{}\n", stop(k), p.x, p.y, p.z)
    };
    "stop,contact,x_m,y_m,z_m\n".to_owned() + &planned.iter().enumerate().map(row).collect::<String>()
}

fn text(planned: &[PlannedTouch], (request, fewest): (&TouchRequest, usize), robot: &KnownRobot, out: &Path) -> String {
    let chain = &robot.exported().chain;
    let mut text = String::new();
    let of = if request.targets.is_empty() {
        "over the stops of the solution".to_owned()
    } else {
        format!("at {} targets", request.targets.len())
    };
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "touches   {} of {} points, in the order in which they tell most",
        planned.len(),
        request.points.len()
    );
    let _ = writeln!(text, "{:>10}  {:<12} {:>12}  joints, deg (m)", "stop", "point", "expected mm");
    for (k, t) in planned.iter().enumerate() {
        // Fewer do not determine tool and work object.
        let expected = if k + 1 < fewest { "-".to_owned() } else { format!("{:.3}", 1e3 * t.expected_m) };
        let joints = shown(&t.readings, chain).join(", ");
        let _ = writeln!(text, "{:>10}  {:<12} {expected:>12}  {joints}", stop(k), request.points[t.point].0);
    }
    if let Some(last) = planned.last() {
        let _ = writeln!(
            text,
            "expected  tool in the work object {:.3} mm RMS {of} with all of them; joint noise of an arrival comes on top",
            1e3 * last.expected_m
        );
    }
    let _ = writeln!(text, "note      collisions are not looked at: approach by hand");
    let _ = writeln!(
        text,
        "results   {} (series.toml, joints.csv, contacts.csv, plan.json): write the joint values of each touch into joints.csv, then robotcal frames --touches",
        out.display()
    );
    text
}
