//! The whole adjustment as one dense least-squares problem, from dual numbers: no elimination, no blocks.

use nalgebra::{DMatrix, DVector};
use robotcal::problem::{Problem, Slack, State};

use super::witness::{self, Seed};

/// Normal equations in the order free dense columns, slack of every image in use, three coordinates of every marker.
pub struct Dense {
    pub unknowns: Vec<Unknown>,
    pub information: DMatrix<f64>,
    pub rhs: DVector<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unknown {
    Column(usize),
    Slack(usize, usize),
    Marker(usize, usize),
}

impl Dense {
    /// One plate.
    pub fn new(problem: &Problem, state: &State) -> Self {
        let mut unknowns: Vec<Unknown> =
            (0..problem.layout.len()).filter(|&c| problem.layout.columns[c].free).map(Unknown::Column).collect();
        for (i, _) in problem.used() {
            unknowns.extend((0..state.slack[i].len()).map(|k| Unknown::Slack(i, k)));
        }
        unknowns.extend((0..problem.plates[0].markers.len()).flat_map(|m| (0..3).map(move |k| Unknown::Marker(m, k))));
        let n = unknowns.len();
        let mut dense = Self { unknowns, information: DMatrix::zeros(n, n), rhs: DVector::zeros(n) };
        dense.add_pixels(problem, state);
        dense.add_priors(problem, state);
        dense
    }

    fn add_pixels(&mut self, problem: &Problem, state: &State) {
        for (i, image) in problem.used() {
            for o in image.used() {
                let by = |seed| witness::predict(state, &problem.layout, image, &state.slack[i], o, seed);
                let uv = by(None);
                let r = o.uv - nalgebra::Vector2::new(uv[0].re, uv[1].re);
                let information = o.information / problem.noise.pixel_factor[image.camera].powi(2);
                let length = (r.transpose() * information * r)[0].sqrt();
                let w = information * (problem.huber / length).min(1.0);
                let mut touched = Vec::new();
                for (at, u) in self.unknowns.iter().enumerate() {
                    let seed = match *u {
                        Unknown::Column(c) => Seed::Column(c),
                        Unknown::Slack(image, k) if image == i => Seed::Slack(k),
                        Unknown::Marker(m, k) if m == o.marker => Seed::Marker(m, k),
                        _ => continue,
                    };
                    let d = by(Some(seed));
                    touched.push((at, nalgebra::Vector2::new(d[0].eps, d[1].eps)));
                }
                for (a, ja) in &touched {
                    self.rhs[*a] += (ja.transpose() * w * r)[0];
                    for (b, jb) in &touched {
                        self.information[(*a, *b)] += (ja.transpose() * w * jb)[0];
                    }
                }
            }
        }
    }

    fn add_priors(&mut self, problem: &Problem, state: &State) {
        let values = state.values(&problem.layout);
        for (at, u) in self.unknowns.iter().enumerate() {
            let (off, sigma) = match *u {
                Unknown::Column(c) => {
                    let column = &problem.layout.columns[c];
                    (column.prior_mean - values[c], column.prior_sigma)
                }
                Unknown::Slack(i, k) => match &state.slack[i] {
                    Slack::Joints(dq) => (-dq[k], problem.noise.joint[problem.images[i].series][k]),
                    _ => (0.0, f64::INFINITY),
                },
                Unknown::Marker(m, k) => (-state.plates[0].corrections[m][k], problem.plates[0].markers[m].sigma_m),
            };
            self.information[(at, at)] += sigma.powi(-2);
            self.rhs[at] += off * sigma.powi(-2);
        }
    }

    /// Index of an unknown.
    pub fn find(&self, u: Unknown) -> Option<usize> {
        self.unknowns.iter().position(|x| *x == u)
    }

    /// Covariance and step by an eigendecomposition of the scaled matrix, and its condition number.
    pub fn solve(&self) -> (DMatrix<f64>, DVector<f64>, f64) {
        let scale = self.information.diagonal().map(|d| 1.0 / d.sqrt());
        let s = DMatrix::from_diagonal(&scale);
        let eigen = (&s * &self.information * &s).symmetric_eigen();
        let inverse = DMatrix::from_diagonal(&eigen.eigenvalues.map(|x| 1.0 / x));
        let covariance = &s * &eigen.eigenvectors * inverse * eigen.eigenvectors.transpose() * &s;
        let step = &covariance * &self.rhs;
        (covariance, step, eigen.eigenvalues.max() / eigen.eigenvalues.min())
    }
}
