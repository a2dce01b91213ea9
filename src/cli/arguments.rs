//! The arguments of the process.

/// Words of the command line as they can be shown: a path may hold bytes that are no text.
pub(super) fn command_line() -> Vec<String> {
    std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect()
}
