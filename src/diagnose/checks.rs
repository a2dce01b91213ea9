//! The table of checks: at which stage each runs, and what its findings explain away.

use super::finding::Finding;
use super::kind::{CheckContext, Kind, Weight};
use super::left_out::reading_circles::ReadingCircles;
use super::left_out::{
    exchanged_pictures, exchanged_readings, exchanged_targets, left_out_bodies, left_out_images, left_out_observations,
    many_left_out, moved, shifted_measurements, shifted_readings,
};
use super::steps::{loose, pose_step};
use super::{
    camera_model, camera_pattern, cameras_contradict, contradicted_distances, extrapolates, few_images, focus,
    held_near_nominal, held_parameters, joint_noise, length_standard, marker_off, measurement_scatter, mirror_image,
    no_gain, odd_image, parameter_off, plate_size, reading_ratio, repeated_measurements, rounded_readings, scatter,
    small_gain, stated_noise, tag_size, undetermined, zeros_off,
};
use crate::assess::{Accuracy, Uncertainty};
use crate::error::{Code, Error, Result};
use crate::fit::Fit;
use crate::problem::{Adjustment, Problem};

/// When a check runs, and with what beside the setting.
#[derive(Clone, Copy)]
pub enum Stage {
    /// After the stand-alone camera poses.
    FreePoses(fn(&Problem, &CheckContext) -> Vec<Finding>),
    /// After wrong pairs and outliers were left out.
    LeftOut(fn(&Adjustment, &CheckContext) -> Vec<Finding>),
    /// Then, beside what the checks above have found.
    BesideLeftOut(fn(&Adjustment, &[Vec<Finding>], &CheckContext) -> Vec<Finding>),
    /// With the readings that wrongly paired images fit.
    WrongPairs(fn(&Adjustment, &ReadingCircles, &CheckContext) -> Vec<Finding>),
    /// After the fit, with the accuracy on images that it had not seen.
    Fit(fn(&Fit, &Accuracy, &CheckContext) -> Vec<Finding>),
    /// After it is known how far the result can be trusted.
    Uncertainty(fn(&Uncertainty, &Accuracy, &CheckContext) -> Vec<Finding>),
    /// Then, with the fit.
    Judged(fn(&Fit, &Uncertainty, &Accuracy, &CheckContext) -> Vec<Finding>),
}

/// One check.
#[derive(Clone, Copy)]
pub struct Check {
    /// Its name: that of its file.
    pub name: &'static str,
    /// When it runs.
    pub stage: Stage,
    /// True where a finding of this check explains another away, which is then not reported. What weighs less rarely explains what weighs more: where it
    /// does, as exchanged pictures do that a body seems to have moved, nothing is left of the other, and each arm says what it asks.
    pub explains: fn(&Finding, &Finding) -> bool,
}

const fn check(name: &'static str, stage: Stage) -> Check {
    Check { name, stage, explains: |_, _| false }
}

fn found<T: Into<Finding>>(all: impl IntoIterator<Item = T>) -> Vec<Finding> {
    all.into_iter().map(Into::into).collect()
}

/// All checks, in the order in which their findings are reported.
pub const CHECKS: &[Check] = &[
    Check {
        // What moved once has two places.
        explains: |own, other| match (own, other) {
            (Finding::Displaced(own), Finding::LooseMounting(loose)) => own.explains_two_places_of(&loose.mounting),
            (Finding::Displaced(own), Finding::NoiseContradicted(noise)) => noise.is_explained_by(own.weight),
            (Finding::Displaced(own), Finding::JointNoiseLarge(noise)) => {
                noise.is_of_what_moved_in(&own.series, own.weight)
            }
            (Finding::Displaced(own), Finding::CamerasContradict(apart)) => {
                apart.is_of_what_moved_in(&own.series, own.weight)
            }
            (Finding::Displaced(own), Finding::DoubtedSize(size)) => size.is_of_what_moved_in(&own.series, own.weight),
            (Finding::FocusChange(own), Finding::LooseMounting(loose)) => own.explains_two_places_of(&loose.mounting),
            (Finding::FocusChange(own), Finding::NoiseContradicted(noise)) => noise.is_explained_by(own.weight),
            (Finding::ImagesShifted(own), Finding::LooseMounting(loose)) => own.explains_two_places_of(&loose.mounting),
            (Finding::ImagesShifted(own), Finding::FocusChange(focus)) => own.explains_focus(focus),
            (Finding::ImagesShifted(own), Finding::Displaced(moved)) => own.looks_like(moved),
            (Finding::ImagesShifted(own), Finding::NoiseContradicted(noise)) => noise.is_explained_by(own.weight),
            (Finding::ZeroMoved(own), Finding::LooseMounting(_)) => own.explains_two_places(),
            (Finding::ZeroMoved(own), Finding::Displaced(other)) => {
                other.is_by_turns() && own.explains_two_places() && own.series == other.series
            }
            (Finding::ZeroMoved(own), Finding::NoiseContradicted(noise)) => noise.is_explained_by(own.weight),
            (Finding::ZeroMoved(own), Finding::JointNoiseLarge(noise)) => {
                noise.is_of_what_moved_in(&own.series, own.weight)
            }
            (Finding::Displaced(own), Finding::MeasurementsScatter(other)) => {
                own.explains_scatter_of(&other.instrument)
            }
            (Finding::PlaceMisstated(own), Finding::MeasurementsScatter(other)) => {
                own.explains_scatter_of(&other.instrument)
            }
            (Finding::PlaceMisstated(own), Finding::NoiseContradicted(noise)) => noise.is_explained_by(own.weight),
            _ => false,
        },
        ..check("pose_step", Stage::Fit(pose_step::check))
    },
    Check {
        explains: |own, other| match (own, other) {
            (Finding::ReadingsRounded(own), Finding::JointNoiseLarge(noise)) => noise.series == own.series,
            (Finding::ReadingsRounded(_), Finding::NoiseContradicted(noise)) => noise.is_explained_by(Weight::Gate),
            (
                Finding::ReadingsRounded(own),
                Finding::Displaced(_)
                | Finding::LooseMounting(_)
                | Finding::FocusChange(_)
                | Finding::BodyMoved(_)
                | Finding::ZeroMoved(_),
            ) => own.explains_moves(),
            _ => false,
        },
        ..check("rounded_readings", Stage::Fit(|a, b, s| found(rounded_readings::check(a, b, s))))
    },
    Check {
        // Another focal length looks like a plate that stands elsewhere.
        explains: |own, other| match (own, other) {
            (Finding::FocusChange(own), Finding::Displaced(moved)) => own.looks_like(moved),
            (Finding::FocusChange(own), Finding::CamerasContradict(apart)) => {
                apart.is_of_focus_of(&own.camera, own.weight)
            }
            _ => false,
        },
        ..check("focus", Stage::FreePoses(|p, s| found(focus::check(p, s))))
    },
    Check {
        // It grows with the reading, as what is loose or moved does not.
        explains: |own, other| match (own, other) {
            (
                Finding::ReadingRatio(own),
                Finding::Displaced(_)
                | Finding::ImagesShifted(_)
                | Finding::ZeroMoved(_)
                | Finding::LooseMounting(_)
                | Finding::JointNoiseLarge(_)
                | Finding::BodyMoved(_)
                | Finding::NoGain(_),
            ) => own.explains(),
            (Finding::ReadingRatio(own), Finding::NoiseContradicted(noise)) => {
                own.explains() && noise.is_explained_by(Weight::Gate)
            }
            _ => false,
        },
        ..check("reading_ratio", Stage::Fit(|a, b, s| found(reading_ratio::check(a, b, s))))
    },
    check("camera_model", Stage::FreePoses(|p, s| found(camera_model::check(p, s)))),
    check("camera_pattern", Stage::Fit(|a, b, s| found(camera_pattern::check(a, b, s)))),
    check("few_images", Stage::Fit(|a, b, s| found(few_images::check(a, b, s)))),
    check("cameras_contradict", Stage::Fit(|a, b, s| found(cameras_contradict::check(a, b, s)))),
    check("joint_noise", Stage::Fit(|a, b, s| found(joint_noise::check(a, b, s)))),
    Check {
        explains: |own, other| match (own, other) {
            (Finding::HeldContradicted(own), Finding::LooseMounting(loose)) => {
                own.explains_two_places_of(&loose.mounting)
            }
            (
                Finding::HeldContradicted(own),
                Finding::DoubtedSize(_) | Finding::ParameterOff(_) | Finding::JointNoiseLarge(_),
            ) => own.weight == Weight::Gate,
            _ => false,
        },
        ..check("held_parameters", Stage::Fit(|a, b, s| found(held_parameters::check(a, b, s))))
    },
    check("stated_noise", Stage::Fit(|a, b, s| found(stated_noise::check(a, b, s)))),
    Check {
        explains: |_, other| matches!(other, Finding::NoiseContradicted(noise) if noise.is_explained_by(Weight::Gate)),
        ..check("loose", Stage::Fit(loose::check))
    },
    check("moved", Stage::LeftOut(|a, s| found(moved::check(a, s)))),
    Check {
        explains: |own, other| match (own, other) {
            (Finding::ExchangedPictures(own), Finding::BodyMoved(moved)) => own.explains(&moved.images),
            _ => false,
        },
        ..check("exchanged_pictures", Stage::LeftOut(|a, s| found(exchanged_pictures::check(a, s))))
    },
    check("exchanged_readings", Stage::WrongPairs(|a, r, s| found(exchanged_readings::check(a, r, s)))),
    Check {
        explains: |_, other| matches!(other, Finding::ManyLeftOut(_)),
        ..check("left_out_images", Stage::LeftOut(|a, s| found(left_out_images::check(a, s))))
    },
    check("exchanged_targets", Stage::LeftOut(|a, s| found(exchanged_targets::check(a, s)))),
    check("shifted_measurements", Stage::LeftOut(|a, s| found(shifted_measurements::check(a, s)))),
    check("shifted_readings", Stage::WrongPairs(|a, r, s| found(shifted_readings::check(a, r, s)))),
    check("repeated_measurements", Stage::LeftOut(|a, s| found(repeated_measurements::check(a, s)))),
    check("left_out_bodies", Stage::BesideLeftOut(|a, f, s| found(left_out_bodies::check(a, why_left_out(f), s)))),
    check("measurement_scatter", Stage::Fit(|a, b, s| found(measurement_scatter::check(a, b, s)))),
    check("left_out_observations", Stage::LeftOut(|a, s| found(left_out_observations::check(a, s)))),
    check("mirror_image", Stage::Fit(|a, b, s| found(mirror_image::check(a, b, s)))),
    Check {
        explains: |_, other| matches!(other, Finding::SmallGain(_)),
        ..check("no_gain", Stage::Judged(|a, u, b, s| found(no_gain::check(a, u, b, s))))
    },
    check("zeros_off", Stage::LeftOut(|a, s| found(zeros_off::check(a, s)))),
    Check {
        // The robot takes up what a plate of another size leaves, and what it cannot looks like noise.
        explains: |own, other| match (own, other) {
            (Finding::DoubtedSize(own), Finding::JointNoiseLarge(noise)) => own.explains_noise(noise),
            (Finding::DoubtedSize(own), Finding::ParameterOff(off)) => own.explains_parameter(off),
            _ => false,
        },
        ..check("plate_size", Stage::Fit(|a, b, s| found(plate_size::check(a, b, s))))
    },
    check("contradicted_distances", Stage::Fit(|a, b, s| found(contradicted_distances::check(a, b, s)))),
    Check {
        explains: |own, other| match (own, other) {
            (Finding::ContradictedLengths(own), Finding::DoubtedSize(plate)) => own.explains(plate),
            (Finding::ContradictedLengths(own), Finding::Displaced(moved)) => {
                own.is_of(&moved.mounting) && !moved.is_far()
            }
            (Finding::ContradictedLengths(own), Finding::ContradictedDistances(other)) => {
                own.instrument.is_none() && other.weight == Weight::Note
            }
            _ => false,
        },
        ..check("length_standard", Stage::Fit(|a, b, s| found(length_standard::check(a, b, s))))
    },
    check("marker_off", Stage::Fit(|a, b, s| found(marker_off::check(a, b, s)))),
    check("tag_size", Stage::Fit(|a, b, s| found(tag_size::check(a, b, s)))),
    check("parameter_off", Stage::Fit(|a, b, s| found(parameter_off::check(a, b, s)))),
    check("scatter", Stage::Uncertainty(|a, b, s| found(scatter::check(a, b, s)))),
    check("held_near_nominal", Stage::Fit(|a, b, s| found(held_near_nominal::check(a, b, s)))),
    check("extrapolates", Stage::Uncertainty(|a, b, s| found(extrapolates::check(a, b, s)))),
    check("undetermined", Stage::Uncertainty(|a, b, s| found(undetermined::check(a, b, s)))),
    check("many_left_out", Stage::LeftOut(|a, s| found(many_left_out::check(a, s)))),
    check("small_gain", Stage::Fit(|a, b, s| found(small_gain::check(a, b, s)))),
    check("odd_image", Stage::Fit(|a, b, s| found(odd_image::check(a, b, s)))),
];

/// Code and place of what says why measurements of a tracker were left out.
fn why_left_out(above: &[Vec<Finding>]) -> Vec<(Code, String)> {
    let why = |found: &Finding| match found {
        Finding::ExchangedTargets(found) => Some((found.code(), found.place())),
        Finding::ShiftedMeasurements(found) => Some((found.code(), found.place())),
        _ => None,
    };
    above.iter().flatten().filter_map(why).collect()
}

/// True of what readings computed from poses of a tool, or in a frame, look like: there they are the finding. `mountings`: names of those of
/// the series with such poses; another is loose by itself.
pub fn follows_from_tool(finding: &Finding, mountings: &[&str]) -> bool {
    match finding {
        Finding::JointNoiseLarge(_) | Finding::NoGain(_) | Finding::SmallGain(_) | Finding::ComputedPostures(_) => true,
        Finding::LooseMounting(loose) => mountings.contains(&loose.mounting.as_str()),
        _ => false,
    }
}

/// What the checks have found so far.
pub struct Diagnosis<'a> {
    setting: CheckContext<'a>,
    /// Findings of every row of [`CHECKS`].
    found: [Vec<Finding>; CHECKS.len()],
}

impl<'a> Diagnosis<'a> {
    /// Nothing is found yet.
    pub fn new(setting: CheckContext<'a>) -> Self {
        Self { setting, found: std::array::from_fn(|_| Vec::new()) }
    }

    /// Runs the checks of a stage in their order.
    fn run(&mut self, of_stage: impl Fn(&Stage, &[Vec<Finding>], &CheckContext) -> Option<Vec<Finding>>) {
        for (row, check) in CHECKS.iter().enumerate() {
            let Some(mut found) = of_stage(&check.stage, &self.found[..row], &self.setting) else { continue };
            found.retain(|f| !self.is_explained(f));
            self.found[row] = found;
        }
        // What was found before may be explained now.
        let left = self.found.clone().map(|all| all.into_iter().filter(|f| !self.is_explained(f)).collect());
        self.found = left;
    }

    fn is_explained(&self, finding: &Finding) -> bool {
        CHECKS.iter().zip(&self.found).any(|(check, own)| own.iter().any(|f| (check.explains)(f, finding)))
    }

    /// Checks of the stand-alone camera poses.
    pub fn after_free_poses(&mut self, problem: &Problem) {
        self.run(|stage, _, setting| match stage {
            Stage::FreePoses(check) => Some(check(problem, setting)),
            _ => None,
        });
    }

    /// Checks of the stand-alone camera poses, and of what was left out.
    ///
    /// # Errors
    /// Where too little is left for a result.
    pub fn of_left_out(setting: CheckContext<'a>, adjustment: &Adjustment) -> Result<Self> {
        let mut own = Self::new(setting);
        own.after_free_poses(&adjustment.problem);
        let circles = ReadingCircles::of(&adjustment.problem);
        own.run(|stage, above, setting| match stage {
            Stage::LeftOut(check) => Some(check(adjustment, setting)),
            Stage::BesideLeftOut(check) => Some(check(adjustment, above, setting)),
            Stage::WrongPairs(check) => Some(check(adjustment, &circles, setting)),
            _ => None,
        });
        own.refusal().map_or(Ok(own), Err)
    }

    /// Checks of the fit.
    pub fn after_fit(&mut self, fit: &Fit, accuracy: &Accuracy) {
        self.run(|stage, _, setting| match stage {
            Stage::Fit(check) => Some(check(fit, accuracy, setting)),
            _ => None,
        });
    }

    /// Checks of how far the result can be trusted.
    pub fn after_uncertainty(&mut self, fit: &Fit, uncertainty: &Uncertainty, accuracy: &Accuracy) {
        self.run(|stage, _, setting| match stage {
            Stage::Uncertainty(check) => Some(check(uncertainty, accuracy, setting)),
            Stage::Judged(check) => Some(check(fit, uncertainty, accuracy, setting)),
            _ => None,
        });
    }

    /// All findings, in the order of the table.
    pub fn findings(self) -> Vec<Finding> {
        self.found.into_iter().flatten().collect()
    }

    /// Why there can be no result: what was moved where that is known.
    fn refusal(&self) -> Option<Error> {
        let all = || self.found.iter().flatten();
        let refusal = all().find(|f| f.weight() == Weight::Refusal)?;
        let moved = all().find(|f| matches!(f, Finding::BodyMoved(_)));
        Some(moved.unwrap_or(refusal).refusal())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use super::*;
    use crate::diagnose::{
        Carried, ContradictedLengths, Displaced, Displacement, DoubtedSize, HeldContradicted, InOrder, JointNoiseLarge,
        LooseMounting, PlateSays, ToldBy,
    };
    use crate::series::CameraMount;
    use crate::urdf::JointKind;

    fn is_explained(finding: &Finding, by: &Finding) -> bool {
        CHECKS.iter().any(|check| (check.explains)(by, finding))
    }

    fn fixture_elsewhere(weight: Weight, distance_m: (f64, f64)) -> Finding {
        Finding::from(Displaced {
            series: "touches".to_owned(),
            body: Carried::Places,
            places: Vec::new(),
            mounting: "fixture".to_owned(),
            displacement: Displacement::FromThenOn,
            images: vec!["t07".to_owned()],
            distance_m,
            angle_rad: None,
            share: 0.8,
            explains_most: true,
            weight,
        })
    }

    #[test]
    fn what_moved_may_be_why_a_plate_seems_a_little_off() {
        let size = |weight: Weight, shown_in: &str| {
            Finding::from(DoubtedSize::Contradicted {
                plate: "plate".to_owned(),
                measured: false,
                off: -7e-4,
                sigma: 2e-4,
                weight,
                told_by: ToldBy::Links,
                shown_in: vec![shown_in.to_owned()],
                in_order: InOrder::default(),
            })
        };
        let moved = |weight: Weight| fixture_elsewhere(weight, (1e-3, 5e-5));
        assert!(is_explained(&size(Weight::Note, "touches"), &moved(Weight::Gate)));
        assert!(!is_explained(&size(Weight::Gate, "touches"), &moved(Weight::Gate)));
        assert!(!is_explained(&size(Weight::Note, "touches"), &moved(Weight::Note)));
        // Another series shows the plate.
        assert!(!is_explained(&size(Weight::Note, "other"), &moved(Weight::Gate)));
    }

    #[test]
    fn what_moved_explains_the_noise_of_its_own_stops_and_no_gate_by_a_note() {
        let noise = |weight: Weight, series: &str| {
            Finding::from(JointNoiseLarge {
                series: series.to_owned(),
                joint: "a2".to_owned(),
                kind: JointKind::Revolute,
                sigma: 3e-3,
                worst_predicted: Vec::new(),
                badly_seen: Vec::new(),
                stands_still: None,
                quieter: Some(("quiet".to_owned(), 5e-5)),
                of_same_stops: vec![series.to_owned()],
                by_images: true,
                readings_are_computed: false,
                readings_are_poses: false,
                weight,
            })
        };
        let moved = |weight: Weight| fixture_elsewhere(weight, (1e-3, 5e-5));
        assert!(is_explained(&noise(Weight::Note, "touches"), &moved(Weight::Note)));
        assert!(is_explained(&noise(Weight::Gate, "touches"), &moved(Weight::Gate)));
        assert!(!is_explained(&noise(Weight::Gate, "touches"), &moved(Weight::Note)));
        assert!(!is_explained(&noise(Weight::Note, "other"), &moved(Weight::Gate)));
    }

    #[test]
    fn places_of_another_size_only_seem_to_move() {
        let lengths = |instrument: &str| {
            Finding::from(ContradictedLengths {
                instrument: Some(instrument.to_owned()),
                off: -0.96,
                sigma: 0.01,
                plate: PlateSays::Nothing,
                on_rail: false,
            })
        };
        let hardly_told = fixture_elsewhere(Weight::Gate, (0.653, 0.423));
        assert!(is_explained(&hardly_told, &lengths("fixture")));
        assert!(!is_explained(&hardly_told, &lengths("tracker")));
        assert!(!is_explained(&fixture_elsewhere(Weight::Gate, (0.653, 0.01)), &lengths("fixture")));
    }

    #[test]
    fn every_check_is_named_after_its_file() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/diagnose");
        for check in CHECKS {
            let file = format!("{}.rs", check.name);
            let is_there = ["", "steps", "left_out"].iter().any(|part| folder.join(part).join(&file).is_file());
            assert!(is_there, "{}", check.name);
        }
        let names: BTreeSet<&str> = CHECKS.iter().map(|check| check.name).collect();
        assert_eq!(names.len(), CHECKS.len());
    }

    fn loose(mounting: &str) -> Finding {
        Finding::from(LooseMounting {
            mounting: mounting.to_owned(),
            mount: CameraMount::Hand,
            turn: "yaw",
            angle_rad: 0.01,
            spread_rad: 0.001,
            images: Vec::new(),
            of: 20,
        })
    }

    /// The flange is hardly off by what is held, and the camera has two places by it alone.
    #[test]
    fn a_note_explains_the_gate_of_which_it_leaves_nothing() {
        let held = Finding::from(HeldContradicted {
            parameters: vec!["joint_2.offset".to_owned()],
            deviate: 9.0,
            moved_m: Some([1e-5, 1e-4]),
            steadied: vec!["hand".to_owned()],
            weight: Weight::Note,
        });
        assert!(held.weight() < loose("hand").weight());
        assert!(is_explained(&loose("hand"), &held));
        assert!(!is_explained(&loose("other"), &held));
    }

    #[test]
    fn a_camera_of_another_series_is_loose_whatever_the_poses_of_one_are() {
        assert!(follows_from_tool(&loose("of_poses"), &["of_poses"]));
        assert!(!follows_from_tool(&loose("of_joints"), &["of_poses"]));
    }
}
