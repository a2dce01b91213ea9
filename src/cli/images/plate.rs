//! `robotcal plate`: designs a plate of coded circles, or a board of another kind, and draws it.

use std::path::{Path, PathBuf};

use clap::Args;
use sha2::{Digest, Sha256};

use super::plate_board::{self, BoardArgs, BoardRequest, Kind};
use crate::cli::Verdict;
use crate::cli::flags::arguments::pair;
use crate::cli::terminal::say::say;
use crate::error::Result;
use crate::output::ResultFolder;
use crate::output::plate_drawing::{Caption, pdf, png, svg};
use crate::plan::plate_design::{PlateDesign, PlateRequest, Sheet, Viewing, design};
use crate::series::{plate_csv, plate_toml};

/// Flags of `plate`.
#[derive(Debug, Args)]
pub struct PlateArgs {
    #[command(flatten)]
    board: BoardArgs,
    /// Folder for plate.toml, plate.csv, plate.pdf, plate.svg and plate.png
    #[arg(long, value_name = "FOLDER", default_value = "plate")]
    out: PathBuf,
    /// Columns and rows of markers [default: 28x18]
    #[arg(long, value_name = "CxR", value_parser = pair::<u32>)]
    shape: Option<[u32; 2]>,
    /// Number of markers, with the sheet's proportions
    #[arg(long, value_name = "N", conflicts_with = "shape")]
    markers: Option<u32>,
    /// Distance of neighbouring markers, mm [default: 18, or what suits sheet and camera]
    #[arg(long, value_name = "MM")]
    pitch_mm: Option<f64>,
    /// Paper to print on: A5 to A0, "US letter", "US ledger" (lying), or its width and height in mm as WxH
    #[arg(long, value_name = "NAME|WxH", value_parser = sheet)]
    sheet: Option<Sheet>,
    /// Focal length of the camera to design for, px
    #[arg(long, value_name = "PX", requires = "distance_m")]
    focal_px: Option<f64>,
    /// Columns and rows of its images
    #[arg(long, value_name = "WxH", default_value = "1280x1024", value_parser = pair::<u32>)]
    image: [u32; 2],
    /// Nearest and farthest viewing distance, m
    #[arg(long, value_name = "NEARxFAR", requires = "focal_px", value_parser = pair::<f64>)]
    distance_m: Option<[f64; 2]>,
    /// Largest tilt, degrees
    #[arg(long, value_name = "DEG", default_value_t = 50.0)]
    tilt_deg: f64,
    /// How far a printed marker may be from nominal (sigma), mm
    #[arg(long, value_name = "MM", default_value_t = 0.1)]
    tolerance_mm: f64,
    /// Seed of the code search
    #[arg(long, default_value_t = 1995)]
    seed: u64,
    /// Resolution of plate.png
    #[arg(long, default_value_t = 100.0)]
    dpi: f64,
}

fn sheet(text: &str) -> std::result::Result<Sheet, String> {
    if let Some(sheet) = Sheet::by_name(text, false) {
        return Ok(sheet);
    }
    let size = pair::<f64>(text).map_err(|_| "give A5 to A0, \"US letter\", \"US ledger\", or WxH in mm".to_owned())?;
    Ok(Sheet::of_size(size.map(|mm| mm / 1e3)))
}

pub fn run(args: &PlateArgs) -> Result<Verdict> {
    let place = ResultFolder::among(&args.out)?;
    if args.board.kind != Kind::CodedCircles {
        let size = BoardRequest {
            shape: args.shape,
            pitch_mm: args.pitch_mm,
            sheet: args.sheet,
            tolerance_mm: args.tolerance_mm,
            dpi: args.dpi,
        };
        plate_board::draw(&place, &args.out, &args.board, &size)?;
        return Ok(Verdict::Good);
    }
    let viewing = args.focal_px.zip(args.distance_m).map(|(focal_px, [near_m, far_m])| Viewing {
        focal_px,
        width_px: args.image[0],
        height_px: args.image[1],
        near_m,
        far_m,
        tilt_rad: args.tilt_deg.to_radians(),
    });
    let made = design(&PlateRequest {
        shape: args.shape.map(|[c, r]| (c, r)),
        markers: args.markers,
        pitch_m: args.pitch_mm.map(|mm| mm / 1e3),
        sheet_m: args.sheet.map(|s| [s.width_m, s.height_m]),
        viewing,
        tolerance_m: args.tolerance_mm / 1e3,
        seed: args.seed,
    })?;
    let name = write(&place, &made, args.dpi)?;
    say!("{}", summary(&made, &name, &args.out));
    Ok(Verdict::Good)
}

/// Writes the files and returns the name of the plate, which ends in four digits of the hash of its markers.
fn write(place: &ResultFolder, made: &PlateDesign, dpi: f64) -> Result<String> {
    let plate = &made.plate;
    let table = plate_csv(plate);
    let hash = Sha256::digest(table.as_bytes());
    let digits = format!("{:02x}{:02x}", hash[0], hash[1]);
    let name = format!("robotcal {}x{}-{:.1}mm-{digits}", plate.columns, plate.rows, plate.pitch_m * 1e3);
    let caption = Caption { name: name.clone(), sheet: made.sheet };
    let files = [
        ("plate.toml", plate_toml(plate, Some("plate.csv"))?.into_bytes()),
        ("plate.csv", table.into_bytes()),
        ("plate.pdf", pdf(plate, &caption)),
        ("plate.svg", svg(plate, &caption)),
        ("plate.png", png(plate, &caption, dpi)?),
    ];
    let files = files.each_ref().map(|(file, bytes)| ((*file).to_owned(), bytes.as_slice()));
    place.require_the_same(&["plate.toml", "plate.csv"], &files)?;
    place.write_beside(&files, &[])?;
    Ok(name)
}

fn summary(made: &PlateDesign, name: &str, folder: &Path) -> String {
    let plate = &made.plate;
    let sheet = &made.sheet;
    let size = format!("{:.0} x {:.0} mm", sheet.width_m * 1e3, sheet.height_m * 1e3);
    let paper = sheet.paper.map_or_else(|| format!("no standard paper holds it: {size}"), |p| format!("{p}, {size}"));
    let mut sizes: Vec<f64> = plate.markers.iter().map(|m| m.outer_radius_m).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.dedup();
    let sizes: Vec<String> = sizes.iter().map(|r| format!("{:.2}", r * 2e3)).collect();
    let mut text = format!(
        "plate     {name}: {} markers, {} x {}, pitch {:.1} mm, diameters {} mm\n\
         code      windows of 5x4 markers differ in at least {} cells in all rotations, from mirrored ones in {}\n\
         paper     {paper}\n",
        plate.markers.len(),
        plate.columns,
        plate.rows,
        plate.pitch_m * 1e3,
        sizes.join(" and "),
        made.code.rotated,
        made.code.mirrored,
    );
    if let Some(px) = made.least_minor_axis_px {
        text += &format!("camera    smallest marker at the farthest distance and largest tilt: {px:.1} px\n");
    }
    text += &format!(
        "written   {}: plate.toml, plate.csv, plate.pdf, plate.svg, plate.png\n\
         next      print plate.pdf at 100 %, glue it flat, measure between two markers and put that into [scale] of plate.toml\n",
        folder.display()
    );
    text
}
