//! A progress bar on a terminal, nothing elsewhere.

use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A bar over `length` steps; hidden where stderr is no terminal.
pub(super) fn bar(length: usize, what: &str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(length as u64), ProgressDrawTarget::stderr());
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    if let Ok(style) = ProgressStyle::with_template("{msg:>24} [{bar:30}] {pos}/{len} {elapsed}") {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.set_message(what.to_owned());
    bar
}

/// A bar for every series whose images are looked at.
pub(super) fn of_series() -> impl Fn(&str, usize) + Sync {
    let bars: Mutex<BTreeMap<String, ProgressBar>> = Mutex::default();
    move |name: &str, stops: usize| {
        let mut bars = bars.lock().unwrap_or_else(PoisonError::into_inner);
        let bar = bars.entry(name.to_owned()).or_insert_with(|| bar(stops, name));
        bar.inc(1);
        if bar.position() >= stops as u64 {
            bar.finish_and_clear();
        }
    }
}
