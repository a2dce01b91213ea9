//! Do the data contradict parameters that `--fix` holds?

use nalgebra::DVector;

use super::heaps::Heaps;
use super::kind::{CheckContext, Kind, Quantity, Subject, Weight, some_of};
use crate::assess::{Accuracy, contradicted};
use crate::error::Code;
use crate::fit::Fit;
use crate::problem::{Adjustment, Step, short_name};

/// Most parameters that are named.
const MOST_NAMED: usize = 4;

/// Parameters of the robot are held at values that the data contradict.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldContradicted {
    /// Their names, the clearest first.
    pub parameters: Vec<String>,
    /// Normal deviate of all that is held.
    pub deviate: f64,
    /// How far the fit with all of it free moves the flange, RMS, and the stated sigma, m; none where nothing ties the robot to the plate.
    pub moved_m: Option<[f64; 2]>,
    /// Mountings whose camera has two places in the fit, and none but one in that with all of it free.
    pub steadied: Vec<String>,
    /// Gate or note.
    pub weight: Weight,
}

impl HeldContradicted {
    /// Whether what is held makes the camera of a mounting look loose, however little the flange is off by it. Where the flange is off by more than is
    /// stated, nothing that the fit shows is told from it.
    pub(super) fn explains_two_places_of(&self, mounting: &str) -> bool {
        self.weight == Weight::Gate || self.steadied.iter().any(|own| own == mounting)
    }
}

/// Mountings whose camera has two places that the readings tell where the unknowns have moved by the step.
fn steadied(fit: &Fit, step: &DVector<f64>, setting: &CheckContext) -> Vec<String> {
    let fit = setting.with_noise_found(fit);
    let Adjustment { problem, state } = &fit.adjustment;
    let mut dense = DVector::zeros(problem.layout.len());
    dense.rows_mut(0, step.len()).copy_from(step);
    let step = Step::of(dense, vec![Vec::new(); state.plates.len()], state);
    let freed = Adjustment { state: state.moved(&problem.layout, &step), problem: problem.clone() };
    let is_loose =
        |by: &Adjustment, m: usize| Heaps::of_camera(fit, |i| by.camera_by_readings(i), m).is_loose(setting.limits);
    let is_steadied = |m: &usize| is_loose(&fit.adjustment, *m) && !is_loose(&freed, *m);
    (0..problem.mountings.len()).filter(is_steadied).map(|m| problem.mountings[m].clone()).collect()
}

/// Of a robot that is held as a whole the nominal one is what is wanted.
pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Option<HeldContradicted> {
    let (layout, joints) = (&fit.problem.layout, &fit.state.robot.chain.joints);
    if setting.fixed.is_empty() || !layout.robot().any(|c| layout.columns[c].free) {
        return None;
    }
    let is_motion = |c: usize| layout.twists.contains(&c) && !joints[c / 6].states_origin();
    let mut held: Vec<usize> =
        setting.fixed.iter().filter_map(|name| layout.named("--fix", name).ok()).flatten().collect();
    held.retain(|&c| layout.robot().contains(&c) && !layout.columns[c].free && !is_motion(c));
    held.sort_unstable();
    held.dedup();
    let found = contradicted(fit, &held, setting.limits)?;
    let parameters = found.columns.iter().map(|(c, _)| layout.columns[*c].name.clone()).collect();
    let matters = found.moved_m.is_some_and(|[moved, sigma]| moved > setting.limits.pattern_moves * sigma);
    let weight = if matters { Weight::Gate } else { Weight::Note };
    let steadied = steadied(fit, &found.step, setting);
    Some(HeldContradicted { parameters, deviate: found.deviate, moved_m: found.moved_m, steadied, weight })
}

impl Kind for HeldContradicted {
    fn code(&self) -> Code {
        Code::HeldContradicted
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        self.parameters.iter().cloned().map(Subject::Parameter).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        let moved = self.moved_m.map(|[moved, sigma]| Quantity::new("flange_moved", moved, "m").with_sigma(sigma));
        std::iter::once(Quantity::new("deviate", self.deviate, "1")).chain(moved).collect()
    }

    fn place(&self) -> String {
        "--fix".into()
    }

    fn seen(&self) -> String {
        let names: Vec<String> = self.parameters.iter().map(|name| short_name(name)).collect();
        let moved = self.moved_m.map_or_else(String::new, |[moved, sigma]| {
            format!(
                "; with all that is held free the flange moves by {:.3} mm RMS (stated sigma {:.3} mm)",
                1e3 * moved,
                1e3 * sigma
            )
        });
        let steadied = match self.steadied.as_slice() {
            [] => String::new(),
            mountings => format!("; the camera of {} is not loose then, as it seems to be", mountings.join(", ")),
        };
        format!(
            "the data contradict the values at which parameters are held ({:.0} standard deviations), most clearly of {}{moved}{steadied}",
            self.deviate,
            some_of(&names, MOST_NAMED)
        )
    }

    fn remedy(&self) -> String {
        "leave them out of --fix: they are estimated then; what is known of them is a [prior] with mean and sigma"
            .into()
    }
}
