//! Tokens of program text: bytes in, so that comments may be in any encoding.

use std::collections::BTreeMap;
use std::ops::Range;

use super::text_file::TextFile;
use crate::error::{Code, Error, Result};

/// One token.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Token {
    pub kind: TokenKind,
    pub range: Range<usize>,
    /// Line, from 1.
    pub line: usize,
}

/// Kinds of tokens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum TokenKind {
    /// Letters, digits, `_` and `$`.
    Word,
    /// A number without sign.
    Number(f64),
    /// Text in quotes.
    Text,
    /// Any other byte.
    Mark(u8),
    /// End of a line.
    LineEnd,
}

/// What a language has that others have not.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dialect {
    /// From this byte to the end of the line is a comment.
    pub comment: u8,
    /// Quotes of texts.
    pub quotes: &'static [u8],
    /// A line that begins with this byte is no statement.
    pub header: Option<u8>,
    /// `'B101'` and `'H1F'` are numbers.
    pub based_numbers: bool,
    /// Letters of Latin-1 beyond ASCII belong to names.
    pub latin_letters: bool,
}

/// Tokens of a file.
///
/// # Errors
/// A text that does not end on its line.
pub(super) fn tokens(file: &TextFile, dialect: Dialect) -> Result<Vec<Token>> {
    let bytes = &file.bytes;
    let is_utf8 = std::str::from_utf8(bytes).is_ok();
    let letter = |rest: &[u8]| letter_length(rest, dialect.latin_letters, is_utf8);
    let mut out = Vec::new();
    let mut at = 0;
    let mut line_begins = true;
    let mut line = 1;
    while at < bytes.len() {
        let byte = bytes[at];
        let rest = &bytes[at..];
        let until = |stop: &dyn Fn(u8) -> bool| rest.iter().position(|b| stop(*b)).unwrap_or(rest.len());
        let to_line_end = until(&|b| b == b'\n' || b == b'\r');
        if byte == dialect.comment || (line_begins && dialect.header == Some(byte)) {
            at += to_line_end;
            continue;
        }
        let quoted = || rest[1..to_line_end].iter().position(|c| *c == byte).ok_or_else(|| unclosed(file, line));
        let (kind, length) = match byte {
            b if !b.is_ascii_digit() && letter(rest) > 0 => (Some(TokenKind::Word), word_length(rest, letter)),
            b'\n' => (Some(TokenKind::LineEnd), 1),
            b'\r' if rest.get(1) != Some(&b'\n') => (Some(TokenKind::LineEnd), 1),
            // Other control characters, and what is not ASCII (blanks of other widths, byte order marks), separate.
            b if b <= b' ' || b >= 0x7f => (None, 1),
            b if b.is_ascii_digit() || (b == b'.' && rest.get(1).is_some_and(u8::is_ascii_digit)) => {
                let length = number_length(rest);
                (Some(TokenKind::Number(number(&rest[..length]))), length)
            }
            b'\'' if dialect.based_numbers => match based_number(rest) {
                Some((value, length)) => (Some(TokenKind::Number(value)), length),
                None => (Some(TokenKind::Mark(byte)), 1),
            },
            b if dialect.quotes.contains(&b) => (Some(TokenKind::Text), quoted()? + 2),
            b => (Some(TokenKind::Mark(b)), 1),
        };
        if let Some(kind) = kind {
            out.push(Token { kind, range: at..at + length, line });
            line_begins = kind == TokenKind::LineEnd;
            line += usize::from(line_begins);
        }
        at += length;
    }
    Ok(out)
}

fn unclosed(file: &TextFile, line: usize) -> Error {
    let what = "a text in quotes does not end on its line";
    Error::new(Code::ProgramSyntax, format!("{}:{line}", file.name), what, "close the quotes")
}

/// Bytes of a letter, digit, `_` or `$` with which a text begins; 0 for anything else.
fn letter_length(text: &[u8], latin_letters: bool, is_utf8: bool) -> usize {
    match text {
        [b, ..] if b.is_ascii_alphanumeric() || matches!(b, b'_' | b'$') => 1,
        // Between the letters stand the signs of multiplication and division.
        [0xc3, 0x97 | 0xb7, ..] if is_utf8 => 0,
        [0xc3, 0x80..=0xbf, ..] if latin_letters && is_utf8 => 2,
        [0xd7 | 0xf7, ..] => 0,
        [0xc0..=0xff, ..] if latin_letters && !is_utf8 => 1,
        _ => 0,
    }
}

fn word_length(text: &[u8], letter: impl Fn(&[u8]) -> usize) -> usize {
    let mut end = 0;
    loop {
        match letter(&text[end..]) {
            0 => return end,
            length => end += length,
        }
    }
}

/// A word in capital letters; the bytes of a text that is no UTF-8 are letters of Latin-1.
fn capitals(word: &[u8]) -> String {
    let text = std::str::from_utf8(word).map_or_else(|_| word.iter().map(|b| char::from(*b)).collect(), str::to_owned);
    let capital = |c: char| match c {
        '\u{e0}'..='\u{fe}' if c != '\u{f7}' => c.to_uppercase().next().unwrap_or(c),
        c => c.to_ascii_uppercase(),
    };
    text.chars().map(capital).collect()
}

/// Digits, point, digits, exponent.
fn number_length(bytes: &[u8]) -> usize {
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let mut end = digits(0);
    if bytes.get(end) == Some(&b'.') {
        end += 1 + digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits((end + 1 + sign).min(bytes.len()));
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    end
}

fn number(bytes: &[u8]) -> f64 {
    std::str::from_utf8(bytes).ok().and_then(|t| t.parse().ok()).unwrap_or(f64::NAN)
}

/// `'B0110'` or `'H1F'`.
fn based_number(bytes: &[u8]) -> Option<(f64, usize)> {
    let base = match bytes.get(1)? {
        b'b' | b'B' => 2,
        b'h' | b'H' => 16,
        _ => return None,
    };
    let end = 2 + bytes[2..].iter().position(|b| *b == b'\'')?;
    let digits = std::str::from_utf8(&bytes[2..end]).ok()?;
    let value = u32::from_str_radix(digits, base).ok()?;
    Some((f64::from(value), end + 1))
}

/// Tokens with a place to read from.
pub(super) struct Reader<'a> {
    pub file: &'a TextFile,
    pub index: usize,
    tokens: Vec<Token>,
    pub at: usize,
    /// Names of words that are others than they are written, by their tokens.
    names: BTreeMap<usize, String>,
}

impl<'a> Reader<'a> {
    pub fn new(file: &'a TextFile, index: usize, dialect: Dialect) -> Result<Self> {
        Ok(Self { file, index, tokens: tokens(file, dialect)?, at: 0, names: BTreeMap::new() })
    }

    /// The same with names of their own for some of its words, by the number of their token.
    pub fn renamed(
        file: &'a TextFile,
        index: usize,
        dialect: Dialect,
        names: impl Fn(&Self) -> BTreeMap<usize, String>,
    ) -> Result<Self> {
        let plain = Self::new(file, index, dialect)?;
        Ok(Self { names: names(&plain), ..plain })
    }

    pub fn peek(&self) -> Option<&Token> {
        self.tokens.get(self.at)
    }

    pub fn token_is_mark(&self, token: usize, mark: u8) -> bool {
        self.token(token).is_some_and(|t| t.kind == TokenKind::Mark(mark))
    }

    /// A token by its number.
    pub fn token(&self, k: usize) -> Option<&Token> {
        self.tokens.get(k)
    }

    /// The token `n` places on (before, where negative).
    pub fn ahead(&self, n: isize) -> Option<&Token> {
        self.tokens.get(self.at.checked_add_signed(n)?)
    }

    pub fn ahead_is_mark(&self, n: isize, mark: u8) -> bool {
        self.ahead(n).is_some_and(|t| t.kind == TokenKind::Mark(mark))
    }

    /// True for a word in capital or small letters.
    pub fn ahead_is_word(&self, n: isize, word: &str) -> bool {
        self.ahead(n).is_some_and(|t| t.kind == TokenKind::Word && self.text(t).eq_ignore_ascii_case(word.as_bytes()))
    }

    /// True where a word stands in the rest of the line.
    pub fn rest_of_line_has(&self, word: &str) -> bool {
        let line = (0..).take_while(|&n| self.ahead(n).is_some_and(|t| t.kind != TokenKind::LineEnd));
        line.into_iter().any(|n| self.ahead_is_word(n, word))
    }

    pub fn done(&self) -> bool {
        self.at >= self.tokens.len()
    }

    /// Line of the present token, or of the last.
    pub fn line(&self) -> usize {
        self.line_of(self.at)
    }

    pub fn line_of(&self, token: usize) -> usize {
        let token = self.tokens.get(token).or(self.tokens.last());
        token.map_or(1, |t| t.line)
    }

    pub fn place(&self) -> String {
        format!("{}:{}", self.file.name, self.line())
    }

    pub fn text(&self, token: &Token) -> &'a [u8] {
        &self.file.bytes[token.range.clone()]
    }

    /// The word at the present place, as written.
    pub fn word(&self) -> Option<&'a [u8]> {
        self.peek().filter(|t| t.kind == TokenKind::Word).map(|t| self.text(t))
    }

    pub fn is_mark(&self, mark: u8) -> bool {
        self.peek().is_some_and(|t| t.kind == TokenKind::Mark(mark))
    }

    /// Steps over a mark if it is there.
    pub fn take_mark(&mut self, mark: u8) -> bool {
        let there = self.is_mark(mark);
        self.at += usize::from(there);
        there
    }

    /// Steps over line ends.
    pub fn skip_line_ends(&mut self) {
        while self.peek().is_some_and(|t| t.kind == TokenKind::LineEnd) {
            self.at += 1;
        }
    }

    /// A number with its sign, and the bytes of both.
    pub fn take_number(&mut self) -> Option<(f64, Range<usize>)> {
        let start = self.at;
        let sign = match self.peek()?.kind {
            TokenKind::Mark(b'-') => -1.0,
            TokenKind::Mark(b'+') => 1.0,
            _ => 0.0,
        };
        let first = self.peek()?.range.start;
        self.at += usize::from(sign != 0.0);
        match self.peek().map(|t| (t.kind, t.range.end)) {
            Some((TokenKind::Number(value), end)) if value.is_finite() => {
                self.at += 1;
                Some((if sign < 0.0 { -value } else { value }, first..end))
            }
            _ => {
                self.at = start;
                None
            }
        }
    }

    /// The present token for messages.
    pub fn shown(&self) -> String {
        match self.peek() {
            None => "the end of the text".into(),
            Some(t) if t.kind == TokenKind::LineEnd => "the end of the line".into(),
            Some(t) => format!("\"{}\"", String::from_utf8_lossy(self.text(t))),
        }
    }

    /// The word at the present place in capital letters.
    pub fn name(&self) -> Option<String> {
        self.name_of(self.at)
    }

    /// The word at a token in capital letters.
    pub fn name_of(&self, token: usize) -> Option<String> {
        let word = self.token(token).filter(|t| t.kind == TokenKind::Word)?;
        Some(self.names.get(&token).cloned().unwrap_or_else(|| capitals(self.text(word))))
    }

    /// To the beginning of the next line.
    pub fn skip_line(&mut self) {
        while self.peek().is_some_and(|t| t.kind != TokenKind::LineEnd) {
            self.at += 1;
        }
        self.at += 1;
    }

    /// True at the end of a line or of the text.
    pub fn at_line_end(&self) -> bool {
        self.peek().is_none_or(|t| t.kind == TokenKind::LineEnd)
    }

    /// Index of the mark that closes the bracket at token `open`.
    pub fn closing(&self, open: usize) -> Option<usize> {
        let mut depth = 0;
        for (k, token) in self.tokens.iter().enumerate().skip(open) {
            match token.kind {
                TokenKind::Mark(b'(' | b'[' | b'{') => depth += 1,
                TokenKind::Mark(b')' | b']' | b'}') => depth -= 1,
                _ => {}
            }
            if depth == 0 {
                return Some(k);
            }
        }
        None
    }
}
