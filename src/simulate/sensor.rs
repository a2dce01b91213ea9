//! From light to counts: vignetting, shot and read noise, dark signal, gain differences, quantisation.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::conditions::ImagingConditions;
use super::raster::PixelRect;

/// Turns light (shares of full scale behind the lens) into counts in place. `rect` says which pixels of the sensor they are.
pub fn expose(light: &mut [f32], rect: &PixelRect, size: [u32; 2], conditions: &ImagingConditions, rng: &mut impl Rng) {
    let full_scale = conditions.full_scale();
    let well = conditions.full_well_e;
    let is_noisy = well.is_finite() && well > 0.0;
    let has_pattern = is_noisy && (conditions.dark_sigma_e > 0.0 || conditions.gain_sigma > 0.0);
    let read_variance = conditions.read_noise_e.powi(2);
    let (middle_u, middle_v) = ((f64::from(size[0]) - 1.0) / 2.0, (f64::from(size[1]) - 1.0) / 2.0);
    let loss = conditions.vignetting / (middle_u * middle_u + middle_v * middle_v);
    for (row, line) in light.chunks_exact_mut(rect.width).enumerate() {
        let v = i64::from(rect.y) + row as i64;
        let dv2 = (v as f64 - middle_v).powi(2);
        // One stream for each row of the sensor, so that a window shows the same pattern as the whole picture.
        let mut pattern = Pattern::new(conditions.sensor_seed, v, i64::from(rect.x), has_pattern);
        for (column, value) in line.iter_mut().enumerate() {
            let du = f64::from(rect.x) + column as f64 - middle_u;
            let mut signal = f64::from(*value) * (1.0 - loss * (du * du + dv2));
            if is_noisy {
                let [gain, dark] = pattern.next();
                signal *= 1.0 + conditions.gain_sigma * gain;
                let dark_e = (conditions.dark_e + conditions.dark_sigma_e * dark).max(0.0);
                let electrons = (signal * well).max(0.0) + dark_e;
                let sigma = (electrons + read_variance).sqrt();
                signal = (electrons + sigma * rng.sample::<f64, _>(StandardNormal)) / well;
            }
            // Truncation after adding a half rounds non-negative values.
            *value = ((signal * full_scale).clamp(0.0, full_scale) + 0.5) as u32 as f32;
        }
    }
}

/// The fixed pattern of a sensor along one row: deviations of gain and dark signal in units of their sigma.
struct Pattern {
    stream: Option<ChaCha8Rng>,
}

impl Pattern {
    fn new(seed: u64, row: i64, first_column: i64, wanted: bool) -> Self {
        let stream = wanted.then(|| {
            let mut stream = ChaCha8Rng::seed_from_u64(seed);
            stream.set_stream(row as u64);
            stream.set_word_pos(first_column.max(0) as u128);
            stream
        });
        Self { stream }
    }

    /// One word per pixel, so that a window can begin anywhere: each half is a sum of two uniform bytes, scaled to unit variance.
    fn next(&mut self) -> [f64; 2] {
        let Some(stream) = &mut self.stream else { return [0.0; 2] };
        let bytes = stream.next_u32().to_le_bytes().map(f64::from);
        // Variance of a byte: (256^2 - 1) / 12.
        let scale = (6.0_f64 / 65_535.0).sqrt();
        [(bytes[0] + bytes[1] - 255.0) * scale, (bytes[2] + bytes[3] - 255.0) * scale]
    }
}
