//! Do pictures of two cameras that were left out fit each other's place?

use crate::assess::Limits;
use crate::diagnose::kind::{CheckContext, Kind, Quantity, Subject, Weight, some_of};
use crate::error::Code;
use crate::init::resect;
use crate::problem::{Adjustment, Image, ImageRejection, Weighting};

/// Most images that are named.
const MOST_IMAGES: usize = 6;

/// Stops at which the picture of each of two cameras is that of the other.
#[derive(Debug, Clone, PartialEq)]
pub struct ExchangedPictures {
    /// The cameras' mountings.
    pub mountings: [String; 2],
    /// The images of the first of them, in their order, each with the name of that of the other.
    pub images: Vec<[String; 2]>,
    /// How well the worst of them fits its readings in the place of the other, m + rad.
    pub misfit: f64,
}

/// Every two cameras once.
pub fn check(adjustment: &Adjustment, setting: &CheckContext) -> Vec<ExchangedPictures> {
    let images = &adjustment.problem.images;
    let mut found: Vec<ExchangedPictures> = Vec::new();
    let is_out = |i: usize| images[i].rejected.as_ref().is_some_and(ImageRejection::is_wrong_pair);
    for one in (0..images.len()).filter(|&i| is_out(i)) {
        let others = (one + 1..images.len()).filter(|&k| images[k].stop == images[one].stop && is_out(k));
        for other in others.filter(|&k| images[k].mounting != images[one].mounting) {
            let Some(misfit) = exchanged(adjustment, [one, other], setting) else { continue };
            let mountings = [one, other].map(|i| adjustment.problem.mountings[images[i].mounting].clone());
            let names = [one, other].map(|i| images[i].name.clone());
            match found.iter_mut().find(|f| f.mountings == mountings) {
                Some(known) => {
                    known.images.push(names);
                    known.misfit = known.misfit.max(misfit);
                }
                None => found.push(ExchangedPictures { mountings, images: vec![names], misfit }),
            }
        }
    }
    found
}

/// How well both fit in the place of each other, where they do.
fn exchanged(adjustment: &Adjustment, [one, other]: [usize; 2], setting: &CheckContext) -> Option<f64> {
    let fits = |own, of| in_place_of(adjustment, own, of).filter(|&misfit| is_better(adjustment, own, misfit, setting));
    Some(f64::max(fits(one, other)?, fits(other, one)?))
}

/// How well a picture fits the readings as one that another camera took at its place, m + rad.
fn in_place_of(adjustment: &Adjustment, own: usize, of: usize) -> Option<f64> {
    let Adjustment { problem, state } = adjustment;
    let place = &problem.images[of];
    let taken = Image {
        camera: place.camera,
        mounting: place.mounting,
        mount: place.mount,
        placement: place.placement,
        ..problem.images[own].clone()
    };
    let predicted = adjustment.camera_by_readings(of)?;
    let (seen, _) = resect(&taken, state, &predicted, &Weighting::of(problem, &taken))?;
    Some(predicted.misfit(&seen))
}

fn is_better(adjustment: &Adjustment, image: usize, misfit: f64, setting: &CheckContext) -> bool {
    let Limits { mistake_explains, suspicious_misfit, .. } = *setting.limits;
    let own = setting.free.poses[image].as_ref().and_then(|pose| adjustment.misfit(&pose.camera_from_plate, image));
    let before = own.map_or(f64::INFINITY, |(angle, distance)| angle + distance);
    misfit < suspicious_misfit && misfit < mistake_explains * before
}

impl ExchangedPictures {
    /// True of what seems to have moved where all its images are of these.
    pub(in crate::diagnose) fn explains(&self, images: &[String]) -> bool {
        images.iter().all(|name| self.images.iter().flatten().any(|own| own == name))
    }
}

impl Kind for ExchangedPictures {
    fn code(&self) -> Code {
        Code::PicturesExchanged
    }

    fn weight(&self) -> Weight {
        Weight::Note
    }

    fn subjects(&self) -> Vec<Subject> {
        self.images.iter().flatten().cloned().map(Subject::Image).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![
            Quantity::new("stops", self.images.len() as f64, "1"),
            Quantity::new("misfit_exchanged", self.misfit, "m + rad"),
        ]
    }

    fn place(&self) -> String {
        self.mountings.join(", ")
    }

    fn seen(&self) -> String {
        let [one, other] = &self.mountings;
        let named: Vec<String> = self.images.iter().map(|[a, b]| format!("{a} with {b}")).collect();
        format!(
            "the pictures of {one} and {other} are exchanged at {} stops ({}): each fits the readings in the place of the other to {:.1} (mm plus mrad)",
            self.images.len(),
            some_of(&named, MOST_IMAGES),
            1e3 * self.misfit
        )
    }

    fn remedy(&self) -> String {
        "exchange these files (where there is images.csv, their rows there), and all of them are used".into()
    }
}
