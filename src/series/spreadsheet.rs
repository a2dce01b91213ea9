//! Cells that spreadsheets write otherwise than programs read them.

/// Marks that stand between thousands in one language or another.
const BETWEEN_THOUSANDS: [char; 8] = ['\'', '\u{2019}', ' ', '\u{a0}', '\u{202f}', '\u{2009}', ',', '.'];
/// The months as spreadsheets shorten them in English, German, French, Spanish, Italian and Dutch.
const MONTHS: &str = "jan feb mar apr may jun jul aug sep sept oct nov dec jän mär mrz mai juni juli okt dez janv févr mars avr juin juil août déc \
                      ene abr ago dic gen mag giu lug set ott mrt mei";

/// The mark between the thousands of a cell that is a number without it. A single comma or point may as well be decimal.
pub fn mark_of_thousands(cell: &str) -> Option<char> {
    let plain = cell.strip_prefix(['-', '+']).unwrap_or(cell);
    let mark = plain.chars().find(|c| BETWEEN_THOUSANDS.contains(c))?;
    let decimal = |c: char| matches!(c, ',' | '.') && c != mark;
    let (whole, fraction) = plain.split_once(decimal).map_or((plain, None), |(whole, rest)| (whole, Some(rest)));
    let groups: Vec<&str> = whole.split(mark).collect();
    let are_digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let is_sure = !matches!(mark, ',' | '.') || groups.len() > 2 || fraction.is_some();
    let are_thousands = groups.iter().skip(1).all(|group| group.len() == 3) && (1..=3).contains(&groups[0].len());
    let are_numbers = groups.iter().copied().chain(fraction).all(are_digits);
    (groups.len() > 1 && is_sure && are_thousands && are_numbers).then_some(mark)
}

/// Whether a cell is a day or a time of day.
pub fn is_date(cell: &str) -> bool {
    let words: Vec<&str> = cell.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let is_number = |word: &&str| word.bytes().all(|b| b.is_ascii_digit());
    let is_month = |word: &&str| MONTHS.split_whitespace().any(|month| month == word.to_lowercase());
    let (numbers, months) =
        (words.iter().filter(|w| is_number(w)).count(), words.iter().filter(|w| is_month(w)).count());
    let is_bounded = cell.starts_with(|c: char| c.is_ascii_digit()) && cell.ends_with(|c: char| c.is_ascii_digit());
    let is_separated = cell.contains(['/', ':', '-']) || (numbers == 3 && cell.matches('.').count() == 2);
    numbers + months == words.len()
        && match months {
            0 => is_bounded && is_separated && (2..=3).contains(&numbers),
            _ => months == 1 && (1..=2).contains(&numbers),
        }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_between_thousands_are_told_from_decimal_ones() {
        for (cell, mark) in [
            ("1'234.5", '\''),
            ("-1,234.5", ','),
            ("1.234,5", '.'),
            ("1 234", ' '),
            ("1,234,567", ','),
            ("12\u{2019}345", '\u{2019}'),
        ] {
            assert_eq!(mark_of_thousands(cell), Some(mark), "{cell}");
        }
        for cell in ["1,234", "1.234", "0,5", "12,34.5", "1'23", "1234", "", "-", "'", "a,bcd,efg", "12. Mai"] {
            assert_eq!(mark_of_thousands(cell), None, "{cell}");
        }
    }

    #[test]
    fn dates_and_times_are_no_other_text() {
        for cell in ["12. Mai", "12-May", "Mär 24", "2026-05-12", "12.05.2026", "12/5", "12:30:05", "3. Dez. 26"] {
            assert!(is_date(cell), "{cell}");
        }
        for cell in ["1.5", "-1-2", "1e-5", "12", "may", "", "#DIV/0!", "1.2 mm", "12 rad", "1,5", "marker 5"] {
            assert!(!is_date(cell), "{cell}");
        }
    }
}
