//! A displacement of centres over the picture: one part everywhere the same, one along the radius that grows to the corner.

use nalgebra::{Matrix3, Vector3};

/// Displacement over the picture that an asymmetric blur causes or shows: motion with changing speed the same
/// everywhere, coma along the radius, to third order linear in the distance from the middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// Mean (column, row), px.
    pub mean_px: [f64; 2],
    /// Its standard error per axis, px.
    pub sigma_px: [f64; 2],
    /// The part that grows with the distance from the picture's middle: along the radius in the corner, px.
    pub corner_px: f64,
    /// Its standard error, px.
    pub corner_sigma_px: f64,
}

impl Drift {
    /// Weighted least squares over (place, displacement, information per axis) in a picture of this size.
    pub(in crate::detect::circles) fn fit(
        seen: impl Iterator<Item = ([f64; 2], [f64; 2], [f64; 2])>,
        size: [usize; 2],
    ) -> Option<Self> {
        let middle = size.map(|n| (n as f64 - 1.0) / 2.0);
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (at, value, information) in seen {
            for a in 0..2 {
                let field = (at[a] - middle[a]) / middle[0].hypot(middle[1]);
                let terms = Vector3::new(f64::from(a == 0), f64::from(a == 1), field);
                normal += terms * terms.transpose() * information[a];
                right += terms * (value[a] * information[a]);
            }
        }
        let covariance = normal.try_inverse()?;
        let [u, v, corner_px] = (covariance * right).into();
        let sigma = |k: usize| covariance[(k, k)].max(0.0).sqrt();
        let sigma_px = [sigma(0), sigma(1)];
        Some(Self { mean_px: [u, v], sigma_px, corner_px, corner_sigma_px: sigma(2) })
    }

    /// A part of the mean is significant (4 sigma) and larger than `least_px`.
    pub fn mean_exceeds(&self, least_px: f64) -> bool {
        (self.mean_px.iter().zip(&self.sigma_px)).any(|(value, sigma)| value.abs() > (4.0 * sigma).max(least_px))
    }

    /// The mean or the part along the radius is significant (4 sigma) and larger than `least_px`.
    pub fn exceeds(&self, least_px: f64) -> bool {
        self.mean_exceeds(least_px) || self.corner_px.abs() > (4.0 * self.corner_sigma_px).max(least_px)
    }
}
