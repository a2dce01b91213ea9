//! A number of an error or a finding.

use serde::{Deserialize, Serialize};

/// A number of an error or a finding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Quantity {
    /// What it is.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its unit; 1 for a number without.
    pub unit: String,
    /// Its standard deviation, where it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
}

impl Quantity {
    /// A quantity without stated sigma.
    pub fn new(name: &str, value: f64, unit: &str) -> Self {
        Self { name: name.to_owned(), value, unit: unit.to_owned(), sigma: None }
    }

    /// With its standard deviation.
    #[must_use]
    pub fn with_sigma(self, sigma: f64) -> Self {
        Self { sigma: Some(sigma), ..self }
    }
}
