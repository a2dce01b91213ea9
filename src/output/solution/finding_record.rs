//! A finding as it stands in solution.json.

use serde::{Deserialize, Serialize};

use crate::diagnose::{Finding, Quantity, Subject, Weight};
use crate::error::Code;

/// A finding: what kind it is, what it is about, its numbers, and what was seen and what to do in words.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FindingRecord {
    /// Stable name of its kind.
    pub code: Code,
    /// How much it weighs.
    pub weight: Weight,
    /// What it is about; empty where it is about the whole result.
    pub subject: Vec<Subject>,
    /// Its numbers.
    pub quantities: Vec<Quantity>,
    /// What was seen, and what to do, in one sentence.
    pub text: String,
    /// What was seen; empty in files of earlier versions.
    #[serde(default)]
    pub seen: String,
    /// What to do about it; empty where nothing is known, and in files of earlier versions.
    #[serde(default)]
    pub remedy: String,
}

impl From<&Finding> for FindingRecord {
    fn from(finding: &Finding) -> Self {
        Self {
            code: finding.code(),
            weight: finding.weight(),
            subject: finding.subjects(),
            quantities: finding.quantities(),
            text: finding.to_string(),
            seen: finding.seen(),
            remedy: finding.remedy(),
        }
    }
}
