//! What data tell of the robot: rank, directions that stay unknown, correlations, observability, all with names.
//!
//! In units of the priors the posterior covariance `K` of the robot's parameters has eigenvalues `k` between 0 and 1; the data
//! alone have the information `1/k - 1` in that direction, whose root is a singular value of the square-root factor of the
//! reduced system. A direction counts as determined where the data make out at least a tenth (`k < 0.9`).

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::advice::{Advice, Adviser};
use super::limits::Limits;
use super::statistics::extent;
use super::stops::{StopsKnowledge, Structural, information_of_share, structural};
use crate::linalg::{SymmetricFactor, symmetric_eigen};
use crate::model::robot::{Posture, Robot};
use crate::problem::{Layout, places_body, short_name};

/// Most pairs that are kept.
const MOST_PAIRS: usize = 60;

/// Relative difference of two lengths that rounding may make.
const AS_LONG: f64 = 1e-6;

/// Why a direction is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The base of the robot against the pose of what stands in it.
    Base,
    /// The tip of the robot against the pose of what it carries.
    Tip,
    /// Parameters that do the same to this robot.
    Redundant,
    /// A parameter that does nothing to this robot.
    Idle,
    /// The stops do not show it; others would.
    Stops,
}

/// Parameters that change together without the data noticing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnknownDirection {
    /// Why.
    pub cause: Cause,
    /// Parameters with their part, in units of their priors, largest first.
    pub parameters: Vec<(String, f64)>,
    /// What to do, where there is something.
    pub remedy: Option<String>,
}

/// Two parameters that are hard to tell apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Correlation {
    /// One.
    pub first: String,
    /// The other.
    pub second: String,
    /// Correlation of the errors of the estimates.
    pub correlation: f64,
    /// What to do.
    pub remedy: String,
}

/// Observability indices over the directions that the data determine, in units of the priors; none where there is none.
///
/// With the singular values `s_1 >= .. >= s_r` of the prior-scaled square-root factor and `n` images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Observability {
    /// `(s_1 .. s_r)^(1/r) / sqrt n` (J. Borm, C. Menq 1991).
    pub o1: f64,
    /// `s_r / s_1` (M. Driels, U. Pathre 1990).
    pub o2: f64,
    /// `s_r` (A. Nahvi, J. Hollerbach, V. Hayward 1994).
    pub o3: f64,
    /// `s_r^2 / s_1` (A. Nahvi, J. Hollerbach 1996).
    pub o4: f64,
    /// `1 / sum 1/s_i` (Y. Sun, J. Hollerbach 2008).
    pub o5: f64,
}

/// What the data tell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Identifiability {
    /// Free parameters of the robot.
    pub parameters: usize,
    /// Directions that stops over the whole range of the joints could tell.
    pub tellable: usize,
    /// How many of these the data tell: without the directions of [`Cause::Stops`]. What priors and a precise camera tell beyond
    /// is not counted.
    pub rank: usize,
    /// Directions that they do not tell.
    pub unknown: Vec<UnknownDirection>,
    /// Pairs with |correlation| > 0.9, strongest first, without those that only express an unknown direction.
    pub correlations: Vec<Correlation>,
    /// Indices; none where nothing is determined.
    pub observability: Option<Observability>,
    /// Readings of the stops: name, smallest, largest (rad or m).
    pub covered: Vec<(String, f64, f64)>,
    /// What to measure next, best first.
    pub next: Vec<Advice>,
}

/// Before the solve: what `stops` can tell.
pub fn identifiability_of_stops(
    robot: &Robot,
    layout: &Layout,
    stops: &[Posture],
    limits: &Limits,
) -> Option<Identifiability> {
    let known = StopsKnowledge::new(robot, layout, stops)?;
    let n = known.columns.len();
    let posterior = known.covariance.view((0, 0), (n, n)).into_owned();
    let (values, vectors) = symmetric_eigen(&known.information)?;
    let names: Vec<String> = known.columns.iter().map(|&c| short_name(&layout.columns[c].name)).collect();
    judge(robot, layout, stops, known, &values, &vectors, &posterior, &names, limits)
}

/// After the solve: `covariance` of the dense columns of `layout`, m and rad.
pub fn identifiability(
    robot: &Robot,
    layout: &Layout,
    stops: &[Posture],
    covariance: &DMatrix<f64>,
    limits: &Limits,
) -> Option<Identifiability> {
    let known = StopsKnowledge::new(robot, layout, stops)?;
    let (columns, scale) = (&known.columns, &known.scale);
    let n = columns.len();
    let k = DMatrix::from_fn(n, n, |i, j| covariance[(columns[i], columns[j])] / (scale[i] * scale[j]));
    let (shares, vectors) = symmetric_eigen(&k)?;
    // Ascending shares are descending informations.
    let values = shares.map(|k| (1.0 / k.max(f64::MIN_POSITIVE) - 1.0).max(0.0));
    let listed: Vec<usize> = (0..layout.len())
        .filter(|c| layout.columns[*c].free && covariance[(*c, *c)] > 0.0 && !layout.locals.contains(c))
        .filter(|c| !layout.fields.iter().any(|field| field.contains(c)))
        .collect();
    let names: Vec<String> = listed.iter().map(|&c| short_name(&layout.columns[c].name)).collect();
    let all = DMatrix::from_fn(listed.len(), listed.len(), |i, j| covariance[(listed[i], listed[j])]);
    judge(robot, layout, stops, known, &values, &vectors, &all, &names, limits)
}

#[allow(clippy::too_many_arguments)]
fn judge(
    robot: &Robot,
    layout: &Layout,
    stops: &[Posture],
    known: StopsKnowledge,
    values: &DVector<f64>,
    vectors: &DMatrix<f64>,
    covariance: &DMatrix<f64>,
    covariance_names: &[String],
    limits: &Limits,
) -> Option<Identifiability> {
    let never = structural(robot, layout, limits.share_of_data);
    let least = information_of_share(limits.share_of_data);
    let names: Vec<String> = known.columns.iter().map(|&c| short_name(&layout.columns[c].name)).collect();
    let told: Vec<f64> = values.iter().copied().filter(|v| *v >= least).map(f64::sqrt).collect();
    let silent: Vec<usize> = (0..values.len()).filter(|&k| values[k] < least).collect();
    let own = beyond(&never, &vectors.select_columns(&silent), limits.own_direction);
    let adviser = Adviser::new(robot, layout, stops, &known, &never, limits);
    let mut unknown: Vec<UnknownDirection> = sparse(&own)
        .into_iter()
        .map(|v| UnknownDirection {
            cause: Cause::Stops,
            parameters: named(&v, &names, limits.named_part),
            remedy: Some(adviser.in_words(Some(&v))),
        })
        .collect();
    unknown.extend(structural_in_words(robot, &never, &names, limits.named_part));
    let tellable = names.len() - never.directions.ncols();
    Some(Identifiability {
        parameters: names.len(),
        tellable,
        rank: tellable - own.ncols(),
        correlations: correlations(covariance, covariance_names, &names, &never, &adviser, limits),
        unknown,
        observability: observability(&told, stops.len()),
        covered: covered(robot, stops),
        next: adviser.next(),
    })
}

/// Smallest and largest reading of every joint.
fn covered(robot: &Robot, stops: &[Posture]) -> Vec<(String, f64, f64)> {
    let named = |(r, name): (usize, &String)| {
        let (low, high) = extent(stops.iter().map(|s| s.readings[r]));
        (name.clone(), low, high)
    };
    if stops.is_empty() { Vec::new() } else { robot.chain.readings.iter().enumerate().map(named).collect() }
}

fn observability(singular: &[f64], images: usize) -> Option<Observability> {
    let largest = singular.iter().copied().reduce(f64::max)?;
    let smallest = singular.iter().copied().reduce(f64::min)?;
    let r = singular.len() as f64;
    let mean_log = singular.iter().map(|s| s.ln()).sum::<f64>() / r;
    Some(Observability {
        o1: mean_log.exp() / (images.max(1) as f64).sqrt(),
        o2: smallest / largest,
        o3: smallest,
        o4: smallest * smallest / largest,
        o5: 1.0 / singular.iter().map(|s| 1.0 / s).sum::<f64>(),
    })
}

/// Orthonormal basis of what `silent` directions hold beyond the structural ones.
fn beyond(never: &Structural, silent: &DMatrix<f64>, least: f64) -> DMatrix<f64> {
    let rest = silent - &never.directions * (never.directions.transpose() * silent);
    let none = DMatrix::zeros(silent.nrows(), 0);
    if rest.ncols() == 0 {
        return none;
    }
    let Some((values, vectors)) = symmetric_eigen(&(&rest * rest.transpose())) else { return none };
    let kept: Vec<usize> = (0..values.len()).rev().filter(|&k| values[k] > least).collect();
    vectors.select_columns(&kept)
}

/// The same span with few parameters in every direction: each has a pivot that the others do not have. Pivots are those of Cholesky's
/// factorisation of the projector onto the span, in the order of the parameters: they do not hang on the basis that is given.
fn sparse(basis: &DMatrix<f64>) -> Vec<DVector<f64>> {
    let mut pivots = Vec::new();
    let mut left = basis.clone();
    for _ in 0..basis.ncols() {
        let lengths: Vec<f64> = left.row_iter().map(|r| r.norm_squared()).collect();
        let largest = lengths.iter().fold(0.0, |m: f64, &l| m.max(l));
        let Some(row) = lengths.iter().position(|&l| l > (1.0 - AS_LONG) * largest) else { break };
        let along = left.row(row).transpose() / lengths[row].sqrt();
        left -= &left * &along * along.transpose();
        pivots.push(row);
    }
    pivots.sort_unstable();
    let Some(inverse) = basis.select_rows(&pivots).try_inverse() else { return Vec::new() };
    (basis * inverse).column_iter().map(|c| c.into_owned()).collect()
}

fn named(v: &DVector<f64>, names: &[String], least_part: f64) -> Vec<(String, f64)> {
    let largest = v.amax();
    let mut parts: Vec<(usize, f64)> =
        v.iter().copied().enumerate().filter(|(_, x)| x.abs() >= least_part * largest).collect();
    let size = |x: f64| (x.abs() / (AS_LONG * largest)).round();
    parts.sort_by(|a, b| size(b.1).total_cmp(&size(a.1)).then(a.0.cmp(&b.0)));
    parts.into_iter().map(|(k, x)| (names[k].clone(), x)).collect()
}

/// Names of the parameters that move the whole base, and of those that move the whole tip.
fn frame_parameters(robot: &Robot) -> [Vec<String>; 2] {
    let chain = &robot.chain;
    let origin = |name: &str| format!("{}.origin", name.replace('/', "."));
    let before =
        chain.joints.iter().take_while(|j| j.drive.is_none()).chain(chain.joints.iter().find(|j| j.drive.is_some()));
    let mut first: Vec<String> = before.map(|j| origin(&j.name)).collect();
    let mut last: Vec<String> =
        chain.joints.iter().rev().take_while(|j| j.drive.is_none()).map(|j| origin(&j.name)).collect();
    first.extend(chain.readings.first().map(|r| format!("{r}.offset")));
    last.extend(chain.readings.last().map(|r| format!("{r}.offset")));
    [first, last]
}

fn within(name: &str, blocks: &[String]) -> bool {
    blocks.iter().any(|b| name.strip_prefix(b.as_str()).is_some_and(|rest| rest.is_empty() || rest.starts_with('.')))
}

fn structural_in_words(robot: &Robot, never: &Structural, names: &[String], least_part: f64) -> Vec<UnknownDirection> {
    let [first, last] = frame_parameters(robot);
    let cause = |parameters: &[(String, f64)]| {
        let all = |blocks: &[String]| parameters.iter().all(|(name, _)| within(name, blocks));
        match parameters.len() {
            _ if all(&first) => Cause::Base,
            _ if all(&last) => Cause::Tip,
            1 => Cause::Idle,
            _ => Cause::Redundant,
        }
    };
    sparse(&never.directions)
        .into_iter()
        .map(|v| {
            let parameters = named(&v, names, least_part);
            UnknownDirection { cause: cause(&parameters), parameters, remedy: None }
        })
        .collect()
}

/// `covariance` with the names of its rows; `robot` names those of the directions.
fn correlations(
    covariance: &DMatrix<f64>,
    all: &[String],
    robot: &[String],
    never: &Structural,
    adviser: &Adviser,
    limits: &Limits,
) -> Vec<Correlation> {
    let shares = never.shares();
    let place = |name: &String| robot.iter().position(|r| r == name);
    let mut pairs = Vec::new();
    for i in 0..all.len() {
        for j in 0..i {
            let rho = covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            let (a, b) = (place(&all[j]), place(&all[i]));
            let expressed = [a, b].iter().flatten().any(|&k| shares[k] > limits.share_of_data);
            if rho.abs() > limits.strong_correlation && !expressed && !share_a_frame(&all[j], &all[i]) {
                pairs.push((j, i, rho, a, b));
            }
        }
    }
    pairs.sort_by(|x, y| y.2.abs().total_cmp(&x.2.abs()).then((x.0, x.1).cmp(&(y.0, y.1))));
    pairs.truncate(MOST_PAIRS);
    let silent = Silent::of(covariance, all, |name| place(name).is_some_and(|k| shares[k] > limits.share_of_data));
    let in_words = |(first, second, rho, a, b): (usize, usize, f64, Option<usize>, Option<usize>)| {
        let mut v = DVector::zeros(robot.len());
        a.into_iter().for_each(|k| v[k] = 1.0);
        b.into_iter().for_each(|k| v[k] = rho.signum());
        let followed = silent.as_ref().and_then(|s| s.followed([first, second], limits.strong_correlation));
        let remedy = remedy_of_pair([&all[first], &all[second]], &v, followed, adviser);
        Correlation { first: all[first].clone(), second: all[second].clone(), correlation: rho, remedy }
    };
    pairs.into_iter().map(in_words).collect()
}

/// What to do about parameters that are correlated: `direction` of the robot that holds them, `followed` by what moves both alike.
fn remedy_of_pair(names: [&str; 2], direction: &DVector<f64>, followed: Option<&str>, adviser: &Adviser) -> String {
    let is_size = |name: &str| name.starts_with("plate_shape") && name.ends_with(".scale");
    match followed {
        _ if names.iter().all(|name| name.starts_with("camera.")) => {
            "fill the whole image, tilt by 20 to 45 degrees, and vary the distance".to_owned()
        }
        _ if names.into_iter().any(is_size) => MEASURE_THE_SIZE.to_owned(),
        _ if direction.norm() > 0.0 => adviser.in_words(Some(direction)),
        Some(followed) => {
            format!("{followed} does the same to both, and only its prior tells it from them: nothing is lost by that")
        }
        None if names.into_iter().any(places_body) => {
            "measure at stops with the tip turned to more different directions".to_owned()
        }
        None => {
            "roll the camera about its axis at some stops, tilt by 20 to 45 degrees, and vary the distance".to_owned()
        }
    }
}

/// What to do where the size of a plate goes with a length of the robot.
const MEASURE_THE_SIZE: &str = "measure the distance of two far markers as exactly as you can ([scale] in plate.toml): no stop tells the size of the plate";

/// Parameters of the robot that no series can tell, and what all others have to do with them.
struct Silent<'a> {
    names: Vec<&'a str>,
    /// Correlation of every parameter with each of them.
    with: DMatrix<f64>,
    /// `R_s^-1 R_s.` for the correlations `R_s` among them.
    solved: DMatrix<f64>,
    correlations: DMatrix<f64>,
}

impl<'a> Silent<'a> {
    fn of(covariance: &DMatrix<f64>, all: &'a [String], is_silent: impl Fn(&String) -> bool) -> Option<Self> {
        let rows: Vec<usize> = (0..all.len()).filter(|&k| is_silent(&all[k])).collect();
        let scale = covariance.diagonal().map(f64::sqrt);
        let correlations = covariance.map_with_location(|i, j, c| c / (scale[i] * scale[j]));
        let with = correlations.select_columns(&rows);
        let solved = SymmetricFactor::new(&with.select_rows(&rows)).ok()?.solve_many(&with.transpose());
        Some(Self { names: rows.iter().map(|&k| all[k].as_str()).collect(), with, solved, correlations })
    }

    /// The one that two parameters follow most, where the correlation of the two is no strong one with all of these held.
    fn followed(&self, [i, j]: [usize; 2], strong: f64) -> Option<&'a str> {
        let left =
            |i: usize, j: usize| self.correlations[(i, j)] - self.with.row(i).transpose().dot(&self.solved.column(j));
        if left(i, j).abs() > strong * (left(i, i) * left(j, j)).max(0.0).sqrt() {
            return None;
        }
        let common = |k: &usize| (self.with[(i, *k)] * self.with[(j, *k)]).abs();
        let most = (0..self.names.len()).max_by(|a, b| common(a).total_cmp(&common(b)))?;
        Some(self.names[most])
    }
}

/// Poses of two plates, or of two mountings: all hang on the same robot, which makes them move together.
fn share_a_frame(a: &str, b: &str) -> bool {
    let block = |name: &str| name.rsplit_once('.').map_or(String::new(), |(block, _)| block.to_owned());
    let both = |kind: &str| a.starts_with(kind) && b.starts_with(kind);
    (both("plate.") || both("hand_camera")) && block(a) != block(b)
}
