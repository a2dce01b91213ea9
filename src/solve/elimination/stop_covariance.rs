//! Covariance of what a fit says at one stop.

use nalgebra::DMatrix;

/// Covariance of what a fit says at one stop.
#[derive(Debug, Clone)]
pub struct StopCovariance {
    /// Of what is latent: errors of its readings, then the ties of its images.
    pub latents: DMatrix<f64>,
    /// Of where each measured body is, as body twists of the pose, m and rad.
    pub bodies: Vec<DMatrix<f64>>,
}
