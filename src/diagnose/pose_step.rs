//! A plate or a camera that stands elsewhere from some image on, or creeps all through a series, by too little for any image to be left out.
//!
//! Rao's score test on the linearised fit: what the images of a stop tell of their poses, joint noise eliminated, has the root score `s` and
//! the derivatives `T` by all columns ([`StopInformation`]). Let the pose of one body differ by a constant `x` at the stops of a part `P` of a
//! series, `A` its columns of `T`; or by `w x` at all of them, `w` growing from 0 to 1 with the rows, `A` its columns times `w`. With `K` the covariance of all columns, `g = sum_P A' s` and
//! `J = sum_P A' A - V' K V`, `V = sum_P T' A`, the cost falls by `D = g' J^-1 g`, chi-squared with six degrees of freedom where nothing
//! moved, and `x = J^-1 g` with the covariance `J^-1`.
//!
//! The estimated joint noise has grown with the fault, so that `D` is small beside what the sizes say; it is compared with the squares `R` of what
//! the poses of the images miss those of the readings, in units of the noise of both, which are as many as the degrees of freedom that the robot
//! left, and with the squares `P` of the robot's errors over their priors, which are as many as it took: a step may take up either. `D / (R + P)`
//! has a beta distribution where noise is Gaussian. Real robots err alike in postures that are alike, so that chance alone does not acquit them:
//! the step must also explain most of `R`.

use std::ops::Range;
use std::rc::Rc;

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};

use super::displaced::{Carried, Displaced, Displacement};
use super::kind::{CheckContext, Weight};
use crate::assess::{Accuracy, Limits, RootInformation, StopInformation};
use crate::fit::Fit;
use crate::linalg::{SymmetricFactor, product};
use crate::problem::{Adjustment, Image, Layout, Problem};
use crate::series::CameraMount;
use crate::solve::LinearProblem;

/// What stands elsewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Body {
    Placement(usize),
    Mounting(usize),
}

/// How the images are divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Order {
    /// By rows: moved once.
    Time,
    /// By how far this axis of what the robot carries points up: held by its weight only.
    Up(usize),
    /// Not at all: it creeps with the rows.
    Drift,
}

/// A step of one body between two parts of a series.
#[derive(Debug, Clone, PartialEq)]
struct PoseStep {
    /// Index of the series.
    series: usize,
    body: Body,
    order: Order,
    /// Rows of [`Linear`] that it moves, in this order, and by which part of it.
    moved: Vec<(usize, f64)>,
    /// Their images.
    images: Vec<usize>,
    /// Displacement as a twist of the body: m, rad.
    twist: Vector6<f64>,
    /// Its covariance by the joint noise that was estimated without it.
    covariance: Matrix6<f64>,
    /// Fall of the cost, `D`.
    fall: f64,
    /// Share of the squares `R` that this and the other steps explain.
    share: f64,
}

/// The fit, linearised.
struct Linear {
    stops: Vec<Row>,
    information: DMatrix<f64>,
}

/// One stop.
struct Row {
    images: Vec<Shown>,
    /// Root score.
    score: DVector<f64>,
    by_free: DMatrix<f64>,
    /// Derivatives by all columns.
    by_columns: Rc<DMatrix<f64>>,
}

/// An image of a stop.
#[derive(Debug, Clone, Copy)]
struct Shown {
    image: usize,
    /// Up in the axes of what the robot carries.
    up: [f64; 3],
}

impl Body {
    fn is_of(self, image: &Image) -> bool {
        match self {
            Self::Placement(p) => image.placement == p,
            Self::Mounting(m) => image.mounting == m,
        }
    }

    fn columns(self, layout: &Layout) -> Range<usize> {
        match self {
            Self::Placement(p) => layout.placements[p].clone(),
            Self::Mounting(m) => layout.mountings[m].clone(),
        }
    }
}

impl Row {
    /// Derivatives by a body.
    fn by(&self, columns: &Range<usize>) -> DMatrix<f64> {
        self.by_columns.columns_range(columns.clone()).into_owned()
    }

    /// Squares of what its pose misses that of the readings.
    fn squares(&self, problem: &Problem) -> f64 {
        let image = &problem.images[self.images[0].image];
        let by_pose = self.by(&problem.layout.placements[image.placement]);
        let score = by_pose.tr_mul(&self.score);
        SymmetricFactor::new(&by_pose.tr_mul(&by_pose)).map_or(0.0, |factor| score.dot(&factor.solve(&score)))
    }

    /// Its images of a body.
    fn of(&self, problem: &Problem, body: Body) -> impl Iterator<Item = Shown> {
        self.images.iter().copied().filter(move |shown| body.is_of(&problem.images[shown.image]))
    }
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<Displaced> {
    let fit = setting.with_noise_found(fit);
    find_steps(fit, setting.limits).iter().map(|step| step.finding(&fit.problem, setting)).collect()
}

/// Steps that explain most of the joint noise, in the order of the images.
fn find_steps(fit: &Fit, limits: &Limits) -> Vec<PoseStep> {
    let problem = &fit.problem;
    let mut linear = Linear::of(fit.linear());
    let columns = linear.information.ncols();
    let all: f64 = linear.stops.iter().map(|row| row.squares(problem)).sum();
    let of_priors = prior_squares(fit);
    let (mut left, mut found, mut good) = (all, Vec::<PoseStep>::new(), Vec::new());
    while found.len() < limits.displacements {
        let tried = candidates(problem, &linear, limits.displaced_images);
        let Some(mut best) = linear.best(problem, &tried, limits.displaced_images) else { break };
        best.share = (best.fall / left).min(1.0);
        let squares = left + of_priors;
        let chance = tried.len() as f64 * chance(best.fall / squares, squares);
        tracing::debug!(?best.body, ?best.order, first = %problem.images[best.images[0]].name, moved = best.images.len(),
            fall = best.fall, left, share = best.share, chance, twist = ?best.twist, "step of a body");
        if chance > limits.displaced_false_alarms {
            break;
        }
        let Some((next, step)) = linear.with(problem, &best) else { break };
        let enough = best.share > limits.displaced_share;
        (linear, left) = (next, (left - best.fall).max(0.0));
        best.twist.fill(0.0);
        found.push(best);
        for (k, own) in found.iter_mut().enumerate() {
            own.twist += step.fixed_rows::<6>(columns + 6 * k);
            own.share = 1.0 - left / all;
        }
        if enough {
            good.clone_from(&found);
        }
    }
    good.sort_by_key(|s| (matches!(s.order, Order::Up(_)), s.images[0]));
    good
}

/// Squares of the errors of robot, mountings and placements over their priors, `P`.
fn prior_squares(Adjustment { problem, state }: &Adjustment) -> f64 {
    let values = state.values(&problem.layout);
    let columns = problem.layout.columns[..problem.layout.theta_len()].iter().zip(values.iter());
    columns.filter(|(c, _)| c.free).map(|(c, value)| ((value - c.prior_mean) / c.prior_sigma).powi(2)).sum()
}

/// Probability that six parameters explain this share of so many squares or more, of Gaussian noise.
fn chance(share: f64, squares: f64) -> f64 {
    let b = 0.5 * (squares - 6.0);
    if b <= 0.0 {
        return 1.0;
    }
    let x = share.clamp(0.0, 1.0);
    (1.0 - x).powf(b) * (1.0 + b * x + 0.5 * b * (b + 1.0) * x * x)
}

/// A way to divide the stops of a series: the rows of [`Linear`] behind the step, from the last on.
struct Candidate {
    series: usize,
    body: Body,
    order: Order,
    /// Rows in order; the step lies before `from`.
    rows: Rc<Vec<usize>>,
    from: usize,
}

impl Candidate {
    /// The rows that it moves, and by which part of it.
    fn moved(&self) -> impl Iterator<Item = (usize, f64)> {
        let last = self.rows.len().saturating_sub(1).max(1) as f64;
        let part = move |k: usize| if self.order == Order::Drift { k as f64 / last } else { 1.0 };
        self.rows.iter().enumerate().skip(self.from).map(move |(k, row)| (*row, part(k)))
    }
}

/// With at least so many stops on either side.
fn candidates(problem: &Problem, linear: &Linear, fewest: usize) -> Vec<Candidate> {
    let mut all = Vec::new();
    let mut divide = |series, body, order, rows: Vec<usize>| {
        let rows = Rc::new(rows);
        for from in (fewest..=rows.len().saturating_sub(fewest)).rev() {
            all.push(Candidate { series, body, order, rows: rows.clone(), from });
        }
        if order == Order::Time && rows.len() >= 2 * fewest {
            all.push(Candidate { series, body, order: Order::Drift, rows, from: 0 });
        }
    };
    let count = problem.images.iter().map(|i| i.series + 1).max().unwrap_or(0);
    for series in 0..count {
        let of_series = |body: Body| -> Vec<usize> {
            let in_series = |shown: Shown| problem.images[shown.image].series == series;
            let belongs = |r: &usize| linear.stops[*r].of(problem, body).any(in_series);
            (0..linear.stops.len()).filter(belongs).collect()
        };
        let placements = (0..problem.placements.len()).map(Body::Placement);
        for body in placements.chain((0..problem.mountings.len()).map(Body::Mounting)) {
            let rows = of_series(body);
            let Some(first) = rows.first().and_then(|&r| linear.stops[r].of(problem, body).next()) else { continue };
            let in_hand = problem.images[first.image].mount == CameraMount::Hand;
            if in_hand == matches!(body, Body::Mounting(_)) {
                for axis in 0..3 {
                    let mut rows = rows.clone();
                    let up = |r: &usize| linear.stops[*r].of(problem, body).next().map_or(0.0, |shown| shown.up[axis]);
                    rows.sort_by(|a, b| up(a).total_cmp(&up(b)));
                    divide(series, body, Order::Up(axis), rows);
                }
            }
            divide(series, body, Order::Time, rows);
        }
    }
    all
}

impl Linear {
    fn of(linear: LinearProblem) -> Self {
        let Adjustment { problem, state } = linear.adjustment;
        let lin = linear.lin;
        let StopInformation { stops: all, information, .. } = StopInformation::of(linear);
        let shown = |k: usize| {
            let image = &problem.images[lin.images[k]];
            if state.joint_errors[image.stop].is_empty() || state.ties[lin.images[k]].is_free() {
                return None;
            }
            let camera_from_plate = lin.chains[k].pose;
            let carried = match image.mount {
                CameraMount::Hand => state.placements[image.placement] * camera_from_plate.inverse(),
                CameraMount::Fixed => state.mountings[image.mounting] * camera_from_plate,
            };
            Some(Shown { image: lin.images[k], up: [0, 1, 2].map(|axis| carried.rotation[(2, axis)]) })
        };
        let row = |told: RootInformation| {
            let images: Vec<Shown> = told.places.filter_map(shown).collect();
            let by_columns = Rc::new(told.by_root);
            (!images.is_empty()).then_some(Row { images, score: told.score, by_free: told.by_free, by_columns })
        };
        Self { stops: all.into_iter().filter_map(row).collect(), information }
    }

    /// The step with the largest fall of the cost; where several are alike, the first, which is one in time.
    fn best(&self, problem: &Problem, tried: &[Candidate], fewest: usize) -> Option<PoseStep> {
        let covariance = SymmetricFactor::new(&self.information).ok()?.inverse();
        let mut best: Option<(f64, usize, Vector6<f64>, Matrix6<f64>)> = None;
        let mut sums = Sums::new(self.information.ncols());
        for (c, candidate) in tried.iter().enumerate() {
            let (rows, columns) = (&candidate.rows, candidate.body.columns(&problem.layout));
            // Behind a step are the rows behind the one before it, and one more.
            if candidate.order == Order::Drift || candidate.from + fewest == rows.len() {
                sums = Sums::new(self.information.ncols());
                candidate.moved().for_each(|(r, part)| sums.add(&self.stops[r], &columns, part));
            } else {
                sums.add(&self.stops[rows[candidate.from]], &columns, 1.0);
            }
            let Some((fall, twist, own)) = sums.step(&covariance) else { continue };
            if best.as_ref().is_none_or(|b| fall > b.0) {
                best = Some((fall, c, twist, own));
            }
        }
        let (fall, c, twist, covariance) = best?;
        let Candidate { series, body, order, .. } = tried[c];
        let moved: Vec<(usize, f64)> = tried[c].moved().collect();
        let images = moved.iter().flat_map(|(r, _)| self.stops[*r].of(problem, body));
        let images = images.map(|shown| shown.image).collect();
        Some(PoseStep { series, body, order, moved, images, twist, covariance, fall, share: 0.0 })
    }

    /// With the displacement of the body as six more columns, at the optimum; and the way there.
    fn with(&self, problem: &Problem, step: &PoseStep) -> Option<(Self, DVector<f64>)> {
        let n = self.information.ncols();
        let mut information = self.information.clone().resize(n + 6, n + 6, 0.0);
        let mut gradient = DVector::zeros(n + 6);
        let mut derivatives = Vec::with_capacity(self.stops.len());
        let columns = step.body.columns(&problem.layout);
        for (r, row) in self.stops.iter().enumerate() {
            let mut by_free = row.by_free.clone().resize_horizontally(n + 6, 0.0);
            if let Some((_, part)) = step.moved.iter().find(|(moved, _)| *moved == r) {
                let own = row.by(&columns) * *part;
                by_free.columns_mut(n, 6).copy_from(&own);
                let coupling = by_free.tr_mul(&own);
                let mut right = information.columns_mut(n, 6);
                right += &coupling;
                let mut below = information.view_mut((n, 0), (6, n));
                below += coupling.rows(0, n).transpose();
                let mut rest = gradient.rows_mut(n, 6);
                rest += own.tr_mul(&row.score);
            }
            derivatives.push(by_free);
        }
        let step = SymmetricFactor::new(&information).ok()?.solve(&gradient);
        let stops = (self.stops.iter().zip(derivatives))
            .map(|(row, by_free)| Row {
                images: row.images.clone(),
                score: &row.score - &by_free * &step,
                by_free,
                by_columns: row.by_columns.clone(),
            })
            .collect();
        Some((Self { stops, information }, step))
    }
}

/// Sums over the stops that a displacement moves.
struct Sums {
    score: Vector6<f64>,
    own: Matrix6<f64>,
    coupling: DMatrix<f64>,
}

impl Sums {
    fn new(columns: usize) -> Self {
        Self { score: Vector6::zeros(), own: Matrix6::zeros(), coupling: DMatrix::zeros(columns, 6) }
    }

    fn add(&mut self, row: &Row, columns: &Range<usize>, part: f64) {
        let by = &(row.by(columns) * part);
        let (score, own) = (by.tr_mul(&row.score), by.tr_mul(by));
        self.score += score.fixed_rows::<6>(0);
        self.own += own.fixed_view::<6, 6>(0, 0);
        self.coupling += row.by_free.tr_mul(by);
    }

    /// Fall of the cost, displacement, and its covariance.
    fn step(&self, covariance: &DMatrix<f64>) -> Option<(f64, Vector6<f64>, Matrix6<f64>)> {
        let taken = self.coupling.tr_mul(&product(covariance, &self.coupling));
        let left = DMatrix::from_column_slice(6, 6, (self.own - taken.fixed_view::<6, 6>(0, 0)).as_slice());
        let own = SymmetricFactor::new(&left).ok()?.inverse();
        let own = Matrix6::from_column_slice(own.as_slice());
        let twist = own * self.score;
        Some((self.score.dot(&twist), twist, own))
    }
}

impl PoseStep {
    fn finding(&self, problem: &Problem, setting: &CheckContext) -> Displaced {
        let image = &problem.images[self.images[0]];
        let body = match (self.body, image.mount) {
            (Body::Placement(_), CameraMount::Hand) => Carried::Plate,
            (Body::Placement(_), CameraMount::Fixed) => Carried::PlateInHand,
            (Body::Mounting(_), CameraMount::Hand) => Carried::CameraInHand,
            (Body::Mounting(_), CameraMount::Fixed) => Carried::Camera,
        };
        let sized = |from: usize| {
            let variance: f64 = (from..from + 3).map(|k| self.covariance[(k, k)]).sum();
            (self.twist.fixed_rows::<3>(from).norm(), (variance / 3.0).sqrt())
        };
        let (distance_m, angle_rad) = (sized(0), sized(3));
        let matters = distance_m.0 > setting.limits.displaced_m || angle_rad.0 > setting.limits.displaced_rad;
        Displaced {
            series: setting.series[self.series].name.clone(),
            body,
            mounting: problem.mountings[image.mounting].clone(),
            displacement: match self.order {
                Order::Time => Displacement::FromThenOn,
                Order::Up(axis) => Displacement::AxisUp(axis),
                Order::Drift => Displacement::AllThrough,
            },
            images: self.images.iter().map(|&i| problem.images[i].name.clone()).collect(),
            distance_m,
            angle_rad,
            share: self.share,
            weight: if matters { Weight::Gate } else { Weight::Note },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::chance;

    #[test]
    fn the_chance_is_that_of_a_beta_distribution() {
        // Of eight squares six are explained: the share has the density 3 x^2.
        for x in [0.1, 0.5, 0.9] {
            assert!((chance(x, 8.0) - (1.0 - x * x * x)).abs() < 1e-12);
        }
        assert!((chance(0.0, 100.0) - 1.0).abs() < 1e-12 && chance(1.0, 100.0) == 0.0);
        assert!((chance(0.999, 6.0) - 1.0).abs() < 1e-12, "nothing is left to compare with");
    }

    #[test]
    fn many_squares_make_it_chi_squared() {
        // The 99.9 % point of chi-squared with six degrees of freedom is 22.458.
        assert!((chance(22.458 / 1e6, 1e6) - 1e-3).abs() < 1e-5);
    }
}
