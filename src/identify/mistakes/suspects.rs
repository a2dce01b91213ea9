//! When readings and images do not fit: the usual mistakes, tried one by one, named where one of them explains it.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::likeliest::{Explained, with_sign_or_zero};
use super::name_order::in_other_orders;
use super::readings::{Undone, mistakes_undone, shifted_rows, signs_of_others};
use crate::assess::Limits;
use crate::diagnose::MistakeKind;
use crate::error::Code;
use crate::geom::Pose;
use crate::init::{PosePair, SeenStop, bases, hand_eye_misfit, plate_scale, solve_hand_eye};
use crate::linalg::median;
use crate::model::mirror::mirror_images;
use crate::model::robot::Robot;
use crate::problem::{MeasuredSeries, Problem};
use crate::series::{LENGTH_UNITS, spread};
use crate::urdf::JointKind;

/// Images of one camera mounting and one plate placement with what they say.
pub(in crate::identify) struct Suspects<'a> {
    pub problem: &'a Problem,
    pub robot: &'a Robot,
    pub series: &'a [MeasuredSeries],
    pub pairs: &'a [(usize, PosePair)],
    /// All images by mounting and placement.
    pub groups: &'a [Vec<(usize, PosePair)>],
    pub limits: &'a Limits,
}

/// Images by which a mistake is seen to explain the misfit of all: a sample of a median.
pub(in crate::identify) const ENOUGH: usize = 100;

/// Those of `n` images by which a mistake is seen to explain the misfit of all.
pub(in crate::identify) fn some_of(n: usize) -> impl Iterator<Item = usize> {
    spread(n, ENOUGH)
}

impl Suspects<'_> {
    /// The mistake that, undone, fits far better than `misfit`, if there is one, and the misfit that it then leaves.
    pub fn better_than(&self, misfit: f64) -> Option<(MistakeKind, Option<f64>)> {
        let of_poses = self.robot.chain.pose_coordinates().is_some();
        let explains = |(left, _): &(f64, MistakeKind)| *left < self.limits.mistake_explains * misfit;
        let is_suspicious = misfit >= self.limits.suspicious_misfit;
        let told = |(left, mistake): (f64, MistakeKind)| (mistake, Some(left));
        if let Some(misread) = self.read_otherwise().filter(|found| is_suspicious && explains(found)) {
            return Some(told(misread));
        }
        // Poses without a robot may be as coarse as they are; the links of a URDF are right to a percent.
        let is_told = !of_poses || is_suspicious;
        let scale = self.wrong_scale().filter(|(left, _)| is_told && *left < self.limits.scale_explains * misfit);
        if !is_suspicious {
            return scale.map(told);
        }
        // A scale takes up something of every misfit.
        let left_by_scale = scale.as_ref().map_or(f64::INFINITY, |(left, _)| *left);
        let is_more = |(left, _): &(f64, MistakeKind)| *left < self.limits.mistake_explains * left_by_scale;
        let undone = self.undone(misfit).filter(|found| explains(found) && is_more(found));
        match undone.or(scale) {
            Some(found) => Some(told(found)),
            None => self.other_lengths().filter(|_| !of_poses).map(|mistake| (mistake, None)),
        }
    }

    /// The mistake in readings, mounting or pictures that leaves least when it is undone, and how much that is.
    fn undone(&self, misfit: f64) -> Option<(f64, MistakeKind)> {
        let hypotheses = match self.robot.chain.pose_coordinates() {
            Some(_) => shifted_rows(&self.readings()).into(),
            None => [mistakes_undone(self.robot, &self.readings()), self.in_other_orders()].concat(),
        };
        let partly = self.partly_shifted(misfit);
        let is_partly = |of: &MistakeKind| partly.iter().any(|(_, partly)| partly.is_part_of(of));
        let tried: Vec<(f64, MistakeKind)> = hypotheses
            .into_par_iter()
            .filter(|undone| !is_partly(&undone.1) && !self.are_reversed_arms(undone))
            .map(|(readings, mistake)| (self.misfit(&readings), mistake))
            .collect();
        let others = [self.wrong_mount(), self.mirrored()];
        let all: Vec<Explained> = tried.into_iter().chain(partly.iter().cloned()).chain(others).collect();
        let best = (0..all.len()).min_by(|a, b| all[*a].0.total_cmp(&all[*b].0))?;
        let (left, kind) = &all[best];
        Some((*left, with_sign_or_zero(&all, best, self.limits).unwrap_or_else(|| kind.clone())))
    }

    /// Poses of a controller with a mistake undone, the best of them.
    fn read_otherwise(&self) -> Option<(f64, MistakeKind)> {
        let all = self.series.first()?.otherwise.len();
        let tried = (0..all).filter_map(|k| {
            let pairs: Vec<PosePair> =
                self.pairs.iter().map(|(i, pair)| self.pair_otherwise(*i, pair, k)).collect::<Option<_>>()?;
            Some((solve_hand_eye(&pairs).first()?.median_error, k))
        });
        let (error, k) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let other = &self.series.first()?.otherwise[k];
        let (code, what, remedy) = (other.code, other.says("the images fit"), other.remedy.clone());
        Some((error, MistakeKind::Poses { code, what, remedy }))
    }

    fn pair_otherwise(&self, image: usize, pair: &PosePair, otherwise: usize) -> Option<PosePair> {
        let own = &self.problem.images[image];
        let tip = (*self.series[own.series].otherwise.get(otherwise)?.poses.get(self.place(image))?)?;
        Some(PosePair::of_flange(own.mount, tip, pair.camera_from_plate))
    }

    /// Place of an image among the stops of its series.
    fn place(&self, image: usize) -> usize {
        let images = &self.problem.images;
        images[..image].iter().filter(|i| i.series == images[image].series).count()
    }

    /// The readings by another order of the names of the images, where these are of one series.
    fn in_other_orders(&self) -> Vec<Undone> {
        let of = |i: usize| self.problem.images[i].series;
        let Some(series) =
            self.pairs.first().map(|(i, _)| of(*i)).filter(|s| self.pairs.iter().all(|(i, _)| of(*i) == *s))
        else {
            return Vec::new();
        };
        let placed = |(readings, mistake): (BTreeMap<usize, Vec<f64>>, MistakeKind)| {
            let of_images = self.pairs.iter().map(|(i, _)| readings.get(&self.place(*i)).cloned());
            Some((of_images.collect::<Option<Vec<_>>>()?, mistake))
        };
        in_other_orders(&self.series[series]).into_iter().filter_map(placed).collect()
    }

    pub fn readings(&self) -> Vec<Vec<f64>> {
        self.pairs
            .iter()
            .map(|(i, _)| self.problem.posture(*i).map(|s| s.readings.clone()).unwrap_or_default())
            .collect()
    }

    /// Whether the readings come from poses of a controller.
    pub fn are_of_poses(&self) -> bool {
        self.pairs.first().is_some_and(|(i, _)| self.series[self.problem.images[*i].series].poses_were_read())
    }

    /// Its stops.
    pub fn stops(&self) -> Vec<SeenStop> {
        self.seen_with(&self.readings())
    }

    pub(super) fn misfit(&self, readings: &[Vec<f64>]) -> f64 {
        self.misfit_with(readings, |stop| stop)
    }

    pub(super) fn misfit_with(&self, readings: &[Vec<f64>], changed: impl Fn(SeenStop) -> SeenStop) -> f64 {
        let stops: Vec<SeenStop> = self.seen_with(readings).into_iter().map(changed).collect();
        // Where bases were found from the readings as they are, they are found anew.
        let placed = bases::found(self.robot).and_then(|joint| bases::placed(self.robot, joint, &stops));
        let robot = placed.as_ref().unwrap_or(self.robot);
        let pairs: Vec<PosePair> = some_of(stops.len()).map(|k| stops[k].pair(robot)).collect();
        hand_eye_misfit(&pairs)
    }

    fn seen_with(&self, readings: &[Vec<f64>]) -> Vec<SeenStop> {
        let stop = |((i, pair), readings): (&(usize, PosePair), &Vec<f64>)| SeenStop {
            readings: readings.clone(),
            mount: self.problem.images[*i].mount,
            camera_from_plate: pair.camera_from_plate,
        };
        self.pairs.iter().zip(readings).map(stop).collect()
    }

    /// Pictures that were mirrored. With `M = diag(-1, 1, 1)` the camera sees `p' = M (R p + t)` of a point p of the plate, and on a plate that looks
    /// the same when it is mirrored the ids are those of `p' = M p`, but for a turn and a shift of the plate: the pose that is seen is
    /// `(M R M, M t)`. A picture whose rows and columns are exchanged is mirrored and turned, as if the camera were turned with it.
    fn mirrored(&self) -> (f64, MistakeKind) {
        let mirror = Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0));
        let changed = |stop: SeenStop| {
            let Pose { rotation, translation } = stop.camera_from_plate;
            SeenStop { camera_from_plate: Pose::new(mirror * rotation * mirror, mirror * translation), ..stop }
        };
        let mirror = mirror_images(&self.robot.chain, self.limits.suspicious_misfit).into_iter().next();
        let joints = signs_of_others(self.robot, &[], &mirror.unwrap_or_default());
        (self.misfit_with(&self.readings(), changed), MistakeKind::Mirrored(joints))
    }

    /// Directions fit and distances do not: the axes of this arm with other lengths.
    fn other_lengths(&self) -> Option<MistakeKind> {
        let poses: Vec<PosePair> = self.pairs.iter().map(|(_, p)| *p).collect();
        let (angle_rad, distance_m) = directions_alone(&poses, self.limits)?;
        Some(MistakeKind::Lengths { angle_rad, distance_m, constant: self.constant_slide() })
    }

    /// A prismatic joint that reads the same at all stops.
    fn constant_slide(&self) -> Option<String> {
        self.constant(|kind| kind == JointKind::Prismatic).into_iter().next()
    }

    /// The joints that read the same at all stops, where these are many.
    pub fn constant_joints(&self) -> Option<Vec<String>> {
        let is_arm = self.robot.chain.pose_coordinates().is_none();
        let joints = self.constant(|_| is_arm && self.pairs.len() >= self.limits.constant_stops);
        (!joints.is_empty()).then_some(joints)
    }

    fn constant(&self, which: impl Fn(JointKind) -> bool) -> Vec<String> {
        let (chain, readings) = (&self.robot.chain, self.readings());
        let is_constant = |k: usize| readings.windows(2).all(|pair| pair[0].get(k) == pair[1].get(k));
        let joints = chain.reading_kinds.iter().zip(&chain.readings).enumerate();
        joints.filter(|(k, (kind, _))| which(**kind) && is_constant(*k)).map(|(_, (_, name))| name.clone()).collect()
    }

    /// A plate is mistaken for one of another size, or its size is in another unit.
    fn is_scale_of_plates(&self, scale: f64) -> bool {
        let larger = scale.max(1.0 / scale);
        let units_m = || LENGTH_UNITS.iter().map(|unit| unit.metres).chain([1.0]);
        let is_unit = |ratio: f64| ratio > 1.0 && (larger / ratio - 1.0).abs() < self.limits.scale_of_unit;
        larger < self.limits.scale_most || units_m().any(|a| units_m().any(|b| is_unit(a / b)))
    }

    fn wrong_scale(&self) -> Option<(f64, MistakeKind)> {
        let poses: Vec<PosePair> = self.pairs.iter().map(|(_, p)| *p).collect();
        let scale = best_scale(&poses)?;
        if (scale - 1.0).abs() < self.limits.scale_error || !self.is_scale_of_plates(scale) {
            return None;
        }
        let error = left_by_scale(&poses, scale)?;
        let plate = &self.problem.plates[self.problem.images[self.pairs.first()?.0].plate];
        if self.robot.chain.pose_coordinates().is_some() {
            let what = format!(
                "the plate is {scale:.3} times as large as plate.toml says, judged by the positions in controller.csv"
            );
            let remedy = "bring the positions to metres (of inches the plate seems 39.37 times as large), or correct pitch_m in plate.toml"
                .to_owned();
            return Some((error, MistakeKind::Poses { code: Code::PlatePitchWrong, what, remedy }));
        }
        Some((error, MistakeKind::PlateSize { scale, pitch_m: plate.pitch_m }))
    }
}

/// Median misfits of directions, rad, and of distances, m, where directions fit and distances do not: not even less what the directions displace of a
/// plate that is as far away.
pub(in crate::identify) fn directions_alone(pairs: &[PosePair], limits: &Limits) -> Option<(f64, f64)> {
    let start = solve_hand_eye(pairs).into_iter().next()?;
    let (angles, distances): (Vec<f64>, Vec<f64>) = pairs.iter().map(|p| start.solution.error(p)).unzip();
    let (angle_rad, distance_m) = (median(angles).unwrap_or(f64::INFINITY), median(distances).unwrap_or(f64::INFINITY));
    let far_m = median(pairs.iter().map(|p| p.camera_from_plate.translation.norm()))?;
    let by_lengths_m = distance_m - angle_rad * far_m;
    (angle_rad < limits.suspicious_misfit && by_lengths_m > limits.other_lengths_m).then_some((angle_rad, distance_m))
}

/// The scale of the plate that fits best.
pub(in crate::identify) fn best_scale(pairs: &[PosePair]) -> Option<f64> {
    plate_scale(pairs, &solve_hand_eye(pairs).first()?.solution)
}

/// The median misfit that a scale of the plate leaves.
pub(in crate::identify) fn left_by_scale(pairs: &[PosePair], scale: f64) -> Option<f64> {
    let scaled = pairs.iter().map(|p| {
        let mut pose = p.camera_from_plate;
        pose.translation *= scale;
        PosePair { camera_from_plate: pose, ..*p }
    });
    Some(solve_hand_eye(&scaled.collect::<Vec<_>>()).first()?.median_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Images of a plate `far_m` away, each turned by some 10 mrad about the camera, in which the hand is displaced by some `length_m`.
    fn pairs(far_m: f64, length_m: f64) -> Vec<PosePair> {
        let (camera, plate) =
            (Pose::from_xyz_rpy([0.02, 0.05, 0.1], [0.1, 0.2, 1.5]), Pose::from_xyz_rpy([1.0, 0.2, 0.0], [0.0; 3]));
        let scattered = |k: usize, by: f64| [1.3, 2.9, 4.7].map(|f| by * f64::sin(f * k as f64 + f));
        let pair = |k: usize| {
            let seen = Pose::from_xyz_rpy([0.0, 0.0, far_m], scattered(k, 0.6));
            let turned = Pose::from_xyz_rpy([0.0; 3], scattered(k + 50, 0.008));
            let displaced = Pose::from_xyz_rpy(scattered(k + 90, length_m), [0.0; 3]);
            PosePair { camera_from_plate: turned * seen, chain: displaced * camera * seen * plate.inverse() }
        };
        (0..30).map(pair).collect()
    }

    #[test]
    fn links_are_not_blamed_for_what_directions_displace_far_away() {
        let limits = Limits::default();
        for (far_m, length_m, are_lengths) in
            [(4.0, 0.002, false), (0.5, 0.002, false), (0.5, 0.06, true), (2.5, 0.12, true)]
        {
            let found = directions_alone(&pairs(far_m, length_m), &limits);
            assert_eq!(found.is_some(), are_lengths, "{far_m} m, {length_m} m: {found:?}");
        }
    }
}
