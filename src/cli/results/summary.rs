//! The answer of `identify` and `show` in at most [`MOST_LINES`] lines: verdict, accuracy, what was left out, what to do, where it stands.
//! All else is in the long table (`-v`, `show --all`) and in the report.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::assess::Advice;
use crate::cli::terminal::paragraph::{WIDTH, indented, paragraph};
use crate::diagnose::Subject;
use crate::error::Code;
use crate::files::word;
use crate::output::parameter_words::MOST_NEXT;
use crate::output::solution_json::SolutionRecord;
use crate::output::verdict::{Trust, Verdict, VerdictReason};
use crate::output::{ALONE, CALIBRATED};
use crate::urdf::JointKind;

/// Most lines in all.
const MOST_LINES: usize = 12;

/// Most lines of why the result asks for a look.
const MOST_DOUBTS: usize = 4;

/// The answer; `folder` is that of the result, and `report` the file of its report.
pub fn text(record: &SolutionRecord, folder: &Path, report: &Path) -> String {
    let verdict = Verdict::of(record);
    let failed = verdict.trust == Trust::Failed;
    let mut figures = if failed { flange_in_brief(record) } else { flange(record) };
    figures.extend(held_out(record));
    figures.extend(left_out(record));
    let free = MOST_LINES.saturating_sub(figures.len() + 2);
    let least = match failed {
        true => verdict.reasons.len().min(free / 2),
        false => with_their_remedies(&verdict, free),
    };
    let next = next(record, &verdict, free.saturating_sub(least).min(MOST_NEXT));
    let reasons = reasons(&verdict, free.saturating_sub(next.len()));
    let mut lines = vec![headline(&verdict)];
    [reasons, figures, next].into_iter().for_each(|more| lines.extend(more));
    lines.push(results(record, report));
    if lines.len() < MOST_LINES {
        let file = folder.join(crate::output::solution_json::FILE_NAME);
        lines.push(indented("more", &format!("robotcal show --all {}", word(file.display()))));
    }
    lines.into_iter().map(|line| line + "\n").collect()
}

fn headline(verdict: &Verdict) -> String {
    format!("verdict   {}", in_words(verdict))
}

/// May it be used? In a few words.
pub fn in_words(verdict: &Verdict) -> String {
    let count = verdict.reasons.len();
    match verdict.trust {
        Trust::Good => "good".into(),
        Trust::Doubts if count == 1 => "good, with one doubt".into(),
        Trust::Doubts => format!("good, with {count} doubts"),
        Trust::Failed if count == 1 => "NOT TO BE TRUSTED: a check failed".into(),
        Trust::Failed => format!("NOT TO BE TRUSTED: {count} checks failed"),
    }
}

/// What was found; of a failed result the remedies stand under "next".
fn reasons(verdict: &Verdict, most: usize) -> Vec<String> {
    let words = |r: &&VerdictReason| if verdict.trust == Trust::Failed { r.what.clone() } else { with_remedy(r) };
    let mut all: Vec<&VerdictReason> = verdict.reasons.iter().collect();
    // A line is for what is not shown; what always is comes last before it.
    let shown = if all.len() > most { most.saturating_sub(1) } else { all.len() };
    let hidden = |k: usize, r: &VerdictReason| k >= shown && r.is_always_shown;
    let raised = (0..all.len()).filter(|&k| hidden(k, all[k])).count();
    let kept = shown.saturating_sub(raised);
    all[kept..].sort_by_key(|r| !r.is_always_shown);
    shared("          - ", &all.iter().map(words).collect::<Vec<_>>(), most)
}

/// What was found, and what to do about it.
pub(super) fn with_remedy(reason: &VerdictReason) -> String {
    match reason.remedy.as_str() {
        "" => reason.what.clone(),
        remedy => format!("{} ({remedy})", reason.what),
    }
}

/// Lines of what asks for a look: one for each at least, as many as they need where a line is left for what to do next.
fn with_their_remedies(verdict: &Verdict, free: usize) -> usize {
    let needed = reasons(verdict, MOST_DOUBTS.min(free.saturating_sub(1))).len();
    needed.max(verdict.reasons.len().min(MOST_DOUBTS))
}

/// Several things in `most` lines, at least one for each, the first ones in full; those that find no room are counted.
fn shared(first: &str, all: &[String], most: usize) -> Vec<String> {
    let shown = if all.len() > most { most.saturating_sub(1) } else { all.len() };
    let mut lines: Vec<String> = Vec::new();
    for (k, words) in all.iter().take(shown).enumerate() {
        let others = all.len().min(shown + 1) - k - 1;
        lines.extend(paragraph(first, words, most - lines.len() - others));
    }
    let more = (all.len() > shown && most > 0).then(|| format!("{first}{} more: see the report", all.len() - shown));
    lines.into_iter().chain(more).collect()
}

/// Expected error of the flange, before and after.
fn flange(r: &SolutionRecord) -> Vec<String> {
    let Some(e) = &r.flange else { return Vec::new() };
    let row = |what: &str, m: f64, interval: Option<[f64; 2]>| {
        let told = interval.map_or(String::new(), |[low, high]| format!("  ({:.3} to {:.3})", 1e3 * low, 1e3 * high));
        format!("          {what:<24} {:>7.3} mm{told}", 1e3 * m)
    };
    let told = if e.intervals.is_some() { " (95 % interval)" } else { "" };
    let i = e.intervals.as_ref();
    let (alone_m, of_alone) = e.best_urdf_m();
    let at = if r.has_no_robot() { r.flange_holds() } else { "in the range of the stops" };
    let mut lines = vec![format!("accuracy  expected flange error {at}, RMS{told}:")];
    if r.has_no_robot() {
        lines.push(row("poses of the controller", alone_m, of_alone));
    } else {
        lines.push(row("nominal robot", e.nominal_m, i.map(|i| i.nominal_m)));
        lines.push(row("corrected URDF alone", alone_m, of_alone));
    }
    if r.beyond_urdf() {
        lines.push(row("with compensation.toml", e.model_m, i.map(|i| i.model_m)));
    }
    lines.extend(e.without_size_doubt.map(|doubt| {
        format!(
            "          without the size of the plate, in doubt by {:.2} %: every length is off by as much if it is",
            100.0 * doubt
        )
    }));
    lines
}

/// The same in a line, for a result that is not to be trusted.
fn flange_in_brief(r: &SolutionRecord) -> Vec<String> {
    let Some(e) = &r.flange else { return Vec::new() };
    let whole =
        if r.beyond_urdf() { format!(", {:.3} with compensation.toml", 1e3 * e.model_m) } else { String::new() };
    let (alone_mm, nominal_mm) = (1e3 * e.best_urdf_m().0, 1e3 * e.nominal_m);
    let words = match r.has_no_robot() {
        true => format!("not valid: flange {alone_mm:.3} mm at the poses of the stops, by the controller"),
        false => format!("not valid: flange {nominal_mm:.3} mm nominal, {alone_mm:.3} URDF{whole}"),
    };
    vec![indented("accuracy", &words)]
}

/// How well unseen images are predicted.
fn held_out(r: &SolutionRecord) -> Vec<String> {
    let [before, after] = [&r.accuracy.nominal, &r.accuracy.calibrated].map(|e| e.rms_mm);
    let what = if r.images.is_empty() { "at stops" } else { "on the plate, in images" };
    let change = if r.has_no_robot() { String::new() } else { format!("{before:.3} -> ") };
    let words = format!("{change}{after:.3} mm {what} that the fit had not seen");
    vec![indented("held out", &words)]
}

/// Images and observations that took no part, counted by reason.
fn left_out(r: &SolutionRecord) -> Vec<String> {
    let mut reasons: BTreeMap<Code, Vec<&str>> = BTreeMap::new();
    let exchanged = |name: &str| {
        let mut found = r.findings.iter().filter(|f| f.code == Code::ReadingsExchanged);
        found.any(|f| f.subject.contains(&Subject::Image(name.to_owned())))
    };
    for (name, rejection) in r.images.iter().filter_map(|i| Some((&i.name, i.rejection()?))) {
        let code = if exchanged(name) { Code::ReadingsExchanged } else { rejection.code() };
        reasons.entry(code).or_default().push(name);
    }
    let out: usize = reasons.values().map(Vec::len).sum();
    let named: Vec<String> = reasons.iter().map(|(code, names)| reason(r, *code, names)).collect();
    let why = if named.is_empty() { String::new() } else { format!(" ({})", named.join(", ")) };
    let s = &r.statistics;
    let b = &r.bodies.measurements;
    let of_bodies = format!("{} of {} measurements", r.bodies.left_out(), b.len());
    if r.images.is_empty() {
        return vec![indented("left out", &of_bodies)];
    }
    let bodies = if b.is_empty() { String::new() } else { format!(", {of_bodies}") };
    let words = format!(
        "{out} of {} images{why}, {} of {} observations{bodies}",
        r.images.len(),
        s.observations_left_out,
        s.observations_left_out + s.observations_used
    );
    paragraph("left out  ", &words, 2)
}

/// Images of one reason, the first few by name.
fn reason(r: &SolutionRecord, code: Code, names: &[&str]) -> String {
    let more = if names.len() > MOST_NAMED { ", .." } else { "" };
    let spoken = if code == Code::ReadingsExchanged { with_exchanged_rows(r) } else { spoken(code) };
    format!("{} {spoken}: {}{more}", names.len(), names[..names.len().min(MOST_NAMED)].join(", "))
}

/// Images left out for one reason that are named.
const MOST_NAMED: usize = 3;

/// Images whose rows are exchanged, in the table of which all that is found says so.
fn with_exchanged_rows(r: &SolutionRecord) -> String {
    let found = r.findings.iter().filter(|f| f.code == Code::ReadingsExchanged);
    let places: BTreeSet<&str> = found.filter_map(|f| f.text.split_once(": ").map(|(place, _)| place)).collect();
    match places.first().filter(|place| places.len() == 1 && place.ends_with(".csv")) {
        Some(table) => format!("with exchanged rows of {table}"),
        None => "in each other's place".into(),
    }
}

/// A code as it is spoken of images, behind their number.
fn spoken(code: Code) -> String {
    match code {
        Code::WronglyPaired => "wrongly paired".into(),
        Code::ImageDuplicate => "shown by others as well".into(),
        Code::ImageSizeDiffers => "of another size".into(),
        Code::MarkersTooFew => "with too few markers".into(),
        Code::ImageContradictory => "contradicting the others".into(),
        other => other.name().trim_start_matches("image_").replace('_', " "),
    }
}

/// Remedies of a failed result, else what would help most; the most useful first.
fn next(r: &SolutionRecord, verdict: &Verdict, most: usize) -> Vec<String> {
    if !verdict.remedies.is_empty() {
        return shared("next      ", &verdict.remedies, most);
    }
    let mastering = r.offsets_in_mastering.then(|| ENTER_MASTERING.to_owned());
    let size = r.hangs_on_a_stated_size().then(|| MEASURE_THE_PLATE.to_owned());
    let stops = r.identifiability.iter().flat_map(|found| &found.next).map(|a| advice(r, a));
    mastering.into_iter().chain(size).chain(stops).map(|words| indented("next", &words)).take(most).collect()
}

/// Where joint offsets are not in the corrected URDF.
const ENTER_MASTERING: &str = "enter in the controller the offsets of mastering.csv with in_urdf = no";

/// Where its size stands in its file alone.
const MEASURE_THE_PLATE: &str = "measure the plate ([scale]): 0.1 % off adds 1 mm a metre to the above";

/// A stop to add, in a line.
fn advice(r: &SolutionRecord, a: &Advice) -> String {
    let reading = r.robot.readings.iter().position(|name| *name == a.joint);
    let slides = reading.is_some_and(|k| r.robot.reading_kinds[k] == JointKind::Prismatic);
    let (factor, unit) = if slides { (1e3, "mm") } else { (1f64.to_degrees(), "deg") };
    let [near, low, high] = [a.near, a.covered.0, a.covered.1].map(|q| factor * q);
    let so_far = match a.gap.map(|(below, above)| (factor * below, factor * above)) {
        Some((below, above)) => format!(" (none from {below:.0} to {above:.0})"),
        None => format!(" (so far {low:.0} to {high:.0})"),
    };
    let line = |so_far: &str| {
        format!("stops with {} near {near:.0} {unit}{so_far}: {:.0} % less unknown", a.joint, 100.0 * a.gain)
    };
    let whole = line(&so_far);
    if indented("next", &whole).chars().count() > WIDTH { line("") } else { whole }
}

/// Where all of it stands.
fn results(r: &SolutionRecord, report: &Path) -> String {
    let report = indented("report", &report.display().to_string());
    let urdf = [ALONE, CALIBRATED].into_iter().find_map(|end| Some((r.file_ending_with(end)?, end)));
    let names = urdf.into_iter().flat_map(|(name, end)| [format!("; robot: {name}"), format!("; robot: *{end}")]);
    let beside = names.map(|name| format!("{report}{name}")).find(|line| line.len() <= WIDTH);
    beside.unwrap_or(report)
}
