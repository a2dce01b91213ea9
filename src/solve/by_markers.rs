//! Markers eliminated, first in the space of camera poses, then the robot enters by `dp = G dtheta + L dslack`.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, SMatrix, Vector3};
use rayon::prelude::*;

use super::system::{Carried, FIXED_MARKER_SIGMA_M, Linearised, scatter};
use crate::linalg::product;
use crate::model::plate_modes::MODES;
use crate::problem::{Problem, Slack, State, Step};

/// One marker, ready to be eliminated: data of all images and its prior.
#[derive(Debug, Clone)]
struct Marker {
    inverse: Matrix3<f64>,
    /// Coupling with the dense intrinsic columns, 3 x n_e.
    me: DMatrix<f64>,
    bm: Vector3<f64>,
    seen: bool,
}

/// Every marker with its elimination.
#[derive(Debug, Clone)]
pub(super) struct MarkersEliminated {
    theta: usize,
    markers: Vec<Vec<Marker>>,
}

type Reduced = (DMatrix<f64>, DVector<f64>, Vec<usize>, MarkersEliminated);

impl MarkersEliminated {
    /// Information, right-hand side and start of each image's slack; priors of slack and markers are in, those of the dense
    /// columns are not.
    pub fn build(problem: &Problem, state: &State, lin: &Linearised, lambda: f64) -> Reduced {
        let theta = problem.layout.theta_len();
        let markers = gather_markers(problem, state, lin, lambda);
        let space = PoseSpace::new(problem, lin, &markers);
        let (mut a, mut rhs, slack_start) = space.to_robot_space(problem, lin);
        for (&start, &image) in slack_start.iter().zip(&lin.images) {
            if let Slack::Joints(dq) = &state.slack[image] {
                for (k, q) in dq.iter().enumerate() {
                    let information = problem.slack_information(&problem.images[image], k);
                    a[(start + k, start + k)] += information;
                    rhs[start + k] -= q * information;
                }
            }
        }
        (a, rhs, slack_start, Self { theta, markers })
    }

    /// The whole step from the solution `x` of the reduced system.
    pub fn step(&self, problem: &Problem, lin: &Linearised, slack_start: &[usize], x: &DVector<f64>) -> Step {
        let dense = x.rows(0, problem.layout.len()).into_owned();
        let mut slack = vec![Vec::new(); problem.images.len()];
        let de = dense.rows(self.theta, dense.len() - self.theta).into_owned();
        let mut pull: Vec<Vec<Vector3<f64>>> =
            self.markers.iter().map(|plate| plate.iter().map(|m| m.bm - &m.me * &de).collect()).collect();
        for (k, &image) in lin.images.iter().enumerate() {
            let chain = &lin.chains[k];
            let ds = x.rows(slack_start[k], chain.d_slack.ncols()).into_owned();
            let dp = &chain.d_theta * dense.rows(0, self.theta) + &chain.d_slack * &ds;
            for m in &lin.terms[k].markers {
                pull[problem.images[image].plate][m.marker] -= m.mp * &dp;
            }
            slack[image] = ds.as_slice().to_vec();
        }
        let markers = (self.markers.iter().zip(pull))
            .map(|(plate, pull)| {
                let step = |(m, p): (&Marker, Vector3<f64>)| if m.seen { m.inverse * p } else { Vector3::zeros() };
                plate.iter().zip(pull).map(step).collect()
            })
            .collect();
        Step { dense, slack, markers }
    }

    /// Covariance of every marker that was seen: `V + D cov(x) D'` with `D = V * coupling`, less what moves the marker with `x`
    /// for a position instead of a correction.
    pub fn marker_covariances(
        &self,
        problem: &Problem,
        lin: &Linearised,
        slack_start: &[usize],
        reduced: &DMatrix<f64>,
        carried: Option<&Carried>,
    ) -> Vec<Vec<Option<Matrix3<f64>>>> {
        let plate = |(p, markers): (usize, &Vec<Marker>)| {
            let seen: Vec<usize> = (0..markers.len()).filter(|&m| markers[m].seen).collect();
            let rows: Vec<DMatrix<f64>> = seen
                .par_iter()
                .map(|&m| {
                    let mut d = self.marker_coupling(problem, lin, slack_start, (p, m), reduced.nrows());
                    if let Some((start, modes)) = carried.map(|c| c(p, m)) {
                        let mut own = d.columns_mut(start, MODES);
                        own -= modes;
                    }
                    d
                })
                .collect();
            let mut d = DMatrix::zeros(3 * seen.len(), reduced.nrows());
            for (k, rows) in rows.iter().enumerate() {
                d.rows_mut(3 * k, 3).copy_from(rows);
            }
            let dc = product(&d, reduced);
            let mut all = vec![None; markers.len()];
            for (k, &m) in seen.iter().enumerate() {
                let c = dc.rows(3 * k, 3) * d.rows(3 * k, 3).transpose();
                all[m] = Some(markers[m].inverse + Matrix3::from_column_slice(c.as_slice()));
            }
            all
        };
        self.markers.iter().enumerate().map(plate).collect()
    }

    /// `D = V * coupling` of one marker (plate, index), 3 x unknowns: `cov(m, x) = -D cov(x)`.
    fn marker_coupling(
        &self,
        problem: &Problem,
        lin: &Linearised,
        slack_start: &[usize],
        (plate, marker): (usize, usize),
        unknowns: usize,
    ) -> DMatrix<f64> {
        let m = &self.markers[plate][marker];
        let mut coupling = DMatrix::zeros(3, unknowns);
        coupling.view_mut((0, self.theta), (3, m.me.ncols())).copy_from(&m.me);
        for k in (0..lin.images.len()).filter(|&k| problem.images[lin.images[k]].plate == plate) {
            let terms = &lin.terms[k].markers;
            let Ok(at) = terms.binary_search_by_key(&marker, |t| t.marker) else { continue };
            let mp = DMatrix::from_column_slice(3, 6, terms[at].mp.as_slice());
            let chain = &lin.chains[k];
            let mut theta = coupling.view_mut((0, 0), (3, self.theta));
            theta += &mp * &chain.d_theta;
            coupling.view_mut((0, slack_start[k]), (3, chain.d_slack.ncols())).copy_from(&(&mp * &chain.d_slack));
        }
        for (i, c) in problem.layout.columns.iter().enumerate() {
            if !c.free {
                coupling.column_mut(i).fill(0.0);
            }
        }
        DMatrix::from_column_slice(3, 3, m.inverse.as_slice()) * coupling
    }
}

fn gather_markers(problem: &Problem, state: &State, lin: &Linearised, lambda: f64) -> Vec<Vec<Marker>> {
    let theta = problem.layout.theta_len();
    let n_e = problem.layout.len() - theta;
    let mut plates: Vec<Vec<Marker>> = problem
        .plates
        .iter()
        .map(|p| {
            let empty =
                Marker { inverse: Matrix3::zeros(), me: DMatrix::zeros(3, n_e), bm: Vector3::zeros(), seen: false };
            vec![empty; p.markers.len()]
        })
        .collect();
    for (terms, &i) in lin.terms.iter().zip(&lin.images) {
        let image = &problem.images[i];
        let columns = problem.layout.intrinsics(image);
        for t in &terms.markers {
            let m = &mut plates[image.plate][t.marker];
            m.seen = true;
            m.inverse += t.mm;
            m.bm += t.bm;
            scatter(&mut m.me, 0, t.intrinsics(), &columns, theta);
        }
    }
    for (k, plate) in plates.iter_mut().enumerate() {
        for (id, m) in plate.iter_mut().enumerate() {
            let prior = problem.plates[k].markers[id].sigma_m.max(FIXED_MARKER_SIGMA_M).powi(-2);
            let mut information = m.inverse + Matrix3::identity() * prior;
            for d in 0..3 {
                information[(d, d)] *= 1.0 + lambda;
            }
            m.bm -= state.plates[k].corrections[id] * prior;
            m.inverse = information.try_inverse().unwrap_or_else(Matrix3::zeros);
        }
    }
    plates
}

/// Normal equations in camera poses and intrinsics, markers eliminated.
struct PoseSpace {
    /// 6J x 6J, symmetric.
    pp: DMatrix<f64>,
    /// 6J x n_e.
    pe: DMatrix<f64>,
    /// n_e x n_e.
    ee: DMatrix<f64>,
    bp: DVector<f64>,
    be: DVector<f64>,
}

impl PoseSpace {
    fn new(problem: &Problem, lin: &Linearised, markers: &[Vec<Marker>]) -> Self {
        let theta = problem.layout.theta_len();
        let n_e = problem.layout.len() - theta;
        let j = lin.images.len();
        let mut space = Self {
            pp: DMatrix::zeros(6 * j, 6 * j),
            pe: DMatrix::zeros(6 * j, n_e),
            ee: DMatrix::zeros(n_e, n_e),
            bp: DVector::zeros(6 * j),
            be: DVector::zeros(n_e),
        };
        for (k, t) in lin.terms.iter().enumerate() {
            let columns = problem.layout.intrinsics(&problem.images[lin.images[k]]);
            let pe = t.pe.column_iter().map(|c| c.into_owned()).enumerate();
            scatter(&mut space.pe, 6 * k, pe, &columns, theta);
            space.bp.fixed_rows_mut::<6>(6 * k).copy_from(&t.bp);
            for (a, row) in columns.iter().enumerate().filter_map(|(a, c)| c.map(|c| (a, c - theta))) {
                space.be[row] += t.be[a];
                for (b, column) in columns.iter().enumerate().filter_map(|(b, c)| c.map(|c| (b, c - theta))) {
                    space.ee[(row, column)] += t.ee[(a, b)];
                }
            }
        }
        let seen: Vec<&Marker> = markers.iter().flatten().filter(|m| m.seen).collect();
        let (mut me, mut ve) = (DMatrix::zeros(3 * seen.len(), n_e), DMatrix::zeros(3 * seen.len(), n_e));
        for (k, m) in seen.iter().enumerate() {
            me.rows_mut(3 * k, 3).copy_from(&m.me);
            ve.rows_mut(3 * k, 3).copy_from(&(m.inverse * &m.me));
            space.be -= m.me.tr_mul(&(m.inverse * m.bm));
        }
        space.ee -= product(&me.transpose(), &ve);
        let rows: Vec<PoseRow> = (0..j).into_par_iter().map(|k| PoseRow::new(problem, lin, markers, k, n_e)).collect();
        for (k, row) in rows.iter().enumerate() {
            for (i, block) in row.blocks.iter().enumerate() {
                space.pp.fixed_view_mut::<6, 6>(6 * k, 6 * i).copy_from(block);
                space.pp.fixed_view_mut::<6, 6>(6 * i, 6 * k).copy_from(&block.transpose());
            }
            let mut pe = space.pe.fixed_rows_mut::<6>(6 * k);
            pe -= &row.pe;
            let mut bp = space.bp.fixed_rows_mut::<6>(6 * k);
            bp -= row.bp;
        }
        space
    }

    /// `x_pose = G theta + L slack`: the same equations in robot and slack.
    fn to_robot_space(&self, problem: &Problem, lin: &Linearised) -> (DMatrix<f64>, DVector<f64>, Vec<usize>) {
        let (theta, dense, j) = (problem.layout.theta_len(), problem.layout.len(), lin.images.len());
        let mut slack_start = Vec::with_capacity(j);
        let mut n = dense;
        for c in &lin.chains {
            slack_start.push(n);
            n += c.d_slack.ncols();
        }
        let mut a = DMatrix::zeros(n, n);
        let mut rhs = DVector::zeros(n);
        let mut g = DMatrix::zeros(6 * j, theta);
        for (k, c) in lin.chains.iter().enumerate() {
            g.rows_mut(6 * k, 6).copy_from(&c.d_theta);
        }
        let gt = g.transpose();
        let m = product(&self.pp, &g);
        a.view_mut((0, 0), (theta, theta)).copy_from(&product(&gt, &m));
        let e_theta = product(&gt, &self.pe);
        a.view_mut((0, theta), e_theta.shape()).copy_from(&e_theta);
        a.view_mut((theta, 0), (dense - theta, theta)).copy_from(&e_theta.transpose());
        a.view_mut((theta, theta), self.ee.shape()).copy_from(&self.ee);
        rhs.rows_mut(0, theta).copy_from(&(&gt * &self.bp));
        rhs.rows_mut(theta, dense - theta).copy_from(&self.be);
        for (k, chain) in lin.chains.iter().enumerate().filter(|(_, c)| c.d_slack.ncols() > 0) {
            let lt = chain.d_slack.transpose();
            let (start, d) = (slack_start[k], lt.nrows());
            rhs.rows_mut(start, d).copy_from(&(&lt * self.bp.rows(6 * k, 6)));
            let with_theta = &lt * m.rows(6 * k, 6);
            let with_e = &lt * self.pe.rows(6 * k, 6);
            a.view_mut((start, 0), (d, theta)).copy_from(&with_theta);
            a.view_mut((0, start), (theta, d)).copy_from(&with_theta.transpose());
            a.view_mut((start, theta), (d, dense - theta)).copy_from(&with_e);
            a.view_mut((theta, start), (dense - theta, d)).copy_from(&with_e.transpose());
            for (i, other) in lin.chains.iter().enumerate().take(k + 1) {
                let block = &lt * self.pp.view((6 * k, 6 * i), (6, 6)) * &other.d_slack;
                a.view_mut((start, slack_start[i]), block.shape()).copy_from(&block);
                a.view_mut((slack_start[i], start), (block.ncols(), d)).copy_from(&block.transpose());
            }
        }
        (a, rhs, slack_start)
    }
}

/// One block row of the pose-space equations: what the elimination of the markers takes off.
struct PoseRow {
    blocks: Vec<Matrix6<f64>>,
    pe: SMatrixRows,
    bp: nalgebra::Vector6<f64>,
}

type SMatrixRows = nalgebra::OMatrix<f64, nalgebra::U6, nalgebra::Dyn>;

impl PoseRow {
    fn new(problem: &Problem, lin: &Linearised, markers: &[Vec<Marker>], k: usize, n_e: usize) -> Self {
        let plate_of = |k: usize| problem.images[lin.images[k]].plate;
        let plate = &markers[plate_of(k)];
        let own = &lin.terms[k];
        let y: Vec<(usize, SMatrix<f64, 6, 3>)> =
            own.markers.iter().map(|t| (t.marker, t.mp.transpose() * plate[t.marker].inverse)).collect();
        let mut row =
            Self { blocks: vec![Matrix6::zeros(); k + 1], pe: SMatrixRows::zeros(n_e), bp: nalgebra::Vector6::zeros() };
        for (id, y) in &y {
            row.pe += y * &plate[*id].me;
            row.bp += y * plate[*id].bm;
        }
        row.blocks[k] = own.pp;
        for i in (0..=k).filter(|&i| plate_of(i) == plate_of(k)) {
            let other = &lin.terms[i].markers;
            let mut at = 0;
            for (id, y) in &y {
                while at < other.len() && other[at].marker < *id {
                    at += 1;
                }
                if at < other.len() && other[at].marker == *id {
                    row.blocks[i] -= y * other[at].mp;
                }
            }
        }
        row
    }
}
