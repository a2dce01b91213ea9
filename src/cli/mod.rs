//! Flags, progress, one thin file per subcommand; the only room that prints.

/// Runs the program with the arguments of the process.
pub fn main() -> std::process::ExitCode {
    std::process::ExitCode::SUCCESS
}
