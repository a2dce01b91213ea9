//! Every number that decides a verdict on data or result, with its source. `[limits]` of the `--config` file overrides them by
//! these names, and solution.json holds them as they were used.

use serde::Serialize;

use crate::problem::Bounds;
use crate::solve::FEWEST_MARKER_COORDINATES;

/// A limit, to be set.
pub(super) enum LimitMut<'a> {
    Number(&'a mut f64),
    Count(&'a mut usize),
}

impl<'a> From<&'a mut f64> for LimitMut<'a> {
    fn from(number: &'a mut f64) -> Self {
        Self::Number(number)
    }
}

impl<'a> From<&'a mut usize> for LimitMut<'a> {
    fn from(count: &'a mut usize) -> Self {
        Self::Count(count)
    }
}

macro_rules! limits {
    ($($(#[$doc:meta])+ $name:ident: $kind:ty = $value:expr;)+) => {
        /// Numbers that decide verdicts.
        #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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

            /// All names.
            pub(super) const NAMES: &[&str] = &[$(stringify!($name),)+];

            /// The one of this name.
            pub(super) fn of_name(&mut self, name: &str) -> Option<LimitMut<'_>> {
                match name {
                    $(stringify!($name) => Some((&mut self.$name).into()),)+
                    _ => None,
                }
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
    /// Times the joint noise of the quietest other series of the robot from which one is noisier: series of one robot in order are alike to a factor
    /// of two.
    times_quieter_noise: f64 = 4.0;
    /// Joint noise from which that is said, rad or m: robots repeat to some 0.1 mrad.
    noisier_from: f64 = 1e-4;
    /// Apparent shift of a plate across the optical axis, m, from which cameras at the same stops contradict each other: lens, light and focus make
    /// hundredths of a millimetre, compressed pictures of webcams a tenth.
    cameras_apart_across_m: f64 = 2e-4;
    /// The same along the axis, where a plate is seen the less well.
    cameras_apart_along_m: f64 = 5e-4;
    /// Times these from which the cameras are not to be trusted.
    times_cameras_apart: f64 = 2.5;
    /// Held-out error over what the joint noise does to the flange, below which the hold-out contradicts it: of fifteen stops, either is known to a
    /// fifth.
    held_out_of_noise: f64 = 0.5;
    /// Share of the stops, whose poses were read, in other postures from which a choice as good leaves open which robot is the right one.
    open_postures: f64 = 0.25;
    /// Gain of the log likelihood by a tool on the flange from which the poses of a controller are taken for those of that tool.
    tool_log_odds: f64 = 20.0;
    /// Its distance from the flange in sigmas from which that is told.
    tool_sigmas: f64 = 4.0;
    /// Sigma of the flange that is no reason to distrust, mm: what nominal robots miss by.
    flange_sigma_mm: f64 = 1.0;
    /// Share of the robot's images that may be left out in a result worth having.
    share_of_images_left_out: f64 = 0.25;
    /// Share of the robot's images left out beyond which there is no result: the fit is of a minority.
    hopeless_share_of_images_left_out: f64 = 0.5;
    /// Share of single observations that may be left out: clean data lose 4e-5.
    share_of_observations_left_out: f64 = 0.05;
    /// Normalised length of the residual beyond which a single observation is left out: a clean one is so with a probability of 4e-5.
    observation_sigmas: f64 = 4.5;
    /// Length below which it comes back: one that stands at the bound does not change sides with every round.
    observation_back_sigmas: f64 = 4.0;
    /// Joint error of an image or measurement, in robust sigmas per joint, beyond which it does not belong to its readings.
    joint_error_sigmas: f64 = 8.0;
    /// Smallest robust sigma of a joint that is believed there, rad or m: robots repeat to some 0.1 mrad.
    joint_error_sigma: f64 = 1e-4;
    /// Length of the residual of a measured point, in sigmas, beyond which it is left out: noise is so with a probability of 4e-5.
    point_sigmas: f64 = 4.79;
    /// The same of a measured pose.
    pose_sigmas: f64 = 5.52;
    /// Images of the robot, and different readings, below which the prior decides much of the result: a 6R arm has some 30 parameters, six rows an
    /// image.
    few_images: usize = 20;
    /// Share of the robot's images left out from which a result asks for a look.
    doubtful_share_left_out: f64 = 0.1;
    /// Gain on held-out images, nominal over calibrated, below which a new model is hardly worth installing.
    doubtful_gain: f64 = 1.3;
    /// Times the RMS held-out error, and times what is expected of the image itself, from which a single image asks for a look.
    doubtful_odd_image: f64 = 3.0;
    /// Times the median held-out error from which an image stands out.
    times_usual_error: f64 = 2.5;
    /// Times the median sigma of a marker from which an image is badly seen.
    times_usual_blur: f64 = 2.0;
    /// Prior sigmas beyond which a deviation is no longer within tolerance.
    sigmas_beyond_tolerance: f64 = 5.0;
    /// Share of the markers of a plate that may lie beyond it without the plate itself being another.
    share_of_markers_moved: f64 = 0.1;
    /// Prior sigmas beyond which the URDF is of another robot or its zeros are elsewhere: offsets of 2 degrees, origins 15 mm off.
    far_beyond_tolerance: f64 = 15.0;

    /// Change of dark images over full scale, in common or from place to place, that is said: a fifth of a percent tilts edges of 100 counts
    /// by half a percent of their contrast.
    dark_drift: f64 = 2e-3;
    /// Relative change of the light from the first white images to the last that is said.
    light_drift: f64 = 0.05;
    /// The same from place to place in the image: the gradients that bias a marker by a hundredth of a pixel change by more over its size.
    white_drift: f64 = 0.01;
    /// What the scatter of single frames leaves of a change from place to place, times which it is no chance.
    drift_sigmas: f64 = 3.0;

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
    /// Distance of two heaps in units of their own spread from which they are no chance, of many images: normal samples of 16 to 72
    /// values reach less than this and the next together with a probability of 0.999 (best of all splits, simulated).
    loose_spreads: f64 = 4.5;
    /// What few images add to it, over their number.
    loose_spreads_of_few: f64 = 30.0;

    /// Fewest wrongly paired images that make a new place of plate or camera credible.
    moved_images: usize = 3;
    /// Agreement of the new place over its images, as a share of the distance to the old one.
    moved_agreement: f64 = 0.2;

    /// Tilt beside a quarter or half turn about the optical axis, rad, up to which the picture is turned and not the camera: the axis does not
    /// meet the middle of the picture, by some 50 px of a focal length of 1000 to either side.
    turned_image_rad: f64 = 0.1;
    /// Distance beside it, m: what a robot far from nominal may miss by; most cameras that are mounted anew the other way round sit farther off.
    turned_image_m: f64 = 0.02;

    /// Fewest images on either side of a displacement: six parameters need more than one image.
    displaced_images: usize = 3;
    /// Changes between two places from which they are taken by turns: more than of a move, or of one to and fro with a wrong image or two in between.
    place_changes: usize = 6;
    /// Share of the squares of the joint noise that a displacement must explain: real robots err alike in postures that are alike.
    displaced_share: f64 = 0.6;
    /// Share from which it is named as a doubt: image noise has its part of the squares, too.
    displaced_doubt: f64 = 0.4;
    /// Probability, over all displacements that are looked at, with which Gaussian noise may look like one.
    displaced_false_alarms: f64 = 1e-4;
    /// The same where each stop has one error that follows its posture: so likely, what seems to follow the tilt is a doubt.
    displaced_by_posture: f64 = 0.05;
    /// Sigmas per axis that its shift or its turn must be beyond: noise alone reaches them along three axes in 5 %.
    displaced_sigmas: f64 = 2.8;
    /// Displacement from which a result is not to be trusted, m: as far as a good robot repeats.
    displaced_m: f64 = 0.05e-3;
    /// The same of its angle, rad.
    displaced_rad: f64 = 0.1e-3;
    /// Most displacements in all: more are no displacements but noise.
    displacements: usize = 3;

    /// Normal deviate from which a pattern in the residuals is no chance: one in thirty thousand for each that is looked for.
    pattern_sigmas: f64 = 4.0;
    /// Stated sigmas by which a pattern must move flange or poses for the gate to fail.
    pattern_moves: f64 = 1.0;
    /// Share of what the best pattern removes from which a simpler one names the cause: the rest is of second order.
    pattern_share: f64 = 0.8;
    /// Fewest coordinates of markers that the data must tell before they are compared with their tolerance: its size is then known to a tenth.
    tolerance_coordinates: f64 = FEWEST_MARKER_COORDINATES;

    /// Factor on the stated sigma of a tracker or of contacts from which it is said: sigmas are believed to a factor of two.
    doubtful_measurement_factor: f64 = 3.0;
    /// The same from which the measurements do not belong together: real trackers and sockets stay below 1.2.
    measurement_factor: f64 = 10.0;

    /// Standard deviations between a measured distance and all else beyond which it takes no part, of a single one: sigmas are believed to a
    /// factor of two, and robots err alike where the places are neighbours (sockets of a real Panda, 50 mm apart with a sigma of 0.1 mm: 0.7 mm).
    distance_sigmas: f64 = 8.0;
    /// The same of one that takes part, from which it is said.
    distance_doubtful: f64 = 4.0;

    /// Standard deviations from which on plate and links contradict each other.
    plate_size_sigmas: f64 = 3.0;
    /// The same from which on it is said of a plate that nobody measured: by chance one in eighty.
    plate_size_doubtful: f64 = 2.5;
    /// The same, of a first look from the fit with the stated size, from which a fit with a free size decides.
    plate_size_suspected: f64 = 1.5;
    /// Standard deviation of the size by the links, relative to the size that they tell, from which on they say nothing of it.
    plate_size_told: f64 = 0.02;
    /// Prior sigmas of the x/y scale beyond which a plate was not made to size.
    plate_aspect_sigmas: f64 = 5.0;

    /// Fewest images of the robot in a group with a hand-eye transform and target pose of its own: two more than the closed form needs. So many
    /// of their stops must be different ones; by fewer a tracker names no mistake, either.
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
    /// Sigma of the flange outside the region of the stops over the error of the nominal robot, beyond which it is said: twice, so that a
    /// series that covers most of what matters is not doubted for the corners that it does not.
    extrapolation_ratio: f64 = 2.0;
    /// Ratio of the sigma of the flange by clusters of images to that by the model from which the larger one is reported.
    scatter_ratio: f64 = 1.5;
    /// Fewest images whose scatter says anything: of ten, the standard deviation is known to a quarter.
    scatter_images: usize = 10;
    /// Largest part of the scatter of one image that counts as taken by the fit: beyond it, dividing by the rest makes a single
    /// image decide.
    scatter_taken: f64 = 0.8;

    /// Fewest touches that give a tool: three leave nothing to judge them by.
    fewest_touches: usize = 4;
    /// Fewest places, apart from each other, that give a work object: its six unknowns.
    fewest_places: usize = 3;
    /// Touches for each one that may be left out: of fewer nobody can say which one is wrong.
    touches_for_one_left_out: usize = 5;
    /// Extent of touched places, m RMS about their middle, beyond which they are not in metres.
    touches_apart_m: f64 = 20.0;
    /// Sigma of a touch, m, from which it is not in metres. Files of a series are read below 0.01 m alone, whatever is given here.
    touch_sigma_m: f64 = 0.01;
    /// Extent of places across their line over that along it, below which they lie on a line: with touches of 0.1 mm the angle about it
    /// is worse than that of any gauge.
    touches_on_a_line: f64 = 0.01;
    /// RMS turn of the tip about the axis that it was turned least about, rad, below which touches do not tell the tool: a sigma of
    /// fifty touches' sigmas.
    touches_turned_rad: f64 = 0.02;
    /// Sigma of a direction of tool or work object, mm, from which it counts as not told.
    frame_sigma_mm: f64 = 1.0;
    /// Factor on the stated sigma of touches from which they contradict it.
    touch_factor: f64 = 3.0;
    /// Distance (m) and angle (rad) between the work object of a program and the measured one beyond which they are not the same.
    same_work_m: f64 = 0.1;
    /// The angle.
    same_work_rad: f64 = 0.1;
    /// Distance from the base of the robot beyond which a frame that is said to be it, of places or of a program, is another, m.
    same_base_m: f64 = 0.05;
    /// Distance between the tool of a program and the measured one beyond which they are not the same, m.
    same_tool_m: f64 = 0.05;
    /// Angle between them, where the measured one has an orientation.
    same_tool_rad: f64 = 0.1;
    /// Differences of height within which touched places count as one plane, m.
    flat_places_m: f64 = 1e-3;
    /// How many times nearer to a measured frame than the next one a frame of a program must be to count as that one: a cell is off by
    /// less than a third of what lies between two of its frames, or nothing tells them apart.
    frame_clearly_nearer: f64 = 3.0;

    /// Fewest observations of an image that takes part: four give its pose, two more a margin.
    image_observations: usize = 6;
    /// Largest angle between two views of a camera below which all its images are alike, rad (5 degrees).
    alike_views_rad: f64 = 0.09;
    /// Largest tilt of the plate below which all images of a camera face it, rad (8 degrees): the cosine that tells focal length
    /// from distance differs from 1 by less than a hundredth.
    facing_tilt_rad: f64 = 0.14;
    /// Relative sigma of the focal length beyond which the images do not determine it: data sheets of lenses know it as well.
    focal_sigma: f64 = 0.02;
    /// Tangent of the angle off the axis at the corner of the image from which on a fisheye is tried: nearer to the axis the series
    /// of its formula and of the radial ones converge to the same functions, and it only lacks decentring, which real lenses have.
    fisheye_tangent: f64 = 1.0;
    /// Relative difference of held-out errors within which the simpler lens is taken: the lenses of `tests/model/lenses.rs` that are
    /// needed gain more.
    lens_as_good: f64 = 0.01;

    /// Images that must show the plate before zeros of the joints are looked for elsewhere than in the URDF.
    zeros_images: usize = 15;
    /// Offset of a zero, rad (m), from which on it is no matter of the fit: 3 degrees.
    zeros_off_rad: f64 = 0.05;
    /// Offset of a zero, rad (m), beyond which it is none: 40 degrees.
    zeros_most_rad: f64 = 0.7;
    /// Median misfit, rad + m, that other zeros leave at most where they are the cause.
    zeros_explain: f64 = 0.05;
    /// They are the cause where they leave less than this share of the misfit that is there without them, or with another axis reversed.
    zeros_explain_share: f64 = 0.5;

    /// Misfit of readings and images, rad + m, below which no mistake is looked for: nominal robots miss by as much.
    suspicious_misfit: f64 = 0.025;
    /// Median misfit of distances, less what that of the directions displaces, from which the links are those of another robot, m.
    other_lengths_m: f64 = 0.025;
    /// Fewest stops at all of which a joint reads the same before that is named as the likely cause: of few stops some leave a joint alone.
    constant_stops: usize = 8;
    /// A mistake explains the misfit where undoing it leaves less than this share of it.
    mistake_explains: f64 = 0.25;
    /// Relative error of the scale of the plate that is told from errors of the robot: nominal links are right to a percent.
    scale_error: f64 = 0.015;
    /// Factor beyond which a plate is not mistaken for another: boards that are on sale differ by less, but for units.
    scale_most: f64 = 3.0;
    /// Relative distance of a scale from that of two units of length, within which it is theirs: errors of the scale by robots far from nominal.
    scale_of_unit: f64 = 0.05;
    /// Correcting the scale must leave less than this share of the misfit.
    scale_explains: f64 = 0.6;
    /// The readings of another row are named for an image where they leave less than this share of its misfit beyond what is usual.
    other_readings_explain: f64 = 0.1;

    /// Share of the stops that must have a reading in common with others before the local errors of that joint are told apart: a
    /// few coincidences tell too little.
    stops_in_common: f64 = 0.5;
    /// Share of the prior variance that the data must remove before they count as telling of a parameter, or of a direction.
    share_of_data: f64 = 0.1;
    /// Part of a direction outside those that no series can tell from which it counts as one of its own: more in than out.
    own_direction: f64 = 0.5;
    /// Part in a direction, beside the largest one, below which a parameter is not named with it.
    named_part: f64 = 0.1;
    /// Correlation from which two parameters are hard to tell apart: were one known, the other would be known twice as well.
    strong_correlation: f64 = 0.9;
    /// Share of the variance in question that one more stop must remove to be proposed.
    advised_gain: f64 = 0.02;
    /// Range of its readings below which a joint stands still, rad or m.
    stands_still: f64 = 0.02;
    /// Part of its covered range by which a joint may lie outside and still count as covered.
    covered_margin: f64 = 0.05;

    /// Fewest images of the robot for a comparison of estimators: some are held out, the others must still tell the robot.
    compared_images: usize = 12;
    /// Fewest postures that make up a region of the workspace: one is what a fold leaves out.
    region_postures: usize = 2;
    /// Fewest regions, and fewest postures that are held out as wholes: a fit needs two others to hold on to.
    regions: usize = 3;

    /// How far, RMS, measured points may be from where a robot puts them, m: robots miss by millimetres, other robots and readings by more.
    far_points_m: f64 = 0.05;
    /// Share of the squares of what a robot that nobody corrected misses by that points may leave open: beyond, they leave more open than they tell.
    points_leave_open: f64 = 0.5;
    /// Error of a model in another measurement over the most that its solution states (the upper end of the 95 % interval) from which it is no
    /// longer the robot: sigmas are believed to a factor of two. Between one and this it is a doubt.
    beyond_stated: f64 = 2.0;
    /// Size of the residuals of touches in their stated sigmas below which they were computed, not made: sigmas are believed to a factor of
    /// two, and this is a tenth.
    exact_touches: f64 = 0.1;
    /// Fewest degrees of freedom for that verdict: of six, noise leaves a tenth with a probability of 5e-6.
    exact_touches_freedom: usize = 6;
}

impl Limits {
    /// Those of what is left out of a fit.
    pub const fn bounds(&self) -> Bounds {
        Bounds {
            observation: self.observation_sigmas,
            observation_back: self.observation_back_sigmas,
            joint_error: self.joint_error_sigmas,
            joint_sigma: self.joint_error_sigma,
            body: [self.point_sigmas, self.pose_sigmas],
        }
    }

    /// Refuses what no verdict can be made with.
    ///
    /// # Errors
    /// Names the number that is negative or not finite.
    pub fn check(&self) -> crate::error::Result<()> {
        let bad = self.named().into_iter().find(|(_, value)| !(value.is_finite() && *value >= 0.0));
        bad.map_or(Ok(()), |(name, value)| {
            let what = format!("{name} = {value}");
            Err(crate::error::Error::new(
                crate::error::Code::SettingRange,
                "[limits]",
                what,
                "give a number that is not negative",
            ))
        })
    }
}
