//! Statements of RAPID: where each begins and ends, and which of them move.

use super::Task;
use super::moves::{MoveSwitches, TWO_POINTS, Targets, targets_of};
use super::switching::{ROUTINES, words_before_name};
use super::value::{Node, TYPES, node};
use crate::error::{Code, Error, Result};
use crate::programs::reason::{LeftReason, Why};
use crate::programs::scan::{Reader, TokenKind};

/// Beginnings of lines in which a position in numbers is not where the robot goes.
pub(super) const DECLARE: [&str; 8] = ["CONST", "PERS", "VAR", "LOCAL", "TASK", "PROC", "FUNC", "TRAP"];
/// Words of the language that begin a statement, or part of one, which ends without a semicolon.
pub(super) const CONTROL: [&str; 26] = [
    "MODULE",
    "ENDMODULE",
    "PROC",
    "ENDPROC",
    "FUNC",
    "ENDFUNC",
    "TRAP",
    "ENDTRAP",
    "RECORD",
    "ENDRECORD",
    "IF",
    "ELSEIF",
    "ELSE",
    "ENDIF",
    "TEST",
    "CASE",
    "DEFAULT",
    "ENDTEST",
    "WHILE",
    "ENDWHILE",
    "FOR",
    "ENDFOR",
    "ERROR",
    "UNDO",
    "BACKWARD",
    "THEN",
];
/// Switches of a move whose path something else corrects: `CorrWrite`, a sensor that tracks the seam.
const LED: [&str; 2] = ["CORR", "TRACK"];
/// The switch of a move to joints that no offset of external axes moves.
const NO_OFFSET: &str = "NOEOFFS";
/// Stands before and behind the name of a routine that is called by a text.
const LATE: u8 = b'%';
/// Words between two operands.
pub(super) const OPERATORS: [&str; 6] = ["AND", "OR", "XOR", "NOT", "DIV", "MOD"];

/// True for the first word of a statement that declares data.
fn declares(word: &str) -> bool {
    DECLARE.contains(&word) || TYPES.contains(&word)
}

pub(super) fn is_control(reader: &Reader<'_>) -> bool {
    reader.name().is_some_and(|word| CONTROL.contains(&word.as_str()))
}

/// Token at which a statement ends: its semicolon, or a word that cannot stand within it.
pub(super) fn statement_end(reader: &mut Reader<'_>) -> usize {
    let start = reader.at;
    reader.at += 1;
    while !reader.done() && !reader.is_mark(b';') && !is_control(reader) {
        reader.at += 1;
    }
    std::mem::replace(&mut reader.at, start)
}

/// The first token behind the condition of an `IF`: two operands without anything between them end it.
fn condition_end(reader: &mut Reader<'_>) -> usize {
    let start = reader.at;
    let mut has_operand = false;
    reader.at += 1;
    while let Some(kind) = reader.peek().map(|t| t.kind) {
        let is_operator = reader.name().is_some_and(|word| OPERATORS.contains(&word.as_str()));
        let is_bracket = matches!(kind, TokenKind::Mark(b'(' | b'[' | b'{'));
        let begins = (kind == TokenKind::Word && !is_operator) || kind == TokenKind::Mark(b'%');
        if kind == TokenKind::Mark(b';') || is_control(reader) || (begins && has_operand) {
            break;
        }
        if is_bracket {
            reader.at = reader.closing(reader.at).unwrap_or(reader.at);
        }
        has_operand = match kind {
            TokenKind::LineEnd => has_operand,
            TokenKind::Word => !is_operator,
            TokenKind::Mark(_) => is_bracket,
            TokenKind::Number(_) | TokenKind::Text => true,
        };
        reader.at += 1;
    }
    std::mem::replace(&mut reader.at, start)
}

/// Behind the brackets that stand `words` words behind the present one.
fn behind_brackets(reader: &Reader<'_>, words: usize) -> usize {
    let open = reader.at + words + 1;
    let is_open = reader.ahead_is_mark(words as isize + 1, b'(');
    reader.closing(open).filter(|_| is_open).map_or(open, |close| close + 1)
}

/// Where the statement behind a word of [`CONTROL`] begins.
pub(super) fn behind_header(reader: &mut Reader<'_>, word: &str) -> usize {
    let end = statement_end(reader);
    let behind = |found: &dyn Fn(isize) -> bool| {
        let all = 1..(end - reader.at) as isize;
        all.into_iter().find(|&k| found(k)).map_or(reader.at + 1, |k| reader.at + 1 + k as usize)
    };
    match word {
        "WHILE" | "FOR" => behind(&|k| reader.ahead_is_word(k, "DO")),
        "CASE" | "DEFAULT" => behind(&|k| reader.ahead_is_mark(k, b':')),
        "MODULE" => behind_brackets(reader, 1),
        "RECORD" => reader.at + 2,
        "ERROR" => behind_brackets(reader, 0),
        w if ROUTINES.contains(&w) => behind_brackets(reader, 1 + words_before_name(w)),
        "IF" | "ELSEIF" => condition_end(reader),
        _ => reader.at + 1,
    }
}

/// True where a robtarget is written in a statement that sets no data.
fn has_literal(reader: &mut Reader<'_>, end: usize) -> Result<bool> {
    let start = reader.at;
    let mut found = false;
    while !found && reader.at < end {
        let assigned = reader.is_mark(b':') && reader.ahead_is_mark(1, b'=') && !reader.ahead_is_mark(-2, b'\\');
        if assigned {
            break;
        }
        let nested = reader.is_mark(b'[') && reader.ahead_is_mark(1, b'[');
        let at = reader.at;
        found = nested && node(reader)?.is_robtarget();
        reader.at = at + 1;
    }
    reader.at = start;
    Ok(found)
}

/// True where arguments stand behind the word on which the reader stands.
fn has_arguments(reader: &Reader<'_>) -> bool {
    let mut behind = (1..).filter_map(|k| match reader.ahead(k) {
        Some(token) if token.kind == TokenKind::LineEnd => None,
        token => Some(token.map(|t| t.kind)),
    });
    !matches!(behind.next().flatten(), None | Some(TokenKind::Mark(b':' | b'(' | b';')))
}

/// Arguments of an instruction.
#[derive(Default)]
pub(super) struct Arguments {
    /// Those that stand between commas.
    pub plain: Vec<Argument>,
    /// The work object, behind its switch.
    work: Option<Node>,
    switches: MoveSwitches,
}

/// One that stands between commas.
pub(super) struct Argument {
    /// Its first operand.
    pub value: Node,
    /// False where more follows, so that it is an expression.
    pub is_whole: bool,
}

/// Reads the arguments of an instruction of this name and line, up to its semicolon.
pub(super) fn arguments(reader: &mut Reader<'_>, (name, line): (&str, usize)) -> Result<Arguments> {
    let mut read = Arguments::default();
    loop {
        reader.skip_line_ends();
        if reader.done() || (read.plain.is_empty() && reader.is_mark(b';')) {
            let (file, what) = (&reader.file.name, format!("{name} does not end with a semicolon"));
            return Err(Error::new(Code::ProgramSyntax, format!("{file}:{line}"), what, "complete the instruction"));
        }
        if reader.take_mark(b'\\') {
            let (name, value) = switch(reader)?;
            read.switches.is_led |= LED.contains(&name.as_str());
            read.switches.has_no_offset |= name == NO_OFFSET;
            read.work = value.filter(|_| name == "WOBJ").or(read.work);
        } else if reader.is_mark(b';') {
            return Ok(read);
        } else if !reader.take_mark(b',') {
            read.plain.push(argument(reader)?);
        }
    }
}

/// Reads a switch behind its stroke: its name and what it gives, `\NAME:=value` or `\NAME?parameter`, which may be there or not.
fn switch(reader: &mut Reader<'_>) -> Result<(String, Option<Node>)> {
    let name = reader.name().unwrap_or_default();
    reader.at += 1;
    if reader.take_mark(b'?') {
        reader.at += 1;
        return Ok((name, Some(Node::Perhaps)));
    }
    let has_value = reader.take_mark(b':') && reader.take_mark(b'=');
    let value = has_value.then(|| node(reader)).transpose()?;
    Ok((name, value))
}

/// Reads an argument up to the comma, switch or semicolon behind it.
fn argument(reader: &mut Reader<'_>) -> Result<Argument> {
    let value = node(reader)?;
    let behind = reader.at;
    while let Some(kind) = reader.peek().map(|t| t.kind) {
        match kind {
            TokenKind::Mark(b',' | b';' | b'\\') | TokenKind::LineEnd => break,
            TokenKind::Mark(b'(' | b'[' | b'{') => reader.at = reader.closing(reader.at).unwrap_or(reader.at) + 1,
            _ => reader.at += 1,
        }
    }
    Ok(Argument { value, is_whole: reader.at == behind })
}

impl Task<'_> {
    /// All statements of a file, in their order.
    pub(super) fn statements(&mut self, mut reader: Reader<'_>) -> Result<()> {
        // Conditions of one line, which end with the statement behind them.
        let (mut begins, mut conditions) = (0, 0_usize);
        self.switching.file_begins(reader.index);
        while !reader.done() {
            if reader.ahead_is_mark(-1, b';') {
                (0..std::mem::take(&mut conditions)).for_each(|_| self.switching.branches_end(&mut self.way));
            }
            if reader.at >= begins && reader.is_mark(LATE) {
                begins = statement_end(&mut reader);
                self.late_call(&mut reader, begins)?;
                continue;
            }
            let Some(word) = reader.name() else {
                reader.at += 1;
                continue;
            };
            if reader.at < begins {
                self.switching.within(&reader, &word, &mut self.way);
                reader.at += 1;
            } else if let Some(targets) = self.move_to(&reader, &word) {
                self.switching.before(&word, &self.way);
                self.instruction(&mut reader, targets)?;
                reader.at += 1;
            } else if CONTROL.contains(&word.as_str()) {
                begins = behind_header(&mut reader, &word);
                self.switching.statement(&reader, &word, &mut self.way);
                let is_block = reader.ahead_is_word((begins - reader.at) as isize, "THEN");
                conditions += usize::from(word == "IF" && !is_block);
                let is_definition = ROUTINES.contains(&word.as_str()) || word == "MODULE" || word == "RECORD";
                reader.at = if is_definition { begins } else { reader.at + 1 };
            } else {
                let is_label = reader.ahead_is_mark(1, b':') && !reader.ahead_is_mark(2, b'=');
                begins = if is_label { reader.at + 2 } else { statement_end(&mut reader) };
                if is_label {
                    self.switching.label(&mut self.way);
                }
                if !declares(&word) {
                    self.switching.before(&word, &self.way);
                    self.no_move(&mut reader, &word, begins)?;
                }
                self.switching.statement(&reader, &word, &mut self.way);
                reader.at += 1;
            }
        }
        Ok(())
    }

    /// `%"name"% argument, ..;`, a call of a routine by its name in a text, which may be computed; the reader stands on its beginning, and ends behind
    /// the name.
    fn late_call(&mut self, reader: &mut Reader<'_>, end: usize) -> Result<()> {
        let behind = (reader.at + 1..end).find(|k| reader.token_is_mark(*k, LATE)).unwrap_or(reader.at);
        let is_text = reader.ahead(1).filter(|t| t.kind == TokenKind::Text && behind == reader.at + 2);
        let name = is_text.map(|t| String::from_utf8_lossy(reader.text(t)).trim_matches('"').to_ascii_uppercase());
        reader.at = behind;
        let word = name.clone().unwrap_or_else(|| char::from(LATE).to_string());
        self.switching.before(&word, &self.way);
        self.no_move(reader, &word, end)?;
        self.switching.statement(reader, &word, &mut self.way);
        if name.is_none() {
            self.switching.runs_anything();
        }
        reader.at += 1;
        Ok(())
    }

    /// What a statement that is no known move says of positions.
    fn no_move(&mut self, reader: &mut Reader<'_>, word: &str, end: usize) -> Result<()> {
        if has_literal(reader, end)? {
            let words = format!("a position stands in it, and what {word} does with it is not known");
            self.leave((reader.index, reader.line()), word, Why::new(LeftReason::NotATarget, words));
            self.goes_untold();
        }
        self.may_go(reader, word);
        let start = reader.at;
        let used = self.used(reader, word, end);
        reader.at = start;
        used
    }

    /// Targets of a known instruction that moves the robot; the reader stands on its name.
    fn move_to(&self, reader: &Reader<'_>, word: &str) -> Option<Targets> {
        targets_of(word).filter(|_| !self.switching.has_routine(word) && has_arguments(reader))
    }

    /// A move; the reader stands on its name and ends on its semicolon.
    fn instruction(&mut self, reader: &mut Reader<'_>, targets: Targets) -> Result<()> {
        let line = reader.line();
        let name = String::from_utf8_lossy(reader.word().unwrap_or_default()).into_owned();
        reader.at += 1;
        let Arguments { mut plain, work, switches } = arguments(reader, (&name, line))?;
        self.move_switches = switches;
        plain.drain(..plain.len().min(targets.skipped));
        let count = targets.count.min(plain.len());
        let tool = self.tool_of(&plain, count);
        let on_circle = plain.first().filter(|_| count == TWO_POINTS).map(|argument| &argument.value);
        for (k, Argument { value, is_whole }) in plain[..count].iter().enumerate() {
            let is_told = on_circle.filter(|_| k > 0).map_or(Ok(()), |point| self.tells_axes_of(value, point));
            let done = match (is_whole, is_told) {
                (true, Ok(())) => self.visit(value, &name, (reader.index, line), &tool, work.as_ref())?,
                (_, Err(why)) => Err(why),
                (false, _) => Err(Why::computed()),
            };
            if let Err(why) = done {
                self.leave((reader.index, line), &name, why);
            }
            match is_whole {
                true if k + 1 < count => self.passes(value),
                true => self.carries(value),
                false => self.goes_untold(),
            }
        }
        self.move_switches = MoveSwitches::default();
        Ok(())
    }

    /// True for the name of a tool.
    pub(super) fn is_tool(&self, name: &str) -> bool {
        name == "TOOL0" || self.data.get(name).is_some_and(|d| d.kind == "TOOLDATA")
    }

    /// Name of the tool: the argument that is one, else that behind speed and zone.
    fn tool_of(&self, arguments: &[Argument], targets: usize) -> Option<String> {
        let word = |a: &Argument| if let Node::Word(w) = &a.value { Some(w.clone()) } else { None };
        let rest = arguments.get(targets..).unwrap_or_default();
        rest.iter().filter_map(word).find(|w| self.is_tool(w)).or_else(|| rest.get(2).and_then(word))
    }
}
