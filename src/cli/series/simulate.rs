//! `robotcal simulate`: a series of a robot with known errors, with images or with observations.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use crate::cli::Verdict;
use crate::cli::flags::camera_args::lens;
use crate::cli::flags::joint_table::Unit;
use crate::cli::flags::robot::read_chain;
use crate::cli::terminal::progress;
use crate::cli::terminal::say::{say, say_line};
use crate::error::{Code, Error, Result};
use crate::output::NewFolder;
use crate::plan::plate_design::{PlateRequest, design};
use crate::plan::viewpoint::ViewRange;
use crate::series::{CameraMount, Edge, Plate, read_plate};
use crate::simulate::conditions::ImagingConditions;
use crate::simulate::faults::{FAULTS, Fault};
use crate::simulate::folder::{Content, write};
use crate::simulate::{RobotErrors, SimulatedSeries, WorldRequest, lens_camera, series};

/// Flags of `simulate`.
#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// Robot description (URDF); its errors are put on top
    #[arg(long, value_name = "FILE")]
    urdf: PathBuf,
    /// New folder for the series
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Base link
    #[arg(long, value_name = "LINK", help_heading = "Robot")]
    base: Option<String>,
    /// Tip link
    #[arg(long, value_name = "LINK", help_heading = "Robot")]
    tip: Option<String>,
    /// Plate [default: the 504-marker plate of `robotcal plate`]
    #[arg(long, value_name = "FILE", help_heading = "Camera and plate")]
    plate: Option<PathBuf>,
    /// Where the camera is
    #[arg(long, value_enum, default_value_t = Mount::Hand, help_heading = "Camera and plate")]
    mount: Mount,
    /// Lens: brown, fisheye, parallax, rational, thin_prism, brown+field or fisheye+field
    #[arg(long, default_value = "brown", help_heading = "Camera and plate")]
    lens: String,
    /// Number of stops
    #[arg(long, default_value_t = 50)]
    images: usize,
    /// Number of places where the plate stands
    #[arg(long, default_value_t = 1)]
    placements: usize,
    /// Write observations.csv instead of images
    #[arg(long)]
    observations: bool,
    /// Observations of outer edges only
    #[arg(long, requires = "observations")]
    outer_only: bool,
    /// Unit of joints.csv
    #[arg(long, value_enum, default_value_t = Unit::Deg)]
    joint_unit: Unit,
    /// Errors of the robot (sigma): origins by 0.3 mm and 1 mrad, offsets of 3 mrad; full: gear, sag, backlash, too
    #[arg(long, value_enum, default_value_t = Errors::Rigid, help_heading = "Robot")]
    errors: Errors,
    /// Joint noise (sigma), mrad
    #[arg(long, value_name = "MRAD", default_value_t = 0.02, help_heading = "Robot")]
    joint_noise_mrad: f64,
    /// Noise of the observations (sigma per axis), px; images have that of their sensor
    #[arg(long, value_name = "PX", default_value_t = 0.02, help_heading = "Camera and plate")]
    pixel_noise_px: f64,
    /// Errors of the markers (sigma per axis), mm
    #[arg(long, value_name = "MM", default_value_t = 0.03, help_heading = "Camera and plate")]
    marker_noise_mm: f64,
    /// Columns of the images
    #[arg(long, default_value_t = 1280, help_heading = "Camera and plate")]
    width_px: u32,
    /// Rows of the images
    #[arg(long, default_value_t = 1024, help_heading = "Camera and plate")]
    height_px: u32,
    /// Horizontal field of view, degrees
    #[arg(long, default_value_t = 60.0, help_heading = "Camera and plate")]
    field_deg: f64,
    /// Nearest view, m
    #[arg(long, default_value_t = 0.12, help_heading = "Camera and plate")]
    near_m: f64,
    /// Farthest view, m
    #[arg(long, default_value_t = 0.6, help_heading = "Camera and plate")]
    far_m: f64,
    /// Largest tilt, degrees
    #[arg(long, default_value_t = 50.0, help_heading = "Camera and plate")]
    tilt_deg: f64,
    /// Markers that every view shows at least
    #[arg(long, default_value_t = 20, help_heading = "Camera and plate")]
    least_markers: usize,
    /// Joint vectors kept aside in truth.toml
    #[arg(long, default_value_t = 100)]
    held_out: usize,
    /// Light, blur, sensor and surroundings of the images (TOML, any of the fields of ImagingConditions)
    #[arg(long, value_name = "FILE")]
    conditions: Option<PathBuf>,
    /// Bits per pixel: 8, 10, 12 or 16 (overrides the conditions)
    #[arg(long)]
    bits: Option<u8>,
    /// Put one thing wrong (a name, or "list")
    #[arg(long, value_name = "NAME")]
    fault: Option<String>,
    /// Seed of everything
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Mount {
    Hand,
    Fixed,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Errors {
    None,
    Rigid,
    Full,
}

impl From<Mount> for CameraMount {
    fn from(mount: Mount) -> Self {
        match mount {
            Mount::Hand => Self::Hand,
            Mount::Fixed => Self::Fixed,
        }
    }
}

impl From<Errors> for RobotErrors {
    fn from(errors: Errors) -> Self {
        match errors {
            Errors::None => Self::NONE,
            Errors::Rigid => Self::default(),
            Errors::Full => Self::full(),
        }
    }
}

pub fn run(args: &SimulateArgs) -> Result<Verdict> {
    let fault = match args.fault.as_deref() {
        Some("list") => {
            FAULTS.iter().for_each(|e| say_line!("{}", e.name));
            return Ok(Verdict::Good);
        }
        name => name.map(named_fault).transpose()?,
    };
    let new = NewFolder::begin(&args.out)?;
    let conditions = conditions(args)?;
    let mut made = series(&request(args)?)?;
    if args.outer_only {
        made.observations.iter_mut().for_each(|i| i.observations.retain(|o| o.edge == Edge::Outer));
    }
    if let Some(fault) = fault {
        if args.observations && fault.expectation().needs_images {
            let place = format!("--fault {}", fault.expectation().name);
            return Err(Error::new(Code::OptionConflict, place, "shows in images only", "leave --observations out"));
        }
        fault.apply(&mut made)?;
        if args.outer_only {
            made.observations.iter_mut().for_each(|i| i.observations.retain(|o| o.edge == Edge::Outer));
        }
    }
    save(args, new.path(), &made, &conditions)?;
    if let Some(fault) = fault {
        fault.apply_to_folder(new.path())?;
    }
    new.finish()?;
    say!("{}", summary(&made, &args.out));
    Ok(Verdict::Good)
}

fn named_fault(name: &str) -> Result<Fault> {
    Fault::from_name(name).ok_or_else(|| {
        let known = crate::error::closest_name(name, FAULTS.iter().map(|e| e.name));
        let remedy = known.map_or_else(|| "--fault list shows all".to_owned(), |k| format!("is \"{k}\" meant?"));
        Error::new(Code::FaultUnknown, "--fault", format!("there is no fault \"{name}\""), remedy)
    })
}

fn conditions(args: &SimulateArgs) -> Result<ImagingConditions> {
    let mut conditions = match &args.conditions {
        None => ImagingConditions::default(),
        Some(path) => {
            let text = crate::files::read_text(path, crate::files::FileKind::Settings)?;
            toml::from_str(&text).map_err(|e| {
                Error::new(
                    Code::SettingSyntax,
                    path.display(),
                    e.message(),
                    "see the fields of ImagingConditions in the manual",
                )
            })?
        }
    };
    conditions.bits = args.bits.unwrap_or(conditions.bits);
    if ![8, 10, 12, 16].contains(&conditions.bits) {
        return Err(Error::new(Code::OptionRange, "--bits", conditions.bits, "give 8, 10, 12 or 16"));
    }
    Ok(conditions)
}

fn check_ranges(args: &SimulateArgs) -> Result<()> {
    let sane = args.near_m > 0.0
        && args.far_m >= args.near_m
        && (0.0..85.0).contains(&args.tilt_deg)
        && (5.0..140.0).contains(&args.field_deg)
        && args.width_px >= 64
        && args.height_px >= 64;
    if !sane {
        let remedy = "near-m > 0, far-m >= near-m, tilt below 85 degrees, field of 5 to 140 degrees, at least 64x64 px";
        return Err(Error::new(Code::OptionRange, "simulate", "the camera or its views cannot be", remedy));
    }
    let noises = [(args.joint_noise_mrad, 100.0), (args.pixel_noise_px, 100.0), (args.marker_noise_mm, 100.0)];
    if !noises.iter().all(|(noise, most)| (0.0..=*most).contains(noise)) || args.images == 0 || args.placements == 0 {
        let what = "the noise or the number of stops or placements cannot be";
        let remedy = "a stop and a placement at least; noise from 0 to 100 mrad, px and mm";
        return Err(Error::new(Code::OptionRange, "simulate", what, remedy));
    }
    Ok(())
}

fn request(args: &SimulateArgs) -> Result<WorldRequest> {
    check_ranges(args)?;
    let chain = read_chain(&args.urdf, args.base.as_deref(), args.tip.as_deref())?;
    Ok(WorldRequest {
        camera: lens_camera(lens(&args.lens)?, args.width_px, args.height_px, args.field_deg.to_radians()),
        mount: args.mount.into(),
        images: args.images,
        placements: args.placements,
        errors: args.errors.into(),
        joint_noise_rad: args.joint_noise_mrad / 1e3,
        pixel_sigma_px: args.pixel_noise_px,
        marker_sigma_m: args.marker_noise_mm / 1e3,
        views: ViewRange {
            near_m: args.near_m,
            far_m: args.far_m,
            tilt_rad: args.tilt_deg.to_radians(),
            ..ViewRange::default()
        },
        least_markers: args.least_markers,
        postures: None,
        held_out: args.held_out,
        joint_unit: args.joint_unit.into(),
        seed: args.seed,
        ..WorldRequest::typical(chain, plate(args)?)
    })
}

fn plate(args: &SimulateArgs) -> Result<Plate> {
    match &args.plate {
        Some(path) => read_plate(path, &mut Vec::new()),
        None => Ok(design(&PlateRequest::default())?.plate),
    }
}

fn save(args: &SimulateArgs, folder: &Path, made: &SimulatedSeries, conditions: &ImagingConditions) -> Result<()> {
    if args.observations {
        return write(folder, made, Content::Observations);
    }
    let bar = progress::bar(made.truth.stops.len(), "rendering");
    let progress = |_: &str| bar.inc(1);
    let written = write(folder, made, Content::Images { conditions, progress: &progress });
    bar.finish_and_clear();
    written
}

fn summary(made: &SimulatedSeries, folder: &Path) -> String {
    let seen: usize = made.observations.iter().map(|i| i.observations.len()).sum();
    let stops = made.observations.len();
    format!(
        "series    {}: {stops} stops, {:.0} contours in view on average, {} joint vectors kept aside\n\
         truth     {}/truth.toml\n",
        folder.display(),
        seen as f64 / stops.max(1) as f64,
        made.truth.held_out.len(),
        folder.display()
    )
}
