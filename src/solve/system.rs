//! Normal equations with the markers eliminated, first in the space of camera poses, then in that of robot and slack.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, SMatrix, Vector3};
use rayon::prelude::*;

use crate::linalg::product;
use crate::model::camera::MAX_PARAMETERS;
use crate::problem::{Chained, E, Image, ImageTerms, Problem, Slack, State, Step, Weighting, chained, linearise};

/// Smallest prior sigma of a marker coordinate, m: below it a marker counts as fixed.
const FIXED_MARKER_SIGMA_M: f64 = 1e-9;

/// All images linearised at one state.
#[derive(Debug, Clone)]
pub struct Linearised {
    /// Indices of the images in use.
    pub images: Vec<usize>,
    /// Pixel blocks of each image in use.
    pub terms: Vec<ImageTerms>,
    /// Chain of each image in use.
    pub chains: Vec<Chained>,
    /// Robust cost of the pixels plus half the squares of priors and slack.
    pub cost: f64,
}

/// Linearises every image in use; `None` where a marker lies behind a camera.
pub fn linearise_all(problem: &Problem, state: &State) -> Option<Linearised> {
    let images: Vec<usize> = problem.used().map(|(i, _)| i).collect();
    let parts: Option<Vec<(ImageTerms, Chained)>> = images
        .par_iter()
        .map(|&i| {
            let image = &problem.images[i];
            let chain = chained(problem, state, image, &state.slack[i])?;
            let terms = linearise(image, state, &chain.pose, &Weighting::of(problem, image))?;
            Some((terms, chain))
        })
        .collect();
    let (terms, chains): (Vec<_>, Vec<_>) = parts?.into_iter().unzip();
    let pixels: f64 = terms.iter().map(|t| t.cost).sum();
    let cost = pixels + prior_cost(problem, state, &images);
    cost.is_finite().then_some(Linearised { images, terms, chains, cost })
}

fn prior_cost(problem: &Problem, state: &State, images: &[usize]) -> f64 {
    let values = state.values(&problem.layout);
    let dense: f64 = (problem.layout.columns.iter().zip(values.iter()))
        .map(|(c, v)| ((v - c.prior_mean) / c.prior_sigma).powi(2))
        .sum();
    let markers: f64 = (problem.plates.iter().zip(&state.plates))
        .flat_map(|(plate, shape)| plate.markers.iter().zip(&shape.corrections))
        .map(|(m, c)| c.norm_squared() / m.sigma_m.max(FIXED_MARKER_SIGMA_M).powi(2))
        .sum();
    let slack: f64 = images
        .iter()
        .map(|&i| match &state.slack[i] {
            Slack::Joints(dq) => {
                let sigma = &problem.noise.joint[problem.images[i].camera];
                dq.iter().zip(sigma).map(|(q, s)| (q / s).powi(2)).sum()
            }
            _ => 0.0,
        })
        .sum();
    0.5 * (dense + markers + slack)
}

/// One marker, ready to be eliminated: data of all images and its prior.
#[derive(Debug, Clone)]
struct Marker {
    inverse: Matrix3<f64>,
    /// Coupling with the dense intrinsic columns, 3 x n_e.
    me: DMatrix<f64>,
    bm: Vector3<f64>,
    seen: bool,
}

/// Reduced normal equations; unknowns in the order dense columns, then the slack of each image in use.
#[derive(Debug, Clone)]
pub struct System {
    /// Information matrix, symmetric.
    pub information: DMatrix<f64>,
    /// Right-hand side.
    pub rhs: DVector<f64>,
    /// First unknown of the slack of each image in use.
    pub slack_start: Vec<usize>,
    theta: usize,
    touched: Vec<bool>,
    markers: Vec<Vec<Marker>>,
}

/// Local intrinsic index to column of the dense part.
fn intrinsic_columns(problem: &Problem, image: &Image) -> [Option<usize>; E] {
    let layout = &problem.layout;
    let (camera, shape) = (&layout.cameras[image.camera], &layout.shapes[image.plate]);
    std::array::from_fn(|k| {
        let column = if k < MAX_PARAMETERS { camera.start + k } else { shape.start + k - MAX_PARAMETERS };
        let inside = k >= MAX_PARAMETERS || k < camera.len();
        inside.then_some(column)
    })
}

fn scatter<const R: usize>(
    into: &mut DMatrix<f64>,
    row: usize,
    block: &SMatrix<f64, R, E>,
    columns: &[Option<usize>; E],
    shift: usize,
) {
    for (k, column) in columns.iter().enumerate() {
        if let Some(c) = column {
            for r in 0..R {
                into[(row + r, c - shift)] += block[(r, k)];
            }
        }
    }
}

impl System {
    /// Builds the system at a linearisation, with Levenberg-Marquardt damping `lambda` on the scaled diagonal.
    pub fn new(problem: &Problem, state: &State, lin: &Linearised, lambda: f64) -> Self {
        let theta = problem.layout.theta_len();
        let markers = gather_markers(problem, state, lin, lambda);
        let space = PoseSpace::new(problem, lin, &markers);
        let mut system = space.to_robot_space(problem, lin);
        system.add_priors(problem, state, lin);
        for i in 0..system.rhs.len() {
            system.information[(i, i)] *= 1.0 + lambda;
        }
        system.hold_fixed(problem);
        Self { theta, markers, ..system }
    }

    fn add_priors(&mut self, problem: &Problem, state: &State, lin: &Linearised) {
        let values = state.values(&problem.layout);
        for (i, c) in problem.layout.columns.iter().enumerate() {
            let information = c.prior_sigma.powi(-2);
            if information > 0.0 {
                self.information[(i, i)] += information;
                self.rhs[i] += (c.prior_mean - values[i]) * information;
            }
        }
        for (&start, &image) in self.slack_start.iter().zip(&lin.images) {
            if let Slack::Joints(dq) = &state.slack[image] {
                let sigma = &problem.noise.joint[problem.images[image].camera];
                for (k, (q, s)) in dq.iter().zip(sigma).enumerate() {
                    self.information[(start + k, start + k)] += s.powi(-2);
                    self.rhs[start + k] -= q * s.powi(-2);
                }
            }
        }
    }

    /// Fixed columns, and columns that nothing in this series touches, get a step of zero.
    fn hold_fixed(&mut self, problem: &Problem) {
        self.touched = (0..problem.layout.len()).map(|i| self.information[(i, i)] > 0.0).collect();
        for (i, c) in problem.layout.columns.iter().enumerate() {
            if !c.free || !self.touched[i] {
                self.information.row_mut(i).fill(0.0);
                self.information.column_mut(i).fill(0.0);
                self.information[(i, i)] = 1.0;
                self.rhs[i] = 0.0;
            }
        }
    }

    /// False for a dense column that no image in use and no prior touches.
    pub fn touched(&self, column: usize) -> bool {
        self.touched[column]
    }

    /// True for a marker that some image in use shows.
    pub fn seen(&self, plate: usize, marker: usize) -> bool {
        self.markers[plate][marker].seen
    }

    /// The whole step from the solution `x` of the reduced system.
    pub fn step(&self, problem: &Problem, lin: &Linearised, x: &DVector<f64>) -> Step {
        let dense = x.rows(0, problem.layout.len()).into_owned();
        let mut slack = vec![Vec::new(); problem.images.len()];
        let de = dense.rows(self.theta, dense.len() - self.theta).into_owned();
        let mut pull: Vec<Vec<Vector3<f64>>> =
            self.markers.iter().map(|plate| plate.iter().map(|m| m.bm - &m.me * &de).collect()).collect();
        for (k, &image) in lin.images.iter().enumerate() {
            let chain = &lin.chains[k];
            let ds = x.rows(self.slack_start[k], chain.d_slack.ncols()).into_owned();
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

    /// Rows that turn a covariance of the reduced unknowns into that of one marker:
    /// `cov(m) = V + D cov(x) D'` and `cov(m, x) = -D cov(x)`, with `D = V * coupling`, 3 x unknowns.
    pub fn marker_coupling(
        &self,
        problem: &Problem,
        lin: &Linearised,
        plate: usize,
        marker: usize,
    ) -> (Matrix3<f64>, DMatrix<f64>) {
        let m = &self.markers[plate][marker];
        let mut coupling = DMatrix::zeros(3, self.rhs.len());
        coupling.view_mut((0, self.theta), (3, m.me.ncols())).copy_from(&m.me);
        for (k, _) in lin.images.iter().enumerate().filter(|(_, i)| problem.images[**i].plate == plate) {
            let terms = &lin.terms[k].markers;
            let Ok(at) = terms.binary_search_by_key(&marker, |t| t.marker) else { continue };
            let mp = DMatrix::from_column_slice(3, 6, terms[at].mp.as_slice());
            let chain = &lin.chains[k];
            let mut theta = coupling.view_mut((0, 0), (3, self.theta));
            theta += &mp * &chain.d_theta;
            coupling.view_mut((0, self.slack_start[k]), (3, chain.d_slack.ncols())).copy_from(&(&mp * &chain.d_slack));
        }
        for (i, c) in problem.layout.columns.iter().enumerate() {
            if !c.free {
                coupling.column_mut(i).fill(0.0);
            }
        }
        (m.inverse, DMatrix::from_column_slice(3, 3, m.inverse.as_slice()) * coupling)
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
        let columns = intrinsic_columns(problem, image);
        for t in &terms.markers {
            let m = &mut plates[image.plate][t.marker];
            m.seen = true;
            m.inverse += t.mm;
            m.bm += t.bm;
            scatter(&mut m.me, 0, &t.me, &columns, theta);
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
            let columns = intrinsic_columns(problem, &problem.images[lin.images[k]]);
            scatter(&mut space.pe, 6 * k, &t.pe, &columns, theta);
            space.bp.fixed_rows_mut::<6>(6 * k).copy_from(&t.bp);
            for (a, row) in columns.iter().enumerate() {
                let Some(r) = row else { continue };
                space.be[r - theta] += t.be[a];
                let line = t.ee.fixed_rows::<1>(a).into_owned();
                scatter(&mut space.ee, r - theta, &line, &columns, theta);
            }
        }
        for m in markers.iter().flatten().filter(|m| m.seen) {
            let v = &m.inverse;
            let ve = v * &m.me;
            space.ee -= m.me.transpose() * &ve;
            space.be -= ve.transpose() * m.bm;
        }
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
    fn to_robot_space(&self, problem: &Problem, lin: &Linearised) -> System {
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
        System { information: a, rhs, slack_start, theta, touched: Vec::new(), markers: Vec::new() }
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
