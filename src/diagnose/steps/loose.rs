//! A camera that sits loosely on its mount: it tips over between two positions, and the joint noise shows two heaps. So it does where the plate has
//! two places by turns: what stands out most clearly from the spread of its heaps is named.

use super::candidates::Changed;
use super::displaced::{Carried, Displaced, Displacement};
use super::loose_mounting::LooseMounting;
use super::rows::{Linear, Step};
use crate::assess::Accuracy;
use crate::diagnose::finding::Finding;
use crate::diagnose::heaps::{Heaps, TwoPlaces};
use crate::diagnose::kind::{CheckContext, Weight};
use crate::fit::Fit;
use crate::problem::Image;
use crate::series::CameraMount;

/// What the axes of the camera do, in the order x, y, z.
const TURNS: [&str; 3] = ["pitch", "yaw", "roll"];

/// Every mounting whose camera, or whose plate, has two places by turns.
pub fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<Finding> {
    let fit = setting.with_noise_found(fit);
    (0..fit.problem.mountings.len()).filter_map(|m| of_mounting(fit, m, setting)).collect()
}

/// The clearest of what a mounting shows.
fn of_mounting(fit: &Fit, mounting: usize, setting: &CheckContext) -> Option<Finding> {
    let limits = setting.limits;
    let by_readings = |image| fit.camera_by_readings(image);
    let camera = Heaps::of_camera(fit, by_readings, mounting).loose(limits);
    let plates = (0..fit.problem.placements.len()).filter_map(|placement| {
        let shown = |image: &Image| image.mounting == mounting && image.placement == placement;
        let heaps = Heaps::of(fit, by_readings, shown, |seen, predicted| (predicted.inverse() * seen).log());
        Some((placement, heaps.moved(limits)?))
    });
    let plate = plates.max_by(|a, b| a.1.clearness().total_cmp(&b.1.clearness()));
    let clearest = |two: &TwoPlaces| camera.as_ref().is_none_or(|camera| camera.clearness() < two.clearness());
    let plate = plate.filter(|(_, two)| clearest(two)).and_then(|(placement, two)| {
        let step = as_plate(fit, (placement, mounting), &two)?;
        Some((placement, two, step))
    });
    match plate {
        Some((_, two, step)) => Some(two.displaced(fit, &step, mounting, setting).into()),
        None => camera.map(|two| two.loose_mounting(fit, mounting).into()),
    }
}

/// A plate that stands elsewhere in these images, where that explains more than a camera that does.
fn as_plate(fit: &Fit, (placement, mounting): (usize, usize), two: &TwoPlaces) -> Option<Step> {
    let (problem, linear) = (&fit.problem, Linear::of(fit.linear()));
    let step = |changed| linear.most(problem, &[linear.at(problem, changed, &two.smaller)?]);
    let plate = step(Changed::Placement(placement))?;
    let camera = step(Changed::Mounting(mounting));
    camera.is_none_or(|camera| camera.fall < plate.fall).then_some(plate)
}

impl TwoPlaces {
    fn names(&self, fit: &Fit) -> Vec<String> {
        self.smaller.iter().map(|&i| fit.problem.images[i].name.clone()).collect()
    }

    fn loose_mounting(&self, fit: &Fit, mounting: usize) -> LooseMounting {
        let image = fit.problem.images.iter().find(|image| image.mounting == mounting);
        LooseMounting {
            mounting: fit.problem.mountings[mounting].clone(),
            mount: image.map_or(CameraMount::Hand, |image| image.mount),
            turn: TURNS[self.axis - 3],
            angle_rad: self.distance,
            spread_rad: self.spread,
            images: self.names(fit),
            of: self.of,
        }
    }

    fn displaced(&self, fit: &Fit, step: &Step, mounting: usize, setting: &CheckContext) -> Displaced {
        let first = self.smaller.first().map(|&i| &fit.problem.images[i]);
        let is_carried = first.is_some_and(|image| image.mount == CameraMount::Fixed);
        Displaced {
            series: first.map_or_else(String::new, |image| setting.series[image.series].name.clone()),
            body: if is_carried { Carried::PlateInHand } else { Carried::Plate },
            places: Vec::new(),
            mounting: fit.problem.mountings[mounting].clone(),
            displacement: Displacement::ByTurns,
            images: self.names(fit),
            distance_m: step.size(0),
            angle_rad: (step.change.len() > 3).then(|| step.size(3)),
            share: self.share,
            explains_most: true,
            weight: Weight::Gate,
        }
    }
}
