//! Under which conditions a picture is taken.

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

/// Everything about light, lens blur, sensor and surroundings that is not geometry of plate and camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImagingConditions {
    /// Bits per pixel: 8, 10, 12 or 16.
    pub bits: u8,
    /// Signal of a surface of reflectance 1 under full light, as a share of full scale.
    pub exposure: f64,
    /// Reflectance of the plate's ground.
    pub light_reflectance: f64,
    /// Reflectance of the markers.
    pub dark_reflectance: f64,
    /// Sigma of the point-spread function in focus, px.
    pub psf_sigma_px: f64,
    /// Length of the coma tail in the image's corner, px; grows linearly with the distance from the image's centre.
    pub coma_px: f64,
    /// Distance in focus, m; `None`: everything is in focus.
    pub focus_m: Option<f64>,
    /// Sigma of the defocus blur per difference of inverse distance, px m.
    pub defocus_px_m: f64,
    /// Loss of light in the image's corner, as a share; grows with the square of the distance from the centre.
    pub vignetting: f64,
    /// Relative change of the illumination per px along columns and rows, 1 at the image's centre.
    pub gradient_per_px: [f64; 2],
    /// A bright spot of illumination.
    pub spot: Option<Spot>,
    /// Specular reflections.
    pub glare: Vec<Glare>,
    /// Electrons at full scale (infinite: no shot noise).
    pub full_well_e: f64,
    /// Read noise, electrons; counts only with a finite full well.
    pub read_noise_e: f64,
    /// Mean dark signal, electrons.
    pub dark_e: f64,
    /// Sigma of the dark signal between pixels, electrons.
    pub dark_sigma_e: f64,
    /// Sigma of the gain between pixels, as a share.
    pub gain_sigma: f64,
    /// Which sensor: its pattern of dark signal and gain.
    pub sensor_seed: u64,
    /// Reflectance of what lies beyond the plate.
    pub table_reflectance: f64,
    /// Number of things that lie around the plate.
    pub clutter: u32,
    /// Which things they are.
    pub clutter_seed: u64,
    /// What hangs in front of the plate.
    pub occluders: Vec<Occluder>,
    /// Motion of the camera during the exposure: body twist `[rho (m), phi (rad)]`.
    pub motion: [f64; 6],
}

/// A spot of light: adds `strength * exp(-d^2 / (2 radius^2))` to the illumination.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spot {
    /// Centre, px.
    pub at_px: [f64; 2],
    /// Radius, px.
    pub radius_px: f64,
    /// Strength relative to the normal light.
    pub strength: f64,
}

/// A specular reflection: adds light whatever the reflectance; `strength` 1 is a signal of full scale in its middle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Glare {
    /// Centre, px.
    pub at_px: [f64; 2],
    /// Radius, px.
    pub radius_px: f64,
    /// Signal in the middle relative to full scale.
    pub strength: f64,
}

/// A polygon between camera and plate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Occluder {
    /// Corners in the image, px.
    pub outline_px: Vec<[f64; 2]>,
    /// Reflectance.
    pub reflectance: f64,
}

impl Default for ImagingConditions {
    /// A good industrial camera in daylight: 8 bit, contrast to noise about 100, slight vignetting and gradient.
    fn default() -> Self {
        Self {
            bits: 8,
            exposure: 0.85,
            light_reflectance: 0.85,
            dark_reflectance: 0.06,
            psf_sigma_px: 0.75,
            coma_px: 0.0,
            focus_m: None,
            defocus_px_m: 0.0,
            vignetting: 0.15,
            gradient_per_px: [1e-4, -5e-5],
            spot: None,
            glare: Vec::new(),
            full_well_e: 20_000.0,
            read_noise_e: 12.0,
            dark_e: 20.0,
            dark_sigma_e: 4.0,
            gain_sigma: 0.002,
            sensor_seed: 1,
            table_reflectance: 0.30,
            clutter: 60,
            clutter_seed: 7,
            occluders: Vec::new(),
            motion: [0.0; 6],
        }
    }
}

impl ImagingConditions {
    /// Even light, 16 bit, no noise, nothing around the plate: for what must be exact.
    pub fn ideal(psf_sigma_px: f64) -> Self {
        Self {
            bits: 16,
            psf_sigma_px,
            vignetting: 0.0,
            gradient_per_px: [0.0; 2],
            full_well_e: f64::INFINITY,
            dark_e: 0.0,
            dark_sigma_e: 0.0,
            gain_sigma: 0.0,
            table_reflectance: 0.85,
            clutter: 0,
            ..Self::default()
        }
    }

    /// The same with the full well at which the contrast between ground and marker over the noise on the ground is `ratio`,
    /// without read noise.
    pub fn with_contrast_to_noise(self, ratio: f64) -> Self {
        let light = self.exposure * self.light_reflectance;
        let contrast = self.exposure * (self.light_reflectance - self.dark_reflectance);
        // sigma = sqrt(light / full well) in shares of full scale.
        Self { full_well_e: light * (ratio / contrast).powi(2), read_noise_e: 0.0, ..self }
    }

    /// Count at which the sensor saturates.
    pub fn full_scale(&self) -> f64 {
        f64::from((1_u32 << self.bits.clamp(1, 16)) - 1)
    }

    /// Sigma of point spread and defocus at a distance along the optical axis, px.
    pub fn blur_px(&self, depth_m: f64) -> f64 {
        let defocus = self.focus_m.map_or(0.0, |f| self.defocus_px_m * (1.0 / depth_m - 1.0 / f).abs());
        self.psf_sigma_px.hypot(defocus)
    }

    /// Illumination of the scene at a pixel, 1 at the image's centre without a spot.
    pub fn illumination(&self, uv: Vector2<f64>, centre: Vector2<f64>) -> f64 {
        let d = uv - centre;
        let gradient = 1.0 + self.gradient_per_px[0] * d.x + self.gradient_per_px[1] * d.y;
        gradient.max(0.0) + self.spot.map_or(0.0, |s| s.strength * bell(uv, s.at_px, s.radius_px))
    }
}

/// `exp(-d^2 / (2 radius^2))` of the distance to `at`.
pub fn bell(uv: Vector2<f64>, at: [f64; 2], radius: f64) -> f64 {
    let d = uv - Vector2::from(at);
    (-d.norm_squared() / (2.0 * radius * radius)).exp()
}
