//! One image, linearised: normal equations in the space of its camera pose, its camera and plate shape, and its markers.
//!
//! Pixels know the robot only through the six degrees of freedom of the camera pose. So the pixels are condensed to blocks of
//! pose (p, 6), intrinsics (e, camera parameters then plate modes) and markers (m, 3 each); the robot enters afterwards by
//! `dp = G dtheta + L dl`, `l` what is latent ([`State::chained`]).

use nalgebra::{DMatrix, DVector, Matrix2, Matrix6, Matrix6x2, Matrix6xX, SMatrix, Vector2, Vector6};

use super::equations::{Collector, E, Equations, MarkerTerms};
use super::state::{Displaced, seen_centre};
use super::{Image, Layout, MarkerObservation, Problem, State, TakenFrom, Tie};
use crate::geom::{Pose, adjoint};
use crate::linalg::{add_combination, dense, wide};
use crate::model::circle::Prediction;
use crate::model::plate_modes::MODES;
use crate::model::robot::{Kinematics, LinearOrigins};

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
    /// Pose with intrinsics, 6 x (E + u and v of what is touched).
    pub pe: Matrix6xX<f64>,
    /// Intrinsics.
    pub ee: DMatrix<f64>,
    /// Right-hand side of the pose.
    pub bp: Vector6<f64>,
    /// Right-hand side of the intrinsics.
    pub be: DVector<f64>,
    /// Control points of the displacement field that are touched, ascending.
    pub touched: Vec<usize>,
    /// Markers that were seen, ascending, by themselves; how they are coupled with the rest is told by [`equations`].
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
    /// Every how many-th of the observations in use counts.
    pub every: usize,
}

impl Weighting {
    /// Of an image of `problem`.
    pub fn of(problem: &Problem, image: &Image) -> Self {
        Self { pixel_factor: problem.noise.pixel_factor[image.camera], huber: problem.huber, every: 1 }
    }

    /// With about `enough` of the observations of the image.
    pub fn thinned(self, image: &Image, enough: usize) -> Self {
        Self { every: (image.observations.len() / enough).max(1), ..self }
    }

    #[inline(always)]
    fn huber(&self, length: f64) -> (f64, f64) {
        if length <= self.huber {
            (0.5 * length * length, 1.0)
        } else {
            (self.huber * (length - 0.5 * self.huber), self.huber / length)
        }
    }
}

/// Prediction of one observation; `None` where the marker is behind the camera.
pub fn predict(image: &Image, state: &State, pose: &Pose, observation: &MarkerObservation) -> Option<Prediction> {
    let (camera, plate) = (&state.cameras[image.camera], &state.plates[image.plate]);
    wide(
        #[inline(always)]
        || observation.predict(camera, pose, plate).map(|(prediction, _)| prediction),
    )
}

/// Normal-equation blocks of one image at a camera pose; `None` where an observed marker is behind the camera.
pub fn linearise(image: &Image, state: &State, pose: &Pose, weighting: &Weighting) -> Option<ImageTerms> {
    linearise_with_equations(image, state, pose, weighting).map(|(terms, _)| terms)
}

/// As [`linearise`], with the equations that the blocks are sums of.
pub fn linearise_with_equations(
    image: &Image,
    state: &State,
    pose: &Pose,
    weighting: &Weighting,
) -> Option<(ImageTerms, Equations)> {
    let mut cost = 0.0;
    let mut residuals = Vec::with_capacity(image.observations.len());
    let tell = |share, residual| {
        cost += share;
        residuals.push(residual);
    };
    let equations = wide(
        #[inline(always)]
        || whitened(image, state, pose, weighting, tell),
    )?;
    Some((ImageTerms::new(cost, &equations, residuals), equations))
}

/// The equations that [`linearise`] sums up.
pub fn equations(image: &Image, state: &State, pose: &Pose, weighting: &Weighting) -> Option<Equations> {
    wide(
        #[inline(always)]
        || whitened(image, state, pose, weighting, |_, _| ()),
    )
}

/// Normal equations of the pose of one image, all else held.
#[derive(Debug, Clone, Copy, Default)]
pub struct PoseTerms {
    /// As [`ImageTerms::cost`].
    pub cost: f64,
    /// Information.
    pub pp: Matrix6<f64>,
    /// Right-hand side.
    pub bp: Vector6<f64>,
}

impl PoseTerms {
    /// Adds an observation with its derivative by the pose, its residual and the square root of its weight.
    #[inline(always)]
    fn add(&mut self, d_pose: &Matrix6x2<f64>, duv: &Vector2<f64>, root: &Matrix2<f64>) {
        let (u, v) = d_pose.as_slice().split_at(6);
        for (by_u, by_v) in [(root[(0, 0)], root[(0, 1)]), (0.0, root[(1, 1)])] {
            let equation: [f64; 6] = std::array::from_fn(|k| by_u * u[k] + by_v * v[k]);
            let residual = by_u * duv[0] + by_v * duv[1];
            for (sums, of) in self.pp.as_mut_slice().as_chunks_mut::<6>().0.iter_mut().zip(equation) {
                sums.iter_mut().zip(equation).for_each(|(sum, by)| *sum += by * of);
            }
            self.bp.iter_mut().zip(equation).for_each(|(sum, by)| *sum += by * residual);
        }
    }
}

/// As [`linearise`], of the pose alone.
pub fn linearise_pose(image: &Image, state: &State, pose: &Pose, weighting: &Weighting) -> Option<PoseTerms> {
    wide(
        #[inline(always)]
        || {
            let mut terms = PoseTerms::default();
            each_seen(
                image,
                state,
                pose,
                weighting,
                #[inline(always)]
                |p, seen| {
                    terms.cost += seen.cost;
                    terms.add(&p.d_pose, &seen.residual.duv, &seen.root);
                },
            )?;
            Some(terms)
        },
    )
}

/// `tell` hears of every observation in use, with its robust cost.
#[inline(always)]
fn whitened(
    image: &Image,
    state: &State,
    pose: &Pose,
    weighting: &Weighting,
    mut tell: impl FnMut(f64, Residual),
) -> Option<Equations> {
    let most = image.observations.len().div_ceil(weighting.every);
    let mut equations = Collector::new(most, state.cameras[image.camera].parametric());
    each_seen(
        image,
        state,
        pose,
        weighting,
        #[inline(always)]
        |p, seen| {
            equations.add(seen.marker, p, &seen.by_modes, &seen.residual.duv, &seen.root);
            tell(seen.cost, seen.residual);
        },
    )?;
    Some(equations.finish())
}

/// An observation in use.
struct UsedObservation {
    marker: usize,
    /// Derivative of its prediction by the modes of the plate.
    by_modes: SMatrix<f64, MODES, 2>,
    residual: Residual,
    /// Robust cost.
    cost: f64,
    /// Square root `F'` of its weight, the robust one included.
    root: Matrix2<f64>,
}

/// Tells of every observation in use with its prediction; `None` where one is behind the camera.
#[inline(always)]
fn each_seen(
    image: &Image,
    state: &State,
    pose: &Pose,
    weighting: &Weighting,
    mut tell: impl FnMut(&Prediction, &UsedObservation),
) -> Option<()> {
    let (plate, camera) = (&state.plates[image.plate], &state.cameras[image.camera]);
    let precision = 1.0 / weighting.pixel_factor;
    let used = image.observations.iter().enumerate().filter(|(_, o)| o.rejected.is_none());
    let mut stated = (Matrix2::zeros(), Matrix2::zeros());
    for (observation, o) in used.step_by(weighting.every) {
        let (p, by_modes) = o.predict(camera, pose, plate)?;
        let duv = o.uv - p.uv;
        // Observations one after the other are often alike.
        if stated.0 != o.information {
            stated = (o.information, square_root(&o.information) * precision);
        }
        let root = stated.1;
        let normalised = (root * duv).norm();
        let (cost, weight) = weighting.huber(normalised);
        let root = if weight < 1.0 { root * weight.sqrt() } else { root };
        let residual = Residual { observation, duv, normalised, weight };
        tell(&p, &UsedObservation { marker: o.marker, by_modes, residual, cost, root });
    }
    Some(())
}

/// `F'` of a positive semidefinite matrix `F F'`, upper triangular.
#[inline(always)]
fn square_root(m: &Matrix2<f64>) -> Matrix2<f64> {
    let a = m[(0, 0)].max(0.0).sqrt();
    let b = if a > 0.0 { m[(0, 1)] / a } else { 0.0 };
    Matrix2::new(a, b, 0.0, (m[(1, 1)] - b * b).max(0.0).sqrt())
}

impl ImageTerms {
    fn new(cost: f64, equations: &Equations, residuals: Vec<Residual>) -> Self {
        let touched = equations.touched.clone();
        let field = 2 * touched.len();
        let products = equations.products();
        let mut pe = Matrix6xX::zeros(E + field);
        pe.fixed_columns_mut::<E>(0).copy_from(&products.pose_with_intrinsics());
        let mut ee = DMatrix::zeros(E + field, E + field);
        ee.fixed_view_mut::<E, E>(0, 0).copy_from(&products.intrinsics());
        let mut be = DVector::zeros(E + field);
        be.fixed_rows_mut::<E>(0).copy_from(&products.intrinsics_with_residual());
        let (pp, bp) = (products.pose(), products.pose_with_residual());
        let mut terms = Self { cost, pp, pe, ee, bp, be, touched, markers: equations.marker_terms(), residuals };
        if field > 0 {
            terms.add_field(equations);
        }
        terms
    }

    fn add_field(&mut self, equations: &Equations) {
        let unknowns = self.be.len();
        let (pe, ee) = (self.pe.as_mut_slice(), self.ee.as_mut_slice());
        wide(
            #[inline(always)]
            || {
                for sight in equations.sights() {
                    let (pose, residual) = (sight.row_range(equations.pose_rows()), sight.residual());
                    let intrinsics = sight.by_intrinsics();
                    let intrinsics = [0, 1].map(|k| &intrinsics.as_slice()[E * k..E * (k + 1)]);
                    for (at, (k, d)) in sight.by_field().iter().enumerate() {
                        for (c, [by_u, by_v]) in (E + 2 * k..).zip([[d.m11, d.m21], [d.m12, d.m22]]) {
                            add_combination(&mut pe[6 * c..6 * (c + 1)], pose, [by_u, by_v]);
                            self.be[c] += by_u * residual[0] + by_v * residual[1];
                            let (with_e, with_field) = ee[unknowns * c..unknowns * (c + 1)].split_at_mut(E);
                            add_combination(with_e, intrinsics, [by_u, by_v]);
                            let points = with_field.as_chunks_mut::<2>().0;
                            for (other, e) in &sight.by_field()[..=at] {
                                let [u, v] = &mut points[*other];
                                *u += e.m11 * by_u + e.m21 * by_v;
                                *v += e.m12 * by_u + e.m22 * by_v;
                            }
                        }
                    }
                }
            },
        );
        self.ee.fill_lower_triangle_with_upper_triangle();
    }
}

impl Kinematics {
    /// Puts the derivatives of a pose by twists and joint terms into their columns, given that by the body twist of `base_from_tip`.
    pub(super) fn put(&self, d_tip: &Matrix6<f64>, layout: &Layout, into: &mut DMatrix<f64>) {
        for (k, d) in self.d_twists.iter().enumerate() {
            into.fixed_view_mut::<6, 6>(0, layout.twists.start + 6 * k).copy_from(&(d_tip * d));
        }
        for (k, d) in self.d_terms.iter().enumerate() {
            into.fixed_view_mut::<6, 1>(0, layout.terms.start + k).copy_from(&(d_tip * d));
        }
    }

    /// Derivatives of a pose by the first `joints` readings, 6 x joints.
    pub(super) fn by_readings(&self, d_tip: &Matrix6<f64>, joints: usize) -> DMatrix<f64> {
        let mut by = DMatrix::zeros(6, joints);
        by.column_iter_mut().zip(&self.d_readings).for_each(|(mut column, d)| column.copy_from(&(d_tip * d)));
        by
    }
}

/// How the camera pose of one image depends on the dense columns that act through it, and on what is latent.
#[derive(Debug, Clone)]
pub struct Chained {
    /// `camera_from_plate`.
    pub pose: Pose,
    /// `G`, 6 x theta, all theta columns.
    pub d_theta: DMatrix<f64>,
    /// `L`, 6 x unknowns of [`TakenFrom`]: joint errors of the stop, then the tie.
    pub d_latent: DMatrix<f64>,
}

impl Chained {
    /// Columns of `G`: how each theta column moves the pose.
    pub fn columns(&self) -> &[[f64; 6]] {
        self.d_theta.as_slice().as_chunks().0
    }

    /// How steps of the dense columns and of what is latent move the pose, as a body twist.
    pub fn moved(&self, dense: &DVector<f64>, latents: impl Iterator<Item = f64>) -> Vector6<f64> {
        let mut twist = Vector6::zeros();
        twist.gemv(1.0, &self.d_theta, &dense.rows(0, self.d_theta.ncols()), 0.0);
        for (column, latent) in self.d_latent.column_iter().zip(latents) {
            twist.axpy(latent, &column, 1.0);
        }
        twist
    }
}

impl State {
    /// Pose of an image and its derivatives as body twists; `None` for an image off the robot that has no free pose.
    pub fn chained(&self, layout: &Layout, image: &Image, from: TakenFrom) -> Option<Chained> {
        self.chained_from(&self.robot.linear_origins(), layout, image, from)
    }

    /// As [`State::chained`], where the origins of the robot are at hand.
    pub fn chained_from(
        &self,
        origins: &LinearOrigins,
        layout: &Layout,
        image: &Image,
        from: TakenFrom,
    ) -> Option<Chained> {
        let theta = layout.theta_len();
        if let Tie::Free(pose) = from.tie {
            return Some(Chained { pose: *pose, d_theta: DMatrix::zeros(6, theta), d_latent: DMatrix::identity(6, 6) });
        }
        let kinematics = self.robot.kinematics_from(origins, from.posture?, &from.errors());
        let mounted = image.mount.linearised(
            &self.mountings[image.mounting],
            &kinematics.base_from_tip,
            &self.placements[image.placement],
        );
        let mut g = DMatrix::zeros(6, theta);
        kinematics.put(&mounted.d_robot, layout, &mut g);
        g.fixed_view_mut::<6, 6>(0, layout.mountings[image.mounting].start).copy_from(&mounted.d_camera);
        g.fixed_view_mut::<6, 6>(0, layout.placements[image.placement].start).copy_from(&Matrix6::identity());
        let joints = from.joints();
        let l = kinematics.by_readings(&mounted.d_robot, joints).resize_horizontally(from.unknowns(), 0.0);
        let pose = mounted.camera_from_plate;
        let values = from.tie.displacement();
        if values.is_empty() {
            return Some(Chained { pose, d_theta: g, d_latent: l });
        }
        let displaced = Displaced::new(&pose, &seen_centre(image, self), values);
        // What moves the pose before the plate is turned moves it after that as seen from the turned plate.
        let carry = dense(&adjoint(&displaced.turned.inverse()));
        let mut l = &carry * l;
        l.columns_mut(joints, values.len()).copy_from(&displaced.d_components().columns(0, values.len()));
        Some(Chained { pose: displaced.pose, d_theta: carry * g, d_latent: l })
    }
}
