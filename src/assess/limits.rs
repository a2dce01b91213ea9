//! Every number that decides a verdict on data or result, with its source. `[limits]` of the `--config` file overrides them by
//! these names, and solution.json holds them as they were used.

use serde::{Deserialize, Serialize};

macro_rules! limits {
    ($($(#[$doc:meta])+ $name:ident: $kind:ty = $value:expr;)+) => {
        /// Numbers that decide verdicts.
        #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct Limits {
            $($(#[$doc])+ pub $name: $kind,)+
        }

        impl Default for Limits {
            fn default() -> Self {
                Self { $($name: $value,)+ }
            }
        }

        impl Limits {
            /// All of them by name.
            pub fn named(&self) -> Vec<(&'static str, f64)> {
                vec![$((stringify!($name), self.$name as f64),)+]
            }
        }
    };
}

limits! {
    /// RMS of the stand-alone camera poses beyond which the camera model does not explain the images, px per point. Found markers
    /// scatter by some 0.1 px; wrong lenses and plates leave several.
    free_rms_px: f64 = 1.0;
    /// Joint noise beyond which the readings do not explain the images, rad or m: robots repeat to some 0.1 mrad.
    joint_noise: f64 = 2e-3;
    /// Joint noise that no robot in order has, rad or m: two to five times what was found of real ones.
    unusual_joint_noise: f64 = 5e-4;
    /// Sigma of the flange that is no reason to distrust, mm: what nominal robots miss by.
    flange_sigma_mm: f64 = 1.0;
    /// Share of the robot's images that may be left out in a result worth having.
    share_of_images_left_out: f64 = 0.25;
    /// Share of the robot's images left out beyond which there is no result: the fit is of a minority.
    hopeless_share_of_images_left_out: f64 = 0.5;
    /// Share of single observations that may be left out: clean data lose 4e-5.
    share_of_observations_left_out: f64 = 0.05;
    /// Images of the robot below which the prior decides much of the result: a 6R arm has some 30 parameters, six rows an image.
    few_images: usize = 20;
    /// Times the median held-out error from which an image stands out.
    times_usual_error: f64 = 2.5;
    /// Times the median sigma of a marker from which an image is badly seen.
    times_usual_blur: f64 = 2.0;
    /// Prior sigmas beyond which a deviation is no longer within tolerance.
    sigmas_beyond_tolerance: f64 = 5.0;

    /// Fewest images on either side of a change of focus: a scatter needs three.
    focus_images: usize = 3;
    /// Change of focus in standard errors from which it is no chance, all divisions of a series considered.
    focus_sigmas: f64 = 8.0;
    /// Smallest relative change of the focal length that is reported: what temperature does stays below.
    focus_change: f64 = 1e-3;
    /// Information of an image on its focal length below which it does not vote: a sigma of one percent.
    focus_information: f64 = 1e4;

    /// Fewest images that tell two heaps from chance (simulated: one false alarm in a thousand).
    loose_images: usize = 12;
    /// Fewest images in the smaller heap.
    loose_images_in_heap: usize = 3;
    /// Smallest distance of the heaps that matters, rad: twice what a good robot repeats to.
    loose_turn_rad: f64 = 0.2e-3;

    /// Fewest wrongly paired images that make a new place of plate or camera credible.
    moved_images: usize = 3;
    /// Agreement of the new place over its images, as a share of the distance to the old one.
    moved_agreement: f64 = 0.2;

    /// Fewest images on either side of a displacement: six parameters need more than one image.
    displaced_images: usize = 3;
    /// Share of the squares of the joint noise that a displacement must explain: real robots err alike in postures that are alike.
    displaced_share: f64 = 0.6;
    /// Probability, over all displacements that are looked at, with which Gaussian noise may look like one.
    displaced_false_alarms: f64 = 1e-4;
    /// Displacement from which a result is not to be trusted, m: as far as a good robot repeats.
    displaced_m: f64 = 0.05e-3;
    /// The same of its angle, rad.
    displaced_rad: f64 = 0.1e-3;
    /// Most displacements in all: more are no displacements but noise.
    displacements: usize = 3;

    /// Standard deviations from which on plate and links contradict each other.
    plate_size_sigmas: f64 = 3.0;
    /// Prior sigmas of the x/y scale beyond which a plate was not made to size.
    plate_aspect_sigmas: f64 = 5.0;

    /// Fewest images of the robot in a group with a hand-eye transform and target pose of its own: two more than the closed form needs.
    hand_eye_images: usize = 5;
    /// Smallest rotation between stops about a second axis, rad, RMS: below, the closed form has no unique answer in noise.
    hand_eye_rotation_rad: f64 = 0.05;
    /// Median misfit (rad + m) of the best closed form beyond which readings and images do not belong together: nominal robots stay
    /// below a third of it.
    hand_eye_spread: f64 = 0.08;
    /// An image is set aside before the joint fit when it misses by more than this many times the median ...
    set_aside_factor: f64 = 6.0;
    /// ... and by more than this, rad + m: what a robot far from nominal may miss by.
    set_aside_floor: f64 = 0.03;

    /// Logarithm of the odds at which a smaller model takes the place of a larger one: "decisive" (H. Jeffreys, *Theory of
    /// probability*, 1961). Gears have errors and arms sag; that there is nothing of it must be plain.
    decisive_log_odds: f64 = 4.605;
    /// Ratio of the sigma of the flange by clusters of images to that by the model from which the larger one is reported.
    scatter_ratio: f64 = 1.5;
}

impl Limits {
    /// Refuses what no verdict can be made with.
    ///
    /// # Errors
    /// Names the number that is negative or not finite.
    pub fn check(&self) -> crate::error::Result<()> {
        let bad = self.named().into_iter().find(|(_, value)| !(value.is_finite() && *value >= 0.0));
        bad.map_or(Ok(()), |(name, value)| {
            let what = format!("{name} = {value}");
            Err(crate::error::Error::input("[limits]", what, "give a number that is not negative"))
        })
    }
}
