//! The verdict: may this result be used? Terminal and report say the same.

use crate::error::{Code, Notice};
use crate::output::poses_record::PosesRecord;
use crate::output::solution_json::SolutionRecord;

/// How far a result may be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trust {
    /// Nothing speaks against it.
    Good,
    /// It stands, and something asks for a look.
    Doubts,
    /// A quality gate failed.
    Failed,
}

/// What asks for a look, and the first thing to do about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VerdictReason {
    /// What was found.
    pub what: String,
    /// What to do; empty where nothing is known.
    pub remedy: String,
    /// True where it has a figure that is asked for wherever the result is used: it is shown however little room there is.
    pub is_always_shown: bool,
}

impl VerdictReason {
    fn new(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { what: what.into(), remedy: remedy.into(), is_always_shown: false }
    }
}

/// The verdict on a result with its reasons, the weightiest first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Verdict {
    /// May it be used?
    pub trust: Trust,
    /// Failed gates, or doubts; none of a good result.
    pub reasons: Vec<VerdictReason>,
    /// What to do before a failed result is tried again, the first thing first; none of any other.
    pub remedies: Vec<String>,
}

impl Verdict {
    /// Failed gates first, then what asks for care.
    pub fn of(record: &SolutionRecord) -> Self {
        if !record.failed_gates.is_empty() {
            let gates = record.failed_gates.iter().map(|gate| of_gate(record, gate));
            return Self::failed(gates.collect(), of_columns(&record.notices).chain(of_rows(record)));
        }
        Self::not_failed(noted(&record.notices).collect())
    }

    /// Of poses from images alone.
    pub fn of_poses(record: &PosesRecord) -> Self {
        let failed = record.failed().map(|f| VerdictReason::new(&f.seen, &f.remedy));
        let failed: Vec<VerdictReason> = failed.collect();
        if !failed.is_empty() {
            return Self::failed(failed, std::iter::empty());
        }
        Self::not_failed(noted(&record.notices).collect())
    }

    fn failed(reasons: Vec<VerdictReason>, others: impl Iterator<Item = String>) -> Self {
        let remedies = reasons.iter().map(|r| r.remedy.clone()).chain(others);
        let remedies = remedies.filter(|remedy| !remedy.is_empty()).collect();
        Self { trust: Trust::Failed, reasons, remedies }
    }

    fn not_failed(reasons: Vec<VerdictReason>) -> Self {
        let trust = if reasons.is_empty() { Trust::Good } else { Trust::Doubts };
        Self { trust, reasons, remedies: Vec::new() }
    }
}

/// An axis that moves and is not described may be the cause of what failed.
fn of_columns(notices: &[Notice]) -> impl Iterator<Item = String> + use<> {
    let moving: Vec<Notice> = notices.iter().filter(|n| n.code == Code::JointUnusedMoves).cloned().collect();
    Notice::said_once(&moving).into_iter().map(|n| format!("{}: {}: {}", n.place, n.what, n.remedy))
}

/// Rows of readings that stand beside the wrong images are to be put right whatever else failed, and a better lens that could not be fitted is
/// the likely cause of it.
fn of_rows(record: &SolutionRecord) -> impl Iterator<Item = String> {
    let is_cause = |code: Code| matches!(code, Code::ReadingsExchanged | Code::RowsShifted | Code::NotConverged);
    let exchanged = record.findings.iter().filter(move |f| is_cause(f.code));
    exchanged.map(|f| format!("{}: {}", f.seen, f.remedy))
}

/// The finding of a gate; of files of earlier versions its whole sentence.
fn of_gate(record: &SolutionRecord, sentence: &str) -> VerdictReason {
    let found = record.findings.iter().find(|f| f.text == sentence && !f.seen.is_empty());
    let (what, remedy) = found.map_or((sentence, ""), |f| (f.seen.as_str(), f.remedy.as_str()));
    VerdictReason::new(what, remedy)
}

/// Notices that ask for a look.
fn noted(notices: &[Notice]) -> impl Iterator<Item = VerdictReason> + use<> {
    let noted: Vec<Notice> = notices.iter().filter(|n| !is_information(n.code)).cloned().collect();
    let noted = Notice::said_once(&noted).into_iter();
    noted.map(|n| match n.code {
        // The figure first: lines are cut at their ends.
        Code::LensNotInRos => VerdictReason {
            is_always_shown: true,
            ..VerdictReason::new(format!("{} of {}", n.what, n.place), n.remedy)
        },
        _ => VerdictReason::new(format!("{}: {}", n.place, n.what), n.remedy),
    })
}

/// Notices that tell of a choice, of what is counted among the images left out, or of what every recording has between its stops, and cast no
/// doubt on the result.
fn is_information(code: Code) -> bool {
    matches!(
        code,
        Code::CovariatesUnused
            | Code::DictionaryGuessed
            | Code::FewGreyLevels
            | Code::FlatFieldLeftOut
            | Code::HotPixels
            | Code::ImageDelayFound
            | Code::ImageDelayUnchecked
            | Code::ImageNotThere
            | Code::ImageTurned
            | Code::MarkersBright
            | Code::MarkersSmoothed
            | Code::ImageUnlisted
            | Code::ImagesInMotion
            | Code::JointUnused
            | Code::JointUnusedMoves
            | Code::LensChosen
            | Code::ModelNotCompared
            | Code::ObservationsMissing
            | Code::PlatesAlike
            | Code::RepeatabilityUnused
            | Code::SecondArmRenamed
            | Code::TipChosen
            | Code::UrdfUnlimited
    )
}
