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
    let parts: Option<Vec<T>> = text.split(['x', 'X']).map(|part| part.trim().parse().ok()).collect();
    let pair = parts.and_then(|parts| <[T; 2]>::try_from(parts).ok());
    pair.ok_or_else(|| "give two numbers with an x between them".to_owned())
}

#[cfg(test)]
mod tests {
    use super::pair;

    #[test]
    fn a_pair_is_two_numbers_and_nothing_else() {
        assert_eq!(pair("1280x1024"), Ok([1280, 1024]));
        assert_eq!(pair("0.15 X 0.6"), Ok([0.15, 0.6]));
        for text in ["1280xfoox1024", "1280x1024x", "x1280x1024", "1280", "1280x", "1x2x3", ""] {
            assert!(pair::<u32>(text).is_err(), "{text}");
        }
    }
}
