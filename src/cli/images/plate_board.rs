//! `robotcal plate --kind`: draws a board of any kind but coded circles, which are designed.

use std::fmt::Display;
use std::path::Path;

use clap::{Args, ValueEnum};

use crate::cli::flags::arguments::pair;
use crate::cli::terminal::say::say;
use crate::error::{Code, Error, Result};
use crate::output::ResultFolder;
use crate::output::plate_drawing::{Caption, pdf, png, svg};
use crate::plan::plate_design::{Sheet, margin_m, quiet_field_m};
use crate::series::{Plate, parse_plate, plate_files, regions};

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

/// What is drawn, and on what.
pub(super) struct BoardRequest {
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
pub(super) fn draw(place: &ResultFolder, out: &Path, args: &BoardArgs, size: &BoardRequest) -> Result<()> {
    let plate = plate(args, size)?;
    regions(&plate)?;
    let sheet = size.sheet.unwrap_or_else(|| Sheet::fitting(&plate));
    let [width, height] = quiet_field_m(&plate).map(|half| 2.0 * half);
    let holds = |sheet: &Sheet| sheet.width_m >= width && sheet.height_m >= height;
    let upright = sheet.paper.and_then(|name| Sheet::by_name(name, true));
    let sheet = upright.filter(|upright| !holds(&sheet) && holds(upright)).unwrap_or(sheet);
    if !holds(&sheet) {
        let [width, height, margin] = [width, height, margin_m(&plate)].map(|m| 1e3 * m);
        let what =
            format!("the board needs {width:.0} x {height:.0} mm with a white margin of {margin:.0} mm all round");
        return Err(Error::new(Code::PlateImpossible, "--sheet", what, "take a larger sheet or a smaller board"));
    }
    let name = name(args, &plate);
    let caption = Caption { name: name.clone(), sheet };
    let texts = plate_files(&plate)?.into_iter().map(|(name, text)| (name, text.into_bytes()));
    let drawn = [
        ("plate.pdf", pdf(&plate, &caption)),
        ("plate.svg", svg(&plate, &caption)),
        ("plate.png", png(&plate, &caption, size.dpi)?),
    ];
    let files: Vec<_> = texts.chain(drawn).collect();
    let all: Vec<(String, &[u8])> = files.iter().map(|(file, bytes)| ((*file).to_owned(), bytes.as_slice())).collect();
    place.require_the_same(&["plate.toml", "plate.csv"], &all)?;
    place.write_beside(&all, &[])?;
    let paper = sheet.paper.map_or(String::new(), |p| format!("{p}, "));
    let (width, height) = (sheet.width_m * 1e3, sheet.height_m * 1e3);
    say!(
        "plate     {name}: {} markers\npaper     {paper}{width:.0} x {height:.0} mm\nwritten   {}: {}\nnext      print \
         plate.pdf at 100 %, glue it flat, measure between two of its markers and put that into [scale] of plate.toml\n",
        plate.markers.len(),
        out.display(),
        files.iter().map(|(file, _)| *file).collect::<Vec<_>>().join(", ")
    );
    Ok(())
}

/// The plate that the flags describe, by way of the text of its plate.toml.
fn plate(args: &BoardArgs, size: &BoardRequest) -> Result<Plate> {
    let has_ids = matches!(args.kind, Kind::Charuco | Kind::Aprilgrid | Kind::ArucoGrid | Kind::Tag);
    if args.id != 0 && !has_ids {
        let what = format!("is not of --kind {}", kind_name(args.kind));
        let remedy = "leave it out; a charuco board, an aprilgrid, an aruco-grid and a tag have ids that may begin elsewhere than at 0";
        return Err(Error::new(Code::OptionConflict, "--id", what, remedy));
    }
    let mut plate = parse_plate(Path::new("plate.toml"), &PlateText::of(args, size)?, "")
        .map_err(|error| named_by_flag(error, args))?;
    for id in std::mem::take(&mut plate.large) {
        if let Some(k) = plate.index_of(id) {
            plate.markers[k].outer_radius_m *= LARGER;
        }
    }
    Ok(plate)
}

/// An unknown dictionary comes from a flag: there is no plate.toml as yet.
fn named_by_flag(error: Error, args: &BoardArgs) -> Error {
    let given = [("--family", &args.family), ("--dictionary", &args.dictionary)];
    match given.into_iter().find_map(|(flag, value)| Some((flag, value.as_ref()?))) {
        Some((flag, value)) if error.code == Code::DictionaryUnknown => {
            Error { place: format!("{flag} {value}"), ..error }
        }
        _ => error,
    }
}

/// The text of a plate.toml as it is written from flags.
#[derive(Default)]
struct PlateText {
    text: String,
    lacking: Vec<&'static str>,
}

impl PlateText {
    /// The text; an error names all flags that are lacking.
    fn of(args: &BoardArgs, size: &BoardRequest) -> Result<String> {
        let mut made = Self::default();
        made.key("format", 1);
        made.key("kind", quoted(&kind_name(args.kind)));
        made.key("tolerance_m", metres(size.tolerance_mm));
        if args.kind != Kind::Tag {
            let [columns, rows] = [0, 1].map(|k| size.shape.map(|shape| shape[k]));
            made.needed("columns", "--shape", columns);
            made.key("rows", rows.unwrap_or_default());
        }
        made.keys_of_kind(args, size.pitch_mm);
        if made.lacking.is_empty() {
            Ok(made.text)
        } else {
            Err(missing(&made.lacking.join(", "), &kind_name(args.kind)))
        }
    }

    fn keys_of_kind(&mut self, args: &BoardArgs, pitch_mm: Option<f64>) {
        let [pitch, tag, gap] = [pitch_mm, args.tag_mm, args.gap_mm].map(|mm| mm.map(metres));
        let [dictionary, family] = [&args.dictionary, &args.family].map(|name| name.as_deref().map(quoted));
        match args.kind {
            Kind::CodedCircles | Kind::Chessboard => self.needed("pitch_m", "--pitch-mm", pitch),
            Kind::CircleGrid => {
                self.needed("pitch_m", "--pitch-mm", pitch);
                self.key("radius_m", metres(args.radius_mm.or(pitch_mm.map(|mm| 0.25 * mm)).unwrap_or_default()));
                self.key("asymmetric", args.asymmetric);
                self.key("large", format!("{:?}", args.large));
            }
            Kind::Charuco => {
                self.needed("pitch_m", "--pitch-mm", pitch);
                self.needed("aruco.dictionary", "--dictionary", dictionary);
                self.needed("aruco.side_m", "--tag-mm", tag);
                self.key("aruco.first_id", args.id);
            }
            Kind::Puzzleboard => {
                let [column, row] = args.origin.unwrap_or_default();
                self.needed("pitch_m", "--pitch-mm", pitch);
                self.key("origin_col", column);
                self.key("origin_row", row);
            }
            Kind::Aprilgrid => {
                self.needed("tag_m", "--tag-mm", tag);
                self.key("spacing", format!("{:?}", args.spacing.unwrap_or(0.3)));
                self.key("family", family.unwrap_or_else(|| quoted("36h11")));
                self.key("first_id", args.id);
            }
            Kind::ArucoGrid => {
                self.needed("marker_m", "--tag-mm", tag);
                self.needed("gap_m", "--gap-mm", gap);
                self.needed("dictionary", "--dictionary", dictionary);
                self.key("first_id", args.id);
            }
            Kind::Tag => {
                self.needed("tag_m", "--tag-mm", tag);
                self.key("id", args.id);
                match family {
                    Some(family) => self.key("family", family),
                    None => self.needed("dictionary", "--dictionary", dictionary),
                }
            }
        }
    }

    fn key(&mut self, name: &str, value: impl Display) {
        self.text.push_str(&format!("{name} = {value}\n"));
    }

    fn needed(&mut self, name: &str, flag: &'static str, value: Option<impl Display>) {
        match value {
            Some(value) => self.key(name, value),
            None => self.lacking.push(flag),
        }
    }
}

fn metres(mm: f64) -> String {
    format!("{:?}", mm / 1e3)
}

fn quoted(name: &str) -> String {
    format!("{name:?}")
}

fn kind_name(kind: Kind) -> String {
    kind.to_possible_value().map_or_else(String::new, |v| v.get_name().to_owned())
}

fn name(args: &BoardArgs, plate: &Plate) -> String {
    let size = format!("{} {}x{}", kind_name(args.kind), plate.columns, plate.rows);
    // A single tag has none.
    let lattice = if plate.pitch_m > 0.0 { format!("{size}, pitch {:.2} mm", plate.pitch_m * 1e3) } else { size };
    match &plate.tags {
        Some(tags) => format!("{lattice}, {}, side {:.2} mm", tags.dictionary, tags.side_m * 1e3),
        None => lattice,
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
