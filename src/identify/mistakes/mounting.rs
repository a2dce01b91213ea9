//! What carries what: a camera that is not where it is stated to be, images of two cameras or readings of two arms in each other's place.

use std::collections::BTreeSet;

use super::readings::Undone;
use super::suspects::Suspects;
use crate::diagnose::MistakeKind;
use crate::init::SeenStop;
use crate::series::CameraMount;
use crate::urdf::Joint;

impl Suspects<'_> {
    /// Camera and plate each where the other is stated to be.
    pub(super) fn wrong_mount(&self) -> (f64, MistakeKind) {
        let left = self.misfit_exchanged();
        if let Some([second, first]) = self.arms() {
            return self.exchanged_arms(left, [first, second]);
        }
        let (mount, camera) = (self.mount().other(), self.camera_of_several());
        let kind = match camera.clone().zip(self.exchanged_camera()) {
            Some((own, other)) => MistakeKind::Cameras([own, other]),
            None => MistakeKind::Mount { mount, camera },
        };
        (left, kind)
    }

    fn mount(&self) -> CameraMount {
        self.pairs.first().map_or(CameraMount::Hand, |(i, _)| self.problem.images[*i].mount)
    }

    /// What is left where camera and plate change places.
    fn misfit_exchanged(&self) -> f64 {
        self.misfit_with(&self.readings(), |stop| SeenStop { mount: stop.mount.other(), ..stop })
    }

    /// Name of its camera where others saw the same stops.
    fn camera_of_several(&self) -> Option<String> {
        let own = &self.series[self.series_of()?];
        own.run.as_ref().map(|_| own.camera.clone())
    }

    fn series_of(&self) -> Option<usize> {
        self.pairs.first().map(|(i, _)| self.problem.images[*i].series)
    }

    /// Another camera of the run, mounted the other way as stated, whose images are wrong in the same way.
    fn exchanged_camera(&self) -> Option<String> {
        let own = self.series_of()?;
        let run = self.series[own].run.as_ref()?;
        let is_wrong = |other: &Suspects| {
            other.series_of().is_some_and(|s| s != own && self.series[s].run.as_ref() == Some(run))
                && other.mount() != self.mount()
                && other.pairs.len() >= self.limits.hand_eye_images
                && other.misfit_exchanged() < self.limits.suspicious_misfit
        };
        let mut others = self.groups.iter().map(|pairs| Suspects { pairs, ..*self });
        others.find(is_wrong)?.camera_of_several()
    }

    /// Readings of the arm that carries the plate, and of that which carries the camera, where two arms stand beside each other.
    fn arms(&self) -> Option<[Vec<String>; 2]> {
        let chain = &self.robot.chain;
        let between = chain.joints.iter().position(Joint::is_between_bases)?;
        let of = |joints: &[Joint]| joints.iter().filter_map(|j| j.drive).map(|d| d.reading).collect::<BTreeSet<_>>();
        let named = |readings: BTreeSet<usize>| readings.into_iter().map(|k| chain.readings[k].clone()).collect();
        Some([named(of(&chain.joints[..between])), named(of(&chain.joints[between + 1..]))])
    }

    /// Two arms in each other's place: the names of their columns, or what they carry, which leaves `by_carriers`. From one tip to the other the
    /// columns of two arms of a kind stand in reverse order then.
    fn exchanged_arms(&self, by_carriers: f64, arms: [Vec<String>; 2]) -> (f64, MistakeKind) {
        let [first, second] = &arms;
        let reversed = || self.readings().into_iter().map(|q| q.into_iter().rev().collect()).collect::<Vec<Vec<f64>>>();
        let by_columns = if first.len() == second.len() { self.misfit(&reversed()) } else { f64::INFINITY };
        let left = by_columns.min(by_carriers);
        let fits = |other: f64| other <= left.max(self.limits.suspicious_misfit);
        (left, MistakeKind::Arms { columns: fits(by_columns), carriers: fits(by_carriers), arms })
    }

    /// Of two arms, columns in reverse order are those of the arms exchanged.
    pub(super) fn are_reversed_arms(&self, (_, mistake): &Undone) -> bool {
        matches!(mistake, MistakeKind::Reversed(_)) && self.arms().is_some()
    }
}
