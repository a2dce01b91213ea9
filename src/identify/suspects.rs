//! When readings and images do not fit: the usual mistakes, tried one by one, named where one of them explains it.

use crate::assess::Limits;
use crate::error::Code;
use crate::init::{PosePair, plate_scale, solve_hand_eye};
use crate::model::robot::Robot;
use crate::problem::{MeasuredSeries, Problem};
use crate::series::CameraMount;
use crate::urdf::JointKind;

/// A mistake that explains the misfit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cause {
    /// Which mistake it is.
    pub code: Code,
    /// Joints that it is about; none where it is about all.
    pub joints: Vec<String>,
    /// What was found.
    pub what: String,
    /// What to do.
    pub remedy: String,
}

/// Images of one camera mounting and one plate placement with what they say.
pub(super) struct Suspects<'a> {
    pub problem: &'a Problem,
    pub robot: &'a Robot,
    pub series: &'a [MeasuredSeries],
    pub pairs: &'a [(usize, PosePair)],
    pub limits: &'a Limits,
}

impl Suspects<'_> {
    /// The mistake that, undone, fits far better than `misfit`, if there is one.
    pub fn better_than(&self, misfit: f64) -> Option<Cause> {
        let of_poses = self.robot.chain.pose_coordinates().is_some();
        if misfit >= self.limits.suspicious_misfit
            && let Some((error, cause)) = self.read_otherwise()
            && error < self.limits.mistake_explains * misfit
        {
            return Some(cause);
        }
        // Poses without a robot may be as coarse as they are; the links of a URDF are right to a percent.
        let is_told = !of_poses || misfit >= self.limits.suspicious_misfit;
        let scale = self.wrong_scale().filter(|(error, _)| is_told && *error < self.limits.scale_explains * misfit);
        if let Some((_, cause)) = scale {
            return Some(cause);
        }
        if misfit < self.limits.suspicious_misfit {
            return None;
        }
        let mut best: Option<(f64, Cause)> = None;
        let hypotheses = if of_poses { self.shifted_rows() } else { self.hypotheses() };
        for (readings, cause) in hypotheses {
            let error = self.misfit(&readings);
            if error < self.limits.mistake_explains * misfit && best.as_ref().is_none_or(|(e, _)| error < *e) {
                best = Some((error, cause));
            }
        }
        let (error, mount) = self.wrong_mount();
        if error < self.limits.mistake_explains * misfit && best.as_ref().is_none_or(|(e, _)| error < *e) {
            return Some(mount);
        }
        best.map(|(_, cause)| cause).or_else(|| self.other_lengths().filter(|_| !of_poses))
    }

    /// Poses of a controller with a mistake undone, the best of them.
    fn read_otherwise(&self) -> Option<(f64, Cause)> {
        let all = self.series.first()?.otherwise.len();
        let tried = (0..all).filter_map(|k| {
            let pairs: Vec<PosePair> =
                self.pairs.iter().map(|(i, pair)| self.pair_otherwise(*i, pair, k)).collect::<Option<_>>()?;
            Some((solve_hand_eye(&pairs).first()?.median_error, k))
        });
        let (error, k) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let other = &self.series.first()?.otherwise[k];
        let (what, remedy) = (other.what.clone(), other.remedy.clone());
        Some((error, Cause { code: other.code, joints: Vec::new(), what, remedy }))
    }

    fn pair_otherwise(&self, image: usize, pair: &PosePair, otherwise: usize) -> Option<PosePair> {
        let images = &self.problem.images;
        let own = &images[image];
        let place = images[..image].iter().filter(|i| i.series == own.series).count();
        let tip = (*self.series[own.series].otherwise.get(otherwise)?.poses.get(place)?)?;
        Some(PosePair::of_flange(own.mount, tip, pair.camera_from_plate))
    }

    fn readings(&self) -> Vec<Vec<f64>> {
        self.pairs
            .iter()
            .map(|(i, _)| self.problem.posture(*i).map(|s| s.readings.clone()).unwrap_or_default())
            .collect()
    }

    fn misfit(&self, readings: &[Vec<f64>]) -> f64 {
        self.misfit_mounted(readings, |mount| mount)
    }

    fn misfit_mounted(&self, readings: &[Vec<f64>], changed: impl Fn(CameraMount) -> CameraMount) -> f64 {
        let pairs: Vec<PosePair> = (self.pairs.iter().zip(readings))
            .map(|((i, pair), q)| {
                PosePair::of_stop(self.robot, changed(self.problem.images[*i].mount), q, pair.camera_from_plate)
            })
            .collect();
        solve_hand_eye(&pairs).first().map_or(f64::INFINITY, |s| s.median_error)
    }

    /// Camera in the hand and fixed camera exchanged.
    fn wrong_mount(&self) -> (f64, Cause) {
        let exchanged = |mount| match mount {
            CameraMount::Hand => CameraMount::Fixed,
            CameraMount::Fixed => CameraMount::Hand,
        };
        let stated = self.pairs.first().map_or(CameraMount::Hand, |(i, _)| self.problem.images[*i].mount);
        let (is, word) = match exchanged(stated) {
            CameraMount::Hand => ("the camera is in the hand and the plate stands still", "hand"),
            CameraMount::Fixed => ("the camera stands still and the plate is in the hand", "fixed"),
        };
        let what = format!("{is}: read so, the images fit");
        let remedy = format!("write camera_mount = \"{word}\" in series.toml");
        (
            self.misfit_mounted(&self.readings(), exchanged),
            Cause { code: Code::CameraMountWrong, joints: Vec::new(), what, remedy },
        )
    }

    /// Directions fit and distances do not: the axes of this arm with other lengths.
    fn other_lengths(&self) -> Option<Cause> {
        let poses: Vec<PosePair> = self.pairs.iter().map(|(_, p)| *p).collect();
        let start = solve_hand_eye(&poses).into_iter().next()?;
        let (mut angles, mut distances): (Vec<f64>, Vec<f64>) = poses.iter().map(|p| start.solution.error(p)).unzip();
        angles.sort_by(f64::total_cmp);
        distances.sort_by(f64::total_cmp);
        let (angle, distance) = (angles[angles.len() / 2], distances[distances.len() / 2]);
        (angle < self.limits.suspicious_misfit && distance > self.limits.other_lengths_m).then(|| Cause {
            code: Code::LinkLengthsWrong,
            joints: Vec::new(),
            what: format!(
                "directions fit the joint readings (median {:.1} mrad), distances do not (median {:.0} mm): these are the axes of \
                 such an arm with other link lengths",
                1e3 * angle,
                1e3 * distance
            ),
            remedy: "check that the URDF is of this robot and size, with lengths in metres, and that the tip link carries the camera".into(),
        })
    }

    /// Readings with one mistake undone, and its name.
    fn hypotheses(&self) -> Vec<(Vec<Vec<f64>>, Cause)> {
        let given = self.readings();
        let (names, kinds) = (&self.robot.chain.readings, &self.robot.chain.reading_kinds);
        let n = names.len();
        let mut all = Vec::new();
        let mut add = |code, joints: &[&String], change: &dyn Fn(&mut Vec<f64>), what: String, remedy: String| {
            let mut changed = given.clone();
            changed.iter_mut().for_each(change);
            let joints = joints.iter().map(|name| (*name).clone()).collect();
            all.push((changed, Cause { code, joints, what, remedy }));
        };
        for (k, name) in names.iter().enumerate() {
            add(
                Code::JointSignWrong,
                &[name],
                &|q| q[k] = -q[k],
                format!("the readings of {name} have the wrong sign: with {name} negated the images fit"),
                format!(
                    "negate the column {name} of joints.csv, or the axis of {name} in the URDF if the controller counts that way"
                ),
            );
            for (other, other_name) in names.iter().enumerate().skip(k + 1) {
                add(
                    Code::JointOrderWrong,
                    &[name, other_name],
                    &|q| q.swap(k, other),
                    format!("the joints stand in another order: with {name} and {other_name} exchanged the images fit"),
                    format!("exchange the column names {name} and {other_name} in joints.csv"),
                );
                add(
                    Code::JointSignWrong,
                    &[name, other_name],
                    &|q| (q[k], q[other]) = (-q[k], -q[other]),
                    format!(
                        "the readings of {name} and {other_name} have the wrong sign: with both negated the images fit"
                    ),
                    format!("negate the columns {name} and {other_name} of joints.csv, or these axes in the URDF"),
                );
                for (third, third_name) in names.iter().enumerate().skip(other + 1) {
                    for (a, b) in [(other, third), (third, other)] {
                        add(
                            Code::JointOrderWrong,
                            &[name, other_name, third_name],
                            &|q| (q[k], q[a], q[b]) = (q[a], q[b], q[k]),
                            format!(
                                "the joints stand in another order: with the columns {name}, {}, {} taken for {}, {name}, {} the images fit",
                                names[a], names[b], names[b], names[a]
                            ),
                            format!("correct the column names {name}, {other_name}, {third_name} in joints.csv"),
                        );
                    }
                }
            }
            if kinds[k] == JointKind::Revolute {
                for (factor, is, read_as) in
                    [(1f64.to_radians(), "degrees", "radians"), (1f64.to_degrees(), "radians", "degrees")]
                {
                    add(
                        Code::JointUnitWrong,
                        &[name],
                        &|q| q[k] *= factor,
                        format!("the readings of {name} alone are {is}, read as {read_as}: converted, the images fit"),
                        format!("bring the column {name} of joints.csv to the unit of the others"),
                    );
                }
            }
        }
        let turned = |factor: f64| {
            move |q: &mut Vec<f64>| {
                for (v, kind) in q.iter_mut().zip(kinds) {
                    if *kind == JointKind::Revolute {
                        *v *= factor;
                    }
                }
            }
        };
        let (to_rad, to_deg) = (1f64.to_radians(), 1f64.to_degrees());
        add(
            Code::JointUnitWrong,
            &[],
            &turned(to_rad),
            "the joint values are degrees, read as radians: converted, the images fit".into(),
            "write joint_unit = \"deg\" in series.toml".into(),
        );
        add(
            Code::JointUnitWrong,
            &[],
            &turned(to_deg),
            "the joint values are radians, read as degrees: converted, the images fit".into(),
            "write joint_unit = \"rad\" in series.toml".into(),
        );
        let reversed: Vec<usize> = (0..n).rev().collect();
        add(
            Code::JointOrderWrong,
            &[],
            &|q| *q = reversed.iter().map(|&k| q[k]).collect(),
            "the joints stand in reverse order: reversed, the images fit".into(),
            "reverse the column names in joints.csv".into(),
        );
        all.extend(self.shifted_rows());
        all
    }

    fn shifted_rows(&self) -> Vec<(Vec<Vec<f64>>, Cause)> {
        let given = self.readings();
        let shifted = |(shift, words): (usize, &str)| {
            let mut shifted = given.clone();
            shifted.rotate_left(shift);
            let what =
                format!("images and joint readings are shifted by one row: every image fits the readings of {words}");
            let remedy = "shift the image names in joints.csv by one row".into();
            (shifted, Cause { code: Code::RowsShifted, joints: Vec::new(), what, remedy })
        };
        [(1, "the row below"), (given.len().saturating_sub(1), "the row above")].map(shifted).into()
    }

    fn wrong_scale(&self) -> Option<(f64, Cause)> {
        let poses: Vec<PosePair> = self.pairs.iter().map(|(_, p)| *p).collect();
        let start = solve_hand_eye(&poses).into_iter().next()?;
        let scale = plate_scale(&poses, &start.solution)?;
        if (scale - 1.0).abs() < self.limits.scale_error {
            return None;
        }
        let scaled: Vec<PosePair> = poses
            .iter()
            .map(|p| {
                let mut pose = p.camera_from_plate;
                pose.translation *= scale;
                PosePair { camera_from_plate: pose, ..*p }
            })
            .collect();
        let error = solve_hand_eye(&scaled).first()?.median_error;
        let plate = &self.problem.plates[self.problem.images[self.pairs.first()?.0].plate];
        let what = format!(
            "the plate is {scale:.3} times as large as plate.toml says, judged by the link lengths in the URDF (a pitch of {:.3} mm instead of {:.3} mm fits), \
             or else the robot is {:.3} times as large as the URDF",
            1e3 * scale * plate.pitch_m,
            1e3 * plate.pitch_m,
            1.0 / scale
        );
        Some((
            error,
            Cause {
                code: Code::PlatePitchWrong,
                joints: Vec::new(),
                what,
                remedy: "measure the pitch of the plate with a ruler and correct pitch_m in plate.toml; if it is right, the URDF is of another size of this robot".into(),
            },
        ))
    }
}
