//! Patterns that noise does not leave in the residuals: over the image, over the depth, over the plate.
//!
//! Score tests ([`crate::solve::Response`]) of columns that the model lacks, one group for each cause that has a remedy of its own. With `n`
//! equations and `R` the squares of the whitened residuals, whose size the fit itself has estimated, a group of `m` columns removes
//! `D = s' M^-1 s` of `R`, and `F = D (n' - m) / (R - D)`, `n' = R`, is chi-squared with `m` degrees of freedom where there is no pattern. Noise that
//! is larger where the columns are, as towards the border of the image, makes it larger by `c = tr(M^-1 W) n / (m R)`: it counts as `F / c`. Of
//! groups beyond chance the one with the largest `F - m ln n` (G. Schwarz 1978) names the cause.

use nalgebra::{DMatrix, DVector, Matrix3x2, SMatrix, Vector2, Vector3};

use super::limits::Limits;
use super::pattern_effect::{Effects, PatternEffect};
use crate::fit::Fit;
use crate::linalg::symmetric_eigen;
use crate::model::camera::Lens;
use crate::problem::{Adjustment, Equations, PlateShape, Step};
use crate::solve::{LinearImage, Response, Singular};

/// Highest degree of a polynomial.
const HIGHEST: usize = 5;

/// Share of the information of a scaled direction below which the fit absorbs it.
const ABSORBED: f64 = 1e-8;
/// Columns that everything else absorbs are left out below this share of what they say.
const LEAST_SHARE: f64 = 1e-9;
/// One-sided normal deviate of a power of 95 %.
const POWER_95: f64 = 1.645;
/// Degrees of the displacement field, of the bow and of the print of the plate.
const FIELD_DEGREES: [usize; 2] = [2, HIGHEST];
const BOW_DEGREES: [usize; 2] = [2, 4];
const PRINT_DEGREES: [usize; 2] = [2, 3];
/// Unit of the columns of a plate, m.
const PLATE_UNIT_M: f64 = 1e-4;
/// Columns of the camera parameters cx and cy: the image moves with them.
const CENTRE: [usize; 2] = [2, 3];

/// What can leave a pattern.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pattern {
    /// Displacements with the square of the distance from the axis in one direction: a lens element that is tilted.
    ThinPrism,
    /// Radial displacements of a higher order than the lens has.
    Radial,
    /// Radial displacements that go with one over the depth: the entrance pupil moves.
    Parallax,
    /// Smooth displacements over the image that no formula has.
    Field,
    /// Heights over the plate.
    PlateBow,
    /// Smooth shifts of the markers in the plate.
    PlatePrint,
    /// Markers that are off by more than the stated tolerance.
    Tolerance,
}

impl Pattern {
    /// Those of a camera; the compiler does not ask for a new one here.
    const OF_CAMERA: [Self; 4] = [Self::ThinPrism, Self::Radial, Self::Parallax, Self::Field];
    /// Those of a plate that are columns; likewise.
    const OF_PLATE: [Self; 2] = [Self::PlateBow, Self::PlatePrint];

    /// The formula that has its columns.
    pub fn lens(self) -> Option<Lens> {
        match self {
            Self::ThinPrism => Some(Lens::ThinPrism),
            Self::Radial => Some(Lens::Rational),
            Self::Parallax => Some(Lens::Parallax),
            Self::Field | Self::PlateBow | Self::PlatePrint | Self::Tolerance => None,
        }
    }

    /// True where the lens of a camera has the columns, and they are free: what is left there is the pull of their priors.
    pub fn is_fitted(self, Adjustment { problem, state }: &Adjustment, camera: usize) -> bool {
        let lens = state.cameras[camera].lens;
        let is_free = problem.layout.cameras[camera].clone().last().is_some_and(|c| problem.layout.columns[c].free);
        is_free && (self.lens() == Some(lens.formula()) || self == Self::Field && lens.has_field())
    }

    fn columns(self) -> usize {
        let powers = |[low, high]: [usize; 2]| (low..=high).map(|d| d + 1).sum::<usize>();
        match self {
            Self::ThinPrism => 4,
            Self::Radial | Self::Parallax => 2,
            Self::Field => 2 * powers(FIELD_DEGREES),
            Self::PlateBow => powers(BOW_DEGREES),
            Self::PlatePrint => 2 * powers(PRINT_DEGREES),
            Self::Tolerance => 0,
        }
    }
}

/// A camera or plate, by its index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bearer {
    /// Camera.
    Camera(usize),
    /// Plate.
    Plate(usize),
}

/// What one group of columns says.
#[derive(Debug, Clone, PartialEq)]
pub struct PatternTest {
    /// The cause.
    pub pattern: Pattern,
    /// Whose.
    pub bearer: Bearer,
    /// Chi-squared where noise alone is.
    pub statistic: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// Normal deviate of the statistic.
    pub deviate: f64,
    /// Share of the squares of the residuals that it removes.
    pub share: f64,
    /// RMS of the pattern in the residuals, px.
    pub rms_px: f64,
    /// What would be found with a probability of 95 %, px RMS in the residuals.
    pub least_px: f64,
    /// What it gains beyond its number of columns.
    pub gain: f64,
    /// By how much the step to the fit with these columns moves what counts, and what is stated of it; none of shifts in the plate.
    pub moved: Option<PatternEffect>,
}

impl PatternTest {
    /// True where chance does not leave it.
    pub fn is_found(&self, limits: &Limits) -> bool {
        self.deviate > limits.pattern_sigmas
    }
}

/// A group of columns with its place among all of them.
struct Group {
    pattern: Pattern,
    bearer: Bearer,
    first: usize,
}

/// Tests every pattern; `None` without images.
///
/// # Errors
/// Normal equations that are singular.
pub fn patterns(fit: &Fit, limits: &Limits) -> Result<Vec<PatternTest>, Singular> {
    let linear = fit.linear();
    if linear.images().len() == 0 {
        return Ok(Vec::new());
    }
    let groups = groups(fit);
    let response = response(fit, &groups)?;
    let framed = fit.in_frame().ok();
    let stated = framed.as_ref().map(|framed| framed.dense(fit.problem.layout.len()));
    let effects = Effects::of(fit, framed.as_ref(), stated.as_ref().unwrap_or(&fit.covariance.reduced), limits);
    let (n, squares) = (response.equations as f64, response.squares);
    let points: usize = linear.images().map(|i| i.terms.residuals.len()).sum();
    let sum: f64 = linear.images().flat_map(|i| i.terms.residuals.iter()).map(|r| r.duv.norm_squared()).sum();
    let rms_px = (sum / points.max(1) as f64).sqrt();
    let of_group = |g: &Group| {
        let Solved { y, removed, statistic, uneven, degrees } = solved(&response, g);
        let share = removed / (removed + squares);
        let step = combined(&response.steps[g.first..g.first + y.len()], &y)?;
        let shift = |plate: usize, marker: usize| match g.bearer {
            Bearer::Plate(k) if k == plate => {
                let shifts = plate_shifts(g.pattern, &on_plate(&fit.state.plates[plate], marker));
                shifts.into_iter().zip(y.iter()).map(|(shift, &y)| shift * y).sum()
            }
            _ => Vector3::zeros(),
        };
        Some(PatternTest {
            pattern: g.pattern,
            bearer: g.bearer,
            statistic,
            degrees,
            deviate: deviate(statistic, degrees as f64),
            share,
            rms_px: rms_px * share.sqrt(),
            least_px: rms_px * (uneven * least(degrees, limits.pattern_sigmas) / squares).sqrt(),
            gain: statistic - degrees as f64 * n.ln(),
            // Shifts in the plate trade against its size, by which the step moves everything: that is judged by itself.
            moved: (g.pattern != Pattern::PlatePrint).then(|| effects.moved(&step, shift)),
        })
    };
    let mut tests: Vec<PatternTest> = groups.iter().filter_map(of_group).collect();
    tests.extend(tolerances(fit, rms_px, squares, limits));
    Ok(tests)
}

/// True where the residuals of a camera show a pattern over image or depth that noise does not leave, near an optimum; false without images.
///
/// # Errors
/// Normal equations that are singular.
pub fn camera_shows_pattern(fit: &Fit, camera: usize, limits: &Limits) -> Result<bool, Singular> {
    if fit.linear().images().len() == 0 {
        return Ok(false);
    }
    let groups = placed(Pattern::OF_CAMERA.into_iter().map(|p| (p, Bearer::Camera(camera))));
    let response = response(fit, &groups)?;
    let is_found = |g: &Group| {
        let Solved { statistic, degrees, .. } = solved(&response, g);
        deviate(statistic, degrees as f64) > limits.pattern_sigmas
    };
    Ok(groups.iter().any(is_found))
}

/// The pattern that names the cause: of those beyond chance that which gains most, or the simplest that removes nearly as much of the squares
/// of the residuals (what is of second order in a large fault belongs to no first-order column, and many columns take more of it).
pub fn cause<'a>(tests: &'a [PatternTest], limits: &Limits) -> Option<&'a PatternTest> {
    let found = || tests.iter().filter(|t| t.is_found(limits));
    let best = found().max_by(|a, b| a.gain.total_cmp(&b.gain))?;
    if best.pattern == Pattern::Tolerance {
        return Some(best);
    }
    let alike = |t: &&PatternTest| {
        let is_simpler = t.pattern != Pattern::Tolerance && t.degrees < best.degrees;
        is_simpler && t.share >= limits.pattern_share * best.share
    };
    found().filter(alike).min_by_key(|t| t.degrees).or(Some(best))
}

fn groups(fit: &Adjustment) -> Vec<Group> {
    let of_cameras = (0..fit.problem.cameras.len()).flat_map(|k| Pattern::OF_CAMERA.map(|p| (p, Bearer::Camera(k))));
    let of_plates = (0..fit.problem.plates.len()).flat_map(|k| Pattern::OF_PLATE.map(|p| (p, Bearer::Plate(k))));
    placed(of_cameras.chain(of_plates))
}

fn placed(patterns: impl Iterator<Item = (Pattern, Bearer)>) -> Vec<Group> {
    let mut next = 0;
    let place = |(pattern, bearer): (Pattern, Bearer)| {
        let first = next;
        next += pattern.columns();
        Group { pattern, bearer, first }
    };
    patterns.map(place).collect()
}

fn response(fit: &Fit, groups: &[Group]) -> Result<Response, Singular> {
    let count = groups.iter().map(|g| g.pattern.columns()).sum();
    fit.response(count, |image, equations| columns(fit, groups, image, equations, count))
}

/// Columns of an image, whitened, equations x columns.
fn columns(fit: &Adjustment, groups: &[Group], own: &LinearImage, equations: &Equations, count: usize) -> DMatrix<f64> {
    let image = own.image;
    let (camera, plate) = (&fit.state.cameras[image.camera], &fit.state.plates[image.plate]);
    let mut all = DMatrix::zeros(2 * equations.markers.len(), count);
    let corner = camera.corner();
    for (o, (sight, &marker)) in equations.sights().zip(&equations.markers).enumerate() {
        let at = own.chain.pose.transform(&plate.position(marker));
        let Some(seen) = camera.project_with_jacobian(&at) else { continue };
        let intrinsics = sight.by_intrinsics();
        let by_pixel: SMatrix<f64, 2, 2> = SMatrix::from_columns(&CENTRE.map(|e| intrinsics.row(e).transpose()));
        let by_marker: Matrix3x2<f64> = sight.by_marker();
        let p = &camera.parameters;
        let y = Vector2::new((seen.uv.x - p[2]) / p[0], (seen.uv.y - p[3]) / p[1]) / corner;
        let middle = |n: u32| 0.5 * (f64::from(n) - 1.0);
        let (mu, mv) = (middle(camera.width_px), middle(camera.height_px));
        let across = Vector2::new((seen.uv.x - mu) / mu, (seen.uv.y - mv) / mv);
        let on_plate = on_plate(plate, marker);
        for g in groups {
            let mut put = |k: usize, column: Vector2<f64>| {
                all.fixed_view_mut::<2, 1>(2 * o, g.first + k).copy_from(&column);
            };
            match g.bearer {
                Bearer::Camera(k) if k == image.camera => {
                    let shifts = image_shifts(g.pattern, &y, &across, at.z);
                    shifts.into_iter().enumerate().for_each(|(k, px)| put(k, by_pixel * px));
                }
                Bearer::Plate(k) if k == image.plate => {
                    let shifts = plate_shifts(g.pattern, &on_plate);
                    shifts.into_iter().enumerate().for_each(|(k, m)| put(k, by_marker.tr_mul(&m)));
                }
                _ => {}
            }
        }
    }
    all
}

/// Displacements in the image, px, at `y` (1 at the corner) from the axis, at `across` (-1 to 1) of the image.
fn image_shifts(pattern: Pattern, y: &Vector2<f64>, across: &Vector2<f64>, depth_m: f64) -> Vec<Vector2<f64>> {
    let t2 = y.norm_squared();
    let mut shifts = Vec::with_capacity(pattern.columns());
    match pattern {
        Pattern::ThinPrism => {
            shifts.extend([(t2, 0.0), (t2 * t2, 0.0), (0.0, t2), (0.0, t2 * t2)].map(|(u, v)| Vector2::new(u, v)));
        }
        Pattern::Radial => shifts.extend([y * t2.powi(4), y * t2.powi(5)]),
        Pattern::Parallax => shifts.extend([y * (t2 / depth_m), y * (t2 * t2 / depth_m)]),
        Pattern::Field => each_polynomial(across, FIELD_DEGREES, |b| {
            shifts.extend([Vector2::new(b, 0.0), Vector2::new(0.0, b)]);
        }),
        Pattern::PlateBow | Pattern::PlatePrint | Pattern::Tolerance => {}
    }
    shifts
}

/// Place of a marker, 1 at the farthest.
fn on_plate(plate: &PlateShape, marker: usize) -> Vector2<f64> {
    plate.nominal[marker].xy() / plate.half_diagonal_m.max(f64::MIN_POSITIVE)
}

/// Displacements of a marker, m.
fn plate_shifts(pattern: Pattern, at: &Vector2<f64>) -> Vec<Vector3<f64>> {
    let mut shifts = Vec::with_capacity(pattern.columns());
    match pattern {
        Pattern::PlateBow => {
            each_polynomial(at, BOW_DEGREES, |b| shifts.push(Vector3::new(0.0, 0.0, b * PLATE_UNIT_M)));
        }
        Pattern::PlatePrint => each_polynomial(at, PRINT_DEGREES, |b| {
            shifts.extend([Vector3::new(b * PLATE_UNIT_M, 0.0, 0.0), Vector3::new(0.0, b * PLATE_UNIT_M, 0.0)]);
        }),
        _ => {}
    }
    shifts
}

/// Products of Legendre polynomials of a range of degrees.
fn each_polynomial(at: &Vector2<f64>, [low, high]: [usize; 2], mut tell: impl FnMut(f64)) {
    let legendre = |x: f64| {
        let mut p = [1.0; HIGHEST + 1];
        p[1] = x;
        for k in 1..high {
            let n = k as f64;
            p[k + 1] = ((2.0 * n + 1.0) * x * p[k] - n * p[k - 1]) / (n + 1.0);
        }
        p
    };
    let (x, y) = (legendre(at.x), legendre(at.y));
    (low..=high).for_each(|d| (0..=d).for_each(|i| tell(x[i] * y[d - i])));
}

/// What a group of columns takes.
struct Solved {
    /// `M^-1 s`.
    y: DVector<f64>,
    /// `F`.
    removed: f64,
    /// `F / c`.
    statistic: f64,
    /// `c`, where it is more than one.
    uneven: f64,
    /// Directions that the rest of the fit does not absorb.
    degrees: usize,
}

fn solved(response: &Response, group: &Group) -> Solved {
    let (first, count) = (group.first, group.pattern.columns());
    let scale = response.by_itself.rows(first, count).map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
    let m = response.information.view((first, first), (count, count));
    let scaled = DMatrix::from_fn(count, count, |i, k| m[(i, k)] * scale[i] * scale[k]);
    let score = response.score.rows(first, count).component_mul(&scale);
    let none = || Solved { y: DVector::zeros(count), removed: 0.0, statistic: 0.0, uneven: 1.0, degrees: 0 };
    let Some((values, vectors)) = symmetric_eigen(&scaled) else { return none() };
    let least = (ABSORBED * values.max()).max(LEAST_SHARE);
    let mut y = DVector::zeros(count);
    let w = response.scatter.view((first, first), (count, count));
    let (mut statistic, mut scatter, mut degrees) = (0.0, 0.0, 0);
    for (value, vector) in values.iter().zip(vectors.column_iter()).filter(|(value, _)| **value > least) {
        let along = vector.dot(&score);
        y += vector * (along / value);
        statistic += along * along / value;
        let direction = vector.component_mul(&scale);
        scatter += (w * &direction).dot(&direction) / value;
        degrees += 1;
    }
    let uneven = (scatter * response.equations as f64 / (degrees.max(1) as f64 * response.squares)).max(1.0);
    // One step from a large fault may take more than there is.
    let taken = (statistic / response.squares).min(1.0 - f64::EPSILON);
    let removed = taken * (response.squares - degrees as f64).max(1.0) / (1.0 - taken);
    Solved { y: y.component_mul(&scale), removed, statistic: removed / uneven, uneven, degrees }
}

/// `-X y`.
fn combined(steps: &[Step], y: &DVector<f64>) -> Option<Step> {
    let none = steps.first()?.none();
    Some(steps.iter().zip(y.iter()).fold(none, |sum, (step, y)| sum.plus(-y, step)))
}

/// Normal deviate of a chi-squared statistic (E. Wilson and M. Hilferty 1931).
pub(super) fn deviate(statistic: f64, degrees: f64) -> f64 {
    let spread = 2.0 / (9.0 * degrees.max(1.0));
    ((statistic / degrees.max(1.0)).cbrt() - (1.0 - spread)) / spread.sqrt()
}

/// Noncentrality at which a statistic is beyond `sigmas` with a probability of 95 %.
fn least(degrees: usize, sigmas: f64) -> f64 {
    let m = degrees.max(1) as f64;
    let spread = 2.0 / (9.0 * m);
    let beyond = m * (1.0 - spread + sigmas * spread.sqrt()).powi(3);
    // Mean m + l, variance 2 (m + 2 l).
    let mut l = beyond;
    for _ in 0..50 {
        l = (beyond - m + POWER_95 * (2.0 * (m + 2.0 * l)).sqrt()).max(0.0);
    }
    l
}

/// Do the corrections of the markers fit their stated tolerance? Their squares over the coordinates that the data tell.
fn tolerances(fit: &Fit, rms_px: f64, squares: f64, limits: &Limits) -> Vec<PatternTest> {
    if !fit.problem.noise.marker.is_empty() {
        return Vec::new();
    }
    let tallies = fit.marker_tallies().into_iter().enumerate();
    let told = tallies.filter(|(_, [_, told])| *told >= limits.tolerance_coordinates);
    told.map(|(plate, [sum, told])| {
        let ratio = sum / told;
        PatternTest {
            pattern: Pattern::Tolerance,
            bearer: Bearer::Plate(plate),
            statistic: sum,
            degrees: told.round() as usize,
            deviate: deviate(sum, told.round()),
            share: 0.0,
            rms_px: f64::NAN,
            least_px: rms_px * (least(told.round() as usize, limits.pattern_sigmas) / squares).sqrt(),
            // Twice the gain in the logarithm of the density, less the price of one parameter.
            gain: told * (ratio - 1.0 - ratio.max(f64::MIN_POSITIVE).ln()) - told.ln(),
            moved: None,
        }
    })
    .collect()
}
