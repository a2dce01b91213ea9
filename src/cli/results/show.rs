//! `robotcal show`: a solution printed again, or two solutions against each other.

use std::path::{Path, PathBuf};

use clap::Args;

use super::at::AtArgs;
use super::{long_table, summary};
use crate::cli::Verdict;
use crate::cli::terminal::say::{say, say_line};
use crate::cli::terminal::stages;
use crate::error::{Code, Error, Notice, Result};
use crate::files::{self, FileKind};
use crate::output::difference::{Difference, compare_solutions};
use crate::output::solution_json::{self, SolutionRecord};
use crate::output::verdict;
use crate::output::{REPORT, ResultFolder, Thumbnails, figure_files, is_changed, recover, report_html};
use crate::urdf::JointKind;

/// Flags of `show`.
#[derive(Debug, Args)]
pub struct ShowArgs {
    /// solution.json, or the folder that holds it; a second one is compared with it over the workspace
    #[arg(value_name = "SOLUTION", required = true, num_args = 1..=2)]
    solutions: Vec<PathBuf>,
    /// Print the long table: everything that was found, and what was left out
    #[arg(long)]
    all: bool,
    /// Print every parameter with sigma, prior and share of data
    #[arg(long)]
    parameters: bool,
    /// Print the solution as JSON and nothing else
    #[arg(long, conflicts_with_all = ["all", "parameters", "at"])]
    json: bool,
    /// Write report.html again to this file, with pictures of the images that are still there
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Write the figures of the report to this folder as SVG files
    #[arg(long, value_name = "FOLDER")]
    figures: Option<PathBuf>,
    /// Folder for at.csv
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    out: PathBuf,
    #[command(flatten)]
    at: AtArgs,
}

/// The file of a solution: that of a folder of results, where it is one.
pub fn solution_file(path: &Path) -> PathBuf {
    if path.is_dir() { path.join(solution_json::FILE_NAME) } else { path.to_path_buf() }
}

/// Reads a solution: the file, or that of a folder of results.
pub fn read_solution(path: &Path) -> Result<SolutionRecord> {
    read_solution_with_bytes(path).map(|(record, _)| record)
}

/// As [`read_solution`], with the bytes of the file.
pub(super) fn read_solution_with_bytes(path: &Path) -> Result<(SolutionRecord, Vec<u8>)> {
    let path = &solution_file(path);
    recover(path)?;
    let bytes = files::read(path, FileKind::Solution)?;
    let record = solution_json::read(&bytes).map_err(|e| Error {
        place: e.place.replacen(solution_json::FILE_NAME, &path.display().to_string(), 1),
        ..e
    })?;
    if is_changed(path, &bytes) {
        tracing::warn!("{}", changed(path).coded());
    }
    Ok((record, bytes))
}

fn changed(path: &Path) -> Notice {
    let what =
        "is not the file that robotcal wrote to this folder: it was changed since, or copied here from another result";
    let remedy =
        "where nobody knows why, run identify again: what follows from a changed solution is not known to be right";
    Notice::new(Code::SolutionDamaged, path.display(), what, remedy)
}

pub fn run(args: &ShowArgs) -> Result<Verdict> {
    let first = read_solution(&args.solutions[0])?;
    if let Some(second) = args.solutions.get(1) {
        return compare(args, &first, &read_solution(second)?);
    }
    let at = args.at.table_for(&first)?;
    if let Some(file) = &args.report {
        let page = report_html(&first, &Thumbnails::of_files(first.photogrammetry()));
        let name = file.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let folder = files::folder_of(file);
        let place = ResultFolder::among(folder)?.named_by("--report");
        place.write_beside(&[(name, page.as_bytes())], &args.solutions)?;
    }
    if let Some(folder) = &args.figures {
        let all = figure_files(&first);
        let files: Vec<(String, &[u8])> = all.iter().map(|f| (f.name.clone(), f.svg.as_bytes())).collect();
        ResultFolder::among(folder)?.named_by("--figures").write_beside(&files, &args.solutions)?;
    }
    if args.json {
        say!("{}", String::from_utf8_lossy(&solution_json::to_bytes(&first)?));
        return Ok(verdict_of(&first));
    }
    let given = args.solutions[0].as_path();
    let folder = if given.is_dir() { given } else { given.parent().unwrap_or(Path::new("")) };
    match args.all || stages::are_told() {
        true => say!("{}", long_table::text(&first)),
        false => say!("{}", summary::text(&first, folder, args.report.as_deref().unwrap_or(&folder.join(REPORT)))),
    }
    if args.parameters {
        say!("{}", long_table::parameters(&first));
    }
    if let Some(at) = at {
        say!("{}", at.run(&first, &args.out)?);
    }
    Ok(verdict_of(&first))
}

fn verdict_of(r: &SolutionRecord) -> Verdict {
    if r.failed_gates.is_empty() { Verdict::Good } else { Verdict::GateFailed }
}

/// Regions in which flanges are compared.
const COVERED: &str = "in the region of the stops";
const EVERYWHERE: &str = "within all joint limits";

fn compare(args: &ShowArgs, a: &SolutionRecord, b: &SolutionRecord) -> Result<Verdict> {
    let found = compare_solutions(a, b)?;
    say_line!("first     {}", args.solutions[0].display());
    say_line!("second    {}", args.solutions[1].display());
    say_line!(
        "flange    distance of the flange between the two models, base frames and a point of the flange brought together:"
    );
    match &found.covered {
        Some(d) => print_difference(COVERED, d, a),
        None => say_line!("          their stops have no region in common"),
    }
    print_difference(EVERYWHERE, &found.everywhere, a);
    let apart = |(name, (zero, kind)): (&String, (&f64, &JointKind))| {
        let [_, unit] = kind.units();
        (*zero != 0.0).then(|| format!("{name} {:+.3} {unit}", 1e3 * zero))
    };
    let kinds = &a.robot.reading_kinds;
    let zeros: Vec<String> = a.robot.readings.iter().zip(found.zeros.iter().zip(kinds)).filter_map(apart).collect();
    if !zeros.is_empty() {
        say_line!(
            "zeros     the two corrected URDFs take different joint angles (mastering.csv): one posture reads {} more for the second; do not exchange them",
            zeros.join(", ")
        );
    }
    if !found.disagrees() {
        say_line!("differ    neither the flange nor a parameter of the robot differs by more than 3 sigmas");
    }
    for (region, d) in found.covered.iter().map(|d| (COVERED, d)).chain([(EVERYWHERE, &found.everywhere)]) {
        if let Some(sigmas) = d.sigmas().filter(|_| d.disagrees()) {
            say_line!("differ    the flange {region}: {:.3} mm RMS, {sigmas:.1} sigmas", 1e3 * d.rms_m);
        }
    }
    for (name, x, y, sigmas) in &found.parameters {
        say_line!("differ    {name}: {x:.3e} and {y:.3e}, {sigmas:.1} sigmas");
    }
    let words = |r: &SolutionRecord| summary::in_words(&verdict::Verdict::of(r));
    for (what, r) in [("first", a), ("second", b)] {
        say_line!("accuracy  {what}: {:.3} mm held out ({})", r.accuracy.calibrated.rms_mm, words(r));
    }
    Ok(Verdict::Good)
}

fn print_difference(region: &str, d: &Difference, a: &SolutionRecord) {
    let stated = d.stated_m.map_or(String::new(), |s| format!(", stated sigma of both {:.3} mm", 1e3 * s));
    say_line!(
        "          {region}: {:.3} mm RMS, worst {:.3} mm over {} places{stated}",
        1e3 * d.rms_m,
        1e3 * d.worst_m,
        d.places
    );
    let at: Vec<String> = (d.worst_at.iter().zip(&a.robot.readings).zip(&a.robot.reading_kinds))
        .map(|((q, name), kind)| match kind {
            JointKind::Prismatic => format!("{name} {:.0} mm", 1e3 * q),
            _ => format!("{name} {:.0} deg", q.to_degrees()),
        })
        .collect();
    say_line!("          worst at {}", at.join(", "));
}
