//! One image, linearised: normal equations in the space of its camera pose, its camera and plate shape, and its markers.
//!
//! Pixels know the robot only through the six degrees of freedom of the camera pose. So the pixels are condensed to blocks of
//! pose (p, 6), intrinsics (e, camera parameters then plate modes) and markers (m, 3 each); the robot enters afterwards by
//! `dp = G dtheta + L dslack` ([`chained`]).

use nalgebra::{
    DMatrix, DVector, Matrix2, Matrix3, Matrix3x2, Matrix6, Matrix6x2, Matrix6xX, SMatrix, Vector2, Vector3, Vector6,
};

use super::{Image, Measured, Problem, Slack, State};
use crate::geom::{Pose, adjoint, right_jacobian_se3};
use crate::model::camera::MAX_PARAMETERS;
use crate::model::circle::{self, Prediction};
use crate::model::plate_modes::{MODES, basis};

/// Intrinsic unknowns of one image before its displacement field: camera parameters (padded), then plate modes.
///
/// The field follows: u and v of every control point.
pub const E: usize = MAX_PARAMETERS + MODES;

/// Normal-equation blocks of one marker in one image.
#[derive(Debug, Clone)]
pub struct MarkerTerms {
    /// Index of the marker on its plate.
    pub marker: usize,
    /// 3x3 information.
    pub mm: Matrix3<f64>,
    /// Coupling with the pose.
    pub mp: SMatrix<f64, 3, 6>,
    /// Coupling with the intrinsics before the field.
    pub me: SMatrix<f64, 3, E>,
    /// Coupling with the control points of the field that it touches, ascending.
    pub field: Vec<(usize, Matrix3x2<f64>)>,
    /// Right-hand side.
    pub bm: Vector3<f64>,
}

/// One residual with what the robust weighting made of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// Index among the observations of the image.
    pub observation: usize,
    /// Measured minus predicted, px.
    pub duv: Vector2<f64>,
    /// Length, normalised by the stated covariance and the pixel factor.
    pub normalised: f64,
    /// Huber weight.
    pub weight: f64,
}

/// Normal-equation blocks of one image: minimise `sum rho(|r|)`, information = J' W J, right-hand side = J' W r.
#[derive(Debug, Clone)]
pub struct ImageTerms {
    /// Robust cost (half the squared length where not robustified).
    pub cost: f64,
    /// Pose block.
    pub pp: Matrix6<f64>,
    /// Pose with intrinsics, 6 x (E + field).
    pub pe: Matrix6xX<f64>,
    /// Intrinsics.
    pub ee: DMatrix<f64>,
    /// Right-hand side of the pose.
    pub bp: Vector6<f64>,
    /// Right-hand side of the intrinsics.
    pub be: DVector<f64>,
    /// Markers that were seen, ascending.
    pub markers: Vec<MarkerTerms>,
    /// Residuals of the observations in use.
    pub residuals: Vec<Residual>,
}

/// How residuals are weighted.
#[derive(Debug, Clone, Copy)]
pub struct Weighting {
    /// Factor on the stated standard deviations.
    pub pixel_factor: f64,
    /// Huber bound on the normalised length.
    pub huber: f64,
}

impl Weighting {
    /// Of an image of `problem`.
    pub fn of(problem: &Problem, image: &Image) -> Self {
        Self { pixel_factor: problem.noise.pixel_factor[image.camera], huber: problem.huber }
    }

    fn huber(&self, length: f64) -> (f64, f64) {
        if length <= self.huber {
            (0.5 * length * length, 1.0)
        } else {
            (self.huber * (length - 0.5 * self.huber), self.huber / length)
        }
    }
}

/// Prediction of one observation; `None` where the marker is behind the camera.
pub fn predict(image: &Image, state: &State, pose: &Pose, observation: &Measured) -> Option<Prediction> {
    let position = state.plates[image.plate].position(observation.marker);
    circle::centroid(&state.cameras[image.camera], pose, &position, observation.radius_m)
}

/// Normal-equation blocks of one image at a camera pose; `None` where an observed marker is behind the camera.
pub fn linearise(image: &Image, state: &State, pose: &Pose, weighting: &Weighting) -> Option<ImageTerms> {
    let camera = &state.cameras[image.camera];
    let intrinsics = E + camera.parameters.len() - camera.parametric();
    let mut t = ImageTerms {
        cost: 0.0,
        pp: Matrix6::zeros(),
        pe: Matrix6xX::zeros(intrinsics),
        ee: DMatrix::zeros(intrinsics, intrinsics),
        bp: Vector6::zeros(),
        be: DVector::zeros(intrinsics),
        markers: Vec::with_capacity(image.observations.len()),
        residuals: Vec::with_capacity(image.observations.len()),
    };
    let plate = &state.plates[image.plate];
    for (index, o) in image.observations.iter().enumerate().filter(|(_, o)| o.rejected.is_none()) {
        let p = predict(image, state, pose, o)?;
        let r = o.uv - p.uv;
        let information = o.information / (weighting.pixel_factor * weighting.pixel_factor);
        let normalised = (r.dot(&(information * r))).max(0.0).sqrt();
        let (cost, weight) = weighting.huber(normalised);
        t.cost += cost;
        t.residuals.push(Residual { observation: index, duv: r, normalised, weight });
        t.add(o.marker, &p, &basis(&plate.nominal[o.marker], plate.half_diagonal_m), &r, &(information * weight));
    }
    Some(t)
}

impl ImageTerms {
    fn add(
        &mut self,
        marker: usize,
        p: &Prediction,
        modes: &SMatrix<f64, 3, MODES>,
        r: &Vector2<f64>,
        w: &Matrix2<f64>,
    ) {
        let mut je = SMatrix::<f64, 2, E>::zeros();
        je.fixed_view_mut::<2, MAX_PARAMETERS>(0, 0).copy_from(&p.d_camera);
        je.fixed_view_mut::<2, MODES>(0, MAX_PARAMETERS).copy_from(&(p.d_marker * modes));
        let (wp, we, wr) = (w * p.d_pose, w * je, w * r);
        self.pp += p.d_pose.transpose() * wp;
        self.bp += p.d_pose.transpose() * wr;
        let mut pe = self.pe.fixed_columns_mut::<E>(0);
        pe += p.d_pose.transpose() * we;
        let mut ee = self.ee.fixed_view_mut::<E, E>(0, 0);
        ee += je.transpose() * we;
        let mut be = self.be.fixed_rows_mut::<E>(0);
        be += je.transpose() * wr;
        self.add_field(p, &wp, &we, &wr, w);
        let jm = p.d_marker.transpose();
        let (mm, mp, me, bm) = (jm * w * p.d_marker, jm * wp, jm * we, jm * wr);
        let field = p.d_field.iter().map(|(k, d)| (*k, jm * w * d));
        match self.markers.last_mut().filter(|last| last.marker == marker) {
            Some(last) => {
                last.mm += mm;
                last.mp += mp;
                last.me += me;
                last.bm += bm;
                field.for_each(|f| last.add_field(f));
            }
            None => self.markers.push(MarkerTerms { marker, mm, mp, me, bm, field: field.collect() }),
        }
    }

    fn add_field(
        &mut self,
        p: &Prediction,
        wp: &SMatrix<f64, 2, 6>,
        we: &SMatrix<f64, 2, E>,
        wr: &Vector2<f64>,
        w: &Matrix2<f64>,
    ) {
        for (k, d) in &p.d_field {
            let (column, dt) = (E + 2 * k, d.transpose());
            let mut pe = self.pe.fixed_columns_mut::<2>(column);
            pe += wp.transpose() * d;
            let mut be = self.be.fixed_rows_mut::<2>(column);
            be += dt * wr;
            let with_e = dt * we;
            let mut row = self.ee.fixed_view_mut::<2, E>(column, 0);
            row += with_e;
            let mut transposed = self.ee.fixed_view_mut::<E, 2>(0, column);
            transposed += with_e.transpose();
            let dw = dt * w;
            for (other, e) in &p.d_field {
                let mut block = self.ee.fixed_view_mut::<2, 2>(column, E + 2 * other);
                block += dw * e;
            }
        }
    }
}

impl MarkerTerms {
    fn add_field(&mut self, (k, coupling): (usize, Matrix3x2<f64>)) {
        match self.field.binary_search_by_key(&k, |f| f.0) {
            Ok(at) => self.field[at].1 += coupling,
            Err(at) => self.field.insert(at, (k, coupling)),
        }
    }

    /// Coupling with every intrinsic unknown that it touches: its index, and a column.
    pub fn intrinsics(&self) -> impl Iterator<Item = (usize, Vector3<f64>)> + '_ {
        let field = self.field.iter().flat_map(|(k, c)| [0, 1].map(|d| (E + 2 * k + d, c.column(d).into_owned())));
        (0..E).map(|e| (e, self.me.column(e).into_owned())).chain(field)
    }
}

/// How the camera pose of one image depends on the dense columns that act through it, and on its slack.
#[derive(Debug, Clone)]
pub struct Chained {
    /// `camera_from_plate`.
    pub pose: Pose,
    /// `G`, 6 x theta, all theta columns.
    pub d_theta: DMatrix<f64>,
    /// `L`, 6 x slack.
    pub d_slack: DMatrix<f64>,
}

/// Middle of the markers that an image shows, plate frame, m.
pub(super) fn seen_centre(image: &Image, state: &State) -> Vector3<f64> {
    let nominal = &state.plates[image.plate].nominal;
    let sum: Vector3<f64> = image.observations.iter().map(|o| nominal[o.marker]).sum();
    sum / image.observations.len().max(1) as f64
}

/// Body twists of `camera_from_plate` that turn the plate about its x and y axes through `centre`.
pub(super) fn tilt_axes(centre: &Vector3<f64>) -> Matrix6x2<f64> {
    let mut axes = Matrix6x2::zeros();
    for (k, axis) in [Vector3::x(), Vector3::y()].into_iter().enumerate() {
        axes.fixed_view_mut::<3, 1>(0, k).copy_from(&centre.cross(&axis));
        axes.fixed_view_mut::<3, 1>(3, k).copy_from(&axis);
    }
    axes
}

/// Pose of an image and its derivatives as body twists; `None` for an image off the robot that has no free pose.
pub fn chained(problem: &Problem, state: &State, image: &Image, slack: &Slack) -> Option<Chained> {
    let theta = problem.layout.theta_len();
    if let Slack::Pose(pose) = slack {
        return Some(Chained { pose: *pose, d_theta: DMatrix::zeros(6, theta), d_slack: DMatrix::identity(6, 6) });
    }
    let stop = image.stop.as_ref()?;
    let zero = vec![0.0; stop.readings.len()];
    let noise = if let Slack::Joints(dq) = slack { dq } else { &zero };
    let kinematics = state.robot.kinematics(stop, noise);
    let mounted = image.mount.linearised(
        &state.mountings[image.mounting],
        &kinematics.base_from_tip,
        &state.placements[image.placement],
    );
    let layout = &problem.layout;
    let mut g = DMatrix::zeros(6, theta);
    for (k, d) in kinematics.d_twists.iter().enumerate() {
        g.fixed_view_mut::<6, 6>(0, layout.twists.start + 6 * k).copy_from(&(mounted.d_robot * d));
    }
    for (k, d) in kinematics.d_terms.iter().enumerate() {
        g.fixed_view_mut::<6, 1>(0, layout.terms.start + k).copy_from(&(mounted.d_robot * d));
    }
    g.fixed_view_mut::<6, 6>(0, layout.mountings[image.mounting].start).copy_from(&mounted.d_camera);
    g.fixed_view_mut::<6, 6>(0, layout.placements[image.placement].start).copy_from(&Matrix6::identity());
    let mut l = DMatrix::zeros(6, slack.len());
    for (k, d) in kinematics.d_readings.iter().enumerate().take(slack.len()) {
        l.fixed_view_mut::<6, 1>(0, k).copy_from(&(mounted.d_robot * d));
    }
    let pose = mounted.camera_from_plate;
    let Some([x, y]) = slack.tilt(stop.readings.len()) else { return Some(Chained { pose, d_theta: g, d_slack: l }) };
    let axes = tilt_axes(&seen_centre(image, state));
    let tilt = axes * Vector2::new(x, y);
    let turned = Pose::exp(&tilt);
    // What moves the pose before the tilt moves it after the tilt as seen from the tilted plate.
    let carry = adjoint(&turned.inverse());
    let carry = DMatrix::from_column_slice(6, 6, carry.as_slice());
    let mut l = &carry * l;
    l.view_mut((0, stop.readings.len()), (6, 2)).copy_from(&(right_jacobian_se3(&tilt) * axes));
    Some(Chained { pose: pose * turned, d_theta: carry * g, d_slack: l })
}
