//! Designs a plate of coded circles for a size, a number of markers, a camera and its viewing distance.
//!
//! Four classes of markers (small and large, disc and annulus) carry the code of [`super::plate_code`]. Radii are fixed
//! shares of the pitch, so that the size of a marker can be judged against the distance of its neighbours, which perspective
//! changes by the same factor.

use super::plate_code::{CodeDistance, PlateCode, WINDOW_LONG, WINDOW_SHORT};
use crate::error::{Code, Error, Result};
use crate::series::{Ink, Plate, PlateKind, dictionary_named};

/// Outer radius of a small marker as a share of the pitch.
pub const SMALL_RADIUS: f64 = 0.20;
/// Outer radius of a large marker as a share of the pitch: 1.5 times the small one, 0.4 pitch of ground between two.
pub const LARGE_RADIUS: f64 = 0.30;
/// Inner radius of an annulus as a share of its outer radius.
pub const INNER_SHARE: f64 = 0.5;
/// Smallest minor axis of a marker's image that is still told apart and measured, px.
pub const LEAST_MINOR_AXIS_PX: f64 = 7.0;
/// Cells in which any two windows must differ.
pub const LEAST_CODE_DISTANCE: u32 = 4;
/// Width of the strip beside the quiet zone for axes and printers' margins, m.
const SIDE_STRIP_M: f64 = 0.013;
/// Height of the strips above and below the quiet zone, for scale bar and text, m.
pub const TEXT_STRIP_M: f64 = 0.023;

/// Markers at most that a code is searched for.
const MOST_MARKERS: u64 = 5000;
/// Rows at most that a number of markers is divided into.
const MOST_SIDE: u32 = 5000;
/// Single-cell changes tried for each further cell of distance.
const TRIES: usize = 6000;
const DEFAULT_SHAPE: (u32, u32) = (28, 18);
const DEFAULT_PITCH_M: f64 = 0.018;

/// The camera that shall see the plate, and from where.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viewing {
    /// Focal length, px.
    pub focal_px: f64,
    /// Columns of the image.
    pub width_px: u32,
    /// Rows of the image.
    pub height_px: u32,
    /// Nearest viewing distance, m.
    pub near_m: f64,
    /// Farthest viewing distance, m.
    pub far_m: f64,
    /// Largest angle between the optical axis and the plate's normal, rad.
    pub tilt_rad: f64,
}

/// What is wished for; everything that is `None` is chosen.
#[derive(Debug, Clone, PartialEq)]
pub struct PlateRequest {
    /// Columns and rows of the lattice.
    pub shape: Option<(u32, u32)>,
    /// Number of markers, when no shape is given: the nearest lattice with the sheet's proportions.
    pub markers: Option<u32>,
    /// Distance of neighbouring markers, m.
    pub pitch_m: Option<f64>,
    /// Width and height of the sheet to print on, m.
    pub sheet_m: Option<[f64; 2]>,
    /// The camera to design for.
    pub viewing: Option<Viewing>,
    /// How far a printed marker may be from nominal (prior sigma), m.
    pub tolerance_m: f64,
    /// Seed of the code search.
    pub seed: u64,
}

impl Default for PlateRequest {
    /// The plate of 28 x 18 = 504 markers with a pitch of 18 mm.
    fn default() -> Self {
        Self {
            shape: None,
            markers: None,
            pitch_m: None,
            sheet_m: None,
            viewing: None,
            tolerance_m: 0.0001,
            seed: 1995,
        }
    }
}

/// A designed plate and what is known of it.
#[derive(Debug, Clone, PartialEq)]
pub struct PlateDesign {
    /// The plate.
    pub plate: Plate,
    /// Distances of the code, computed over all pairs of windows.
    pub code: CodeDistance,
    /// The sheet that it needs.
    pub sheet: Sheet,
    /// Minor axis of the smallest marker's image at the farthest distance and largest tilt, px, where a camera was given.
    pub least_minor_axis_px: Option<f64>,
}

/// A sheet of paper; the plate's origin is at its centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sheet {
    /// Name of the paper; `None` when no standard paper is large enough.
    pub paper: Option<&'static str>,
    /// Width, m.
    pub width_m: f64,
    /// Height, m.
    pub height_m: f64,
}

/// Standard papers: name, short and long side in mm. The first that fits is taken, so the American ones come only by size or name.
const PAPERS: [(&str, f64, f64); 8] = [
    ("A5", 148.0, 210.0),
    ("A4", 210.0, 297.0),
    ("A3", 297.0, 420.0),
    ("A2", 420.0, 594.0),
    ("A1", 594.0, 841.0),
    ("A0", 841.0, 1189.0),
    ("US letter", 215.9, 279.4),
    ("US ledger", 279.4, 431.8),
];

impl Sheet {
    /// A sheet of the given width and height in m, with its name when it is a standard one.
    pub fn of_size([width_m, height_m]: [f64; 2]) -> Self {
        let (short, long) = (1e3 * width_m.min(height_m), 1e3 * width_m.max(height_m));
        let paper = PAPERS.iter().find(|p| (p.1 - short).abs() < 0.5 && (p.2 - long).abs() < 0.5).map(|p| p.0);
        Self { paper, width_m, height_m }
    }

    /// A standard sheet by name ("A3", "us letter"), lying (`upright` false) or standing.
    pub fn by_name(name: &str, upright: bool) -> Option<Self> {
        let paper = PAPERS.iter().find(|p| p.0.eq_ignore_ascii_case(name))?;
        let (w, h) = if upright { (paper.1, paper.2) } else { (paper.2, paper.1) };
        Some(Self { paper: Some(paper.0), width_m: w / 1e3, height_m: h / 1e3 })
    }

    /// The smallest A sheet that holds `plate` with its quiet zone and strips; without one, a sheet of just that size.
    pub fn fitting(plate: &Plate) -> Self {
        let [width, height] = with_strips(quiet_field_m(plate));
        let fits = |paper: &&(&str, f64, f64)| {
            let (short, long) = (paper.1 / 1e3, paper.2 / 1e3);
            width.min(height) <= short && width.max(height) <= long
        };
        let upright = height > width;
        PAPERS.iter().find(fits).map_or(Self { paper: None, width_m: width, height_m: height }, |p| {
            let (w, h) = if upright { (p.1, p.2) } else { (p.2, p.1) };
            Self { paper: Some(p.0), width_m: w / 1e3, height_m: h / 1e3 }
        })
    }
}

/// The plate's printed field beyond the outermost markers, m (a whole square for a chessboard).
fn widest_radius(plate: &Plate) -> f64 {
    match plate.kind.print().ink {
        Ink::Squares | Ink::SquaresAndTags | Ink::SquaresAndDots => plate.pitch_m,
        Ink::Tags => plate.tags.as_ref().map_or(0.0, |tags| tags.gap_m),
        Ink::Circles | Ink::Unknown => plate.markers.iter().fold(0.0, |r, m| m.outer_radius_m.max(r)),
    }
}

/// Light modules around a tag that stands alone.
const TAG_MARGIN_MODULES: f64 = 2.0;
/// Margin of a ChArUco board, whose markers are read within its squares, in squares.
const CHARUCO_MARGIN: f64 = 0.5;

/// Paper around what is printed, m: a pitch, by which the board ends in view, and less where codes tell that.
pub fn margin_m(plate: &Plate) -> f64 {
    let single = plate.tags.as_ref().filter(|_| plate.kind == PlateKind::Tag);
    match single.map(|tags| (tags, dictionary_named(&tags.dictionary, "plate"))) {
        Some((tags, Ok(dictionary))) => {
            let modules = dictionary.marker_size() + 2 * tags.print.border();
            TAG_MARGIN_MODULES * tags.side_m / modules as f64
        }
        _ if plate.kind == PlateKind::Charuco => CHARUCO_MARGIN * plate.pitch_m,
        _ => plate.pitch_m,
    }
}

/// Half width and half height of the field that must stay free of everything but markers, m.
pub fn quiet_field_m(plate: &Plate) -> [f64; 2] {
    let beyond = widest_radius(plate) + margin_m(plate);
    let furthest = |axis: usize| plate.markers.iter().fold(0.0, |far: f64, m| far.max(m.position_m[axis].abs()));
    [furthest(0) + beyond, furthest(1) + beyond]
}

fn needed_size(columns: u32, rows: u32, pitch_m: f64, radius_m: f64) -> [f64; 2] {
    with_strips([columns, rows].map(|n| (f64::from(n) - 1.0) / 2.0 * pitch_m + radius_m + pitch_m))
}

/// Width and height of the sheet about a quiet field of half this size, m.
fn with_strips([width_m, height_m]: [f64; 2]) -> [f64; 2] {
    [2.0 * (width_m + SIDE_STRIP_M), 2.0 * (height_m + TEXT_STRIP_M)]
}

/// Designs a plate.
///
/// # Errors
/// When the lattice is too small to carry a code, does not fit the sheet, or cannot be resolved (or hardly seen) by the camera.
pub fn design(request: &PlateRequest) -> Result<PlateDesign> {
    let (columns, rows) = shape(request)?;
    let pitch_m = pitch(request, columns, rows)?;
    check_sheet(request, columns, rows, pitch_m)?;
    let least_minor_axis_px = request.viewing.map(|v| check_viewing(&v, columns, rows, pitch_m)).transpose()?;
    let code = PlateCode::search(columns as usize, rows as usize, request.seed, TRIES);
    let distance = code.distance();
    if distance.rotated < LEAST_CODE_DISTANCE {
        return Err(Error::new(
            Code::PlateCodeWeak,
            "plate code",
            format!("windows of {WINDOW_SHORT}x{WINDOW_LONG} markers differ in only {} cells", distance.rotated),
            "try another --seed or fewer markers",
        ));
    }
    let plate = plate_of(&code, columns, rows, pitch_m, request.tolerance_m);
    let sheet = request.sheet_m.map_or_else(|| Sheet::fitting(&plate), Sheet::of_size);
    Ok(PlateDesign { plate, code: distance, sheet, least_minor_axis_px })
}

fn plate_of(code: &PlateCode, columns: u32, rows: u32, pitch_m: f64, tolerance_m: f64) -> Plate {
    let mut plate = Plate::lattice(PlateKind::CodedCircles, columns, rows, pitch_m, tolerance_m);
    for (marker, &symbol) in plate.markers.iter_mut().zip(&code.symbols) {
        (marker.outer_radius_m, marker.inner_radius_m) = class_radii(symbol, pitch_m);
    }
    plate
}

/// Outer and inner radius of a class, m: 0 small disc, 1 large disc, 2 small annulus, 3 large annulus.
fn class_radii(symbol: u8, pitch_m: f64) -> (f64, f64) {
    let outer = pitch_m * if symbol & 1 == 0 { SMALL_RADIUS } else { LARGE_RADIUS };
    (outer, if symbol & 2 == 0 { 0.0 } else { outer * INNER_SHARE })
}

fn shape(request: &PlateRequest) -> Result<(u32, u32)> {
    let (columns, rows) = match (request.shape, request.markers) {
        (Some(shape), _) => shape,
        (None, Some(count)) => shape_of_count(count, request.sheet_m),
        (None, None) => DEFAULT_SHAPE,
    };
    let (short, long) = (columns.min(rows) as usize, columns.max(rows) as usize);
    if short < WINDOW_SHORT || long < WINDOW_LONG {
        return Err(Error::new(
            Code::PlateImpossible,
            "plate",
            format!(
                "{columns} x {rows} markers are too few: identity is read from windows of {WINDOW_SHORT}x{WINDOW_LONG}"
            ),
            "ask for at least 5 x 4 markers",
        ));
    }
    if u64::from(columns) * u64::from(rows) > MOST_MARKERS {
        return Err(Error::new(
            Code::PlateImpossible,
            "plate",
            format!("{columns} x {rows} markers are more than the code search handles ({MOST_MARKERS})"),
            "ask for fewer markers with a larger pitch",
        ));
    }
    Ok((columns, rows))
}

/// The lattice with about `count` markers and the proportions of the sheet (of an A sheet when none is given).
fn shape_of_count(count: u32, sheet_m: Option<[f64; 2]>) -> (u32, u32) {
    let proportion = sheet_m.map_or(std::f64::consts::SQRT_2, |[w, h]| w / h);
    let cost = |rows: u32| {
        let columns = (f64::from(count) / f64::from(rows)).round().max(1.0);
        let miss = (columns * f64::from(rows) / f64::from(count) - 1.0).abs();
        (10.0 * miss + (columns / f64::from(rows) / proportion).ln().abs(), columns as u32)
    };
    let best = (1..=count.clamp(1, MOST_SIDE)).min_by(|&a, &b| cost(a).0.total_cmp(&cost(b).0)).unwrap_or(1);
    (cost(best).1, best)
}

/// The pitch asked for, or the one that suits sheet and camera, on whole tenths of a millimetre.
fn pitch(request: &PlateRequest, columns: u32, rows: u32) -> Result<f64> {
    if let Some(pitch_m) = request.pitch_m {
        return if pitch_m.is_finite() && pitch_m > 0.0 {
            Ok(pitch_m)
        } else {
            Err(Error::new(Code::OptionRange, "plate", format!("a pitch of {pitch_m} m"), "give a positive --pitch-mm"))
        };
    }
    let largest = request.sheet_m.map(|sheet| largest_pitch(sheet, columns, rows));
    let suited = request.viewing.map(|v| {
        let middle_m = (v.near_m * v.far_m).sqrt();
        let fill = |pixels: u32, n: u32| 0.9 * f64::from(pixels) * middle_m / v.focal_px / f64::from(n);
        fill(v.width_px, columns).min(fill(v.height_px, rows)).max(resolvable_pitch(&v))
    });
    let demand = match (suited, largest) {
        (Some(s), Some(l)) => s.min(l),
        (Some(s), None) => (s * 1e4).ceil() / 1e4,
        (None, Some(l)) => l,
        (None, None) => return Ok(DEFAULT_PITCH_M),
    };
    Ok(if largest.is_some_and(|l| demand >= l) { (demand * 1e4).floor() } else { (demand * 1e4).round() } / 1e4)
}

fn largest_pitch(sheet_m: [f64; 2], columns: u32, rows: u32) -> f64 {
    let fit = |size: f64, strip: f64, n: u32| (size - 2.0 * strip) / (f64::from(n) + 1.0 + 2.0 * LARGE_RADIUS);
    fit(sheet_m[0], SIDE_STRIP_M, columns).min(fit(sheet_m[1], TEXT_STRIP_M, rows))
}

/// Smallest pitch whose small markers have the least minor axis at the farthest distance and largest tilt, m.
fn resolvable_pitch(v: &Viewing) -> f64 {
    LEAST_MINOR_AXIS_PX * v.far_m / (2.0 * SMALL_RADIUS * v.focal_px * v.tilt_rad.cos())
}

fn check_sheet(request: &PlateRequest, columns: u32, rows: u32, pitch_m: f64) -> Result<()> {
    let Some(sheet) = request.sheet_m else { return Ok(()) };
    let needed = needed_size(columns, rows, pitch_m, pitch_m * LARGE_RADIUS);
    if pitch_m <= 0.0 || needed[0] > sheet[0] + 1e-9 || needed[1] > sheet[1] + 1e-9 {
        return Err(Error::new(
            Code::PlateImpossible,
            "plate",
            format!(
                "{columns} x {rows} markers with a pitch of {:.1} mm need a sheet of {:.0} x {:.0} mm, not {:.0} x {:.0} mm",
                pitch_m * 1e3,
                needed[0] * 1e3,
                needed[1] * 1e3,
                sheet[0] * 1e3,
                sheet[1] * 1e3
            ),
            format!(
                "take a pitch of at most {:.1} mm or fewer markers",
                largest_pitch(sheet, columns, rows).max(0.0) * 1e3
            ),
        ));
    }
    Ok(())
}

fn check_range(v: &Viewing) -> Result<()> {
    let sane = v.focal_px > 0.0 && v.near_m > 0.0 && v.far_m >= v.near_m && (0.0..1.4).contains(&v.tilt_rad);
    if sane {
        return Ok(());
    }
    let what =
        format!("focal length {} px, distances {} to {} m, tilt {:.2} rad", v.focal_px, v.near_m, v.far_m, v.tilt_rad);
    let remedy = "give positive values, the nearer distance first, and a tilt below 80 degrees";
    Err(Error::new(Code::OptionRange, "camera", what, remedy))
}

/// Checks that the camera resolves the smallest marker at the far end and sees a whole window at the near end.
fn check_viewing(v: &Viewing, columns: u32, rows: u32, pitch_m: f64) -> Result<f64> {
    check_range(v)?;
    let minor_axis_px = 2.0 * SMALL_RADIUS * pitch_m * v.focal_px / v.far_m * v.tilt_rad.cos();
    if minor_axis_px < LEAST_MINOR_AXIS_PX {
        return Err(Error::new(
            Code::PlateImpossible,
            "plate",
            format!(
                "the camera cannot resolve it: at {:.2} m and {:.0} degrees the smallest markers are {minor_axis_px:.1} px wide, \
                 {LEAST_MINOR_AXIS_PX:.0} px are needed",
                v.far_m,
                v.tilt_rad.to_degrees()
            ),
            format!("take a pitch of at least {:.1} mm, go nearer, or tilt less", resolvable_pitch(v) * 1e3),
        ));
    }
    let (wide, high) = (f64::from(v.width_px), f64::from(v.height_px));
    let seen = |pixels: f64| pixels * v.near_m / v.focal_px / pitch_m;
    let (short, long) = (seen(wide.min(high)), seen(wide.max(high)));
    let enough = f64::from(columns.min(rows)).min(short) >= WINDOW_SHORT as f64 && long >= WINDOW_LONG as f64;
    if !enough {
        return Err(Error::new(
            Code::PlateImpossible,
            "plate",
            format!(
                "at {:.2} m the camera sees only {long:.1} x {short:.1} pitches: identity needs windows of \
                 {WINDOW_LONG}x{WINDOW_SHORT} markers",
                v.near_m
            ),
            format!("take a pitch of at most {:.1} mm or stay farther away", {
                let most = (short / WINDOW_SHORT as f64).min(long / WINDOW_LONG as f64) * pitch_m;
                most * 1e3
            }),
        ));
    }
    Ok(minor_axis_px)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn viewing() -> Viewing {
        Viewing { focal_px: 1400.0, width_px: 1280, height_px: 1024, near_m: 0.15, far_m: 0.5, tilt_rad: 0.9 }
    }

    #[test]
    fn default_plate_has_504_markers_and_fits_a2() {
        let made = design(&PlateRequest::default()).unwrap();
        assert_eq!((made.plate.columns, made.plate.rows, made.plate.markers.len()), (28, 18, 504));
        assert_eq!(made.sheet, Sheet { paper: Some("A2"), width_m: 0.594, height_m: 0.420 });
        assert!(made.code.rotated >= 6, "{:?}", made.code);
        // Every class carries about a quarter of the markers (4 sigma of a fair draw: 39).
        let mut counts = [0_i32; 4];
        for marker in &made.plate.markers {
            let symbol = (0..4).find(|s| class_radii(*s, 0.018) == (marker.outer_radius_m, marker.inner_radius_m));
            counts[usize::from(symbol.unwrap())] += 1;
        }
        assert!(counts.iter().all(|c| (c - 126).abs() < 39), "{counts:?}");
    }

    #[test]
    fn count_and_sheet_choose_shape_and_pitch() {
        let request = PlateRequest { markers: Some(150), sheet_m: Some([0.297, 0.210]), ..PlateRequest::default() };
        let made = design(&request).unwrap();
        assert!((140..=160).contains(&made.plate.markers.len()), "{}", made.plate.markers.len());
        assert_eq!(made.sheet.paper, Some("A4"));
        let [w, h] = needed_size(made.plate.columns, made.plate.rows, made.plate.pitch_m + 1e-4, 0.0);
        assert!(w < 0.297 || h < 0.210, "the pitch is as large as fits");
    }

    #[test]
    fn camera_chooses_a_pitch_that_it_resolves() {
        let request = PlateRequest { shape: Some((14, 9)), viewing: Some(viewing()), ..PlateRequest::default() };
        let made = design(&request).unwrap();
        assert!(made.least_minor_axis_px.unwrap() >= LEAST_MINOR_AXIS_PX);
    }

    #[test]
    fn more_markers_than_a_code_can_have_are_refused() {
        let of = |shape: Option<(u32, u32)>, markers: Option<u32>| {
            design(&PlateRequest { shape, markers, ..PlateRequest::default() }).unwrap_err().code
        };
        for shape in [(65536, 65536), (u32::MAX, u32::MAX), (1000, 6)] {
            assert_eq!(of(Some(shape), None), Code::PlateImpossible, "{shape:?}");
        }
        assert_eq!(of(None, Some(u32::MAX)), Code::PlateImpossible);
    }

    #[test]
    fn unresolvable_and_oversized_plates_are_refused_with_the_pitch_to_take() {
        let far = Viewing { far_m: 2.0, ..viewing() };
        let error =
            design(&PlateRequest { viewing: Some(far), pitch_m: Some(0.018), ..PlateRequest::default() }).unwrap_err();
        assert!(error.what.contains("cannot resolve") && error.remedy.contains("40.2 mm"), "{error}");
        let near = Viewing { near_m: 0.05, ..viewing() };
        let error =
            design(&PlateRequest { viewing: Some(near), pitch_m: Some(0.018), ..PlateRequest::default() }).unwrap_err();
        assert!(error.what.contains("sees only"), "{error}");
        let a4 = Some([0.297, 0.210]);
        let error = design(&PlateRequest { sheet_m: a4, pitch_m: Some(0.018), ..PlateRequest::default() }).unwrap_err();
        assert!(error.what.contains("need a sheet of"), "{error}");
        let error = design(&PlateRequest { shape: Some((4, 4)), ..PlateRequest::default() }).unwrap_err();
        assert_eq!(error.exit_code(), 2);
    }
}
