//! What world is wanted: robot, plate, camera and their errors.

use crate::model::camera::{Camera, Lens};
use crate::model::joint_terms::{RobotModel, TermKind, TermSizes};
use crate::plan::viewpoint::ViewRange;
use crate::problem::OriginPrior;
use crate::series::{AngleUnit, CameraMount, Plate};
use crate::urdf::Chain;

/// Standard deviations of the true robot's errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotErrors {
    /// Displacement of each moving joint's origin, m per axis.
    pub translation_m: f64,
    /// Tilt of each moving joint's origin, rad per axis.
    pub rotation_rad: f64,
    /// Joint terms.
    pub terms: TermSizes,
}

impl Default for RobotErrors {
    /// Typical geometric errors: 0.3 mm, 1 mrad, offsets of 3 mrad; nothing beyond rigid geometry.
    fn default() -> Self {
        Self { translation_m: 0.3e-3, rotation_rad: 1e-3, terms: TermSizes::typical(RobotModel::Rigid) }
    }
}

impl RobotErrors {
    /// A robot that is as its description says.
    pub const NONE: Self = Self { translation_m: 0.0, rotation_rad: 0.0, terms: TermSizes::NONE };

    /// Typical errors, beyond rigid geometry, too.
    pub fn full() -> Self {
        Self { terms: TermSizes::typical(RobotModel::Full), ..Self::default() }
    }

    /// Errors that the priors of the fit describe.
    pub fn of_priors() -> Self {
        let OriginPrior { translation_m, rotation_rad } = OriginPrior::default();
        Self { translation_m, rotation_rad, terms: TermSizes::of_priors(RobotModel::Full) }
    }

    /// With another size of one kind of joint term, in the unit of its parameter.
    #[must_use]
    pub fn with(self, kind: TermKind, size: f64) -> Self {
        Self { terms: self.terms.with(kind, size), ..self }
    }
}

/// What world is wanted.
#[derive(Debug, Clone, PartialEq)]
pub struct WorldRequest {
    /// The nominal robot.
    pub chain: Chain,
    /// The nominal plate.
    pub plate: Plate,
    /// The true camera.
    pub camera: Camera,
    /// Where the camera is.
    pub mount: CameraMount,
    /// Number of stops.
    pub images: usize,
    /// Number of places where the plate stands.
    pub placements: usize,
    /// Errors of the robot.
    pub errors: RobotErrors,
    /// Standard deviation of the joint noise, rad (a tenth of it in m for a prismatic joint).
    pub joint_noise_rad: f64,
    /// Standard deviation of observations, px per axis.
    pub pixel_sigma_px: f64,
    /// Standard deviation of the markers' positions, m per axis.
    pub marker_sigma_m: f64,
    /// Whether the plate also deviates by the modes of [`crate::model::plate_modes`], with their prior sizes.
    pub plate_modes: bool,
    /// Views.
    pub views: ViewRange,
    /// Markers that every view shows at least.
    pub least_markers: usize,
    /// Readings of the stops (rad or m), where they are not to be drawn; `images` of them are visited, whatever they show.
    pub postures: Option<Vec<Vec<f64>>>,
    /// Number of joint vectors kept aside.
    pub held_out: usize,
    /// Unit of the readings in joints.csv.
    pub joint_unit: AngleUnit,
    /// Seed of everything.
    pub seed: u64,
}

impl WorldRequest {
    /// A robot and a plate with everything else typical: 50 stops of a camera in the hand, 0.02 mrad of joint noise.
    pub fn typical(chain: Chain, plate: Plate) -> Self {
        Self {
            chain,
            plate,
            camera: typical_camera(1280, 1024, 60_f64.to_radians()),
            mount: CameraMount::Hand,
            images: 50,
            placements: 1,
            errors: RobotErrors::default(),
            joint_noise_rad: 0.02e-3,
            pixel_sigma_px: 0.02,
            marker_sigma_m: 0.03e-3,
            plate_modes: false,
            views: ViewRange::default(),
            least_markers: 20,
            postures: None,
            held_out: 100,
            joint_unit: AngleUnit::Deg,
            seed: 1,
        }
    }
}

/// An industrial camera with the distortion of a common lens; `field_rad` is the horizontal field of view.
pub fn typical_camera(width_px: u32, height_px: u32, field_rad: f64) -> Camera {
    let focal_px = f64::from(width_px) / 2.0 / (field_rad / 2.0).tan();
    let mut camera = Camera::pinhole(Lens::Brown, width_px, height_px, focal_px);
    camera.parameters[1] *= 1.0004;
    camera.parameters[2] += 0.006 * f64::from(width_px);
    camera.parameters[3] -= 0.004 * f64::from(height_px);
    camera.parameters[4..].copy_from_slice(Lens::Brown.common_coefficients());
    camera
}

/// A camera with a typical lens of the given kind; `field_rad` is the horizontal field of view (but for its distortion).
pub fn lens_camera(lens: Lens, width_px: u32, height_px: u32, field_rad: f64) -> Camera {
    let brown = typical_camera(width_px, height_px, field_rad);
    let mut camera = Camera::pinhole(lens, width_px, height_px, brown.parameters[0]);
    camera.parameters[..4].copy_from_slice(&brown.parameters[..4]);
    // An equidistant lens takes a shorter image of the same field.
    let half = field_rad / 2.0;
    let shorter = half.tan() / lens.ideal_radius(half);
    camera.parameters[..2].iter_mut().for_each(|f| *f *= shorter);
    let coefficients = lens.common_coefficients();
    camera.parameters[4..4 + coefficients.len()].copy_from_slice(coefficients);
    let field = camera.parametric()..camera.parameters.len();
    let across = camera.lattice().map_or(1, |l| l.size()[0]);
    for (k, c) in camera.parameters[field].iter_mut().enumerate() {
        // Waves of half a pixel, some three over the image.
        let (i, j) = ((k / 2 % across) as f64, (k / 2 / across) as f64);
        *c = if k % 2 == 0 { 0.5 * (1.3 * i).sin() * (0.9 * j).cos() } else { 0.5 * (1.1 * j + 0.5 * i).sin() };
    }
    camera
}
