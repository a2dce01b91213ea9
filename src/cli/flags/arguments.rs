//! The arguments of the process.

use crate::files::word;

/// Words of the command line as they can be shown: a path may hold bytes that are no text.
fn command_line() -> Vec<String> {
    std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect()
}

/// The command line, to be given again.
pub fn command_text() -> String {
    command_line().iter().map(word).collect::<Vec<_>>().join(" ")
}

/// The same for reports, whichever file of the program was called.
pub fn command_of_report() -> String {
    let words = command_line().into_iter().skip(1).map(word);
    std::iter::once("robotcal".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// Two numbers with an x between them.
pub fn pair<T: std::str::FromStr + Copy>(text: &str) -> std::result::Result<[T; 2], String> {
    let parts: Vec<T> = text.split(['x', 'X']).filter_map(|p| p.trim().parse().ok()).collect();
    <[T; 2]>::try_from(parts).map_err(|_| "give two numbers with an x between them".to_owned())
}
