//! The whole adjustment as one dense least-squares problem, from dual numbers: no elimination, no blocks.

use nalgebra::{DMatrix, DVector, Vector3};
use robotcal::problem::{Adjustment, Problem, State};

use super::witness::{self, Seed};

/// Normal equations in the order free dense columns, what is latent at every stop in use, three coordinates of every marker.
pub struct Dense {
    pub unknowns: Vec<Unknown>,
    pub information: DMatrix<f64>,
    pub rhs: DVector<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unknown {
    Column(usize),
    /// Of a stop: errors of its readings, then the ties of its images in use.
    Latent(usize, usize),
    Marker(usize, usize),
}

/// Place of the tie of an image among what is latent at its stop; of an image behind all, how much is latent.
fn tie_start(problem: &Problem, state: &State, stop: usize, image: usize) -> usize {
    let before = problem.used().filter(|(i, other)| other.stop == stop && *i < image);
    state.joint_errors[stop].len() + before.map(|(i, _)| state.ties[i].len()).sum::<usize>()
}

/// What a latent is off by and its sigma, where it is an apparent displacement.
fn displacement(problem: &Problem, state: &State, stop: usize, k: usize) -> Option<(f64, f64)> {
    let own = problem.used().filter(|(_, image)| image.stop == stop);
    own.into_iter().find_map(|(i, image)| {
        let component = k.checked_sub(tie_start(problem, state, stop, i))?;
        let value = state.ties[i].displacement().get(component)?;
        Some((-value, problem.displacement_variance(image, component).sqrt()))
    })
}

impl Dense {
    /// One plate.
    pub fn new(adjustment: &Adjustment) -> Self {
        let Adjustment { problem, state } = adjustment;
        let mut unknowns: Vec<Unknown> =
            (0..problem.layout.len()).filter(|&c| problem.layout.columns[c].free).map(Unknown::Column).collect();
        let mut stops: Vec<usize> = problem.used().map(|(_, image)| image.stop).collect();
        stops.dedup();
        for stop in stops {
            let latent = tie_start(problem, state, stop, usize::MAX);
            unknowns.extend((0..latent).map(|k| Unknown::Latent(stop, k)));
        }
        unknowns.extend((0..problem.plates[0].markers.len()).flat_map(|m| (0..3).map(move |k| Unknown::Marker(m, k))));
        let n = unknowns.len();
        let mut dense = Self { unknowns, information: DMatrix::zeros(n, n), rhs: DVector::zeros(n) };
        dense.add_pixels(adjustment);
        dense.add_priors(problem, state);
        dense.add_distance(problem, state);
        dense
    }

    /// The measured distance of two markers, whether images show them or not.
    fn add_distance(&mut self, problem: &Problem, state: &State) {
        let (Some(bar), shape) = (problem.plates[0].scale, &state.plates[0]) else { return };
        let ends = [bar.from, bar.to].map(|id| problem.plates[0].index_of(id).unwrap());
        let between = shape.position(ends[0]) - shape.position(ends[1]);
        let moved = |u: &Unknown, m: usize| -> Vector3<f64> {
            let modes = problem.layout.shapes[0].clone();
            match *u {
                Unknown::Column(c) if modes.contains(&c) => shape.modes_at(m).column(c - modes.start).into_owned(),
                Unknown::Marker(own, k) if own == m => Vector3::ith(k, 1.0),
                _ => Vector3::zeros(),
            }
        };
        let by = |u: &Unknown| (moved(u, ends[0]) - moved(u, ends[1])).dot(&between.normalize()) / bar.sigma_m;
        let row = DVector::from_iterator(self.unknowns.len(), self.unknowns.iter().map(by));
        self.information += &row * row.transpose();
        self.rhs += &row * ((bar.distance_m - between.norm()) / bar.sigma_m);
    }

    fn add_pixels(&mut self, adjustment: &Adjustment) {
        let Adjustment { problem, state } = adjustment;
        for (i, image) in problem.used() {
            let from = adjustment.taken_from(i);
            let tie_start = tie_start(problem, state, image.stop, i);
            for o in image.used() {
                let by = |seed| witness::predict(state, &problem.layout, image, from, o, seed);
                let uv = by(None);
                let r = o.uv - nalgebra::Vector2::new(uv[0].re, uv[1].re);
                let information = o.information / problem.noise.pixel_factor[image.camera].powi(2);
                let length = (r.transpose() * information * r)[0].sqrt();
                let w = information * (problem.huber / length).min(1.0);
                let mut touched = Vec::new();
                for (at, u) in self.unknowns.iter().enumerate() {
                    let seed = match *u {
                        Unknown::Column(c) => Seed::Column(c),
                        Unknown::Latent(stop, k) if stop == image.stop => {
                            if k < from.joints() {
                                Seed::Latent(k)
                            } else if (tie_start..tie_start + from.tie.len()).contains(&k) {
                                Seed::Latent(from.joints() + k - tie_start)
                            } else {
                                continue;
                            }
                        }
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
                Unknown::Latent(stop, k) => match state.joint_errors[stop].get(k) {
                    Some(error) => (-error, problem.noise.joint[problem.stops[stop].series][k]),
                    None => displacement(problem, state, stop, k).unwrap_or((0.0, f64::INFINITY)),
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
