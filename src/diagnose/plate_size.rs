//! Whether a plate has the size that its file states. The lengths of the robot's links are the only others there are; of poses without a robot, the
//! positions of the controller.

use std::collections::BTreeSet;

use nalgebra::{DVector, Vector3};

use super::joint_noise::{JointNoiseLarge, noisiest_joint};
use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use super::parameter_off::{ParameterOff, usual_deviations};
use super::rail::{OR_THE_RAIL, is_on_rail, with_gears_released};
use super::slopes::slopes;
use crate::assess::{Accuracy, Limits};
use crate::error::Code;
use crate::fit::Fit;
use crate::model::plate_modes::{ASPECT, DOT_GAIN, MODES};
use crate::problem::{Adjustment, PlateShape, Problem, SCALE, State, UNKNOWN_SCALE, size_by_distance, telling_markers};
use crate::series::Plate;
use crate::solve::{ComponentOptions, Elimination, Status, System, estimate_components};

/// Stops that tell of the size: what more of them leave open is small beside what the links do.
const MOST_STOPS: usize = 2000;

/// The lengths that tell the size of a plate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ToldBy {
    /// Those of the links.
    Links,
    /// The same with a rail that moves the arm or the plate, whose readings may be as wrong as the plate's size.
    LinksOnRail,
    /// Those of the links and of other plates: where these are of another size than stated, they say so of a right one.
    LinksAndPlates,
    /// Those between poses of a controller: nothing is known of the links.
    Poses,
}

impl ToldBy {
    fn of(Adjustment { problem, state }: &Adjustment) -> Self {
        match state.robot.chain.pose_coordinates() {
            Some(_) => Self::Poses,
            None if is_on_rail(state) => Self::LinksOnRail,
            None if (0..problem.plates.len()).filter(|k| is_free(problem, *k)).count() > 1 => Self::LinksAndPlates,
            None => Self::Links,
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Links | Self::LinksOnRail => "the links of the robot",
            Self::LinksAndPlates => "the links of the robot and the other plates",
            Self::Poses => "the positions of the controller",
        }
    }
}

/// A reason not to believe the size of a plate.
#[derive(Debug, Clone, PartialEq)]
pub enum DoubtedSize {
    /// The links of the robot, or the positions of its controller, say another size.
    Contradicted {
        /// The plate; its number where there are several.
        plate: String,
        /// True where the size was measured (`[scale]`).
        measured: bool,
        /// Relative difference: larger is positive.
        off: f64,
        /// Its standard deviation.
        sigma: f64,
        /// Gate or note.
        weight: Weight,
        /// What says so.
        told_by: ToldBy,
        /// Series that show the plate.
        shown_in: Vec<String>,
        /// What is in order of the robot with the size that it says.
        in_order: InOrder,
    },
    /// Rows and columns differ in scale.
    Uneven {
        /// The plate; its number where there are several.
        plate: String,
        /// Relative difference.
        off: f64,
        /// Prior sigma of it.
        tolerance: f64,
        /// By how much it is longer along x and along y than its file says, each with its standard deviation, as far as its size is told.
        along: Option<[(f64, f64); 2]>,
        /// What tells its size.
        told_by: ToldBy,
        /// What is in order of the robot with the size that it tells.
        in_order: InOrder,
    },
}

/// What is in order of a robot in the fit with a free size of a plate, whatever the fit with the stated size says.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct InOrder {
    /// Series whose joint noise is that of robots.
    series: Vec<String>,
    /// Parameters that are as far from nominal as robots are.
    parameters: Vec<String>,
}

impl InOrder {
    /// Parameters are held against what is stated of them in `problem`: none is released there.
    fn of(released: &Fit, problem: &Problem, setting: &CheckContext) -> Self {
        let limits = setting.limits;
        let is_quiet =
            |k: usize| noisiest_joint(released, k).is_some_and(|(.., sigma)| sigma < limits.unusual_joint_noise);
        // A noise that was stated is none that was found.
        let all = if setting.stated_noise.is_some() { &[][..] } else { setting.series };
        let series = all.iter().enumerate().filter(|(k, _)| is_quiet(*k)).map(|(_, s)| s.name.clone()).collect();
        let values = released.state.values(&problem.layout);
        let is_usual = |c: &usize| usual_deviations(problem, &values, *c) <= limits.sigmas_beyond_tolerance;
        let usual = problem.layout.robot().filter(is_usual);
        let parameters = usual.map(|c| problem.layout.columns[c].name.clone()).collect();
        Self { series, parameters }
    }
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<DoubtedSize> {
    let (problem, limits) = (&fit.problem, setting.limits);
    let some = fit.adjustment.some_stops(MOST_STOPS, MOST_STOPS);
    let told_by = ToldBy::of(&fit.adjustment);
    let mut doubts = Vec::new();
    for (k, stated) in problem.plates.iter().enumerate() {
        let plate = problem.plate_name(k);
        let released = ReleasedSize::of(some.as_ref().unwrap_or(&fit.adjustment), k);
        let beyond = |told: &SizeDifference, sigmas: f64| told.off.abs() > sigmas * told.sigma;
        // A size that is stated wrongly makes the links look worse than they are, and what they say less certain; a stretched plate as well.
        let is_suspected = || released.one_step().is_some_and(|told| beyond(&told, limits.plate_size_suspected));
        let uneven = uneven(&fit.adjustment, k, limits);
        let fitted = if uneven.is_some() || is_suspected() { released.fitted(problem, setting) } else { None };
        let fitted = fitted.filter(|fitted| fitted.told.relative_sigma() < limits.plate_size_told);
        let in_order = || fitted.as_ref().map(|fitted| fitted.in_order.clone()).unwrap_or_default();
        let measured = stated.scale.is_some();
        if let Some(Fitted { told, .. }) = &fitted
            && let Some(weight) = match told {
                told if beyond(told, limits.plate_size_sigmas) => Some(Weight::Gate),
                told if !measured && beyond(told, limits.plate_size_doubtful) => Some(Weight::Note),
                _ => None,
            }
        {
            let (off, sigma, in_order) = (told.off, told.sigma, in_order());
            let (plate, shown_in) = (plate.clone(), shown_in(problem, k, setting));
            doubts.push(DoubtedSize::Contradicted { plate, measured, off, sigma, weight, told_by, shown_in, in_order });
        }
        if let Some((off, tolerance)) = uneven {
            let along = fitted.as_ref().and_then(|Fitted { told, along, .. }| {
                let (axes, by_markers) = ((*along)?, stretch(&fit.adjustment, k)?);
                Some([0, 1].map(|axis| (axes[axis], told.sigma.hypot(by_markers[axis].1))))
            });
            doubts.push(DoubtedSize::Uneven { plate, off, tolerance, along, told_by, in_order: in_order() });
        }
    }
    doubts
}

/// Names of the series whose images in use show a plate.
fn shown_in(problem: &Problem, plate: usize, setting: &CheckContext) -> Vec<String> {
    let showing = problem.used().filter(|(_, image)| image.plate == plate).map(|(_, image)| image.series);
    showing.collect::<BTreeSet<usize>>().into_iter().map(|series| setting.series[series].name.clone()).collect()
}

/// By how much plates, by their names, are larger than stated for a robot that is held, which counts as exact: where `fitted` has camera and plates
/// fitted to it, all lengths are the robot's. None of a plate whose size nothing tells.
pub fn sizes_by_robot(fitted: &Adjustment) -> Vec<(String, SizeDifference)> {
    let of = |plate: usize| Some((fitted.problem.plate_name(plate), ReleasedSize::of(fitted, plate).one_step()?));
    (0..fitted.problem.plates.len()).filter_map(of).collect()
}

/// Plates whose rows and columns differ in scale, as images alone say: their shape needs no robot.
pub fn uneven_plates(adjustment: &Adjustment, limits: &Limits) -> Vec<DoubtedSize> {
    let all = (0..adjustment.problem.plates.len()).filter_map(|k| Some((k, uneven(adjustment, k, limits)?)));
    let uneven = |(k, (off, tolerance))| DoubtedSize::Uneven {
        plate: adjustment.problem.plate_name(k),
        off,
        tolerance,
        along: None,
        told_by: ToldBy::Links,
        in_order: InOrder::default(),
    };
    all.map(uneven).collect()
}

/// The x/y scale of a plate whose size was not measured and its prior sigma, where it is far beyond that.
fn uneven(adjustment: &Adjustment, plate: usize, limits: &Limits) -> Option<(f64, f64)> {
    let told = x_y_scale(adjustment, plate).filter(|_| adjustment.problem.plates[plate].scale.is_none());
    told.filter(|(off, tolerance)| off.abs() > limits.plate_aspect_sigmas * tolerance)
}

impl DoubtedSize {
    /// The same of the plate of a series, which others do not share.
    #[must_use]
    pub fn of_series(mut self, series: &str) -> Self {
        let (Self::Contradicted { plate, .. } | Self::Uneven { plate, .. }) = &mut self;
        *plate = format!("{plate} of series {series}");
        self
    }

    /// What is in order without the doubt, where that fails the result.
    fn in_order(&self) -> Option<&InOrder> {
        let (Self::Contradicted { in_order, .. } | Self::Uneven { in_order, .. }) = self;
        Some(in_order).filter(|_| self.weight() == Weight::Gate)
    }

    /// True where it is noted only, and what moved in a series that shows the plate weighs more and may be why it seems off.
    pub(super) fn is_of_what_moved_in(&self, series: &str, weight: Weight) -> bool {
        let Self::Contradicted { shown_in, .. } = self else { return false };
        self.weight() < weight && shown_in.iter().any(|own| own == series)
    }

    /// True where the joint noise of a series is in order with the size that is told.
    pub(super) fn explains_noise(&self, noise: &JointNoiseLarge) -> bool {
        self.in_order().is_some_and(|in_order| in_order.series.contains(&noise.series))
    }

    /// The same of a parameter.
    pub(super) fn explains_parameter(&self, off: &ParameterOff) -> bool {
        self.in_order().is_some_and(|in_order| in_order.parameters.contains(&off.parameter))
    }

    /// Relative size of what is in doubt: of a stretched plate of the length that is off most, where the links tell.
    pub fn relative(&self) -> f64 {
        match self {
            Self::Contradicted { off, .. } | Self::Uneven { off, along: None, .. } => off.abs(),
            Self::Uneven { along: Some([x, y]), .. } => x.0.abs().max(y.0.abs()),
        }
    }
}

impl Kind for DoubtedSize {
    fn code(&self) -> Code {
        match self {
            Self::Contradicted { .. } => Code::PlateSizeContradicted,
            Self::Uneven { .. } => Code::PlateUneven,
        }
    }

    fn weight(&self) -> Weight {
        match self {
            Self::Contradicted { weight, .. } => *weight,
            Self::Uneven { .. } => Weight::Gate,
        }
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Body(self.place())]
    }

    fn quantities(&self) -> Vec<Quantity> {
        match *self {
            Self::Contradicted { off, sigma, .. } => vec![Quantity::new("relative_size", off, "1").with_sigma(sigma)],
            Self::Uneven { off, tolerance, along, .. } => {
                let all = [Quantity::new("relative_x_y_scale", off, "1"), Quantity::new("tolerance", tolerance, "1")];
                let along = along.into_iter().flatten().zip(["stretch_x", "stretch_y"]);
                let along = along.map(|((size, sigma), name)| Quantity::new(name, size, "1").with_sigma(sigma));
                all.into_iter().chain(along).collect()
            }
        }
    }

    fn place(&self) -> String {
        let (Self::Contradicted { plate, .. } | Self::Uneven { plate, .. }) = self;
        plate.clone()
    }

    fn seen(&self) -> String {
        match self {
            Self::Contradicted { measured, off, sigma, told_by, .. } => format!(
                "{} say that it is {:.2} % (+- {:.2} %) {} than {} says, and every length goes wrong with it",
                told_by.name(),
                100.0 * off.abs(),
                100.0 * sigma,
                if *off > 0.0 { "larger" } else { "smaller" },
                if *measured { "[scale]" } else { "its file" },
            ),
            Self::Uneven { off, along, told_by, .. } => format!(
                "its rows and columns differ in scale by {:.2} %{}, so it was not made to size, and all lengths hang on its size",
                100.0 * off.abs(),
                along.map_or_else(String::new, |[(x, sigma_x), (y, sigma_y)]| format!(
                    " (by {} it is {:+.2} % along x and {:+.2} % along y, +- {:.2} %)",
                    told_by.name(),
                    100.0 * x,
                    100.0 * y,
                    100.0 * sigma_x.max(sigma_y)
                ))
            ),
        }
    }

    fn remedy(&self) -> String {
        let (Self::Contradicted { told_by, .. } | Self::Uneven { told_by, .. }) = *self;
        let remedy = match self {
            Self::Contradicted { measured: true, told_by: ToldBy::Poses, .. } => {
                "check that distance, and that the positions in controller.csv are in metres; a controller whose model of its arm is of another size computes them too long or too short"
            }
            Self::Contradicted { measured: false, told_by: ToldBy::Poses, .. } => {
                "measure two far markers and give [scale] in plate.toml, or correct its pitch_m (of tags tag_m or marker_m); if the plate is right, the controller computes its positions by an arm of another size, or in another unit"
            }
            Self::Contradicted { measured: true, .. } => {
                "check that distance, and that the lengths in the URDF are those of this robot"
            }
            Self::Contradicted { measured: false, .. } => {
                "measure two far markers and give [scale] in plate.toml, or correct its pitch_m (of tags tag_m or marker_m); if the plate is right, the URDF is of another robot or size"
            }
            Self::Uneven { .. } => "measure two far markers and give [scale] in plate.toml",
        };
        let others = match told_by {
            ToldBy::LinksOnRail => OR_THE_RAIL,
            ToldBy::LinksAndPlates => "; the other plates may be of another size as well: measure them alike",
            _ => "",
        };
        format!("{remedy}{others}")
    }
}

/// What images and links say of the size of a plate, less the stated one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizeDifference {
    /// By how much it is larger than stated, relative.
    pub off: f64,
    /// Standard deviation of that, that of the stated size included.
    pub sigma: f64,
}

impl SizeDifference {
    /// Standard deviation, relative to the size that is told: that of a size that tends to nothing tends to nothing, too.
    fn relative_sigma(&self) -> f64 {
        if self.off > -1.0 { self.sigma / (1.0 + self.off) } else { f64::INFINITY }
    }
}

/// What a fit with a free size says.
struct Fitted {
    told: SizeDifference,
    /// By how much the plate is longer along x and along y.
    along: Option<[f64; 2]>,
    in_order: InOrder,
}

/// An adjustment in which nothing but images and links tells the size of a plate.
struct ReleasedSize<'a> {
    adjustment: Adjustment,
    index: usize,
    /// The plate with what was measured of it.
    plate: &'a Plate,
    /// Sigma of the stated size.
    stated: f64,
}

/// Makes the size of a plate one of which nothing is known beforehand.
fn release(adjustment: &mut Adjustment, index: usize) {
    let at = adjustment.problem.layout.shapes[index].start + SCALE;
    adjustment.problem.layout.columns[at].prior_sigma = UNKNOWN_SCALE;
    let released = &mut adjustment.problem.plates[index];
    released.scale = None;
    // The markers keep the shape that was found, and grow with the plate: corrections with a tolerance in metres, and modes beside the stated size, would
    // ask for a plate of no size.
    released.markers.iter_mut().for_each(|m| m.sigma_m = 0.0);
    let start = adjustment.problem.layout.shapes[index].start;
    let shape = &mut adjustment.state.plates[index];
    let grown = 1.0 + shape.modes[SCALE];
    shape.nominal = (0..shape.nominal.len()).map(|m| shape.position(m) / grown).collect();
    shape.corrections.fill(Vector3::zeros());
    for mode in (0..MODES).filter(|mode| ![SCALE, DOT_GAIN].contains(mode)) {
        shape.modes[mode] = 0.0;
        adjustment.problem.layout.columns[start + mode].prior_mean = 0.0;
    }
}

/// Whether the size of a plate is not held.
fn is_free(problem: &Problem, plate: usize) -> bool {
    problem.layout.columns[problem.layout.shapes[plate].start + SCALE].free
}

/// With sizes of plates of which nothing is known beforehand; `None` where none tells a size.
pub(super) fn with_sizes_released(whole: &Adjustment) -> Option<Adjustment> {
    let plates: Vec<usize> = (0..whole.problem.plates.len()).filter(|k| is_free(&whole.problem, *k)).collect();
    (!plates.is_empty()).then(|| {
        let mut released = whole.clone();
        plates.into_iter().for_each(|k| release(&mut released, k));
        released
    })
}

impl<'a> ReleasedSize<'a> {
    fn of(whole: &'a Adjustment, index: usize) -> Self {
        let mut adjustment = with_gears_released(whole).unwrap_or_else(|| whole.clone());
        let plate = &whole.problem.plates[index];
        let column = &whole.problem.layout.columns[whole.problem.layout.shapes[index].start + SCALE];
        let stated = plate.scale.map_or(column.prior_sigma, |bar| bar.sigma_m / bar.distance_m);
        release(&mut adjustment, index);
        Self { adjustment, index, plate, stated }
    }

    fn column(&self) -> usize {
        self.adjustment.problem.layout.shapes[self.index].start + SCALE
    }

    /// By one step from the fit with the stated size; `None` where the size is held, or nothing tells it.
    fn one_step(&self) -> Option<SizeDifference> {
        let at = self.column();
        let lin = self.adjustment.linearise()?;
        let linear = self.adjustment.linear(&lin);
        let system = System::with(Elimination::of_steps(linear), linear, 0.0);
        let factor = system.factor(linear).ok()?;
        let mut along = DVector::zeros(system.rhs.len());
        along[at] = 1.0;
        let variance = factor.solve(&along)[at];
        self.told(&self.adjustment.state, factor.solve(&system.rhs)[at], variance)
    }

    /// By a fit of its own, sizes of the errors included; `None` where it has no end. A joint noise that was not stated is free: a plate of another
    /// size looks like noise. `stated` is the problem in which nothing is released.
    fn fitted(&self, stated: &Problem, setting: &CheckContext) -> Option<Fitted> {
        let joint = setting.stated_noise.is_none();
        let options = ComponentOptions { joint, displacement: false, ..ComponentOptions::default() };
        let outcome = estimate_components(self.adjustment.clone(), &options);
        let fit = Some(outcome).filter(|o| o.status == Status::Converged)?.fit().ok()?;
        let told = self.told(&fit.state, 0.0, fit.covariance.reduced[(self.column(), self.column())])?;
        let lacks = told.off - self.off(&fit.state);
        let along = stretch(&fit.adjustment, self.index).map(|along| along.map(|(off, _)| off + lacks));
        Some(Fitted { told, along, in_order: InOrder::of(&fit, stated, setting) })
    }

    /// By how much the plate of a state is larger than stated.
    fn off(&self, state: &State) -> f64 {
        let (at, shape) = (self.column(), &state.plates[self.index]);
        match size_by_distance(self.plate, shape) {
            Some(size) => 1.0 / size - 1.0,
            None => {
                let grown = growth(&self.adjustment.problem, shape, self.index).unwrap_or(shape.modes[SCALE]);
                grown - self.adjustment.problem.layout.columns[at].prior_mean
            }
        }
    }

    /// From a state, a step of the scale that it lacks, and the variance of the scale with next to nothing known of it beforehand.
    fn told(&self, state: &State, step: f64, variance: f64) -> Option<SizeDifference> {
        let column = &self.adjustment.problem.layout.columns[self.column()];
        let share = 1.0 - variance * UNKNOWN_SCALE.powi(-2);
        // The prior of next to nothing holds the scale back by the rest.
        let mode = state.plates[self.index].modes[SCALE] - column.prior_mean + step;
        let off = self.off(state) + step + mode * (share.recip() - 1.0);
        (column.free && share > 0.0)
            .then(|| SizeDifference { off, sigma: (variance / share + self.stated.powi(2)).sqrt() })
    }
}

/// A marker of a plate that was seen, and is none that was moved: where it should be, by its file, where it is, and the variance per axis that its tolerance leaves it.
struct Place {
    stated: Vector3<f64>,
    found: Vector3<f64>,
    variance: f64,
}

fn places(problem: &Problem, shape: &PlateShape, plate: usize) -> Vec<Place> {
    let place = |m: usize| Place {
        stated: problem.plates[plate].markers[m].position_m,
        found: shape.position(m),
        variance: problem.marker_information(plate, m).recip(),
    };
    telling_markers(problem, plate).into_iter().map(place).collect()
}

/// By how much the markers of a plate that were seen lie further apart than its file says.
fn growth(problem: &Problem, shape: &PlateShape, plate: usize) -> Option<f64> {
    let places = places(problem, shape, plate);
    let middle = places.iter().map(|place| place.stated).sum::<Vector3<f64>>() / places.len().max(1) as f64;
    let (mut along, mut square) = (0.0, 0.0);
    for Place { stated, found, .. } in &places {
        along += (stated - middle).dot(&(found - stated));
        square += (stated - middle).norm_squared();
    }
    (square > 0.0).then(|| along / square)
}

/// The same along x and along y, each with what the tolerance of the markers leaves open of it. What is turned or skew is none of it.
fn stretch(Adjustment { problem, state }: &Adjustment, plate: usize) -> Option<[(f64, f64); 2]> {
    let places = places(problem, &state.plates[plate], plate);
    let variance = places.iter().map(|place| place.variance).sum::<f64>() / places.len().max(1) as f64;
    let along = |axis: usize| {
        let displaced = places.iter().map(|Place { stated, found, .. }| (stated.xy(), found[axis] - stated[axis]));
        let found = slopes(&displaced.collect::<Vec<_>>())?;
        Some((found.of[axis], (variance * found.covariance[(axis, axis)]).sqrt()))
    };
    Some([along(0)?, along(1)?])
}

/// The x/y scale of the markers that were seen, corrections included, and its prior sigma.
fn x_y_scale(adjustment: &Adjustment, plate: usize) -> Option<(f64, f64)> {
    let layout = &adjustment.problem.layout;
    let prior = layout.columns[layout.shapes[plate].start + ASPECT].prior_sigma;
    stretch(adjustment, plate).map(|[x, y]| (x.0 - y.0, prior.hypot(x.1).hypot(y.1)))
}
