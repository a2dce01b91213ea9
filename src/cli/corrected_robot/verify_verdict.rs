//! What speaks for a model and what against it, and the verdict.

use std::path::Path;

use super::verify_stated::{Expectation, Stated};
use crate::assess::{Limits, Ratio};
use crate::cli::Verdict;
use crate::cli::terminal::say::{self, say_line};
use crate::diagnose::{Finding, Weight};
use crate::error::Code;
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

impl Reasons {
    /// The error over that of the nominal robot; `of` says what does not tell them apart.
    pub fn add_gain(&mut self, Ratio { value, low, high }: Ratio, of: &str, limits: &Limits) {
        let share =
            format!("{:.0} % of the nominal error ({:.0} to {:.0} %)", 100.0 * value, 100.0 * low, 100.0 * high);
        match () {
            () if high >= 1.0 && value < 1.0 => {
                self.against.push(format!("{share}, which these {of} do not tell from no gain"));
            }
            () if high >= 1.0 => self.against.push(share),
            () if value * limits.doubtful_gain > 1.0 => self.doubts.push(format!("{share}, hardly worth installing")),
            () => self.good.push(share),
        }
    }

    /// The error beside what is stated of it; where nothing is, and no nominal robot is there to compare with, beside what robots miss by.
    pub fn add_error(
        &mut self,
        (urdf, rms_m): (&Path, f64),
        stated: Option<(&Stated, Expectation)>,
        has_nominal: bool,
        limits: &Limits,
    ) {
        let usual_mm = limits.flange_sigma_mm;
        let mm = 1e3 * rms_m;
        match stated {
            Some((stated, expected)) => {
                let exceeded = exceeded((urdf, rms_m), &stated.path, expected, limits);
                if exceeded.is_none() {
                    let [rms, most] = [expected.rms_m, expected.most_m].map(|m| 1e3 * m);
                    self.good.push(format!("{mm:.3} mm, and its solution states {rms:.3} mm here, at most {most:.3} mm"));
                }
                self.findings.extend(exceeded);
            }
            None if has_nominal => {}
            None if mm > usual_mm => {
                let text = format!(
                    "{} misses by {mm:.3} mm RMS, as robots do that nobody corrected ({usual_mm} mm and more): another robot, a zero or link that changed, or no corrected description; give --nominal to compare with",
                    urdf.display()
                );
                self.findings.push(FileFinding::new(Code::NotCorrected, Weight::Gate, urdf.display(), [("rms_mm", mm)], text));
            }
            None => self.good.push(format!(
                "{mm:.3} mm, less than the {usual_mm} mm of robots that nobody corrected (--nominal tells what was gained)"
            )),
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

    fn has(&self, code: Code) -> bool {
        self.findings.iter().any(|f| f.code == code)
    }

    /// Says all of it.
    pub fn verdict(self) -> Verdict {
        say::findings(&self.findings);
        let gates: Vec<&str> =
            self.findings.iter().filter(|f| f.weight == Weight::Gate).map(|f| f.code.name()).collect();
        let is_own = self.has(Code::OwnMeasurement);
        let doubt = self.has(Code::StatedExceeded).then(|| Code::StatedExceeded.name());
        let is_doubted = doubt.is_some() || !self.doubts.is_empty();
        let is_bad = !gates.is_empty() || !self.against.is_empty();
        let word = match () {
            () if is_bad => "NOT TO BE TRUSTED",
            () if is_own => "nothing is proved",
            () if is_doubted => "good with doubts",
            () => "good",
        };
        let codes = if gates.is_empty() { doubt.map(str::to_owned) } else { Some(gates.join(", ")) };
        let why: Vec<String> = codes.into_iter().chain(self.against).chain(self.doubts).chain(self.good).collect();
        say_line!("verdict   {word}: {}", why.join("; "));
        if is_bad { Verdict::GateFailed } else { Verdict::Good }
    }
}

/// More than a right model misses by, as far beyond that as a good robot repeats.
fn exceeded(
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
    let quantities = found.quantities().into_iter().map(|q| (format!("{}_{}", q.name, q.unit), q.value)).collect();
    Some(FileFinding { code: found.code(), weight, subject: series, quantities, text })
}
