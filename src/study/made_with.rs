//! What made a report.

/// The version of the program and, where its build was told it (`ROBOTCAL_COMMIT`), the commit: "robotcal 0.1.0, commit 1234abc".
pub fn made_with() -> String {
    let commit = option_env!("ROBOTCAL_COMMIT").map(|commit| format!(", commit {commit}")).unwrap_or_default();
    format!("robotcal {}{commit}", env!("CARGO_PKG_VERSION"))
}
