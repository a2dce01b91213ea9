//! How a subcommand ended.

/// What a subcommand that ran to its end says of its result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Exit code 0.
    Good,
    /// Solved, but a named quality gate failed: exit code 1.
    GateFailed,
}
