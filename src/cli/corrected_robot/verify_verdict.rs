//! What speaks for a model and what against it, and the verdict.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Vector3;

use super::verify_stated::{Expectation, Stated};
use crate::assess::{Limits, NORMAL_95, Ratio};
use crate::cli::Verdict;
use crate::cli::terminal::say::{self, say_line};
use crate::diagnose::{Finding, Weight};
use crate::error::Code;
use crate::model::robot::Robot;
use crate::output::corrections::FileFinding;
use crate::urdf::JointKind;

/// Everything that counts.
#[derive(Default)]
pub(super) struct Reasons {
    pub findings: Vec<FileFinding>,
    pub against: Vec<String>,
    pub doubts: Vec<String>,
    pub good: Vec<String>,
}

/// A model in a measurement.
pub(super) struct Measured<'a> {
    pub urdf: &'a Path,
    /// What it misses, m.
    pub rms_m: f64,
    /// What its solution states here.
    pub stated: Option<(&'a Stated, Expectation)>,
    /// Beside the nominal robot, where one is given.
    pub gain: Option<Gain<'a>>,
}

/// The error over that of the nominal robot.
pub(super) struct Gain<'a> {
    pub ratio: Ratio,
    pub nominal: &'a Robot,
    /// What was measured: points or images.
    pub of: &'static str,
    /// Readings of each of them, and a point of the tip that is about as far from it as what was measured, m.
    pub at: (Vec<Vec<f64>>, Vector3<f64>),
}

/// Parameters that every fit takes up, in values of what was measured: nine of points are three.
const FITTED: f64 = 3.0;

impl Gain<'_> {
    fn share(&self) -> String {
        let Ratio { value, low, high } = self.ratio;
        format!("{:.0} % of the nominal error ({:.0} to {:.0} %)", 100.0 * value, 100.0 * low, 100.0 * high)
    }

    /// How many of what was measured tell two models apart that differ by so much, where the better one misses so much: by the 95 % interval of
    /// the ratio, each of one degree of freedom.
    fn needed(apart_m: f64, rms_m: f64, limits: &Limits) -> f64 {
        let gain = 0.5 * (apart_m / rms_m).powi(2).ln_1p();
        (FITTED + (NORMAL_95 / gain).powi(2)).ceil().max(limits.scatter_images as f64)
    }

    /// What the measurement does not tell: the model may as well be better as worse, or differs from the nominal robot here by less than it is
    /// expected to miss, so that either may come nearer by chance.
    fn not_told(
        &self,
        (urdf, rms_m): (&Path, f64),
        (stated, expected): (&Stated, &Expectation),
        limits: &Limits,
    ) -> Option<FileFinding> {
        let Self { nominal, of, at: (readings, on_tip), ratio } = self;
        if ratio.high < 1.0 {
            return None;
        }
        let [here_m, at_stops_m] = stated.apart_from(nominal, on_tip, readings)?;
        if ratio.low >= 1.0 && here_m >= expected.rms_m {
            return None;
        }
        let needed = Self::needed(at_stops_m, rms_m, limits);
        let [here, at_stops, mm] = [here_m, at_stops_m, rms_m].map(|m| 1e3 * m);
        let text = format!(
            "{}: these {of} do not tell {} from the nominal robot. With what is fitted to them the two differ by {here:.3} mm here, beside {mm:.3} mm \
             that the model misses, and by {at_stops:.3} mm at the stops of the series in {}: measure {needed:.0} {of} or more that are spread like \
             those, in position and in hand orientation",
            self.share(),
            urdf.display(),
            stated.path.display()
        );
        let quantities =
            [("differ_here_mm", here), ("differ_at_stops_mm", at_stops), ("rms_mm", mm), ("needed", needed)];
        needed
            .is_finite()
            .then(|| FileFinding::new(Code::ModelsNotTold, Weight::Note, urdf.display(), quantities, text))
    }
}

impl Reasons {
    /// The error of a model, over that of the nominal robot and beside what is stated of it.
    pub fn add(&mut self, measured: &Measured, limits: &Limits) {
        let Measured { urdf, rms_m, stated, gain } = measured;
        let exceeded = stated.as_ref().and_then(|(s, expected)| exceeded((urdf, *rms_m), &s.path, *expected, limits));
        if let Some(gain) = gain {
            // Where the model misses no more than it should, it is no worse than it says.
            let within = stated.as_ref().filter(|_| exceeded.is_none());
            match within.and_then(|(s, expected)| gain.not_told((urdf, *rms_m), (s, expected), limits)) {
                Some(not_told) => self.findings.push(not_told),
                None => self.add_gain(gain, limits),
            }
        }
        match stated {
            Some((_, expected)) => {
                if exceeded.is_none() {
                    let [mm, rms, most] = [*rms_m, expected.rms_m, expected.most_m].map(|m| 1e3 * m);
                    self.good
                        .push(format!("{mm:.3} mm, and its solution states {rms:.3} mm here, at most {most:.3} mm"));
                }
                self.findings.extend(exceeded);
            }
            None if gain.is_some() => {}
            None => self.add_unstated((urdf, 1e3 * rms_m), limits),
        }
    }

    fn add_gain(&mut self, gain: &Gain, limits: &Limits) {
        let share = gain.share();
        match () {
            () if gain.ratio.high >= 1.0 && gain.ratio.value < 1.0 => {
                self.against.push(format!("{share}, which these {} do not tell from no gain", gain.of));
            }
            () if gain.ratio.high >= 1.0 => self.against.push(share),
            () if gain.ratio.value * limits.doubtful_gain > 1.0 => {
                self.doubts.push(format!("{share}, hardly worth installing"));
            }
            () => self.good.push(share),
        }
    }

    /// Where nothing is stated of the error, and no nominal robot is there to compare with: beside what robots miss by.
    fn add_unstated(&mut self, (urdf, mm): (&Path, f64), limits: &Limits) {
        let usual_mm = limits.flange_sigma_mm;
        if mm > usual_mm {
            let text = format!(
                "{} misses by {mm:.3} mm RMS, as robots do that nobody corrected ({usual_mm} mm and more): another robot, a zero or link that changed, or no corrected description; give --nominal to compare with",
                urdf.display()
            );
            self.findings.push(FileFinding::new(
                Code::NotCorrected,
                Weight::Gate,
                urdf.display(),
                [("rms_mm", mm)],
                text,
            ));
        } else {
            self.good.push(format!(
                "{mm:.3} mm, less than the {usual_mm} mm of robots that nobody corrected (--nominal tells what was gained)"
            ));
        }
    }

    /// The measurement is one that the solution was fitted to.
    pub fn add_own(&mut self, urdf: &Path, stated: &Stated) {
        let text = format!(
            "{} was fitted to these very measurements ({}): that it fits them proves nothing; take others",
            urdf.display(),
            stated.path.display()
        );
        self.findings.push(FileFinding::new(Code::OwnMeasurement, Weight::Note, urdf.display(), [], text));
    }

    /// True where the model misses by more than it should.
    pub fn misses(&self) -> bool {
        self.has(Code::StatedExceeded) || self.has(Code::NotCorrected)
    }

    /// True where it cannot be trusted.
    pub fn is_bad(&self) -> bool {
        !self.against.is_empty() || self.findings.iter().any(|f| f.weight == Weight::Gate)
    }

    fn has(&self, code: Code) -> bool {
        self.findings.iter().any(|f| f.code == code)
    }

    /// Says all of it.
    pub fn verdict(self) -> Verdict {
        say::findings(&self.findings);
        let mut gates: Vec<&str> = Vec::new();
        for finding in self.findings.iter().filter(|f| f.weight == Weight::Gate) {
            if !gates.contains(&finding.code.name()) {
                gates.push(finding.code.name());
            }
        }
        let is_own = self.has(Code::OwnMeasurement);
        let doubts = [
            Code::StatedExceeded,
            Code::ModelsNotTold,
            Code::SolutionDiffers,
            Code::SolutionUntrusted,
            Code::PlateSizeContradicted,
        ];
        let doubt = doubts.into_iter().find(|code| self.has(*code));
        let is_doubted = doubt.is_some() || !self.doubts.is_empty();
        let is_bad = self.is_bad();
        let word = match () {
            () if is_bad => "NOT TO BE TRUSTED",
            () if is_own => "nothing is proved",
            () if is_doubted => "good with doubts",
            () => "good",
        };
        let codes = if gates.is_empty() { doubt.map(|code| code.name().to_owned()) } else { Some(gates.join(", ")) };
        let why: Vec<String> = codes.into_iter().chain(self.against).chain(self.doubts).chain(self.good).collect();
        say_line!("verdict   {word}: {}", why.join("; "));
        if is_bad { Verdict::GateFailed } else { Verdict::Good }
    }
}

/// More than a right model misses by, as far beyond that as a good robot repeats.
pub(super) fn exceeded(
    (urdf, rms_m): (&Path, f64),
    solution: &Path,
    expected: Expectation,
    limits: &Limits,
) -> Option<FileFinding> {
    let times = rms_m / expected.most_m.hypot(limits.displaced_m);
    let [mm, rms, most] = [rms_m, expected.rms_m, expected.most_m].map(|m| 1e3 * m);
    let text = format!(
        "{} misses by {mm:.3} mm RMS, and {} states {rms:.3} mm here, at most {most:.3} mm: the robot is not what was identified, or the measurement is worse than it looks; see what changed since then (a zero after a crash or new mastering, the tool), or during it (plate, camera, tracker), and identify again",
        urdf.display(),
        solution.display()
    );
    let weight = if times > limits.beyond_stated { Weight::Gate } else { Weight::Note };
    let quantities = [("rms_mm", mm), ("stated_mm", rms), ("stated_most_mm", most)];
    (times > 1.0).then(|| FileFinding::new(Code::StatedExceeded, weight, urdf.display(), quantities, text))
}

/// A finding about the series of the measurement, where it tells why a model misses.
pub(super) fn of_series(found: &Finding) -> Option<FileFinding> {
    let (weight, text) = match found {
        Finding::ZeroMoved(zero) => {
            let unit = if zero.kind == JointKind::Prismatic { "mm" } else { "mrad" };
            let [offset, sigma] = [zero.offset.0, zero.offset.1].map(|v| 1e3 * v);
            let text = format!(
                "series {}: with the model held, most of what it misses is the zero of {}, off by {offset:+.3} {unit} (sigma {sigma:.3}): mastered anew, or encoder or belt slipped",
                zero.series, zero.joint
            );
            (Weight::Note, text)
        }
        Finding::Displaced(_) | Finding::LooseMounting(_) | Finding::FocusChange(_) | Finding::BodyMoved(_)
            if found.fails() =>
        {
            (Weight::Gate, format!("{}; {}", found.seen(), found.remedy()))
        }
        _ => return None,
    };
    let series = found.notice().place;
    Some(FileFinding { code: found.code(), weight, subject: series, quantities: numbers_of(found), text })
}

/// Its numbers by name, the unit at the end of the name.
pub(super) fn numbers_of(found: &Finding) -> BTreeMap<String, f64> {
    found.quantities().into_iter().map(|q| (format!("{}_{}", q.name, q.unit), q.value)).collect()
}
