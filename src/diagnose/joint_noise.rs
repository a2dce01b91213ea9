//! Do the joint readings explain the images as well as those of robots usually do?

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight, some_of};
use super::stands_still::{StandsStill, stands_still};
use crate::assess::{Accuracy, Limits, NORMAL_95, scatter_m};
use crate::error::Code;
use crate::fit::Fit;
use crate::linalg::median;
use crate::model::robot::Posture;
use crate::problem::{Adjustment, MeasuredSeries, Problem};
use crate::solve::noise_information;
use crate::urdf::JointKind;

/// Most images that are named.
const MOST_IMAGES: usize = 4;

/// An image with a number.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageValue {
    /// Its name.
    pub image: String,
    /// Its value.
    pub value: f64,
}

/// The joint noise of a series is larger than robots in order have, or far larger than that of another series of the robot.
#[derive(Debug, Clone, PartialEq)]
pub struct JointNoiseLarge {
    /// Series.
    pub series: String,
    /// Joint with the largest noise, a milliradian beside a millimetre: robots and rails repeat to a tenth of either.
    pub joint: String,
    /// How it moves.
    pub kind: JointKind,
    /// Its noise, rad or m.
    pub sigma: f64,
    /// Images that the others predict far worse than usual, mm.
    pub worst_predicted: Vec<ImageValue>,
    /// Images whose markers are known far less well than usual, sigma in px: blurred, badly lit, far away.
    pub badly_seen: Vec<ImageValue>,
    /// Stops at which that joint reads the same.
    pub stands_still: Option<StandsStill>,
    /// The quietest of the other series of the robot and its noise of that joint, rad or m, where this one is far noisier.
    pub quieter: Option<(String, f64)>,
    /// All series with this noise: cameras at the same stops have one.
    pub of_same_stops: Vec<String>,
    /// Whether images tell of it; else trackers and contacts do.
    pub by_images: bool,
    /// Whether the readings were computed from poses of a controller.
    pub readings_are_computed: bool,
    /// Whether the readings are poses as a controller gives them, with no robot between: their errors are those of its own robot model.
    pub readings_are_poses: bool,
    /// Gate or note.
    pub weight: Weight,
}

pub(super) fn check(fit: &Fit, accuracy: &Accuracy, setting: &CheckContext) -> Vec<JointNoiseLarge> {
    let limits = setting.limits;
    let noise_found = setting.with_noise_found(fit);
    let of_series = |(k, of): (usize, &MeasuredSeries)| {
        let (reading, joint, sigma) = noisiest_joint(noise_found, k)?;
        let readings_are_poses = fit.state.robot.chain.pose_coordinates().is_some();
        let quieter = quieter_series(noise_found, setting, (k, reading)).filter(|_| !readings_are_poses);
        let kind = fit.state.robot.chain.reading_kinds[reading];
        let readings_are_computed = of.readings_are_computed();
        let told = || is_told(noise_found, (k, reading), accuracy, limits);
        let weight = weight(sigma, (readings_are_computed, quieter.is_some()), told, limits)?;
        let problem = &fit.problem;
        let errors = |i: usize| accuracy.per_image_mm[i].map(|[_, calibrated]| calibrated);
        let sigma_px = |i: usize| {
            let sigmas: Vec<f64> = problem.images[i].used().map(|o| o.information.determinant().powf(-0.25)).collect();
            median(&sigmas)
        };
        Some(JointNoiseLarge {
            series: of.name.clone(),
            joint: joint.to_owned(),
            kind,
            sigma,
            worst_predicted: standing_out(problem, k, errors, limits.times_usual_error),
            badly_seen: standing_out(problem, k, sigma_px, limits.times_usual_blur),
            stands_still: stands_still(of, reading, limits.moved_images),
            quieter,
            of_same_stops: of_same_noise(noise_found, setting, k),
            by_images: problem.used_on_robot().any(|i| problem.images[i].series == k),
            readings_are_computed,
            readings_are_poses,
            weight,
        })
    };
    setting.series.iter().enumerate().filter(|(k, _)| says_noise_first(fit, *k)).filter_map(of_series).collect()
}

/// How much a joint noise weighs; `None` where it is usual, or not told.
fn weight(
    sigma: f64,
    (is_of_computed, is_quieter_elsewhere): (bool, bool),
    told: impl Fn() -> bool,
    limits: &Limits,
) -> Option<Weight> {
    let is_unusual = sigma >= limits.unusual_joint_noise;
    // Computed readings with that much are not those that the robot had.
    if sigma > limits.joint_noise || is_unusual && is_of_computed {
        return Some(Weight::Gate);
    }
    ((is_unusual || is_quieter_elsewhere) && told()).then_some(Weight::Note)
}

/// The other series of the robot with the least noise of a reading, where this one is far noisier.
fn quieter_series(fit: &Fit, setting: &CheckContext, (series, reading): (usize, usize)) -> Option<(String, f64)> {
    let limits = setting.limits;
    let sigma = |series: usize| fit.problem.joint_sigma(fit.problem.noise_of(series))[reading];
    let is_other = |other: &usize| fit.problem.noise_of(*other) != fit.problem.noise_of(series);
    let quietest = (0..setting.series.len()).filter(is_other).min_by(|a, b| sigma(*a).total_cmp(&sigma(*b)))?;
    let (own, quiet) = (sigma(series), sigma(quietest));
    let is_noisier = own >= limits.noisier_from && own > limits.times_quieter_noise * quiet;
    is_noisier.then(|| (setting.series[quietest].name.clone(), quiet))
}

/// Series with the same joint noise: those of the same stops.
pub(super) fn of_same_noise(fit: &Fit, setting: &CheckContext, series: usize) -> Vec<String> {
    let is_same = |(k, _): &(usize, &MeasuredSeries)| fit.problem.noise_of(*k) == fit.problem.noise_of(series);
    setting.series.iter().enumerate().filter(is_same).map(|(_, of)| of.name.clone()).collect()
}

/// False where bodies alone tell of the noise and leave open whether there is any of this joint, as where several joints explain the same errors, or where
/// what was held out is missed by far less than the noise of all joints moves the flange.
fn is_told(fit: &Fit, (series, reading): (usize, usize), accuracy: &Accuracy, limits: &Limits) -> bool {
    let Adjustment { problem, state } = &fit.adjustment;
    if problem.used_on_robot().next().is_some() {
        return true;
    }
    let noise = problem.noise_of(series);
    let told = noise_information(fit);
    let may_be_none =
        told.is_some_and(|told| told.joint_noise(&problem.noise, &[noise], &[reading], NORMAL_95).1[0] == 0.0);
    let own = problem.used_stops().into_iter().map(|s| &problem.stops[s]).filter(|stop| stop.series == noise);
    let postures: Vec<Posture> = own.filter_map(|stop| stop.posture.clone()).collect();
    let scatter_m = scatter_m(&state.robot, &problem.joint_sigma(noise), &postures);
    !may_be_none && 1e-3 * accuracy.calibrated.rms_mm >= limits.held_out_of_noise * scatter_m
}

/// Cameras at the same stops have one noise: it is said once, of the first.
pub(super) fn says_noise_first(fit: &Fit, series: usize) -> bool {
    (0..series).all(|before| fit.problem.noise_of(before) != fit.problem.noise_of(series))
}

/// The reading with the largest joint noise in a series: its index, its name, and the size of the noise, rad or m.
pub(super) fn noisiest_joint(fit: &Fit, series: usize) -> Option<(usize, &str, f64)> {
    let sigmas = fit.problem.joint_sigma(fit.problem.noise_of(series)).into_iter();
    let named = fit.state.robot.chain.readings.iter().map(String::as_str).zip(sigmas);
    named.enumerate().map(|(k, (name, sigma))| (k, name, sigma)).max_by(|a, b| a.2.total_cmp(&b.2))
}

/// Images of a series of which something is more than so many times its median, the largest first.
fn standing_out(problem: &Problem, series: usize, of: impl Fn(usize) -> Option<f64>, times: f64) -> Vec<ImageValue> {
    let own = problem.used().filter(|(_, image)| image.series == series);
    let mut all: Vec<(f64, &str)> =
        own.filter_map(|(i, image)| of(i).map(|value| (value, image.name.as_str()))).collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let usual = all.get(all.len() / 2).map_or(0.0, |e| e.0);
    all.retain(|e| e.0 > times * usual);
    all.into_iter().map(|(value, image)| ImageValue { image: image.to_owned(), value }).collect()
}

fn in_words(what: &str, images: &[ImageValue], shown: impl Fn(f64) -> String) -> String {
    let named: Vec<String> = images.iter().map(|i| format!("{} ({})", i.image, shown(i.value))).collect();
    if named.is_empty() { String::new() } else { format!("{what} {}", some_of(&named, MOST_IMAGES)) }
}

impl JointNoiseLarge {
    /// True where what moved in a series, and weighs no less, is why it is noisier than others of the robot.
    pub(super) fn is_of_what_moved_in(&self, series: &str, weight: Weight) -> bool {
        self.quieter.is_some() && self.weight <= weight && self.of_same_stops.iter().any(|own| own == series)
    }

    /// Images that stand out, in words.
    fn odd_images(&self) -> String {
        let predicted =
            in_words(", images that the others predict worst:", &self.worst_predicted, |mm| format!("{mm:.1} mm"));
        predicted + &in_words(", blurred or badly seen images:", &self.badly_seen, |px| format!("sigma {px:.3} px"))
    }

    /// What robots repeat to, or the other series of this one.
    fn usual(&self) -> String {
        let unit = self.kind.units()[1];
        match &self.quieter {
            Some((name, sigma)) => format!("in series {name} it repeats to {:.3} {unit}", 1e3 * sigma),
            None => format!(
                "{} repeat to some 0.1 {unit}",
                if self.kind == JointKind::Prismatic { "rails" } else { "robots" }
            ),
        }
    }
}

impl Kind for JointNoiseLarge {
    fn code(&self) -> Code {
        Code::JointNoiseLarge
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        let images = self.worst_predicted.iter().chain(&self.badly_seen).map(|i| Subject::Image(i.image.clone()));
        let mut all = vec![Subject::Series(self.series.clone()), Subject::Joint(self.joint.clone())];
        images.for_each(|image| {
            if !all.contains(&image) {
                all.push(image);
            }
        });
        all
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::new("joint_noise", self.sigma, self.kind.units()[0])]
    }

    fn place(&self) -> String {
        format!("series {}", self.series)
    }

    fn seen(&self) -> String {
        let unit = self.kind.units()[1];
        if self.readings_are_poses {
            return format!(
                "the poses of the controller are off by {:.2} {unit} ({} most) against the images from stop to stop: it computes them by its own \
                 model of the robot, and arms are off by about a millimetre by theirs (absolute accuracy){}",
                1e3 * self.sigma,
                self.joint,
                self.odd_images()
            );
        }
        let still = self.stands_still.as_ref().map_or_else(String::new, |still| format!(", which reads {still}"));
        format!(
            "the joint noise is {:.2} {unit} ({} most{still}), where {}{}",
            1e3 * self.sigma,
            self.joint,
            self.usual(),
            self.odd_images()
        )
    }

    fn remedy(&self) -> String {
        let remedy = match self.weight {
            _ if self.readings_are_poses => {
                "give the description of the robot with --urdf (and joint readings, joints.csv, where there are any): its errors are then found; the \
                 stated sigmas contain them. If the arm is in order, and they are far more than a millimetre: did plate or camera move?"
            }
            _ if self.readings_are_computed => {
                "the joint readings were computed from poses: see that these are those of the flange in the base (tool and user frame set to \
                 zero where they were shown or logged). They tell neither postures nor full turns for certain, and take the URDF for the model \
                 in the controller: record joint readings (joints.csv) where they can be had"
            }
            Weight::Gate if self.stands_still.is_some() => {
                "see whether that joint was read at these stops: correct their readings, or leave their rows out"
            }
            Weight::Note if !self.by_images => {
                "did the tracker, its targets or the sockets move, was anything measured before the arm stood still, are readings rounded, is the robot model too small? the stated sigmas contain it"
            }
            Weight::Note => {
                "did plate or camera move, were images taken before the arm stood still, are readings rounded, is autofocus or a stabiliser on? the stated sigmas contain it"
            }
            _ if self.by_images => "look for a loose camera or plate, motion, autofocus, a wrong URDF",
            _ => {
                "look for a loose tracker or target, rows of other stops, motion, a larger sigma than is stated, a joint near its target that counts the other way, a wrong URDF"
            }
        };
        remedy.into()
    }
}
