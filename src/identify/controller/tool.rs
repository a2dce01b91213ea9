//! Whether the poses of a controller are those of a tool, which was taken for the flange, or stand in another frame than the base.
//!
//! With a tool `T` on the flange, or a frame `T` in the base, the controller states `P = N(q) T` or `T^-1 N(q)`, and the readings are
//! `q(T) = N^-1(P T^-1)` or `N^-1(T P)`. A robot that is as in its model would absorb `T` in the hand-eye transform or the target pose, whatever it
//! is; of the real one the errors at `q(T)` are others. So it has the least
//!
//! ```text
//! c(T) = min_x sum_i |e_i - G_i(q(T)) x|^2 + x' P^-1 x
//! ```
//!
//! with `G_i`, `e_i`, `x` as in `computed_postures`; `c` is minimised by Levenberg-Marquardt, `x` eliminated (G. Golub and V. Pereyra 1973).

use nalgebra::{DMatrix, DVector, Matrix6, SymmetricEigen, Vector3, Vector6};
use rayon::prelude::*;

use super::computed_postures::{Compared, Knowledge, SeenAt};
use crate::assess::Limits;
use crate::diagnose::{PosesOf, ToolInPoses};
use crate::error::Result;
use crate::geom::{Pose, exp_so3};
use crate::model::inverse::{reading_limits, solve_from};
use crate::model::robot::Robot;
use crate::problem::{Adjustment, MeasuredSeries, State};
use crate::series::{CameraMount, spread};

/// Stops that are compared, at most.
const MOST_STOPS: usize = 100;
/// Lengths of tools along the axis of the flange from which the search starts, m.
const STARTS_M: [f64; 3] = [0.0, 0.15, -0.15];
/// Most steps of the search.
const STEPS: usize = 12;
/// Step of numerical derivatives, m and rad.
const DIFFERENCE: f64 = 2e-3;
/// Damping beyond which no step gains anything.
const MOST_DAMPING: f64 = 1e3;
/// A step that gains less of the cost ends the search.
const GAINED: f64 = 1e-4;

/// The tool or the frame with which the images fit decidedly better, where the readings of the series were computed from poses.
pub(in crate::identify) fn tool_in_poses(
    robot: &Robot,
    series: &[MeasuredSeries],
    limits: &Limits,
    hold: impl FnOnce(&mut Adjustment) -> Result<()>,
) -> Option<ToolInPoses> {
    let best = Compared::with("tool in poses", robot, (series, limits), hold, |compared| {
        let searches = [PosesOf::Tool, PosesOf::Frame].map(|of| Search::new(compared, series, robot, of));
        let found = searches.into_iter().flatten().filter_map(|search| search.told(limits));
        found.min_by(|a, b| a.1.cost.total_cmp(&b.1.cost))
    });
    let (of, best, sigma_m, gain) = best?;
    let place_m = best.tool.fixed_rows::<3>(0).into_owned();
    let names = series.iter().filter(|s| s.readings_are_computed()).map(|s| s.name.clone()).collect();
    Some(ToolInPoses { series: names, of, place_m: place_m.into(), sigma_m: sigma_m.into(), gain })
}

struct Search<'a> {
    compared: &'a Compared,
    of: PosesOf,
    nominal: Robot,
    limits: Vec<(f64, f64)>,
    /// The stops that are compared as images saw them, the readings that were taken, and the pose that was stated.
    stops: Vec<(SeenAt, Vec<f64>, Pose)>,
    equations: usize,
}

/// A tool or a frame, and what the stops say with it.
struct Tried {
    /// m, and rad as a rotation vector.
    tool: Vector6<f64>,
    stops: Vec<(DMatrix<f64>, DVector<f64>)>,
    known: Knowledge,
    x: DVector<f64>,
    cost: f64,
}

fn pose(tool: &Vector6<f64>) -> Pose {
    let turn: Vector3<f64> = tool.fixed_rows::<3>(3).into_owned();
    Pose::new(exp_so3(&turn), tool.fixed_rows::<3>(0).into_owned())
}

impl<'a> Search<'a> {
    fn new(compared: &'a Compared, series: &[MeasuredSeries], robot: &Robot, of: PosesOf) -> Option<Self> {
        let nominal = Robot::nominal(robot.chain.clone());
        let problem = &compared.adjustment.problem;
        let taken = |seen: &SeenAt| {
            let seen = seen.by_images()?;
            let first = &problem.images[*seen.images.first()?];
            if !series[first.series].readings_are_computed() {
                return None;
            }
            let posture = problem.stops[first.stop].posture.as_ref()?;
            let stated = nominal.base_from_tip(&posture.readings);
            Some((seen, posture.readings.clone(), stated))
        };
        let all: Vec<_> = compared.stops.iter().filter_map(taken).collect();
        let stops: Vec<_> = spread(all.len(), MOST_STOPS).map(|k| all[k].clone()).collect();
        let equations = stops.iter().map(|(seen, ..)| 6 * seen.images.len()).sum();
        let limits = reading_limits(&robot.chain);
        (!stops.is_empty()).then_some(Self { compared, of, nominal, limits, stops, equations })
    }

    /// What the flange carries stands as it was on the tool, what is fixed as it was in the frame.
    fn state(&self, of: &Pose) -> State {
        let Adjustment { problem, state } = &self.compared.adjustment;
        let mut moved = state.clone();
        for image in self.stops.iter().flat_map(|(seen, ..)| &seen.images).map(|i| &problem.images[*i]) {
            let moves_camera = (image.mount == CameraMount::Hand) == (self.of == PosesOf::Tool);
            match moves_camera {
                true => moved.mountings[image.mounting] = *of * state.mountings[image.mounting],
                false => moved.placements[image.placement] = *of * state.placements[image.placement],
            }
        }
        moved
    }

    /// `None` where a stop is out of reach with this tool or frame.
    fn stops_with(&self, tool: &Vector6<f64>) -> Option<Vec<(DMatrix<f64>, DVector<f64>)>> {
        let of = pose(tool);
        let state = self.state(&of);
        let origins = state.robot.linear_origins();
        let without = of.inverse();
        let one = |(seen, taken, stated): &(SeenAt, Vec<f64>, Pose)| {
            let flange = match self.of {
                PosesOf::Tool => *stated * without,
                PosesOf::Frame => of * *stated,
            };
            let readings = solve_from(&self.nominal, &self.limits, &flange, taken)?;
            self.compared.seen_at((&state, &origins), seen, &readings)
        };
        self.stops.par_iter().map(one).collect()
    }

    /// The best one, with the sigma of its place (m) and the gain of the log likelihood, if it is told.
    fn told(&self, limits: &Limits) -> Option<(PosesOf, Tried, Vector3<f64>, f64)> {
        let none = self.at(Vector6::zeros())?;
        let starts = STARTS_M.map(|z| Vector6::new(0.0, 0.0, z, 0.0, 0.0, 0.0));
        let found: Vec<Tried> = starts.into_par_iter().filter_map(|start| self.least(self.at(start)?)).collect();
        let best = found.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost))?;
        let gain = 0.5 * self.equations as f64 * (none.cost / best.cost).ln();
        let sigma_m = self.sigma_m(&best)?;
        let far_m = best.tool.fixed_rows::<3>(0).norm();
        let is_told = gain > limits.tool_log_odds && far_m > limits.tool_sigmas * sigma_m.norm();
        is_told.then_some((self.of, best, sigma_m, gain))
    }

    fn at(&self, tool: Vector6<f64>) -> Option<Tried> {
        let stops = self.stops_with(&tool)?;
        let mut known = Knowledge::of_priors(&self.compared.prior);
        stops.iter().for_each(|(g, e)| known.add((g, e), 1.0));
        let x = known.factor()?.solve(&known.rhs);
        let cost = known.squares - known.rhs.dot(&x);
        Some(Tried { tool, stops, known, x, cost })
    }

    /// Normal equations of the tool with `x` eliminated: information, and the gradient.
    fn reduced(&self, tried: &Tried) -> Option<(Matrix6<f64>, Vector6<f64>)> {
        let residuals = |stops: &[(DMatrix<f64>, DVector<f64>)]| {
            let all: Vec<f64> = stops.iter().flat_map(|(g, e)| (e - g * &tried.x).data.as_vec().clone()).collect();
            DVector::from_vec(all)
        };
        let r = residuals(&tried.stops);
        let mut j = DMatrix::zeros(r.len(), 6);
        for k in 0..6 {
            let mut moved = tried.tool;
            moved[k] += DIFFERENCE;
            j.set_column(k, &((residuals(&self.stops_with(&moved)?) - &r) / DIFFERENCE));
        }
        let mut coupled = DMatrix::zeros(tried.x.len(), 6);
        let mut row = 0;
        for (g, _) in &tried.stops {
            coupled.gemm_tr(1.0, g, &j.rows(row, g.nrows()), 1.0);
            row += g.nrows();
        }
        let information = j.transpose() * &j - coupled.transpose() * tried.known.factor()?.solve_many(&coupled);
        let information = Matrix6::from_column_slice(information.as_slice());
        Some((
            0.5 * (information + information.transpose()),
            Vector6::from_column_slice((j.transpose() * r).as_slice()),
        ))
    }

    fn least(&self, mut tried: Tried) -> Option<Tried> {
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let (information, gradient) = self.reduced(&tried)?;
            let mut gained = 0.0;
            while damping < MOST_DAMPING {
                let damped = information + Matrix6::from_diagonal(&information.diagonal().map(|d| damping * d + 1.0));
                let step = damped.cholesky()?.solve(&-gradient);
                match self.at(tried.tool + step).filter(|next| next.cost < tried.cost) {
                    Some(next) => {
                        gained = 1.0 - next.cost / tried.cost;
                        tried = next;
                        damping *= 0.1;
                        break;
                    }
                    None => damping *= 10.0,
                }
            }
            if gained < GAINED {
                break;
            }
        }
        Some(tried)
    }

    /// Sigma of the position of a tool, m, by the scatter that it leaves.
    fn sigma_m(&self, tried: &Tried) -> Option<Vector3<f64>> {
        let (information, _) = self.reduced(tried)?;
        let SymmetricEigen { eigenvectors, eigenvalues } = information.symmetric_eigen();
        // What nothing tells is a turn about the last axis, which the zero of that joint takes.
        let inverse = eigenvalues.map(|v| 1.0 / v.max(1.0));
        let covariance = eigenvectors * Matrix6::from_diagonal(&inverse) * eigenvectors.transpose();
        let scatter = tried.cost / self.equations as f64;
        Some(covariance.diagonal().fixed_rows::<3>(0).map(|v| (scatter * v).sqrt()))
    }
}
