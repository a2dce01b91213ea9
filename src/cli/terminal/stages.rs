//! Stages of the work: a line on a terminal while they last, and how long each took.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use indicatif::ProgressBar;
use serde::Serialize;
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id};
use tracing::{Metadata, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::filter::filter_fn;
use tracing_subscriber::layer::Context;
use tracing_subscriber::registry::LookupSpan;

use super::progress;
use crate::stage;

/// How long a stage took.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Timing {
    /// What was done, after what it was a part of.
    stage: Vec<String>,
    /// By the clock, s.
    wall_s: f64,
    /// Of all processors together, s; none where the system does not tell.
    cpu_s: Option<f64>,
}

/// Stages that have ended, in their order.
static ENDED: Mutex<Vec<Timing>> = Mutex::new(Vec::new());

/// A stage that lasts.
struct Begun {
    path: Vec<String>,
    at: Instant,
    cpu_s: Option<f64>,
    /// What is drawn meanwhile.
    line: ProgressBar,
}

/// Hears of all stages.
struct Watch;

/// The layer of the log that hears of all stages.
pub fn layer<S: Subscriber + for<'a> LookupSpan<'a>>() -> impl Layer<S> {
    Watch.with_filter(filter_fn(|of: &Metadata| of.target() == stage::TARGET))
}

/// Whether the time of stages is wanted.
static TOLD: AtomicBool = AtomicBool::new(false);

/// Has the time of stages told.
pub fn tell() {
    TOLD.store(true, Ordering::Relaxed);
}

/// True where the time of stages is wanted.
pub fn are_told() -> bool {
    TOLD.load(Ordering::Relaxed)
}

/// The time of every stage that has ended, as JSON.
pub fn timings() -> Vec<u8> {
    let ended = ENDED.lock().unwrap_or_else(PoisonError::into_inner);
    serde_json::to_vec_pretty(&*ended).unwrap_or_default()
}

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for Watch {
    fn on_new_span(&self, attributes: &Attributes<'_>, id: &Id, context: Context<'_, S>) {
        let Some(span) = context.span(id) else { return };
        let whole = span.parent().and_then(|p| p.extensions().get::<Begun>().map(|b| b.path.clone()));
        let mut path = Path(whole.unwrap_or_default());
        attributes.record(&mut path);
        let line = progress::line(&path.0.join(": "));
        span.extensions_mut().insert(Begun { path: path.0, at: Instant::now(), cpu_s: cpu_s(), line });
    }

    fn on_close(&self, id: Id, context: Context<'_, S>) {
        let begun = context.span(&id).and_then(|span| span.extensions_mut().remove::<Begun>());
        let Some(Begun { path, at, cpu_s: before, line }) = begun else { return };
        line.finish_and_clear();
        let cpu_s = cpu_s().zip(before).map(|(now, before)| now - before);
        let timing = Timing { stage: path, wall_s: at.elapsed().as_secs_f64(), cpu_s };
        ENDED.lock().unwrap_or_else(PoisonError::into_inner).push(timing);
    }
}

/// Takes the name of a stage.
struct Path(Vec<String>);

impl Visit for Path {
    fn record_str(&mut self, field: &Field, value: &str) {
        if field.name() == stage::NAME {
            self.0.push(value.to_owned());
        }
    }

    fn record_debug(&mut self, _: &Field, _: &dyn std::fmt::Debug) {}
}

/// Time of all processors that the program has used, s.
#[cfg(target_os = "linux")]
fn cpu_s() -> Option<f64> {
    let used = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(used.tv_sec as f64 + 1e-9 * used.tv_nsec as f64)
}

#[cfg(not(target_os = "linux"))]
fn cpu_s() -> Option<f64> {
    None
}
