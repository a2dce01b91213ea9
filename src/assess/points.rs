//! A kinematic model judged by points that another device measured: only the frame of the device and the reflector are fitted.

use nalgebra::{DMatrix, DVector, Matrix3x6, SMatrix, Vector3};

use super::flange::everywhere;
use super::mean_square::MeanSquare;
use crate::geom::{Pose, rigid_fit, skew};
use crate::linalg::{SymmetricFactor, dense, product, symmetric_eigen};
use crate::model::robot::{Posture, Robot};
use crate::solve::Spread;

/// One point as a tracker saw it.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredPoint {
    /// Position in the frame of the device, m.
    pub position_m: Vector3<f64>,
    /// Readings in the order of the chain, rad or m.
    pub readings: Vec<f64>,
}

impl MeasuredPoint {
    /// A point of the tip where a robot has it at a stop, in the frame of its base.
    pub fn on_tip(robot: &Robot, tip_point_m: &Vector3<f64>, stop: &Posture) -> Self {
        Self { position_m: robot.base_from_tip_at(stop).transform(tip_point_m), readings: stop.readings.clone() }
    }
}

/// The fit of the device's frame (6) and the reflector on the tip (3).
#[derive(Debug, Clone, PartialEq)]
pub struct PointFit {
    /// `device_from_base`.
    pub device_from_base: Pose,
    /// Reflector in the frame of the tip, m.
    pub tip_point_m: Vector3<f64>,
    /// Measured minus predicted, m, in the frame of the device.
    pub residuals_m: Vec<Vector3<f64>>,
    /// RMS of the lengths of the residuals, m.
    pub rms_m: f64,
}

/// Unknowns of frame and reflector.
const FITTED: usize = 9;

/// Share of their mean by which the normal equations are held where the points do not determine frame and reflector.
const HELD: f64 = 1e-9;

/// Eigenvalue of the normal equations, with a diagonal of ones, below which a direction of frame and reflector is told by rounding alone.
const DETERMINED: f64 = 1e-12;

/// Least squares over the base frame and the reflector point; `None` where the points do not determine them as far as points of this robot can: of
/// an arm whose axes are all parallel none tell how much of a shift along them is one of the base, and how much one of the tip.
pub fn fit_points(robot: &Robot, points: &[MeasuredPoint]) -> Option<PointFit> {
    let free = fit(robot, points, 0.0);
    if free.is_some() {
        return free;
    }
    let held = fit(robot, points, HELD)?;
    let at = |readings: &[f64]| robot.base_from_tip(readings);
    let own: Vec<Pose> = points.iter().map(|p| at(&p.readings)).collect();
    let anywhere: Vec<Pose> = everywhere(robot).iter().map(|stop| at(&stop.readings)).collect();
    let told = |tips: &[Pose]| told_directions(tips, &held.tip_point_m);
    (told(&own)? == told(&anywhere)?).then_some(held)
}

/// How many of the nine directions of frame and reflector points at these poses of the tip tell; `None` of nothing finite. Turns of the frame are about
/// the middle of the points, so that their distance from the base takes nothing off.
fn told_directions(tips: &[Pose], tip_point: &Vector3<f64>) -> Option<usize> {
    let middle = tips.iter().map(|tip| tip.transform(tip_point)).sum::<Vector3<f64>>() / tips.len().max(1) as f64;
    let mut n = DMatrix::<f64>::zeros(FITTED, FITTED);
    for tip in tips {
        let centred = Pose::new(tip.rotation, tip.translation - middle);
        let j = by_frame_and_reflector(&Pose::identity(), &centred, tip_point);
        n += j.transpose() * j;
    }
    let unit: Vec<f64> = n.diagonal().iter().map(|d| if *d > 0.0 { d.sqrt() } else { 1.0 }).collect();
    let scaled = DMatrix::from_fn(FITTED, FITTED, |i, k| n[(i, k)] / (unit[i] * unit[k]));
    Some(symmetric_eigen(&scaled)?.0.iter().filter(|value| **value > DETERMINED).count())
}

/// Normal equations whose first nine unknowns are frame and reflector, with what points do not tell of these held.
pub(super) fn held_weakly(normal: DMatrix<f64>) -> DMatrix<f64> {
    held_by(HELD, normal)
}

/// The same with this share of their mean.
fn held_by(share: f64, mut normal: DMatrix<f64>) -> DMatrix<f64> {
    let scale = normal.view((0, 0), (FITTED, FITTED)).diagonal().mean();
    (0..FITTED).for_each(|k| normal[(k, k)] += share * scale);
    normal
}

/// Residuals of points beyond the unknowns of frame and reflector.
pub fn freedom(points: usize) -> f64 {
    (3 * points).saturating_sub(FITTED) as f64
}

/// As [`fit_points`], where only the residuals matter.
pub(super) fn lay_over(robot: &Robot, points: &[MeasuredPoint]) -> Option<PointFit> {
    fit_points(robot, points).or_else(|| fit(robot, points, HELD))
}

fn fit(robot: &Robot, points: &[MeasuredPoint], held: f64) -> Option<PointFit> {
    let tips: Vec<Pose> = points.iter().map(|p| robot.base_from_tip(&p.readings)).collect();
    let mut best: Option<PointFit> = None;
    // The problem is not convex: the frame is started from the best rigid fit for several reflector positions.
    for start in
        [Vector3::zeros(), Vector3::new(0.0, 0.0, 0.2), Vector3::new(0.1, 0.0, 0.1), Vector3::new(-0.1, 0.1, 0.1)]
    {
        let Some(fit) = from_start(&tips, points, start, held) else { continue };
        if best.as_ref().is_none_or(|b| fit.rms_m < b.rms_m) {
            best = Some(fit);
        }
    }
    best
}

fn from_start(tips: &[Pose], points: &[MeasuredPoint], start: Vector3<f64>, held: f64) -> Option<PointFit> {
    let mut tip_point = start;
    let pairs = tips.iter().zip(points).map(|(tip, p)| (tip.transform(&start), p.position_m));
    let mut frame = rigid_fit(&pairs.collect::<Vec<_>>())?;
    for _ in 0..100 {
        let (mut n, mut b) = (DMatrix::<f64>::zeros(FITTED, FITTED), DVector::<f64>::zeros(FITTED));
        for (tip, p) in tips.iter().zip(points) {
            let y = tip.transform(&tip_point);
            let r = p.position_m - frame.transform(&y);
            let j = by_frame_and_reflector(&frame, tip, &tip_point);
            n += j.transpose() * j;
            b += j.transpose() * r;
        }
        let step = SymmetricFactor::new(&held_by(held, n)).ok()?.solve(&b);
        frame = frame.perturbed(&step.fixed_rows::<6>(0).into_owned());
        tip_point += Vector3::new(step[6], step[7], step[8]);
        if step.norm() < 1e-12 {
            break;
        }
    }
    if held == 0.0 && told_directions(tips, &tip_point)? < FITTED {
        return None;
    }
    let residuals_m: Vec<Vector3<f64>> =
        tips.iter().zip(points).map(|(tip, p)| p.position_m - frame.transform(&tip.transform(&tip_point))).collect();
    let rms_m = (residuals_m.iter().map(Vector3::norm_squared).sum::<f64>() / points.len() as f64).sqrt();
    rms_m.is_finite().then_some(PointFit { device_from_base: frame, tip_point_m: tip_point, residuals_m, rms_m })
}

/// Derivatives of a point in the frame of the device by `device_from_base` (a twist on its right) and by the reflector on the tip.
pub(super) fn by_frame_and_reflector(
    device_from_base: &Pose,
    base_from_tip: &Pose,
    tip_point_m: &Vector3<f64>,
) -> SMatrix<f64, 3, FITTED> {
    let rotation = &device_from_base.rotation;
    let mut by = SMatrix::<f64, 3, FITTED>::zeros();
    by.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation);
    by.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-rotation * skew(&base_from_tip.transform(tip_point_m))));
    by.fixed_view_mut::<3, 3>(0, 6).copy_from(&(rotation * base_from_tip.rotation));
    by
}

/// What a fit of points should leave, by the covariance of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpectedRms {
    /// From the uncertainty of the model and what the judged one lacks of it, m.
    pub model_m: f64,
    /// Upper end of its 95 % interval, m: few directions of the model count at few points.
    pub most_model_m: f64,
    /// With the joint noise of every stop, m.
    pub with_joint_noise_m: f64,
    /// Mean squares of what the noise of every reading adds, m^2.
    pub by_reading: Vec<f64>,
    /// The same of single points.
    pub of_points: Vec<ExpectedSquares>,
}

/// Expected square of the residual of a point, m^2.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpectedSquares {
    /// By the uncertainty of the model and what the judged one lacks of it.
    pub model: f64,
    /// By the noise of every reading.
    pub by_reading: Vec<f64>,
}

/// Derivatives of points, three rows each, in the frame of the device.
pub struct Derivatives {
    /// By the robot's columns.
    pub by_model: DMatrix<f64>,
    /// By the noise of every reading of the point itself, in its sigmas.
    pub by_noise: DMatrix<f64>,
    /// By frame and reflector.
    pub fitted: DMatrix<f64>,
}

impl Derivatives {
    /// What the noise of a reading of a point does, m^2: its square at the point itself, and that at all points. It moves the frame, too, by which a
    /// projection makes that at all points less; `normal` are the normal equations of what is fitted.
    fn noise_squares(&self, point: usize, reading: usize, normal: &SymmetricFactor) -> [f64; 2] {
        let own = self.by_noise.fixed_view::<3, 1>(3 * point, reading).into_owned();
        let fitted = self.fitted.fixed_rows::<3>(3 * point);
        let taken_up = fitted.tr_mul(&own);
        let moved = normal.solve(&taken_up);
        let at_all = own.norm_squared() - taken_up.dot(&moved);
        [(own - fitted * moved).norm_squared(), at_all.max(0.0)]
    }
}

impl PointFit {
    /// Sum of the squares of the residuals, m^2.
    pub(super) fn squares(&self) -> f64 {
        self.residuals_m.iter().map(Vector3::norm_squared).sum()
    }

    /// How far a point, of the fit or not, was measured from where the robot puts it, m, in the frame of the device.
    pub fn residual_m(&self, robot: &Robot, point: &MeasuredPoint) -> Vector3<f64> {
        let on_tip = robot.base_from_tip(&point.readings).transform(&self.tip_point_m);
        point.position_m - self.device_from_base.transform(&on_tip)
    }

    /// Expected RMS of the residuals: the model's errors at the points, less what the fit of frame and reflector takes up.
    ///
    /// `covariance` is that of the robot's columns (twists, then terms), m and rad; `joint_sigma` that of every reading. `judged` is what the points
    /// are judged by where that is another robot, which lacks a part of it.
    pub fn expected(
        &self,
        (robot, judged): (&Robot, Option<&Robot>),
        points: &[MeasuredPoint],
        covariance: &DMatrix<f64>,
        joint_sigma: &[f64],
    ) -> Option<ExpectedRms> {
        let lacking = match judged {
            Some(judged) => self.left_by(robot, judged, points)?,
            None => vec![Vector3::zeros(); points.len()],
        };
        let d = self.derivatives(robot, points, covariance.nrows(), joint_sigma);
        let normal = SymmetricFactor::new(&held_weakly(d.fitted.transpose() * &d.fitted)).ok()?;
        let model = &d.by_model - &d.fitted * normal.solve_many(&(d.fitted.transpose() * &d.by_model));
        let n = points.len() as f64;
        let squares = product(&model, covariance).component_mul(&model);
        let of_point = |k: usize| squares.rows(3 * k, 3).sum().max(0.0) + lacking[k].norm_squared();
        let of_model = (0..points.len()).map(of_point).sum::<f64>() / n;
        let mut sums = MeanSquare::new(model.ncols());
        (0..points.len()).for_each(|k| sums.add(&model.fixed_rows::<3>(3 * k).into_owned(), &lacking[k]));
        let [_, most_model_m] = sums.interval_m(covariance, Spread { variance: 0.0, sigma: 0.0 });
        let readings = joint_sigma.len();
        let of_point_by_noise = |k: usize| (0..readings).map(|r| d.noise_squares(k, r, &normal)).collect();
        let noise: Vec<Vec<[f64; 2]>> = (0..points.len()).map(of_point_by_noise).collect();
        let of_points = noise.iter().enumerate().map(|(k, noise)| ExpectedSquares {
            model: of_point(k),
            by_reading: noise.iter().map(|[own, _]| *own).collect(),
        });
        let of_points = of_points.collect();
        let by_reading: Vec<f64> =
            (0..readings).map(|r| noise.iter().map(|noise| noise[r][1]).sum::<f64>() / n).collect();
        let of_noise: f64 = by_reading.iter().sum();
        Some(ExpectedRms {
            model_m: of_model.max(0.0).sqrt(),
            most_model_m,
            with_joint_noise_m: (of_model + of_noise).max(0.0).sqrt(),
            by_reading,
            of_points,
        })
    }

    /// Where the points of this fit are as a robot has them, less where another puts them once frame and reflector are fitted, m, in the frame of
    /// the device.
    fn left_by(&self, robot: &Robot, other: &Robot, points: &[MeasuredPoint]) -> Option<Vec<Vector3<f64>>> {
        let by_robot = |p: &MeasuredPoint| {
            let in_base = MeasuredPoint::on_tip(robot, &self.tip_point_m, &Posture::at(&p.readings));
            MeasuredPoint { position_m: self.device_from_base.transform(&in_base.position_m), ..in_base }
        };
        Some(fit_points(other, &points.iter().map(by_robot).collect::<Vec<_>>())?.residuals_m)
    }

    /// Derivatives of points with so many `columns` of the robot; `joint_sigma` of every reading, rad or m.
    pub fn derivatives(
        &self,
        robot: &Robot,
        points: &[MeasuredPoint],
        columns: usize,
        joint_sigma: &[f64],
    ) -> Derivatives {
        let (n, readings) = (points.len(), joint_sigma.len());
        let mut by_model = DMatrix::zeros(3 * n, columns);
        let mut by_noise = DMatrix::zeros(3 * n, readings);
        let mut fitted = DMatrix::zeros(3 * n, FITTED);
        for (k, p) in points.iter().enumerate() {
            let of_point = self.derivatives_at(robot, p, joint_sigma);
            by_model.view_mut((3 * k, 0), (3, columns)).copy_from(&of_point.by_model);
            by_noise.view_mut((3 * k, 0), (3, readings)).copy_from(&of_point.by_noise);
            fitted.view_mut((3 * k, 0), (3, FITTED)).copy_from(&of_point.fitted);
        }
        Derivatives { by_model, by_noise, fitted }
    }

    /// The same of one point.
    pub(super) fn derivatives_at(&self, robot: &Robot, point: &MeasuredPoint, joint_sigma: &[f64]) -> Derivatives {
        let kinematics = robot.kinematics(&Posture::at(&point.readings), &vec![0.0; joint_sigma.len()]);
        let tip = kinematics.base_from_tip;
        let turned = self.device_from_base.rotation * tip.rotation;
        let mut moved = Matrix3x6::zeros();
        moved.fixed_view_mut::<3, 3>(0, 0).copy_from(&turned);
        moved.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-turned * skew(&self.tip_point_m)));
        let first = 6 * kinematics.d_twists.len();
        let mut by_model = DMatrix::zeros(3, first + kinematics.d_terms.len());
        for (i, d) in kinematics.d_twists.iter().enumerate() {
            by_model.fixed_view_mut::<3, 6>(0, 6 * i).copy_from(&(moved * d));
        }
        for (i, d) in kinematics.d_terms.iter().enumerate() {
            by_model.fixed_view_mut::<3, 1>(0, first + i).copy_from(&(moved * d));
        }
        let mut by_noise = DMatrix::zeros(3, joint_sigma.len());
        for (r, (d, sigma)) in kinematics.d_readings.iter().zip(joint_sigma).enumerate() {
            by_noise.fixed_view_mut::<3, 1>(0, r).copy_from(&(moved * d * *sigma));
        }
        let by = by_frame_and_reflector(&self.device_from_base, &tip, &self.tip_point_m);
        Derivatives { by_model, by_noise, fitted: dense(&by) }
    }
}
