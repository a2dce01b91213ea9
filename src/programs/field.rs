//! One number in the text of a program.

use std::ops::Range;

/// Where a number stands, or where it has to be put.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FieldPlace {
    /// Bytes of the number, its sign included.
    At(Range<usize>),
    /// Not in the text yet: it is inserted at this byte, after these words (`, Z `).
    Missing(usize, String),
}

/// A number of a target.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Index of the file.
    pub file: usize,
    /// Where it stands.
    pub place: FieldPlace,
    /// The number as written, in the unit of the language.
    pub written: f64,
    /// SI value of one unit of the language.
    pub si: f64,
    /// Fewest decimals that keep the accuracy of a correction.
    pub decimals: usize,
}

impl Field {
    /// The value in SI.
    pub fn value(&self) -> f64 {
        self.written * self.si
    }

    /// What a new value (SI) becomes by the decimals of the text, in the unit of the language.
    fn rounded(&self, value: f64, text: &[u8]) -> String {
        let decimals = self.decimals.max(self.decimals_now(text)).min(15);
        let number = format!("{:.decimals$}", value / self.si);
        let zero = number.bytes().all(|b| matches!(b, b'-' | b'0' | b'.'));
        let number = if zero { number.trim_start_matches('-').to_owned() } else { number };
        match &self.place {
            FieldPlace::At(range) if text.get(range.start) == Some(&b'+') && !number.starts_with('-') => {
                format!("+{number}")
            }
            _ => number,
        }
    }

    /// Digits behind the point in the text, where it is written without an exponent.
    fn decimals_now(&self, text: &[u8]) -> usize {
        let FieldPlace::At(range) = &self.place else { return 0 };
        let number = text.get(range.clone()).unwrap_or_default();
        let digits = number.iter().rev().take_while(|b| b.is_ascii_digit()).count();
        match number.len().checked_sub(digits + 1).map(|i| number[i]) {
            Some(b'.') => digits,
            _ => 0,
        }
    }

    /// The edit that writes a new value (SI), and the value that a reader of the new text finds.
    ///
    /// A number that says the same already keeps its bytes.
    pub fn edit(&self, value: f64, text: &[u8]) -> (Option<Edit>, f64) {
        let number = self.rounded(value, text);
        let read = number.parse::<f64>().unwrap_or(f64::NAN);
        match &self.place {
            FieldPlace::At(_) if read == self.written => (None, self.value()),
            FieldPlace::At(range) => {
                (Some(Edit { file: self.file, range: range.clone(), text: number }), read * self.si)
            }
            FieldPlace::Missing(at, words) => {
                let text = format!("{words}{number}");
                (Some(Edit { file: self.file, range: *at..*at, text }), read * self.si)
            }
        }
    }
}

/// Replacement of bytes of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Edit {
    /// Index of the file.
    pub file: usize,
    /// What is replaced.
    pub range: Range<usize>,
    /// By what.
    pub text: String,
}

/// The bytes of file `file` after all edits that belong to it; edits do not overlap.
pub fn splice(bytes: &[u8], file: usize, edits: &[Edit]) -> Vec<u8> {
    let mut own: Vec<&Edit> = edits.iter().filter(|e| e.file == file).collect();
    // The sort is stable: insertions at one place keep their order.
    own.sort_by_key(|e| e.range.start);
    let mut out = Vec::with_capacity(bytes.len() + 16 * own.len());
    let mut at = 0;
    for edit in own {
        out.extend_from_slice(&bytes[at..edit.range.start]);
        out.extend_from_slice(edit.text.as_bytes());
        at = edit.range.end;
    }
    out.extend_from_slice(&bytes[at..]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(number: &str, decimals: usize, value: f64) -> String {
        let written = number.parse().unwrap();
        let field = Field { file: 0, place: FieldPlace::At(0..number.len()), written, si: 1.0, decimals };
        let (edit, _) = field.edit(value, number.as_bytes());
        String::from_utf8(splice(number.as_bytes(), 0, &edit.into_iter().collect::<Vec<_>>())).unwrap()
    }

    #[test]
    fn numbers_keep_their_style_and_gain_the_decimals_that_are_needed() {
        assert_eq!(written("12", 4, 12.03), "12.0300");
        assert_eq!(written("12.125000", 4, 12.03), "12.030000");
        assert_eq!(written("+1.5", 2, 1.25), "+1.25");
        assert_eq!(written("+1.5", 2, -1.25), "-1.25");
        assert_eq!(written("0.001", 2, -0.00001), "0.000");
        assert_eq!(written("1.5E+01", 3, 15.25), "15.250");
        assert_eq!(written(".5", 4, 0.5), ".5", "what says the same keeps its bytes");
        assert_eq!(written("1E1", 4, 10.0), "1E1");
    }
}
