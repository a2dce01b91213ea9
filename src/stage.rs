//! Stages of a long piece of work, told to whoever watches: a span of `tracing` each, which costs nothing where nobody does.

use tracing::span::EnteredSpan;

/// Target of the spans.
pub const TARGET: &str = "robotcal::stage";

/// Field of the spans that says what is done.
pub const NAME: &str = "of";

/// Begins a stage, which ends when what is returned is dropped. Stages within stages are parts of them.
pub fn stage(name: &'static str) -> EnteredSpan {
    tracing::info_span!(target: TARGET, "stage", of = name).entered()
}
