//! What is latent and has a variance that the data decide.

use crate::problem::Adjustment;
use crate::solve::linear::LinearStop;

/// One latent: row in the covariance, standard deviation, sizes with their shares of its variance, by their places among
/// [`crate::problem::Noise::latent_sizes`].
#[derive(Debug, Clone, Copy)]
pub struct Latent {
    pub row: usize,
    pub sigma: f64,
    pub parts: [(usize, f64); 2],
}

/// What is latent at a stop and has a variance, numbered within it.
pub(super) fn stop_latents(Adjustment { problem, state }: &Adjustment, at: &LinearStop) -> Vec<Latent> {
    let LinearStop { stop, joint_errors, .. } = at;
    let n = state.robot.chain.readings.len();
    let first = problem.noise.joint.len() * n;
    let error = |row: usize| {
        let [own, local] = problem.joint_error_variance(stop, row);
        let a = stop.series * n + row;
        let b = if local > 0.0 { first + row } else { a };
        Latent { row, sigma: (own + local).sqrt(), parts: [(a, own / (own + local)), (b, local / (own + local))] }
    };
    let displacements = at.images().flat_map(|image| {
        let ([_, rows], image, count) = (image.latents(), image.image, image.tie.displacement().len());
        rows.zip(0..count).map(move |(row, k)| {
            let component = first + problem.noise.local.len() + problem.size_of_displacement(image, k);
            let sigma = problem.displacement_variance(image, k).sqrt();
            Latent { row, sigma, parts: [(component, 1.0), (component, 0.0)] }
        })
    });
    (0..joint_errors.len()).map(error).chain(displacements).collect()
}

/// Local errors that are parameters, each with its column as row; the size of the first is at `first`.
pub(super) fn local_latents(
    Adjustment { problem, state }: &Adjustment,
    touched: impl Fn(usize) -> bool,
    first: usize,
) -> Vec<Latent> {
    let terms = problem.layout.terms.start;
    let used = problem.layout.locals.clone().filter(|&c| touched(c));
    let latent = |c: usize| {
        let reading = state.robot.terms[c - terms].reading;
        Latent { row: c, sigma: problem.noise.local[reading], parts: [(first + reading, 1.0), (first + reading, 0.0)] }
    };
    used.map(latent).filter(|l| l.sigma > 0.0).collect()
}
