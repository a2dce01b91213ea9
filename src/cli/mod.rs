//! Flags, progress, one thin file per subcommand; the only room that prints.
//!
//! To add a subcommand: a file with its `Args` and `run` in one of the folders below, a variant of `Command` and a row in `Command::run`.
//!
//! Subcommands in the order of the work: `images` (plates and images, no robot), `series` (planned, simulated, converted, looked through), `results` (identified
//! and shown), `corrected_robot` (frames, programs and tests of what was identified). All of them take from `flags` and `terminal`.

mod corrected_robot;
mod examples;
mod flags;
mod images;
mod memory;
mod results;
mod series;
mod terminal;
mod verdict;

use std::io::{IsTerminal, Write};
use std::process::ExitCode;

use clap::error::{ContextKind, ContextValue};
use clap::{Parser, Subcommand};
use tracing_subscriber::filter::filter_fn;
use tracing_subscriber::prelude::*;

use crate::error::{Code, Error, Result, is_another_unit};
use corrected_robot::{compensate, frames, verify, verify_args};
use flags::arguments::command_text;
use images::{detect, plate, poses};
use results::{compare, identify, long_table, show, summary};
use series::{convert, doctor, plan, simulate};
use terminal::{progress, say, stages};
use verdict::Verdict;

/// Calibrates a robot, its camera and a plate of markers in one problem, directly from images.
#[derive(Parser)]
#[command(
    name = "robotcal",
    version,
    about,
    propagate_version = true,
    after_help = examples::START
)]
struct Cli {
    /// Say more: the long table of a result, and on stderr what is done (twice: everything); `identify` also writes the time of every stage (timings.json)
    #[arg(short, long, action = clap::ArgAction::Count, global = true, help_heading = "Everywhere")]
    verbose: u8,
    /// Show no progress
    #[arg(short, long, global = true, help_heading = "Everywhere")]
    quiet: bool,
    /// Threads for images (default: all cores; at most four for each core); the result does not depend on it
    #[arg(long, global = true, value_name = "N", help_heading = "Everywhere")]
    threads: Option<usize>,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// Compare two-stage estimators with the joint fit, on a series or in simulation
    #[command(after_help = examples::COMPARE)]
    Compare(compare::CompareArgs),
    /// Correct the targets of a robot program for the real robot, or move it to another robot
    #[command(after_help = examples::COMPENSATE)]
    Compensate(Box<compensate::CompensateArgs>),
    /// Turn a recording (MCAP, rosbag2) into a series folder, or a series folder into a recording
    #[command(after_help = examples::CONVERT)]
    Convert(convert::ConvertArgs),
    /// Find the plate in images and say what was found, what was dropped and why; needs no robot
    #[command(after_help = examples::DETECT)]
    Detect(Box<detect::DetectArgs>),
    /// Say what is missing in a series folder, before the long work
    #[command(after_help = examples::DOCTOR)]
    Doctor(doctor::DoctorArgs),
    /// Tool (TCP) and base or work object of an identified robot, from touches or tracker points
    #[command(after_help = examples::FRAMES)]
    Frames(Box<frames::FramesArgs>),
    /// Identify robot, camera, hand-eye transform and plate from one or more series
    #[command(after_help = examples::IDENTIFY)]
    Identify(identify::IdentifyArgs),
    /// Plan where to take images, and say what they will be worth
    #[command(after_help = examples::PLAN)]
    Plan(Box<plan::PlanArgs>),
    /// Design a plate of coded circles and draw it for printing
    #[command(after_help = examples::PLATE)]
    Plate(plate::PlateArgs),
    /// Camera, plate and camera poses from images alone; needs no robot and no joint values
    #[command(after_help = examples::POSES)]
    Poses(poses::PosesArgs),
    /// Print a solution again, or compare two over the workspace
    #[command(after_help = examples::SHOW)]
    Show(show::ShowArgs),
    /// Make a series of a robot with known errors, with images or observations
    #[command(after_help = examples::SIMULATE)]
    Simulate(Box<simulate::SimulateArgs>),
    /// Judge a corrected model by points that another device measured, or by another series
    #[command(after_help = examples::VERIFY)]
    Verify(verify_args::VerifyArgs),
}

impl Command {
    fn run(&self) -> Result<Verdict> {
        match self {
            Self::Compare(args) => compare::run(args),
            Self::Compensate(args) => compensate::run(args),
            Self::Convert(args) => convert::run(args),
            Self::Detect(args) => detect::run(args),
            Self::Doctor(args) => doctor::run(args),
            Self::Frames(args) => frames::run(args),
            Self::Identify(args) => identify::run(args),
            Self::Plan(args) => plan::run(args),
            Self::Plate(args) => plate::run(args),
            Self::Poses(args) => poses::run(args),
            Self::Show(args) => show::run(args),
            Self::Simulate(args) => simulate::run(args),
            Self::Verify(args) => verify::run(args),
        }
    }
}

/// What `show`, `show --all` and `show --parameters` print of a solution.
pub fn summary_of(record: &crate::output::solution_json::SolutionRecord) -> String {
    summary::text(record, std::path::Path::new(""), std::path::Path::new(crate::output::REPORT))
        + &long_table::text(record)
        + &long_table::parameters(record)
}

/// Runs the program with the arguments of the process.
pub fn main() -> ExitCode {
    let cli = Cli::try_parse().unwrap_or_else(|error| without_other_unit(error).exit());
    if let Some(code) = memory::in_a_child() {
        return code;
    }
    memory::abort_where_it_lacks();
    if cli.quiet {
        progress::silence();
    }
    if cli.verbose > 0 {
        stages::tell();
    }
    start_log(cli.verbose);
    memory::keep_freed();
    memory::set_threads(cli.threads);
    let Some(command) = cli.command else {
        say::say_line!("{}", examples::START);
        return ExitCode::SUCCESS;
    };
    let ended = command.run().and_then(|verdict| match say::failure() {
        Some(error) => Err(Error::new(
            Code::OutputFailed,
            "stdout",
            error,
            "check where the output goes; results that were named are written",
        )),
        None => Ok(verdict),
    });
    match ended {
        Ok(Verdict::Good) => ExitCode::SUCCESS,
        Ok(Verdict::GateFailed) => ExitCode::from(1),
        Err(error) => {
            // Nobody is left to hear that stderr is closed.
            let _ = writeln!(std::io::stderr(), "error[{}]: {error}", error.code);
            ExitCode::from(error.exit_code())
        }
    }
}

/// Without the tip that a unit may be meant by another one, which is spelt alike.
fn without_other_unit(mut error: clap::Error) -> clap::Error {
    let word = |kind| match error.get(kind) {
        Some(ContextValue::String(word)) => Some(word.as_str()),
        _ => None,
    };
    if let (Some(given), Some(tip)) = (word(ContextKind::InvalidValue), word(ContextKind::SuggestedValue))
        && is_another_unit(given, tip)
    {
        error.remove(ContextKind::SuggestedValue);
    }
    error
}

fn start_log(verbose: u8) {
    let level = match verbose {
        0 => tracing::Level::WARN,
        1 => tracing::Level::INFO,
        2 => tracing::Level::DEBUG,
        _ => tracing::Level::TRACE,
    };
    let from = move |m: &tracing::Metadata| m.level() <= &level && is_own(m.target());
    let words = tracing_subscriber::fmt::layer().with_ansi(std::io::stderr().is_terminal());
    let words = words.with_writer(std::io::stderr).with_target(verbose > 1).without_time();
    tracing_subscriber::registry().with(words.with_filter(filter_fn(from))).with(stages::layer()).init();
}

/// What libraries say among themselves is no word to the user: they decide nothing here.
fn is_own(target: &str) -> bool {
    target.split("::").next() == Some(env!("CARGO_CRATE_NAME"))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use clap::error::{ContextKind, ContextValue};
    use clap::{CommandFactory, Parser};

    use super::{Cli, examples, without_other_unit};

    #[test]
    fn every_example_is_understood_and_every_command_has_some() {
        let lines = examples::ALL.iter().flat_map(|text| text.lines()).filter_map(|l| l.strip_prefix("  "));
        let start = examples::START
            .lines()
            .map(str::trim)
            .filter(|l| l.starts_with("robotcal p") || l.starts_with("robotcal i"));
        for example in lines.chain(start) {
            let parsed = Cli::try_parse_from(example.split_whitespace());
            assert!(parsed.is_ok_and(|cli| cli.command.is_some()), "{example}");
        }
        let command = Cli::command();
        let commands: Vec<_> = command.get_subcommands().filter(|c| c.get_name() != "help").collect();
        assert_eq!(commands.len(), examples::ALL.len());
        assert!(commands.iter().all(|c| c.get_after_help().is_some()));
    }

    #[test]
    fn no_unit_is_proposed_for_another() {
        let tip = |unit: &str| {
            let words = ["robotcal", "compensate", "p.csv", "--joint-unit", unit];
            let error = without_other_unit(Cli::try_parse_from(words).err().unwrap());
            assert_eq!(error.get(ContextKind::InvalidValue), Some(&ContextValue::String(unit.to_owned())));
            error.get(ContextKind::SuggestedValue).is_some()
        };
        assert_eq!(["mrad", "mdeg", "gon", "radd", "degrees"].map(tip), [false, false, false, true, true]);
    }

    /// Flags of programs of ROS that texts name, and a colour of the style sheet.
    const OF_OTHERS: [&str; 7] = ["child-frame-id", "dst", "dst-storage", "frame-id", "once", "paper", "src"];

    /// Flags that every program has.
    const OF_ALL: [&str; 2] = ["help", "version"];

    /// The flags that the strings of a file name.
    fn named(text: &str) -> Vec<String> {
        let own = text.split("#[cfg(test)]").next().unwrap_or_default();
        let code = own.lines().filter(|line| !line.trim_start().starts_with("//"));
        let ends = |c: char| !(c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-');
        let of_line = |line: &str| {
            let parts: Vec<String> =
                line.split("--").skip(1).map(|rest| rest.split(ends).next().unwrap().to_owned()).collect();
            parts
        };
        code.flat_map(of_line).filter(|flag| flag.starts_with(|c: char| c.is_ascii_lowercase())).collect()
    }

    #[test]
    fn every_flag_that_a_text_names_is_there() {
        let command = Cli::command();
        let of = |command: &clap::Command| {
            command.get_arguments().filter_map(|a| a.get_long().map(str::to_owned)).collect::<Vec<_>>()
        };
        let known: BTreeSet<String> = command.get_subcommands().flat_map(of).chain(of(&command)).collect();
        let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
        let mut files = 0;
        while let Some(folder) = folders.pop() {
            for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|e| e == "rs") {
                    files += 1;
                    for flag in named(&std::fs::read_to_string(&path).unwrap()) {
                        assert!(
                            known.contains(&flag) || OF_OTHERS.iter().chain(&OF_ALL).any(|other| *other == flag),
                            "{}: --{flag}",
                            path.display()
                        );
                    }
                }
            }
        }
        assert!(files > 300 && known.len() > 80, "{files} {}", known.len());
    }
}
