//! What statements that are no known moves do with points.

use super::value::Node;

/// What a statement that is no known move does with a point.
#[derive(Debug, Clone)]
pub(super) struct Use {
    /// Its first word.
    pub by: String,
    /// What it does.
    pub does: Does,
}

/// What a statement does with a point.
#[derive(Debug, Clone)]
pub(super) enum Does {
    /// Perhaps it goes there, with the tool and the work object that it names.
    Go { tool: Option<String>, work: Option<Node> },
    /// It computes something else with it.
    Compute,
}
