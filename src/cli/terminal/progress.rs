//! A progress bar on a terminal, nothing elsewhere.

use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::sync::{LazyLock, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

/// How often a line is drawn anew.
const EVERY: Duration = Duration::from_millis(250);

/// Set where no progress is wanted.
static QUIET: OnceLock<()> = OnceLock::new();

/// All lines, one below the other.
static ALL: LazyLock<MultiProgress> = LazyLock::new(|| {
    let hidden = QUIET.get().is_some() || !std::io::stderr().is_terminal();
    MultiProgress::with_draw_target(if hidden { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() })
});

/// Shows no progress from now on; to be said before the first is shown.
pub fn silence() {
    let _ = QUIET.set(());
}

/// A line that says for how long something has been going on.
pub fn line(what: &str) -> ProgressBar {
    let line = ALL.add(ProgressBar::new_spinner());
    if let Ok(style) = ProgressStyle::with_template("{msg:>24} {elapsed}") {
        line.set_style(style);
    }
    line.set_message(what.to_owned());
    if !ALL.is_hidden() {
        line.enable_steady_tick(EVERY);
    }
    line
}

/// A bar over `length` steps; hidden where stderr is no terminal.
pub fn bar(length: usize, what: &str) -> ProgressBar {
    let bar = ALL.add(ProgressBar::new(length as u64));
    if let Ok(style) = ProgressStyle::with_template("{msg:>24} [{bar:30}] {pos}/{len} {elapsed}") {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.set_message(what.to_owned());
    bar
}

/// A bar for every series whose images are looked at.
pub fn of_series() -> impl Fn(&str, usize) + Sync {
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
