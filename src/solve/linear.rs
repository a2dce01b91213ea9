//! An adjustment linearised at its state.

use std::borrow::Cow;
use std::collections::HashSet;
use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Matrix6, SMatrix, Vector3, Vector6};
use rayon::prelude::*;

use crate::linalg::dot;
use crate::model::plate_modes::MODES;
use crate::model::robot::LinearOrigins;
use crate::problem::{
    Adjustment, BodyMeasurement, BodyTerms, Chained, Equations, Image, ImageTerms, Length, PlateDistance, Problem,
    State, Step, Stop, Tie, Weighting, equations, linearise_with_equations,
};

/// Blocks of all images, linearised at one state.
#[derive(Debug, Clone, Default)]
pub struct Linearised {
    /// Indices of the images in use, ascending.
    pub images: Vec<usize>,
    /// Stops at which something in use was measured.
    pub stops: Vec<StopParts>,
    /// Pixel blocks of each image in use.
    pub terms: Vec<Arc<ImageTerms>>,
    /// Chain of each image in use.
    pub chains: Vec<Arc<Chained>>,
    /// Measurements of bodies in use, in the order of their stops.
    pub bodies: Vec<BodyPart>,
    /// Measured distances of the plates.
    pub distances: Vec<PlateDistance>,
    /// Measured distances between places and bodies.
    pub lengths: Vec<Length>,
    /// Robust cost of the pixels plus half the squares of priors, of what is latent at stops and of measured distances.
    pub cost: f64,
    /// Equations of each image in use, which the system is built from; empty where they are too many to keep.
    pub(super) equations: Vec<Arc<Equations>>,
}

/// What was measured at one stop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StopParts {
    /// Index of the stop.
    pub stop: usize,
    /// Its images, among those in use.
    pub images: Range<usize>,
    /// Its measurements of bodies, among those in use.
    pub bodies: Range<usize>,
}

/// One measurement of a body, linearised.
#[derive(Debug, Clone)]
pub struct BodyPart {
    /// Index among all measurements of bodies.
    pub index: usize,
    /// Its blocks.
    pub terms: BodyTerms,
    /// Its chain.
    pub chain: Arc<Chained>,
}

/// One image as it is linearised, with its equations where they are kept.
type Part = ((Arc<ImageTerms>, Arc<Chained>), Option<Arc<Equations>>);

/// Observations up to which their equations are kept, which takes about 40 MB.
const MOST_KEPT: usize = 120_000;

impl Linearised {
    /// With the curvature of the robust cost of measured bodies in place of their information; `None` where both are the same.
    pub(super) fn with_robust_curvature(&self) -> Option<Self> {
        if self.bodies.iter().all(|part| part.terms.weight == 1.0) {
            return None;
        }
        let mut own = self.clone();
        own.bodies.iter_mut().for_each(|part| part.terms.pp = part.terms.robust_curvature());
        Some(own)
    }

    /// A measurement of a body by its index; `None` for one that takes no part.
    pub fn body(&self, index: usize) -> Option<&BodyPart> {
        Some(&self.bodies[self.bodies.binary_search_by_key(&index, |part| part.index).ok()?])
    }

    /// Pixel blocks and chain of an image by its index; `None` for one that takes no part.
    pub fn of(&self, image: usize) -> Option<(&ImageTerms, &Chained)> {
        let k = self.images.binary_search(&image).ok()?;
        Some((&self.terms[k], &self.chains[k]))
    }
}

fn left<T: Clone>(all: &[T], is_left: &[bool]) -> Vec<T> {
    all.iter().zip(is_left).filter(|(_, is_left)| **is_left).map(|(one, _)| one.clone()).collect()
}

/// The linear least-squares problem that stands for an adjustment near its state.
#[derive(Debug, Clone, Copy)]
pub struct LinearProblem<'a> {
    /// The adjustment where it was linearised.
    pub adjustment: &'a Adjustment,
    /// The linearisation.
    pub lin: &'a Linearised,
}

/// One image of a linear problem.
#[derive(Debug, Clone, Copy)]
pub struct LinearImage<'a> {
    problem: &'a Problem,
    state: &'a State,
    /// Its index among all images.
    pub index: usize,
    /// The image.
    pub image: &'a Image,
    /// Its tie to its stop.
    pub tie: &'a Tie,
    /// Its pixel blocks.
    pub terms: &'a ImageTerms,
    /// Its chain.
    pub chain: &'a Chained,
    /// Place of its stop among those in use.
    pub stop: usize,
    /// Number of joint errors of its stop.
    joints: usize,
    /// Place of its tie among what is latent at its stop.
    tie_start: usize,
    /// Its equations, where they are kept.
    equations: Option<&'a Equations>,
}

/// One stop of a linear problem. Latent at it are the errors of its readings, then the ties of its images.
#[derive(Debug, Clone)]
pub struct LinearStop<'a> {
    linear: LinearProblem<'a>,
    /// Its index among all stops.
    pub index: usize,
    /// The stop.
    pub stop: &'a Stop,
    /// Latent errors of its readings.
    pub joint_errors: &'a [f64],
    /// Its place among the stops in use.
    pub at: usize,
    images: Range<usize>,
    bodies: Range<usize>,
}

/// A pose of the linear problem that something shows, whatever shows it.
pub(super) struct LinearPose<'a> {
    /// Its place among all of them: images, then bodies.
    pub place: usize,
    /// Information.
    pub pp: &'a Matrix6<f64>,
    /// Right-hand side.
    pub bp: &'a Vector6<f64>,
    /// Its chain.
    pub chain: &'a Chained,
    /// Places, among what is latent at its stop, of the columns of [`Chained::d_latent`].
    pub latents: Vec<usize>,
}

/// Columns of `L` of a chain at their places among all that is latent at its stop, 6 x latent.
fn by_latents(chain: &Chained, places: impl Iterator<Item = usize>, latent: usize) -> DMatrix<f64> {
    let mut by = DMatrix::zeros(6, latent);
    places.zip(chain.d_latent.column_iter()).for_each(|(place, column)| by.column_mut(place).copy_from(&column));
    by
}

impl BodyPart {
    /// `L` by everything that is latent at its stop, 6 x latent.
    pub fn by_latents(&self, latent: usize) -> DMatrix<f64> {
        by_latents(&self.chain, 0..self.chain.d_latent.ncols(), latent)
    }
}

impl LinearPose<'_> {
    /// `L` by everything that is latent at its stop, 6 x latent.
    pub fn by_latents(&self, latent: usize) -> DMatrix<f64> {
        by_latents(self.chain, self.latents.iter().copied(), latent)
    }
}

impl Adjustment {
    /// Linearises every image in use; `None` where a marker lies behind a camera.
    pub fn linearise(&self) -> Option<Linearised> {
        self.linearise_some(usize::MAX)
    }

    /// As [`Adjustment::linearise`] with about `enough` observations of every image, evenly chosen.
    pub(super) fn linearise_some(&self, enough: usize) -> Option<Linearised> {
        let Self { problem, state } = self;
        let images: Vec<usize> = problem.used().map(|(i, _)| i).collect();
        let origins = state.robot.linear_origins();
        let observations = images.iter().map(|&i| problem.images[i].observations.len()).sum::<usize>();
        let are_kept = enough == usize::MAX && observations <= MOST_KEPT;
        let parts: Option<Vec<Part>> = images
            .par_iter()
            .map(|&i| {
                let image = &problem.images[i];
                let chain = state.chained_from(&origins, &problem.layout, image, self.taken_from(i))?;
                let weighting = Weighting::of(problem, image).thinned(image, enough);
                let (terms, equations) = linearise_with_equations(image, state, &chain.pose, &weighting)?;
                Some(((Arc::new(terms), Arc::new(chain)), are_kept.then(|| Arc::new(equations))))
            })
            .collect();
        let (parts, equations): (Vec<_>, Vec<_>) = parts?.into_iter().unzip();
        let (terms, chains) = parts.into_iter().unzip();
        let equations = equations.into_iter().flatten().collect();
        let bodies = self.linearised_bodies(&origins)?;
        let lin =
            self.with_its_priors(Linearised { images, terms, chains, equations, bodies, ..Linearised::default() });
        lin.cost.is_finite().then_some(lin)
    }

    /// A linearisation at its state with its factors on the noise of measured bodies.
    pub(super) fn with_its_body_factors(&self, mut parts: Linearised) -> Linearised {
        let Self { problem, .. } = self;
        for BodyPart { index, terms, chain } in &mut parts.bodies {
            let measured = &problem.body_measurements[*index];
            *terms = measured.linearise(&chain.pose, problem.body_factors(measured));
        }
        parts
    }

    /// A linearisation at its state with its stops, measured distances and cost, of the parts of the images and bodies in use.
    pub(super) fn with_its_priors(&self, parts: Linearised) -> Linearised {
        let Self { problem, state } = self;
        let Linearised { images, terms, bodies, .. } = &parts;
        let pixels: f64 = terms.iter().map(|t| t.cost).sum();
        let of_bodies: f64 = bodies.iter().map(|b| b.terms.cost).sum();
        let stops = self.stops_of(images, bodies);
        let distances = self.distances(images, terms);
        let lengths: Vec<Length> =
            problem.used_lengths().filter_map(|(_, l)| l.linearise(&problem.layout, state)).collect();
        let residuals = distances.iter().map(|d| d.residual).chain(lengths.iter().map(|l| l.residual));
        let measured: f64 = residuals.map(|r| 0.5 * r * r).sum();
        let cost = pixels + of_bodies + self.prior_cost(images, &stops) + measured;
        Linearised { stops, distances, lengths, cost, ..parts }
    }

    /// What is left of a linearisation at the same state that more images and measurements of bodies took part in.
    pub(super) fn left_of(&self, whole: &Linearised) -> Linearised {
        let (bodies, images): (HashSet<usize>, HashSet<usize>) =
            (self.problem.used_bodies().map(|(k, _)| k).collect(), self.problem.used().map(|(i, _)| i).collect());
        let is_left: Vec<bool> = whole.images.iter().map(|i| images.contains(i)).collect();
        self.with_its_priors(Linearised {
            images: left(&whole.images, &is_left),
            terms: left(&whole.terms, &is_left),
            chains: left(&whole.chains, &is_left),
            equations: left(&whole.equations, &is_left),
            bodies: whole.bodies.iter().filter(|b| bodies.contains(&b.index)).cloned().collect(),
            ..Linearised::default()
        })
    }

    /// Measured distances of the plates that some images show.
    fn distances(&self, images: &[usize], terms: &[Arc<ImageTerms>]) -> Vec<PlateDistance> {
        let Self { problem, state } = self;
        let of = |plate: usize| {
            let shows = |&(&i, _): &(&usize, &Arc<ImageTerms>)| problem.images[i].plate == plate;
            let own = || images.iter().zip(terms).filter(shows).flat_map(|(_, t)| &t.markers);
            own().next()?;
            PlateDistance::of(problem, plate, &state.plates[plate], |m| own().any(|seen| seen.marker == m))
        };
        (0..problem.plates.len()).filter_map(of).collect()
    }

    /// Linearises every measurement of a body in use; `None` for one off the robot.
    fn linearised_bodies(&self, origins: &LinearOrigins) -> Option<Vec<BodyPart>> {
        let Self { problem, state } = self;
        let used: Vec<(usize, &BodyMeasurement)> = problem.used_bodies().collect();
        let part = |&(index, measured): &(usize, &BodyMeasurement)| {
            let chain = state.body_chained(origins, &problem.layout, measured, self.body_taken_from(index))?;
            let terms = measured.linearise(&chain.pose, problem.body_factors(measured));
            Some(BodyPart { index, terms, chain: Arc::new(chain) })
        };
        used.par_iter().map(part).collect()
    }

    /// Stops of some images and measurements of bodies, ascending.
    fn stops_of(&self, images: &[usize], bodies: &[BodyPart]) -> Vec<StopParts> {
        let of_image = |i: &usize| self.problem.images[*i].stop;
        let of_body = |b: &BodyPart| self.problem.body_measurements[b.index].stop;
        let mut parts = Vec::new();
        let (mut image, mut body) = (0, 0);
        while image < images.len() || body < bodies.len() {
            let next = [images.get(image).map(of_image), bodies.get(body).map(of_body)];
            let Some(stop) = next.into_iter().flatten().min() else { break };
            let first = (image, body);
            image += images[image..].iter().take_while(|i| of_image(i) == stop).count();
            body += bodies[body..].iter().take_while(|b| of_body(b) == stop).count();
            parts.push(StopParts { stop, images: first.0..image, bodies: first.1..body });
        }
        parts
    }

    /// Half the squares of priors and of what is latent at some stops and their images.
    fn prior_cost(&self, images: &[usize], stops: &[StopParts]) -> f64 {
        let Self { problem, state } = self;
        let values = state.values(&problem.layout);
        let dense: f64 = (problem.layout.columns.iter().zip(values.iter()))
            .map(|(c, v)| ((v - c.prior_mean) / c.prior_sigma).powi(2))
            .sum();
        let held: f64 = problem.families.iter().map(|f| f.squares(&values)).sum();
        let restraint = problem.restraint.iter().map(|r| r.prior().squares(&values)).sum::<f64>();
        let corrections = state.plates.iter().enumerate().flat_map(|(p, shape)| {
            let of = move |(m, c): (usize, &Vector3<f64>)| c.norm_squared() * problem.marker_information(p, m);
            shape.corrections.iter().enumerate().map(of)
        });
        let markers: f64 = corrections.sum();
        let latent = |StopParts { stop, images: own, .. }: &StopParts| -> f64 {
            let ties =
                images[own.clone()].iter().flat_map(|&i| problem.tie_squares(&problem.images[i], &state.ties[i]));
            problem.joint_error_squares(*stop, &state.joint_errors[*stop]).chain(ties).sum()
        };
        0.5 * (dense + held + restraint + markers + stops.iter().map(latent).sum::<f64>())
    }

    /// With its linearisation.
    pub fn linear<'a>(&'a self, lin: &'a Linearised) -> LinearProblem<'a> {
        LinearProblem { adjustment: self, lin }
    }
}

impl<'a> LinearProblem<'a> {
    /// The images in use.
    pub fn images(self) -> impl ExactSizeIterator<Item = LinearImage<'a>> + Clone {
        (0..self.lin.images.len()).map(move |k| self.image(k))
    }

    /// The stops of the images in use.
    pub fn stops(self) -> impl ExactSizeIterator<Item = LinearStop<'a>> + Clone {
        (0..self.lin.stops.len()).map(move |at| self.stop(at))
    }

    /// Stops one after the other, some of [`Linearised::stops`].
    pub(super) fn stops_of(self, parts: &[StopParts]) -> impl Iterator<Item = LinearStop<'a>> + use<'a> {
        let first = parts.first().map_or(0, |part| self.lin.stops.partition_point(|s| s.stop < part.stop));
        (first..first + parts.len()).map(move |at| self.stop(at))
    }

    /// A stop by its place among those in use.
    pub fn stop(self, at: usize) -> LinearStop<'a> {
        let Adjustment { problem, state } = self.adjustment;
        let StopParts { stop: index, images, bodies } = self.lin.stops[at].clone();
        let (stop, joint_errors) = (&problem.stops[index], state.joint_errors[index].as_slice());
        LinearStop { linear: self, index, stop, joint_errors, at, images, bodies }
    }

    /// The k-th image in use.
    pub fn image(self, k: usize) -> LinearImage<'a> {
        let Self { adjustment: Adjustment { problem, state }, lin } = self;
        let index = lin.images[k];
        let (image, tie) = (&problem.images[index], &state.ties[index]);
        let stop = lin.stops.partition_point(|stop| stop.images.end <= k);
        let joints = state.joint_errors[image.stop].len();
        let before = lin.images[lin.stops[stop].images.start..k].iter();
        let tie_start = joints + before.map(|&i| state.ties[i].len()).sum::<usize>();
        let (terms, chain) = (&lin.terms[k], &lin.chains[k]);
        let equations = lin.equations.get(k).map(Arc::as_ref);
        LinearImage { problem, state, index, image, tie, terms, chain, stop, joints, tie_start, equations }
    }

    /// Right-hand side of the dense columns from the images and some measurements of bodies, without priors.
    pub(super) fn dense_gradient(self, bodies: impl Iterator<Item = &'a BodyPart>) -> DVector<f64> {
        let layout = &self.adjustment.problem.layout;
        let mut gradient = DVector::zeros(layout.len());
        for own in self.images() {
            let LinearImage { terms, chain, .. } = own;
            gradient.rows_mut(0, layout.theta_len()).gemv_tr(1.0, &chain.d_theta, &terms.bp, 1.0);
            for (e, c) in own.columns().iter().enumerate() {
                c.iter().for_each(|&c| gradient[c] += terms.be[e]);
            }
        }
        for BodyPart { terms, chain, .. } in bodies {
            let pull = terms.bp.into();
            gradient.iter_mut().zip(chain.columns()).for_each(|(sum, by)| *sum += dot(by, &pull));
        }
        gradient
    }
}

impl<'a> LinearImage<'a> {
    /// Columns that act on it directly and not through its pose, in the order of its blocks; `None` for padding.
    pub fn columns(&self) -> Vec<Option<usize>> {
        self.problem.layout.intrinsics(self.image, &self.terms.touched)
    }

    /// The equations that its blocks are sums of.
    pub fn equations(&self) -> Option<Cow<'a, Equations>> {
        if let Some(kept) = self.equations {
            return Some(Cow::Borrowed(kept));
        }
        let own = equations(self.image, self.state, &self.chain.pose, &Weighting::of(self.problem, self.image));
        own.map(Cow::Owned)
    }

    /// Places, among what is latent at its stop, of the unknowns that move its pose, in the order of the columns of
    /// [`Chained::d_latent`]: joint errors, then its tie.
    pub fn latents(&self) -> [Range<usize>; 2] {
        let joints = if self.tie.is_free() { 0 } else { self.joints };
        [0..joints, self.tie_start..self.tie_start + self.tie.len()]
    }

    /// The part of a matrix over what is latent at its stop that belongs to the image.
    pub fn part_of(&self, of_stop: &DMatrix<f64>) -> DMatrix<f64> {
        let own: Vec<usize> = self.latents().into_iter().flatten().collect();
        of_stop.select_rows(&own).select_columns(&own)
    }

    /// `L` by everything that is latent at its stop, 6 x latent.
    pub fn by_latents(&self, latent: usize) -> DMatrix<f64> {
        by_latents(self.chain, self.latents().into_iter().flatten(), latent)
    }

    /// Dense columns that it depends on and that are free, ascending.
    pub(super) fn free_columns(&self) -> Vec<usize> {
        let layout = &self.problem.layout;
        let all = (0..layout.theta_len()).chain(self.columns().into_iter().flatten());
        let mut free: Vec<usize> = all.filter(|&c| layout.columns[c].free).collect();
        free.sort_unstable();
        free
    }
}

impl<'a> LinearStop<'a> {
    /// The problem that it is a part of.
    pub(super) fn problem(&self) -> &'a Problem {
        &self.linear.adjustment.problem
    }

    /// Its images in use.
    pub fn images(&self) -> impl Iterator<Item = LinearImage<'a>> + use<'a> {
        let linear = self.linear;
        self.images.clone().map(move |k| linear.image(k))
    }

    /// Its measurements of bodies in use.
    pub fn bodies(&self) -> &'a [BodyPart] {
        &self.linear.lin.bodies[self.bodies.clone()]
    }

    /// Blocks of its images and measurements of bodies in the pose that each shows, with its place among all of them (images first) and the
    /// places, among what is latent here, of the columns of its [`Chained::d_latent`].
    pub(super) fn poses(&self) -> impl Iterator<Item = LinearPose<'a>> {
        let images = self.places().zip(self.images()).map(|(place, own)| LinearPose {
            place,
            pp: &own.terms.pp,
            bp: &own.terms.bp,
            chain: own.chain,
            latents: own.latents().into_iter().flatten().collect(),
        });
        let before = self.linear.lin.images.len();
        let bodies = self.bodies.clone().zip(self.bodies()).map(move |(place, own)| LinearPose {
            place: before + place,
            pp: &own.terms.pp,
            bp: &own.terms.bp,
            chain: &own.chain,
            latents: (0..own.chain.d_latent.ncols()).collect(),
        });
        images.chain(bodies)
    }

    /// Of its images alone.
    pub(super) fn camera_poses(&self) -> impl Iterator<Item = LinearPose<'a>> {
        self.poses().take(self.images.len())
    }

    /// Of its measurements of bodies alone.
    pub(super) fn body_poses(&self) -> impl Iterator<Item = LinearPose<'a>> {
        self.poses().skip(self.images.len())
    }

    /// Places of its images among those in use.
    pub fn places(&self) -> Range<usize> {
        self.images.clone()
    }

    /// Number of unknowns that are latent at it.
    pub fn unknowns(&self) -> usize {
        self.joint_errors.len() + self.images().map(|image| image.tie.len()).sum::<usize>()
    }

    /// What is latent at it; zero for a free pose, of which there is nothing to deviate from.
    pub(super) fn values(&self) -> DVector<f64> {
        let ties = self.images().flat_map(|own| {
            let displaced = own.tie.displacement();
            (0..own.tie.len()).map(move |k| displaced.get(k).copied().unwrap_or_default())
        });
        DVector::from_vec(self.joint_errors.iter().copied().chain(ties).collect())
    }

    /// Information of what is latent at it, by its prior alone; zero for a free pose.
    pub fn prior(&self) -> Vec<f64> {
        let problem = &self.linear.adjustment.problem;
        let errors = (0..self.joint_errors.len()).map(|r| problem.joint_error_information(self.stop, r));
        let ties = self.images().flat_map(|own| problem.tie_information(own.image, own.tie));
        errors.chain(ties).collect()
    }

    /// Information of what is latent at it, prior included.
    pub(super) fn information(&self) -> DMatrix<f64> {
        let mut information = DMatrix::from_diagonal(&DVector::from_vec(self.prior()));
        for LinearPose { pp, chain, latents: places, .. } in self.poses() {
            let l = &chain.d_latent;
            let own = l.tr_mul(&(pp * l));
            for (b, &column) in places.iter().enumerate() {
                places.iter().enumerate().for_each(|(a, &row)| information[(row, column)] += own[(a, b)]);
            }
        }
        information
    }

    /// Right-hand side of what is latent at it, prior included.
    pub(super) fn gradient(&self) -> DVector<f64> {
        let problem = &self.linear.adjustment.problem;
        let mut gradient = DVector::zeros(self.unknowns());
        for (r, q) in self.joint_errors.iter().enumerate() {
            gradient[r] = -q * problem.joint_error_information(self.stop, r);
        }
        for LinearPose { bp, chain, latents, .. } in self.poses() {
            let own = chain.d_latent.tr_mul(bp);
            latents.into_iter().zip(own.iter()).for_each(|(row, g)| gradient[row] += g);
        }
        for image in self.images() {
            let [_, places] = image.latents();
            let pulls = image.tie.displacement().iter().zip(problem.tie_information(image.image, image.tie));
            places.zip(pulls).for_each(|(k, (value, information))| gradient[k] -= value * information);
        }
        gradient
    }

    /// Puts its part of a step where it belongs.
    pub(super) fn put(&self, own: &[f64], step: &mut Step) {
        step.joint_errors[self.index] = own[..self.joint_errors.len()].to_vec();
        for image in self.images() {
            step.ties[image.index] = own[image.tie_start..image.tie_start + image.tie.len()].to_vec();
        }
    }
}

/// What moves a marker (plate, index) with the dense columns beside its correction: first columns, 3 x modes.
pub(super) type Carried<'a> = dyn Fn(usize, usize) -> Vec<(usize, SMatrix<f64, 3, MODES>)> + Sync + 'a;
