//! `robotcal plate --kind`: draws a board of any kind but coded circles, which are designed.

use std::cell::RefCell;
use std::fmt::Write;
use std::path::Path;

use clap::{Args, ValueEnum};

use crate::cli::flags::arguments::pair;
use crate::cli::terminal::say::say;
use crate::error::{Code, Error, Result};
use crate::output::ResultFolder;
use crate::output::plate_drawing::{Caption, pdf, png, svg};
use crate::plan::plate_design::{Sheet, quiet_field_m};
use crate::series::{Plate, parse_plate, plate_csv, plate_toml, regions};

/// Kinds of plates that are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Kind {
    /// Discs and annuli that code their place, designed for sheet and camera
    CodedCircles,
    /// A grid of dots
    CircleGrid,
    /// Squares; the markers are their inner corners
    Chessboard,
    /// A chessboard with ArUco markers in its light squares
    Charuco,
    /// A chessboard with dots that code the place (PuzzleBoard)
    Puzzleboard,
    /// Kalibr's grid of AprilTags
    Aprilgrid,
    /// OpenCV's grid of ArUco markers
    ArucoGrid,
    /// A single AprilTag or ArUco marker
    Tag,
}

/// Flags of the boards.
#[derive(Debug, Args)]
pub(super) struct BoardArgs {
    /// What to draw; --shape counts inner corners of a chessboard, else dots or tags
    #[arg(long, value_enum, default_value = "coded-circles")]
    pub kind: Kind,
    /// Side of a tag or marker with its dark border, mm
    #[arg(long, value_name = "MM")]
    tag_mm: Option<f64>,
    /// Paper between the markers of an aruco-grid, mm
    #[arg(long, value_name = "MM")]
    gap_mm: Option<f64>,
    /// Paper between the tags of an aprilgrid over their side [default: 0.3]
    #[arg(long, value_name = "RATIO")]
    spacing: Option<f64>,
    /// Dictionary of markers as OpenCV spells it, such as DICT_4X4_50
    #[arg(long, value_name = "NAME")]
    dictionary: Option<String>,
    /// Family of AprilTags [default of an aprilgrid: 36h11]
    #[arg(long, value_name = "NAME", conflicts_with = "dictionary")]
    family: Option<String>,
    /// Number of the tag, or of the first one of a grid, in its dictionary
    #[arg(long, value_name = "N", default_value_t = 0)]
    id: u32,
    /// Radius of the dots of a circle-grid, mm [default: a quarter of the pitch]
    #[arg(long, value_name = "MM")]
    radius_mm: Option<f64>,
    /// Column and row of the pattern of a puzzleboard at its top-left [default: 0x0]
    #[arg(long, value_name = "CxR", value_parser = pair::<u32>)]
    origin: Option<[u32; 2]>,
    /// Every other row of a circle-grid is shifted; rows are a pitch apart, the dots of a row two
    #[arg(long)]
    asymmetric: bool,
    /// A dot of a circle-grid that is drawn larger, by half: its column and row from the top-left, counted from 0
    #[arg(long, value_name = "CxR", value_parser = pair::<u32>)]
    large: Vec<[u32; 2]>,
}

/// Size of what is drawn.
pub(super) struct BoardSize {
    pub shape: Option<[u32; 2]>,
    pub pitch_mm: Option<f64>,
    pub sheet: Option<Sheet>,
    pub tolerance_mm: f64,
    pub dpi: f64,
}

/// How much larger the larger dots are.
const LARGER: f64 = 1.5;

/// Draws the board and writes its plate.toml, and plate.csv where that is needed.
///
/// # Errors
/// What the reader of plate.toml says; a board that the sheet does not hold.
pub(super) fn draw(place: &ResultFolder, out: &Path, args: &BoardArgs, size: &BoardSize) -> Result<()> {
    let plate = plate(args, size)?;
    regions(&plate)?;
    let sheet = size.sheet.unwrap_or_else(|| Sheet::fitting(&plate));
    let [width, height] = quiet_field_m(&plate).map(|half| 2.0 * half);
    let holds = |sheet: &Sheet| sheet.width_m >= width && sheet.height_m >= height;
    let upright = sheet.paper.and_then(|name| Sheet::by_name(name, true));
    let sheet = upright.filter(|upright| !holds(&sheet) && holds(upright)).unwrap_or(sheet);
    if !holds(&sheet) {
        let [width, height, margin] = [width, height, plate.pitch_m].map(|m| 1e3 * m);
        let what =
            format!("the board needs {width:.0} x {height:.0} mm with a white margin of {margin:.0} mm all round");
        return Err(Error::new(Code::PlateImpossible, "--sheet", what, "take a larger sheet or a smaller board"));
    }
    let name = name(args, &plate);
    let caption = Caption { name: name.clone(), sheet };
    let table = plate.markers.iter().any(|m| m.outer_radius_m > 0.0).then(|| plate_csv(&plate));
    let mut files = vec![
        ("plate.toml", plate_toml(&plate, table.as_ref().map(|_| "plate.csv"))?.into_bytes()),
        ("plate.pdf", pdf(&plate, &caption)),
        ("plate.svg", svg(&plate, &caption)),
        ("plate.png", png(&plate, &caption, size.dpi)?),
    ];
    files.extend(table.map(|text| ("plate.csv", text.into_bytes())));
    let all: Vec<(String, &[u8])> = files.iter().map(|(file, bytes)| ((*file).to_owned(), bytes.as_slice())).collect();
    place.require_the_same(&["plate.toml", "plate.csv"], &all)?;
    place.write_beside(&all, &[])?;
    let paper = sheet.paper.map_or(String::new(), |p| format!("{p}, "));
    let (width, height) = (sheet.width_m * 1e3, sheet.height_m * 1e3);
    say!(
        "plate     {name}: {} markers\npaper     {paper}{width:.0} x {height:.0} mm\nwritten   {}: {}\nnext      print \
         plate.pdf at 100 %, glue it flat, and measure it",
        plate.markers.len(),
        out.display(),
        files.iter().map(|(file, _)| *file).collect::<Vec<_>>().join(", ")
    );
    Ok(())
}

/// The plate that the flags describe, by way of the text of its plate.toml.
fn plate(args: &BoardArgs, size: &BoardSize) -> Result<Plate> {
    let has_ids = matches!(args.kind, Kind::Charuco | Kind::Aprilgrid | Kind::ArucoGrid | Kind::Tag);
    if args.id != 0 && !has_ids {
        let what = format!("is not of --kind {}", kind_name(args.kind));
        let remedy = "leave it out; a charuco board, an aprilgrid, an aruco-grid and a tag have ids that may begin elsewhere than at 0";
        return Err(Error::new(Code::OptionConflict, "--id", what, remedy));
    }
    let mut text =
        format!("format = 1\nkind = \"{}\"\ntolerance_m = {:?}\n", kind_name(args.kind), size.tolerance_mm / 1e3);
    let mut key = |name: &str, value: String| writeln!(text, "{name} = {value}").unwrap_or_default();
    let metres = |mm: f64| format!("{:?}", mm / 1e3);
    let quoted = |name: &Option<String>| name.as_ref().map(|n| format!("{n:?}"));
    let lacking = RefCell::new(Vec::new());
    let needed = |flag: &'static str, value: Option<String>| {
        value.unwrap_or_else(|| {
            lacking.borrow_mut().push(flag);
            String::new()
        })
    };
    if args.kind != Kind::Tag {
        let [columns, rows] = [0, 1].map(|k| size.shape.map(|shape| shape[k].to_string()));
        key("columns", needed("--shape", columns));
        key("rows", rows.unwrap_or_default());
    }
    let tag = || needed("--tag-mm", args.tag_mm.map(metres));
    let pitch = || needed("--pitch-mm", size.pitch_mm.map(metres));
    let dictionary = || needed("--dictionary", quoted(&args.dictionary));
    match args.kind {
        Kind::CodedCircles | Kind::Chessboard => key("pitch_m", pitch()),
        Kind::CircleGrid => {
            let dots = size.pitch_mm.map(|mm| args.radius_mm.unwrap_or(0.25 * mm)).map(metres);
            key("pitch_m", pitch());
            key("radius_m", dots.unwrap_or_default());
            key("asymmetric", args.asymmetric.to_string());
            key("large", format!("{:?}", args.large));
        }
        Kind::Charuco => {
            key("pitch_m", pitch());
            key("aruco", format!("{{ dictionary = {}, side_m = {}, first_id = {} }}", dictionary(), tag(), args.id));
        }
        Kind::Puzzleboard => {
            let [column, row] = args.origin.unwrap_or_default();
            key("pitch_m", pitch());
            key("origin_col", column.to_string());
            key("origin_row", row.to_string());
        }
        Kind::Aprilgrid => {
            key("tag_m", tag());
            key("spacing", format!("{:?}", args.spacing.unwrap_or(0.3)));
            key("family", quoted(&args.family).unwrap_or_else(|| "\"36h11\"".to_owned()));
            key("first_id", args.id.to_string());
        }
        Kind::ArucoGrid => {
            key("marker_m", tag());
            key("gap_m", needed("--gap-mm", args.gap_mm.map(metres)));
            key("dictionary", dictionary());
            key("first_id", args.id.to_string());
        }
        Kind::Tag => {
            key("tag_m", tag());
            key("id", args.id.to_string());
            match quoted(&args.family) {
                Some(family) => key("family", family),
                None => key("dictionary", dictionary()),
            }
        }
    }
    let lacking = lacking.into_inner();
    if !lacking.is_empty() {
        return Err(missing(&lacking.join(", "), &kind_name(args.kind)));
    }
    let mut plate = parse_plate(Path::new("plate.toml"), &text, "")?;
    for id in std::mem::take(&mut plate.large) {
        if let Some(k) = plate.index_of(id) {
            plate.markers[k].outer_radius_m *= LARGER;
        }
    }
    Ok(plate)
}

fn kind_name(kind: Kind) -> String {
    kind.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned())
}

fn name(args: &BoardArgs, plate: &Plate) -> String {
    let kind = kind_name(args.kind);
    match &plate.tags {
        Some(tags) => {
            format!("{kind} {}x{}, {}, side {:.2} mm", plate.columns, plate.rows, tags.dictionary, tags.side_m * 1e3)
        }
        None => format!("{kind} {}x{}, pitch {:.2} mm", plate.columns, plate.rows, plate.pitch_m * 1e3),
    }
}

fn missing(flags: &str, kind: &str) -> Error {
    Error::new(
        Code::OptionMissing,
        format!("--kind {kind}"),
        format!("needs {flags}"),
        "give what is missing; lengths in millimetres",
    )
}
