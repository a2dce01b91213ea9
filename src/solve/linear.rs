//! An adjustment linearised at its state.

use nalgebra::{DMatrix, DVector, SMatrix, Vector3};
use rayon::prelude::*;

use crate::model::plate_modes::MODES;
use crate::problem::{
    Adjustment, Chained, Equations, Image, ImageTerms, Problem, Slack, State, Weighting, equations, linearise,
};

/// Blocks of all images, linearised at one state.
#[derive(Debug, Clone)]
pub struct Linearised {
    /// Indices of the images in use, ascending.
    pub images: Vec<usize>,
    /// Pixel blocks of each image in use.
    pub terms: Vec<ImageTerms>,
    /// Chain of each image in use.
    pub chains: Vec<Chained>,
    /// Robust cost of the pixels plus half the squares of priors and slack.
    pub cost: f64,
}

impl Linearised {
    /// Pixel blocks and chain of an image by its index; `None` for one that takes no part.
    pub fn of(&self, image: usize) -> Option<(&ImageTerms, &Chained)> {
        let k = self.images.binary_search(&image).ok()?;
        Some((&self.terms[k], &self.chains[k]))
    }
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
    /// What it deviates by.
    pub slack: &'a Slack,
    /// Its pixel blocks.
    pub terms: &'a ImageTerms,
    /// Its chain.
    pub chain: &'a Chained,
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
        let origins = state.robot.moved_origins();
        let parts: Option<Vec<(ImageTerms, Chained)>> = images
            .par_iter()
            .map(|&i| {
                let image = &problem.images[i];
                let chain = state.chained_from(&origins, &problem.layout, image, &state.slack[i])?;
                let weighting = Weighting::of(problem, image).thinned(image, enough);
                let terms = linearise(image, state, &chain.pose, &weighting)?;
                Some((terms, chain))
            })
            .collect();
        let (terms, chains): (Vec<_>, Vec<_>) = parts?.into_iter().unzip();
        let pixels: f64 = terms.iter().map(|t| t.cost).sum();
        let cost = pixels + self.prior_cost(&images);
        cost.is_finite().then_some(Linearised { images, terms, chains, cost })
    }

    /// Half the squares of priors and of the slack of some images.
    fn prior_cost(&self, images: &[usize]) -> f64 {
        let Self { problem, state } = self;
        let values = state.values(&problem.layout);
        let dense: f64 = (problem.layout.columns.iter().zip(values.iter()))
            .map(|(c, v)| ((v - c.prior_mean) / c.prior_sigma).powi(2))
            .sum();
        let held: f64 = problem.families.iter().map(|f| f.squares(&values)).sum();
        let corrections = state.plates.iter().enumerate().flat_map(|(p, shape)| {
            let of = move |(m, c): (usize, &Vector3<f64>)| c.norm_squared() * problem.marker_information(p, m);
            shape.corrections.iter().enumerate().map(of)
        });
        let markers: f64 = corrections.sum();
        let slack: f64 = images.iter().map(|&i| problem.slack_squares(&problem.images[i], &state.slack[i])).sum();
        0.5 * (dense + held + markers + slack)
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

    /// The k-th image in use.
    pub fn image(self, k: usize) -> LinearImage<'a> {
        let Self { adjustment: Adjustment { problem, state }, lin } = self;
        let index = lin.images[k];
        let (image, slack) = (&problem.images[index], &state.slack[index]);
        LinearImage { problem, state, index, image, slack, terms: &lin.terms[k], chain: &lin.chains[k] }
    }

    /// Right-hand side of the dense columns, without their priors.
    pub(super) fn dense_gradient(self) -> DVector<f64> {
        let layout = &self.adjustment.problem.layout;
        let mut gradient = DVector::zeros(layout.len());
        for LinearImage { image, terms, chain, .. } in self.images() {
            gradient.rows_mut(0, layout.theta_len()).gemv_tr(1.0, &chain.d_theta, &terms.bp, 1.0);
            for (e, c) in layout.intrinsics(image).iter().enumerate() {
                c.iter().for_each(|&c| gradient[c] += terms.be[e]);
            }
        }
        gradient
    }
}

impl LinearImage<'_> {
    /// The equations that its blocks are sums of.
    pub fn equations(&self) -> Option<Equations> {
        equations(self.image, self.state, &self.chain.pose, &Weighting::of(self.problem, self.image))
    }

    /// Information of the slack, prior included.
    pub(super) fn slack_information(&self) -> DMatrix<f64> {
        let l = &self.chain.d_slack;
        let mut information = l.tr_mul(&(self.terms.pp * l));
        if let Slack::Joints(dq) = self.slack {
            (0..dq.len()).for_each(|s| information[(s, s)] += self.problem.slack_information(self.image, s));
        }
        information
    }

    /// Right-hand side of the slack, prior included.
    pub(super) fn slack_gradient(&self) -> DVector<f64> {
        let mut gradient = self.chain.d_slack.tr_mul(&self.terms.bp);
        if let Slack::Joints(dq) = self.slack {
            for (s, q) in dq.iter().enumerate() {
                gradient[s] -= q * self.problem.slack_information(self.image, s);
            }
        }
        gradient
    }

    /// Dense columns that it depends on and that are free.
    pub(super) fn free_columns(&self) -> Vec<usize> {
        let layout = &self.problem.layout;
        let intrinsics = layout.intrinsics(self.image);
        let all = (0..layout.theta_len()).chain(intrinsics.into_iter().flatten());
        all.filter(|&c| layout.columns[c].free).collect()
    }

    /// Information of the slack by its prior alone; zero for a free pose.
    pub fn prior_of_slack(&self) -> Vec<f64> {
        let known = |r: usize| match self.slack {
            Slack::Joints(_) => self.problem.slack_information(self.image, r),
            _ => 0.0,
        };
        (0..self.slack.len()).map(known).collect()
    }
}

/// What moves a marker (plate, index) with the dense columns beside its correction: first columns, 3 x modes.
pub(super) type Carried<'a> = dyn Fn(usize, usize) -> Vec<(usize, SMatrix<f64, 3, MODES>)> + Sync + 'a;
