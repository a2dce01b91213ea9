//! Lines for a terminal of 80 columns.

/// Columns of a line.
pub const WIDTH: usize = 80;

/// Columns before the words of a line.
const INDENT: usize = 10;

/// A line with its label.
pub fn indented(label: &str, words: &str) -> String {
    format!("{label:<INDENT$}{words}")
}

/// Words in lines of [`WIDTH`]; `first` stands before them, blanks before the following ones. What does not fit into `most` lines is cut
/// at a word, and said to be.
pub fn paragraph(first: &str, words: &str, most: usize) -> Vec<String> {
    let mut lines = vec![first.to_owned()];
    let mut is_empty = true;
    for word in words.split_whitespace() {
        let used = lines.last().map_or(0, |l| l.chars().count()) + usize::from(!is_empty);
        if !is_empty && used + word.chars().count() > WIDTH {
            if lines.len() == most {
                cut(lines.last_mut());
                return lines;
            }
            lines.push(" ".repeat(first.chars().count()));
            is_empty = true;
        }
        if let Some(line) = lines.last_mut() {
            *line += if is_empty { "" } else { " " };
            *line += word;
        }
        is_empty = false;
    }
    lines
}

fn cut(line: Option<&mut String>) {
    let Some(line) = line else { return };
    while line.chars().count() + 4 > WIDTH {
        match line.rfind(' ') {
            Some(at) if at > INDENT => line.truncate(at),
            _ => break,
        }
    }
    line.push_str(" ...");
}

#[cfg(test)]
mod tests {
    use super::{WIDTH, paragraph};

    #[test]
    fn words_are_broken_at_the_width_and_cut_after_the_last_line() {
        let words = "word ".repeat(60);
        let lines = paragraph("label     ", &words, 3);
        assert_eq!(lines.len(), 3);
        assert!(lines.iter().all(|l| l.len() <= WIDTH), "{lines:?}");
        assert!(lines[2].ends_with(" ...") && lines[1].starts_with("          word"));
        assert_eq!(paragraph("x ", "short", 2), ["x short"]);
        let long = "a".repeat(200);
        assert_eq!(paragraph("x ", &long, 2), [format!("x {long}")]);
    }
}
