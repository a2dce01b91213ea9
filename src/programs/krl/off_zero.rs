//! Where a text puts the external axes `E1` to `E6`, wherever that is.

use super::aggregate::external_axis;
use crate::programs::external::PutAnywhere;
use crate::programs::scan::{Reader, TokenKind};

/// First words of statements that move external axes beside the program, end their motion under way, or let others move them (KUKA, *Operating and
/// programming instructions for system integrators*, asynchronous axes).
pub(super) const BESIDE: [&str; 6] =
    ["ASYPTP", "ASYCONT", "ASYSTOP", "ASYCANCEL", "$ASYNC_AXIS", "$ASYNC_EX_AX_DECOUPLE"];

/// Those of them that go to a position.
const GO_BESIDE: [&str; 2] = ["ASYPTP", "ASYCONT"];

/// Notes that a text moves external axes beside the program to where none of the files tells: they may stand anywhere. `is_told` for names that are set.
pub(super) fn goes_beside(all: &mut PutAnywhere, mut reader: Reader<'_>, is_told: impl Fn(&str) -> bool) {
    while !reader.done() {
        let goes = GO_BESIDE.iter().any(|word| reader.ahead_is_word(0, word));
        let is_named = reader.name_of(reader.at + 1).is_some_and(|name| is_told(&name));
        if goes && !is_named && !reader.ahead_is_mark(1, b'{') {
            all.note_all();
        }
        reader.skip_line();
    }
}

/// Notes the external axes that a text puts somewhere.
pub(super) fn look_through(all: &mut PutAnywhere, mut reader: Reader<'_>) {
    let mut open = Vec::new();
    while !reader.done() {
        match reader.peek().map(|token| token.kind) {
            Some(TokenKind::Mark(mark @ (b'{' | b'(' | b'['))) => open.push(mark),
            Some(TokenKind::Mark(b'}' | b')' | b']')) => _ = open.pop(),
            _ => {}
        }
        let axis = reader.name().and_then(|name| external_axis(&name));
        let is_element = [b'{', b',', b':'].iter().any(|mark| reader.ahead_is_mark(-1, *mark));
        let is_in_list = is_element && open.last() == Some(&b'{');
        let is_set = reader.ahead_is_mark(-1, b'.') && reader.ahead_is_mark(1, b'=') && !reader.ahead_is_mark(2, b'=');
        reader.at += 1;
        let Some(axis) = axis.filter(|_| is_in_list || is_set) else { continue };
        reader.take_mark(b'=');
        let number = reader.take_number().map(|(value, _)| value);
        let ends = reader.at_line_end() || reader.is_mark(b',') || reader.is_mark(b'}');
        all.note(axis, number.filter(|_| ends));
    }
}
