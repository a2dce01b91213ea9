//! The table of lenses.

use serde::{Deserialize, Serialize};

use super::brown::Brown;
use super::fisheye::Fisheye;
use super::formula::{Distorted, Formula, MAX_PARAMETERS, MOST, Points};
use super::parallax::Parallax;
use super::rational::Rational;
use super::thin_prism::ThinPrism;

/// From rows `variant = "name in files": formula, lens without field` to all that asks which lens it is.
macro_rules! lenses {
    ($($(#[$doc:meta])* $lens:ident = $name:literal: $formula:ty, $without_field:ident;)+) => {
        /// Lens distortion models.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        pub enum Lens {
            $($(#[$doc])* #[serde(rename = $name)] $lens,)+
        }

        impl Lens {
            /// All lenses, the simpler ones first.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$lens),+];

            /// Name in files.
            pub fn name(self) -> &'static str {
                match self { $(Self::$lens => $name,)+ }
            }

            /// The lens without the displacement field on top of it.
            pub fn formula(self) -> Self {
                match self { $(Self::$lens => Self::$without_field,)+ }
            }

            /// Names of the lens coefficients (dimensionless), in the order of OpenCV.
            pub fn coefficient_names(self) -> &'static [&'static str] {
                match self { $(Self::$lens => <$formula>::COEFFICIENTS,)+ }
            }

            /// Coefficients of a common lens, for simulated cameras.
            pub fn common_coefficients(self) -> &'static [f64] {
                match self { $(Self::$lens => <$formula>::COMMON,)+ }
            }

            /// Name of the formula in a ROS camera_info; `None` where ROS has no such lens.
            fn ros_formula(self) -> Option<&'static str> {
                match self { $(Self::$lens => <$formula>::ROS,)+ }
            }

            /// Prior sigma of a coefficient about zero; infinite for none.
            pub fn prior_sigma(self, coefficient: usize) -> f64 {
                match self { $(Self::$lens => <$formula>::prior_sigma(coefficient),)+ }
            }

            /// Distance from the axis, on the plane z = 1, of the image of a ray at an angle (rad) from it, where all coefficients are zero.
            pub fn ideal_radius(self, angle: f64) -> f64 {
                match self { $(Self::$lens => <$formula>::ideal_radius(angle),)+ }
            }

            /// Distorts N points; `c` are the coefficients.
            #[inline(always)]
            pub(super) fn distort<const N: usize>(self, c: &[f64], points: &Points<N>) -> Distorted<N> {
                match self { $(Self::$lens => distort::<$formula, N>(c, points),)+ }
            }

            pub(super) fn is_monotonic_to(self, c: &[f64], r2: f64, inverse_depth: f64) -> bool {
                match self { $(Self::$lens => <$formula>::is_monotonic_to(c, r2, inverse_depth),)+ }
            }
        }

        $(const _: () = assert!(
            <$formula>::COEFFICIENTS.len() + 4 <= MAX_PARAMETERS && <$formula>::COMMON.len() == <$formula>::COEFFICIENTS.len()
        );)+
    };
}

#[inline(always)]
fn distort<F: Formula, const N: usize>(c: &[f64], points: &Points<N>) -> Distorted<N> {
    let (mut own, mut into) = ([0.0; MOST], Distorted::zeros());
    own.iter_mut().zip(c).for_each(|(own, c)| *own = *c);
    for n in 0..N {
        F::distort(&own, points.ideal(n), n, &mut into);
    }
    into
}

lenses! {
    /// Brown-Conrady: k1 k2 p1 p2 k3, in the order of OpenCV and of ROS `plumb_bob`.
    Brown = "brown": Brown, Brown;
    /// Kannala-Brandt: k1 k2 k3 k4, in the order of OpenCV's fisheye and of ROS `equidistant`.
    Fisheye = "fisheye": Fisheye, Fisheye;
    /// Brown-Conrady with radial coefficients that depend on the distance: k1 k2 p1 p2 k3 k1z k2z (the last two in m).
    Parallax = "parallax": Parallax, Parallax;
    /// Rational: k1 k2 p1 p2 k3 k4 k5 k6, in the order of OpenCV and of ROS `rational_polynomial`.
    Rational = "rational": Rational, Rational;
    /// Brown-Conrady with a thin prism: k1 k2 p1 p2 k3 s1 s2 s3 s4.
    ThinPrism = "thin_prism": ThinPrism, ThinPrism;
    /// Brown-Conrady and a displacement field on top: k1 k2 p1 p2 k3, then the field.
    BrownField = "brown+field": Brown, Brown;
    /// Kannala-Brandt and a displacement field on top: k1 k2 k3 k4, then the field.
    FisheyeField = "fisheye+field": Fisheye, Fisheye;
}

impl Lens {
    /// True where camera.yaml, with the models of ROS, says all of this lens.
    pub fn is_in_ros(self) -> bool {
        self.ros_name().is_some()
    }

    /// Name of the distortion model in a ROS camera_info; `None` where ROS has none that says all of this lens.
    pub fn ros_name(self) -> Option<&'static str> {
        self.ros_formula().filter(|_| !self.has_field())
    }

    /// True with a displacement field on top of the formula.
    pub fn has_field(self) -> bool {
        self != self.formula()
    }

    /// The lens of a name in files.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|lens| lens.name() == name)
    }

    /// Names of all lenses, as in files.
    pub fn names() -> Vec<&'static str> {
        Self::ALL.iter().map(|lens| lens.name()).collect()
    }

    /// Size that a coefficient without a prior may have, for the evidence of formulas: one bends a ray at 45 degrees by as much as it is off
    /// the axis; what is tangential comes of lens elements that are off by a hundredth.
    pub fn typical(self, coefficient: usize) -> f64 {
        match self.coefficient_names().get(coefficient) {
            Some(name) if name.starts_with('p') => 0.01,
            _ => 1.0,
        }
    }
}
