//! Point-spread functions: a Gaussian, optionally with the one-sided tail of coma, integrated over the pixel.

use nalgebra::Vector2;

/// Cells per pixel and axis.
pub const OVERSAMPLING: usize = 4;

/// Share of the light in the tail of a comatic point-spread function.
const COMA_SHARE: f64 = 0.3;

/// A point-spread function as a sum of separable kernels on the grid of the rasteriser.
#[derive(Debug, Clone)]
pub struct Psf {
    lobes: Vec<(Vec<f32>, Vec<f32>)>,
    reach: usize,
}

/// One separable part: taps along columns and along rows, `(2 reach + 1) * OVERSAMPLING` each.
#[derive(Debug, Clone, Copy)]
pub struct Lobe<'a> {
    /// Taps along u.
    pub along_u: &'a [f32],
    /// Taps along v; carries the weight of the lobe.
    pub along_v: &'a [f32],
}

impl Psf {
    /// A Gaussian of `sigma_px` (0: the bare pixel).
    pub fn gaussian(sigma_px: f64) -> Self {
        Self::comatic(sigma_px, Vector2::zeros())
    }

    /// A Gaussian of `sigma_px` of which 30 % is shifted by `coma_px` and widened by half of that length.
    /// The whole is centred on its mean, so that coma makes edges lopsided but moves no area centroid.
    pub fn comatic(sigma_px: f64, coma_px: Vector2<f64>) -> Self {
        let length = coma_px.norm();
        let parts = if length < 1e-6 {
            vec![(1.0, sigma_px, Vector2::zeros())]
        } else {
            let widened = sigma_px.hypot(length / 2.0);
            vec![
                (1.0 - COMA_SHARE, sigma_px, coma_px * -COMA_SHARE),
                (COMA_SHARE, widened, coma_px * (1.0 - COMA_SHARE)),
            ]
        };
        let extent = parts.iter().map(|(_, s, shift)| 4.0 * s + shift.amax()).fold(0.0, f64::max);
        let reach = extent.ceil() as usize;
        let lobes = parts
            .into_iter()
            .map(|(weight, sigma, shift)| (taps(sigma, shift.x, reach, 1.0), taps(sigma, shift.y, reach, weight)))
            .collect();
        Self { lobes, reach }
    }

    /// Pixels on either side that it reaches.
    pub fn reach(&self) -> usize {
        self.reach
    }

    /// Its separable parts.
    pub fn lobes(&self) -> impl Iterator<Item = Lobe<'_>> {
        self.lobes.iter().map(|(u, v)| Lobe { along_u: u, along_v: v })
    }

    /// Blurs an image of whole pixels in place (for scenery, whose edges need no sub-pixel truth).
    pub fn blur(&self, values: &mut [f32], width: usize) {
        let source = values.to_vec();
        values.fill(0.0);
        for lobe in self.lobes() {
            let along = [lobe.along_u, lobe.along_v].map(pixel_taps);
            blur_separably(&source, values, width, &along, self.reach);
        }
    }
}

/// Taps of a Gaussian about `shift_px`, integrated over the pixel, with sum `weight`. The cell of the grid is a box of its own,
/// whose variance is taken off the Gaussian.
fn taps(sigma_px: f64, shift_px: f64, reach: usize, weight: f64) -> Vec<f32> {
    let s = OVERSAMPLING as f64;
    let sigma = (sigma_px * sigma_px - 1.0 / (12.0 * s * s)).max(0.0).sqrt();
    let count = (2 * reach + 1) * OVERSAMPLING;
    // Tap k weighs the cell that lies at `offset` from the pixel's centre.
    let value = |k: usize| {
        let offset = (k as f64 + 0.5) / s - 0.5 - reach as f64;
        // Light of a scene point lands `shift` away, so the pixel looks back by it.
        let t = offset + shift_px;
        if sigma < 1e-3 {
            f64::from(t.abs() < 0.5)
        } else {
            cumulative((t + 0.5) / sigma) - cumulative((t - 0.5) / sigma)
        }
    };
    let sum: f64 = (0..count).map(value).sum();
    (0..count).map(|k| (value(k) * weight / sum) as f32).collect()
}

/// Standard normal distribution function, to 1e-7 (Abramowitz and Stegun 7.1.26).
pub fn cumulative(x: f64) -> f64 {
    let z = x.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * z);
    let poly =
        t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    let upper = 0.5 * poly * (-z * z).exp();
    if x < 0.0 { upper } else { 1.0 - upper }
}

fn pixel_taps(fine: &[f32]) -> Vec<f32> {
    fine.chunks_exact(OVERSAMPLING).map(|c| c.iter().sum()).collect()
}

/// Adds the separable blur of `source` to `target`; beyond the border the outermost pixel goes on.
fn blur_separably(source: &[f32], target: &mut [f32], width: usize, along: &[Vec<f32>; 2], reach: usize) {
    let height = source.len() / width;
    let mut rows = vec![0.0_f32; source.len()];
    let mut padded = vec![0.0_f32; width + 2 * reach];
    for (line, out) in source.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        for (k, value) in padded.iter_mut().enumerate() {
            *value = line[k.saturating_sub(reach).min(width - 1)];
        }
        for (tap, &w) in along[0].iter().enumerate() {
            out.iter_mut().zip(&padded[tap..]).for_each(|(o, p)| *o += w * p);
        }
    }
    for (y, out) in target.chunks_exact_mut(width).enumerate() {
        for (tap, &w) in along[1].iter().enumerate() {
            let from = (y + tap).saturating_sub(reach).min(height - 1);
            out.iter_mut().zip(&rows[from * width..][..width]).for_each(|(o, p)| *o += w * p);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_have_unit_sum_zero_mean_and_the_variance_asked_for() {
        let psf = Psf::comatic(0.8, Vector2::new(1.2, -0.5));
        let (mut sum, mut mean) = (0.0, Vector2::zeros());
        let moments = |taps: &[f32]| {
            let reach = (taps.len() / OVERSAMPLING - 1) / 2;
            let at = |k: usize| (k as f64 + 0.5) / OVERSAMPLING as f64 - 0.5 - reach as f64;
            let m = |p: i32| taps.iter().enumerate().map(|(k, &w)| f64::from(w) * at(k).powi(p)).sum::<f64>();
            (m(0), m(1), m(2))
        };
        for lobe in psf.lobes() {
            let (u, v) = (moments(lobe.along_u), moments(lobe.along_v));
            sum += u.0 * v.0;
            mean -= Vector2::new(u.1 * v.0, u.0 * v.1);
        }
        // The tails end at 4 sigma.
        assert!((sum - 1.0).abs() < 1e-6 && mean.norm() < 2e-4, "{sum} {mean}");
        for lobe in Psf::gaussian(0.9).lobes() {
            let cell = 1.0 / (12.0 * (OVERSAMPLING * OVERSAMPLING) as f64);
            let variance = moments(lobe.along_u).2 + cell;
            assert!((variance - 0.9 * 0.9 - 1.0 / 12.0).abs() < 2e-3, "{variance}");
        }
    }

    #[test]
    fn distribution_function_at_known_points() {
        for (x, p) in [(0.0, 0.5), (1.0, 0.841_344_746), (-1.959_963_985, 0.025), (3.0, 0.998_650_102)] {
            assert!((cumulative(x) - p).abs() < 2e-7);
        }
    }
}
