//! A finding as it stands in solution.json.

use serde::{Deserialize, Serialize};

use crate::diagnose::{Finding, Quantity, Subject, Weight};
use crate::error::Code;

/// A finding: what kind it is, what it is about, its numbers, and the sentence for it.
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
    /// In words.
    pub text: String,
}

impl From<&Finding> for FindingRecord {
    fn from(finding: &Finding) -> Self {
        Self {
            code: finding.code(),
            weight: finding.weight(),
            subject: finding.subjects(),
            quantities: finding.quantities(),
            text: finding.to_string(),
        }
    }
}
