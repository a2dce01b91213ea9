//! What planned images will be worth: predicted accuracy of the flange and of every parameter.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::choose::{Choice, Demand, Plan, PlanRequest};
use crate::assess::root_of_mean;
use crate::error::{Code, Error, Result};
use crate::linalg::SymmetricFactor;
use crate::plan::criterion::Criterion;
use crate::plan::setting::{PlannedStop, Setting};
use crate::problem::Adjustment;
use crate::series::CameraMount;
use crate::urdf::JointKind;

/// Predicted sigma of one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterForecast {
    /// Name of the column.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// Before.
    pub prior_sigma: f64,
    /// After the planned images.
    pub sigma: f64,
    /// What this sigma alone does to the flange over the targets, RMS, m.
    pub flange_m: f64,
}

/// A point of the curve of accuracy over the number of images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurvePoint {
    /// Planned images.
    pub images: usize,
    /// RMS error of the flange over the targets, m.
    pub planned_m: f64,
    /// The same for as many of the candidates drawn at random, RMS over several choices, m.
    pub random_m: f64,
}

/// Range of one joint.
#[derive(Debug, Clone, PartialEq)]
pub struct JointRange {
    /// Name.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Limits, rad or m.
    pub limits: (f64, f64),
    /// Readings of the planned stops.
    pub planned: Vec<f64>,
}

/// What one planned image brings: on top of the images that were taken, or, where there are none, of all other planned ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Gain {
    /// Index into the legs.
    pub leg: usize,
    /// RMS error of the flange before and after, m.
    pub flange_m: [f64; 2],
    /// Parameter whose part in it shrinks most.
    pub parameter: String,
    /// Its unit.
    pub unit: &'static str,
    /// Its sigma before and after.
    pub sigma: [f64; 2],
}

/// The forecast of a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Forecast {
    /// RMS error of the flange over the targets before any planned image, m.
    pub before_m: f64,
    /// After all of them, m.
    pub flange_m: f64,
    /// Parameters of the robot.
    pub parameters: Vec<ParameterForecast>,
    /// Accuracy over the number of images.
    pub curve: Vec<CurvePoint>,
    /// Chosen stops by importance (indices into the legs), the most important first.
    pub importance: Vec<usize>,
    /// What every image brings, the greatest gain first.
    pub gains: Vec<Gain>,
    /// Joint ranges.
    pub ranges: Vec<JointRange>,
    /// What will stay unknown, and other remarks, in words.
    pub words: Vec<String>,
}

/// Share of a prior variance that must go before a parameter counts as known.
pub(super) const KNOWN_SHARE: f64 = 0.75;
/// Random choices over which the curve of random images is the mean.
const RANDOM_DRAWS: usize = 5;
/// Share below which a parameter asked for counts as not found.
const LEAST_SHARE: f64 = 0.3;
/// Range of a joint that is called small, rad.
const SMALL_RANGE_RAD: f64 = 0.6;
/// Effect on the flange from which an unknown parameter is named, as a share of the predicted error.
const NAMED_FROM: f64 = 0.25;

/// Covariance of all columns from taken and planned images, markers and joint noise eliminated; columns without a prior start
/// from nothing.
///
/// # Errors
/// Where the images do not determine camera, plate or hand-eye transform.
pub fn exact_covariance(planned: &Adjustment, setting: &Setting, stops: Vec<PlannedStop>) -> Result<DMatrix<f64>> {
    let (n, count) = (planned.problem.layout.len(), stops.len());
    let planned = setting.with_stops(planned, stops);
    let singular = || {
        let what = format!("{count} images do not determine camera, plate and hand-eye transform");
        Error::new(
            Code::PlanUndetermined,
            "plan: forecast",
            what,
            "plan more images, or views that differ more in tilt and distance",
        )
    };
    let lin = planned.linearise().ok_or_else(singular)?;
    let all = planned.linear(&lin).covariance().map_err(|_| singular())?;
    Ok(all.reduced.view((0, 0), (n, n)).into_owned())
}

/// RMS error of the flange from a covariance of all columns, m.
pub fn flange_m(weight: &DMatrix<f64>, covariance: &DMatrix<f64>) -> f64 {
    weight.dot(covariance).max(0.0).sqrt()
}

impl Choice {
    /// A candidate as a stop with this image; `None` where it sees no marker.
    pub(super) fn stop(&self, setting: &Setting, candidate: usize, image: &str) -> Option<PlannedStop> {
        let c = &self.pool[candidate];
        setting.stop_seeing(&self.adjustment.state, image, (&c.readings, c.placement, &c.seen))
    }
}

impl Plan {
    /// Planned stops (indices into the legs).
    fn stops(&self, setting: &Setting, legs: impl Iterator<Item = usize>) -> Vec<PlannedStop> {
        legs.filter_map(|k| self.stop(setting, self.legs[k].stop, &image_name(k))).collect()
    }
}

/// Name of the image of a planned stop, as in joints.csv.
pub fn image_name(index: usize) -> String {
    format!("img_{index:03}.png")
}

/// Forecast of a plan: exact at the points of the curve, with every marker's correction eliminated.
///
/// # Errors
/// Where the planned images do not determine camera, plate and hand-eye transform.
pub fn forecast(request: &PlanRequest, plan: &Plan) -> Result<Forecast> {
    let setting = &request.setting;
    let n = plan.legs.len();
    let importance = importance(plan);
    let exact = |legs: &[usize]| {
        let mut stops = request.taken.clone();
        stops.extend(plan.stops(setting, legs.iter().copied()));
        exact_covariance(&plan.adjustment, setting, stops)
    };
    let whole = exact(&(0..n).collect::<Vec<_>>())?;
    let mut curve = Vec::new();
    for count in counts(n) {
        let planned = exact(&importance[..count]);
        let (Ok(planned), Some(random_m)) = (planned, at_random_m(request, plan, count)) else { continue };
        curve.push(CurvePoint { images: count, planned_m: flange_m(&plan.weight, &planned), random_m });
    }
    let start = match request.taken.is_empty() {
        true => None,
        false => Some(exact(&[])?),
    };
    let before = match &start {
        None => flange_criterion(plan).value(&plan.known).map_or(f64::NAN, f64::sqrt),
        Some(covariance) => flange_m(&plan.weight, covariance),
    };
    let flange = flange_m(&plan.weight, &whole);
    let parameters = parameters(plan, &whole);
    let ranges = ranges(request, plan);
    let mut words = words(&parameters, &ranges, plan, flange, setting.mount);
    words.extend(scale_word(plan, &whole, flange));
    words.extend(depth_word(request, plan));
    let gains = match &start {
        Some(start) => gains(plan, |leg| Some([start.clone(), exact(&[leg]).ok()?])),
        None => gains(plan, |leg| among_others(plan, leg)),
    };
    Ok(Forecast { before_m: before, flange_m: flange, parameters, curve, importance, gains, ranges, words })
}

/// Expected error of the flange, m, by so many of the candidates that were drawn at random.
fn at_random_m(request: &PlanRequest, plan: &Plan, count: usize) -> Option<f64> {
    let step = plan.drawn as f64 / count as f64;
    let one = |draw: usize| {
        let mut stops = request.taken.clone();
        stops.extend((0..count).filter_map(|k| {
            let shift = draw as f64 / RANDOM_DRAWS as f64;
            plan.stop(&request.setting, ((k as f64 + shift) * step) as usize, "")
        }));
        let covariance = exact_covariance(&plan.adjustment, &request.setting, stops).ok()?;
        Some(flange_m(&plan.weight, &covariance).powi(2))
    };
    let squares: Vec<f64> = (0..RANDOM_DRAWS).into_par_iter().filter_map(one).collect();
    (!squares.is_empty()).then(|| root_of_mean(squares))
}

/// Numbers of images at which the curve is computed.
fn counts(n: usize) -> Vec<usize> {
    let grid = [4, 6, 8, 10, 13, 17, 22, 30, 40, 55, 75, 100, 140, 200, 300];
    grid.into_iter().filter(|k| *k < n).chain([n]).collect()
}

/// Mean squared error of the flange, of what images tell.
fn flange_criterion(plan: &Plan) -> Criterion {
    plan.identified.criterion(&Criterion::weighted(&plan.weight))
}

/// Stops by importance: the one that is missed least is taken out first.
fn importance(plan: &Plan) -> Vec<usize> {
    let criterion = flange_criterion(plan);
    let of = |leg: usize| &plan.information[plan.legs[leg].stop];
    let mut left: Vec<usize> = (0..plan.legs.len()).collect();
    let mut m = left.iter().fold(plan.known.clone(), |m, &k| m + of(k));
    let mut out = Vec::with_capacity(left.len());
    while left.len() > 1 {
        let Ok(at) = criterion.evaluate(&m) else { break };
        // To second order in what is taken away the loss is slope + curvature / 2.
        let loss = |k: usize| {
            let x = of(k);
            let first = at.slope.dot(x);
            first + (&at.slope * x).dot(&(x * &at.covariance).transpose()).max(0.0)
        };
        let losses: Vec<f64> = left.iter().map(|&k| loss(k)).collect();
        let least = (0..left.len()).min_by(|&a, &b| losses[a].total_cmp(&losses[b])).unwrap_or(0);
        let gone = left.remove(least);
        m -= of(gone);
        out.push(gone);
    }
    out.extend(left);
    out.reverse();
    out
}

/// Covariance without one planned image and with it, all others taken.
fn among_others(plan: &Plan, leg: usize) -> Option<[DMatrix<f64>; 2]> {
    let own = |k: usize| &plan.information[plan.legs[k].stop];
    let others = (0..plan.legs.len()).filter(|k| *k != leg).fold(plan.known.clone(), |m, k| m + own(k));
    let inverse = |m: &DMatrix<f64>| SymmetricFactor::new(m).ok().map(|f| plan.identified.covariance(&f.inverse()));
    Some([inverse(&others)?, inverse(&(others + own(leg)))?])
}

/// Gains of all stops, the greatest first; `covariances` are those without an image and with it.
fn gains(plan: &Plan, covariances: impl Fn(usize) -> Option<[DMatrix<f64>; 2]> + Sync) -> Vec<Gain> {
    let layout = &plan.adjustment.problem.layout;
    let sigma = |c: &DMatrix<f64>, k: usize| c[(k, k)].max(0.0).sqrt();
    let one = |leg: usize| {
        let [before, after] = covariances(leg)?;
        let drop = |k: usize| plan.weight[(k, k)].max(0.0).sqrt() * (sigma(&before, k) - sigma(&after, k));
        let best = (0..layout.terms.end).max_by(|&a, &b| drop(a).total_cmp(&drop(b)))?;
        Some(Gain {
            leg,
            flange_m: [flange_m(&plan.weight, &before), flange_m(&plan.weight, &after)],
            parameter: layout.columns[best].name.trim_start_matches("robot/").to_owned(),
            unit: layout.columns[best].unit,
            sigma: [sigma(&before, best), sigma(&after, best)],
        })
    };
    let mut all: Vec<Gain> = (0..plan.legs.len()).into_par_iter().filter_map(one).collect();
    all.sort_by(|a, b| b.gain_m().total_cmp(&a.gain_m()));
    all
}

/// Says so where the scale of the plate is most of the error: it is the only length, and no pose makes it better known.
fn scale_word(plan: &Plan, covariance: &DMatrix<f64>, flange: f64) -> Option<String> {
    let scale = plan.adjustment.problem.layout.shapes.first()?.start;
    let column = covariance.column(scale);
    let part = (column.dot(&(&plan.weight * column)) / covariance[(scale, scale)]).max(0.0).sqrt();
    let measured = plan.adjustment.problem.plates.first().is_some_and(|p| p.scale.is_some());
    let remedy = match measured {
        true => "measure the distance in [scale] of plate.toml more exactly, or that of markers farther apart",
        false => "measure the distance of two far markers and put it into [scale] of plate.toml",
    };
    (part > NAMED_FROM * flange).then(|| {
        format!(
            "{:.3} mm of the expected {:.3} mm come from the scale of the plate, known to {:.1e}: no further image helps there; {remedy}",
            1e3 * part,
            1e3 * flange,
            covariance[(scale, scale)].sqrt()
        )
    })
}

/// Says so where an image shows markers more than twice as far away as others, and nothing says where the lens is sharp.
fn depth_word(request: &PlanRequest, plan: &Plan) -> Option<String> {
    if request.candidates.sight.focus_m.1.is_finite() {
        return None;
    }
    let depths_m = |leg: usize| {
        let c = &plan.pool[plan.legs[leg].stop];
        let depth_m = |&k: &usize| c.camera_from_plate.transform(&request.setting.plate.markers[k].position_m).z;
        let (near, far) =
            c.seen.iter().map(depth_m).fold((f64::INFINITY, 0.0_f64), |(near, far), z| (near.min(z), far.max(z)));
        (leg, near, far)
    };
    let ratio = |(_, near, far): &(usize, f64, f64)| far / near;
    let (leg, near, far) =
        (0..plan.legs.len()).map(depths_m).max_by(|a, b| ratio(a).total_cmp(&ratio(b))).filter(|d| ratio(d) > 2.0)?;
    Some(format!(
        "{} shows markers from {near:.2} to {far:.2} m away, of which few lenses are sharp at both ends: say with --focus-m where yours is",
        image_name(leg)
    ))
}

/// Refuses a plan that cannot do what was asked: named parameters that stay as unknown as before.
///
/// # Errors
/// Names the parameter, how far its joint moves, and what to change.
pub fn check_demand(request: &PlanRequest, plan: &Plan, forecast: &Forecast) -> Result<()> {
    let Demand::Named(wanted) = &request.demand else { return Ok(()) };
    let layout = &plan.adjustment.problem.layout;
    for name in wanted {
        let columns = layout.named_within(0..layout.terms.end, "--parameters", name)?;
        let asked: Vec<&ParameterForecast> = columns.iter().map(|&c| &forecast.parameters[c]).collect();
        if asked.iter().any(|p| p.share_of_data() > LEAST_SHARE) {
            continue;
        }
        let joint = asked.first().and_then(|p| p.name.split(['.', '/']).next());
        let moved =
            forecast.ranges.iter().find(|r| Some(r.name.as_str()) == joint).map(|r| (r.used().1 - r.used().0, r.kind));
        let (what, remedy) = match moved {
            Some((span, JointKind::Revolute)) if span < SMALL_RANGE_RAD => (
                format!("its joint moves over {:.1} degrees only", span.to_degrees()),
                "widen the limits of this joint in the URDF, or put the plate where it has to move more (--plate-pose)",
            ),
            _ => (
                "at these poses it cannot be separated from the pose of the plate, the camera on the flange or a \
                 neighbouring link"
                    .to_owned(),
                "ask for the accuracy of the flange instead (leave --parameters out), or put the plate at several places \
                 (--plate-pose several times)",
            ),
        };
        let best = asked.iter().map(|p| p.sigma / p.prior_sigma).fold(1.0, f64::min);
        let what = format!("{name} would stay unknown (sigma {:.0} % of its tolerance): {what}", 1e2 * best);
        return Err(Error::new(Code::PlanUndetermined, "plan: --parameters", what, remedy));
    }
    Ok(())
}

fn parameters(plan: &Plan, covariance: &DMatrix<f64>) -> Vec<ParameterForecast> {
    let layout = &plan.adjustment.problem.layout;
    let one = |k: usize| {
        let c = &layout.columns[k];
        let sigma = covariance[(k, k)].max(0.0).sqrt();
        ParameterForecast {
            name: c.name.trim_start_matches("robot/").to_owned(),
            unit: c.unit,
            prior_sigma: c.prior_sigma,
            sigma,
            flange_m: sigma * plan.weight[(k, k)].max(0.0).sqrt(),
        }
    };
    (0..layout.terms.end).map(one).collect()
}

impl Gain {
    /// By how much the RMS error of the flange shrinks, m.
    pub fn gain_m(&self) -> f64 {
        self.flange_m[0] - self.flange_m[1]
    }
}

impl ParameterForecast {
    /// `1 - sigma^2 / prior^2`.
    pub fn share_of_data(&self) -> f64 {
        1.0 - (self.sigma / self.prior_sigma).powi(2)
    }

    /// True where the planned images determine it by themselves.
    pub fn is_known(&self) -> bool {
        self.share_of_data() > KNOWN_SHARE
    }
}

fn ranges(request: &PlanRequest, plan: &Plan) -> Vec<JointRange> {
    let chain = &request.setting.robot.chain;
    let limits = crate::model::inverse::reading_limits(chain);
    let one = |k: usize| JointRange {
        name: chain.readings[k].clone(),
        kind: chain.reading_kinds[k],
        limits: limits[k],
        planned: plan.legs.iter().map(|l| plan.pool[l.stop].readings[k]).collect(),
    };
    (0..chain.readings.len()).map(one).collect()
}

impl JointRange {
    /// Least and greatest planned reading.
    pub fn used(&self) -> (f64, f64) {
        let fold = |f: fn(f64, f64) -> f64, start| self.planned.iter().copied().fold(start, f);
        (fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY))
    }
}

fn words(
    parameters: &[ParameterForecast],
    ranges: &[JointRange],
    plan: &Plan,
    flange: f64,
    mount: CameraMount,
) -> Vec<String> {
    let mut words = Vec::new();
    let terms = &parameters[plan.adjustment.problem.layout.terms.clone()];
    for range in ranges {
        let own = terms.iter().filter(|p| p.name.starts_with(&format!("{}.", range.name)));
        let unknown: Vec<&ParameterForecast> = own.filter(|p| !p.is_known()).collect();
        let (low, high) = range.used();
        let span = match range.kind {
            JointKind::Prismatic => format!("{:.0} mm", 1e3 * (high - low)),
            _ => format!("{:.0} degrees", (high - low).to_degrees()),
        };
        let named: Vec<String> = unknown
            .iter()
            .filter(|p| p.flange_m > NAMED_FROM * flange)
            .map(|p| format!("{} (up to {:.3} mm at the flange)", short(&p.name), 1e3 * p.flange_m))
            .collect();
        if !named.is_empty() {
            words.push(format!(
                "{} of {} will not be known by themselves: these images move it over {span}",
                named.join(", "),
                range.name
            ));
        }
    }
    let known = parameters.iter().filter(|p| p.is_known()).count();
    let places = match mount {
        CameraMount::Hand => "base against plate, flange against camera",
        CameraMount::Fixed => "base against camera, flange against plate",
    };
    words.push(format!(
        "{known} of {} parameters of the robot are determined one by one; of the others only sums matter to the flange \
         ({places}, neighbouring links), and these are in the predicted error",
        parameters.len()
    ));
    words
}

fn short(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or(name)
}
