//! The `robotcal` program.

fn main() -> std::process::ExitCode {
    robotcal::cli::main()
}
