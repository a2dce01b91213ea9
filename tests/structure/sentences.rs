//! Tests look at codes, places and numbers, not at the words of a sentence: those may be written better at any time.

use std::fs;
use std::path::Path;

use super::imports::files_below;

/// Assertions on words that may stand, each with its reason in a comment (`// words: ...`) above it or behind it.
const MOST_ON_WORDS: usize = 10;

/// How a text is searched.
const SEARCHES: [&str; 3] = [".contains(", ".starts_with(", ".ends_with("];

/// What holds a message for a person.
const MESSAGES: [&str; 20] = [
    "said", "what", "remedy", "error", "message", "text", "stdout", "stderr", "answer", "refused", "refuse", "notice",
    "display", "words", "terminal", "reason", "sentence", "verdict", "seen", "told",
];

/// What is made of a message without changing its words.
const SAME_WORDS: [&str; 9] =
    ["to_string", "unwrap", "unwrap_err", "as_str", "as_ref", "to_lowercase", "trim", "expect", "from_utf8_lossy"];

/// What holds names, code, or the text of a file.
const NAMES: [&str; 27] = [
    "n",
    "term",
    "name",
    "names",
    "line",
    "l",
    "parameters",
    "p",
    "path",
    "file_name",
    "key",
    "t",
    "kind",
    "page",
    "svg",
    "code",
    "rest",
    "literal",
    "place",
    "signature",
    "readme",
    "file",
    "manifest",
    "xml",
    "urdf",
    "patched",
    "c",
];

/// What is not a word, out of a list.
const WHERE: [&str; 4] = ["place", "out", "hidden", "path"];

/// Ends of the brackets that open at `open`.
fn closing(text: &str, open: usize) -> Option<usize> {
    let (mut depth, mut quoted, mut escaped) = (0, false, false);
    text[open..].char_indices().find_map(|(at, c)| {
        match c {
            _ if escaped => escaped = false,
            '\\' if quoted => escaped = true,
            '"' => quoted = !quoted,
            '(' | '[' | '{' if !quoted => depth += 1,
            ')' | ']' | '}' if !quoted => depth -= 1,
            _ => {}
        }
        (depth == 0 && !quoted).then_some(open + at)
    })
}

/// The name of what is searched: the last one before the search that is not [`SAME_WORDS`].
fn receiver(before: &str) -> &str {
    let mut rest = before.trim_end();
    loop {
        while let Some(end) = rest.chars().next_back().filter(|c| [')', ']'].contains(c)) {
            let mut depth = 0;
            let open = rest.rfind(|c: char| {
                depth += i32::from([')', ']'].contains(&c)) - i32::from(['(', '['].contains(&c));
                depth == 0
            });
            let Some(open) = open else { return "" };
            // What brackets alone hold is searched through its first name.
            let outer = rest[..open].trim_end();
            if end == ')' && !outer.ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == '>') {
                return "";
            }
            rest = outer;
        }
        rest = rest.trim_end_matches('?').trim_end();
        let start = rest.rfind(|c: char| !(c.is_alphanumeric() || c == '_')).map_or(0, |i| i + 1);
        let name = &rest[start..];
        let further = rest[..start].trim_end();
        match further.strip_suffix('.') {
            Some(further) if SAME_WORDS.contains(&name) => rest = further.trim_end(),
            _ => return name,
        }
    }
}

/// Words of a language in a text between quotes: letters alone, neither names nor what a brace stands for; `key:` and `.end` are none.
fn words(literal: &str) -> usize {
    if !literal.trim().contains(' ') && (literal.trim_end().ends_with(':') || literal.starts_with('.')) {
        return 0;
    }
    let plain = |w: &str| {
        let w = w.trim_matches([',', '.', ':', ';', '!', '?', '(', ')', '\'']);
        w.len() > 2 && w.chars().all(char::is_alphabetic) && !w.chars().all(char::is_uppercase)
    };
    literal.split_whitespace().filter(|w| plain(w)).count()
}

/// True where the search is for words.
fn is_for_words(before: &str, argument: &str) -> bool {
    let of = receiver(before);
    let argument = argument.trim().trim_start_matches(['&', '*']);
    let literal = argument.trim_start_matches("format!(").strip_prefix('"');
    match literal {
        Some(literal) => {
            let text = literal.split('"').next().unwrap_or("");
            let found = words(text);
            found > 0 && (found > 1 && text.trim().contains(' ') || !NAMES.contains(&of))
        }
        // Out of a list: a name, or a word.
        None if argument.starts_with("name") || WHERE.contains(&argument) => false,
        None => MESSAGES.contains(&of) && argument.chars().all(|c| c.is_lowercase() || c == '_'),
    }
}

/// Lines of the searches for words, with what stands there.
fn searches_for_words(text: &str) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    for search in SEARCHES {
        for (at, _) in text.match_indices(search) {
            let open = at + search.len() - 1;
            let Some(close) = closing(text, open) else { continue };
            if is_for_words(&text[..at], &text[open + 1..close]) {
                let line = text[..at].matches('\n').count();
                found.push((line, text.lines().nth(line).unwrap_or("").trim()));
            }
        }
    }
    // What a list of names must hold is searched for as well.
    for (at, call) in text.match_indices("assert_says(") {
        let Some(close) = closing(text, at + call.len() - 1) else { continue };
        let list = text[at..close].rsplit("&[").next().unwrap_or("");
        if list.split('"').skip(1).step_by(2).any(|literal| words(literal) > 1) {
            let line = text[..at].matches('\n').count();
            found.push((line, text.lines().nth(line).unwrap_or("").trim()));
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

/// True where the reason stands beside it.
fn has_reason(text: &str, line: usize) -> bool {
    let lines: Vec<&str> = text.lines().collect();
    [line, line.saturating_sub(1)].iter().any(|l| lines[*l].contains("// words: "))
}

#[test]
fn tests_assert_codes_places_and_numbers_not_sentences() {
    let mut files = Vec::new();
    files_below(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests"), &mut files);
    let (mut all, mut unexplained) = (Vec::new(), Vec::new());
    for path in files.into_iter().filter(|p| !p.components().any(|c| c.as_os_str() == "structure")) {
        let text = fs::read_to_string(&path).unwrap();
        for (line, what) in searches_for_words(&text) {
            let shown = format!("{}:{}: {what}", path.display(), line + 1);
            if !has_reason(&text, line) {
                unexplained.push(shown.clone());
            }
            all.push(shown);
        }
    }
    println!("{} assertions on words:\n{}", all.len(), all.join("\n"));
    assert!(all.len() <= MOST_ON_WORDS, "{} assertions on words:\n{}", all.len(), all.join("\n"));
    assert!(unexplained.is_empty(), "without a reason (// words: ...):\n{}", unexplained.join("\n"));
}

#[test]
fn an_assertion_on_words_is_seen() {
    let text = r#"
        assert!(error.what.contains("is not a number"), "{error}");
        assert!(error.to_string().contains("mirrored"));
        assert!(refuse("k", same).contains("orthonormal"));
        assert!(text(&run.stderr).contains(&format!("{count} left out")));
        assert!(words.iter().all(|w| said.contains(w)));
        assert!(String::from_utf8_lossy(&run.stdout).contains("holds: yes"));
        assert!(notices[0].what.starts_with("damaged"));
        assert!(error.place.ends_with("joints.csv:5") && said.contains("joint_a3"));
        assert!(names.contains("image") && n.starts_with("plate"));
        assert!(error.remedy.contains("--joint-unit") && chosen.contains(&index));
        assert!((0.5..2.0).contains(&ratio), "the ratio is {ratio}");
        assert_says(&error, Code::CsvNumber, &["joints.csv:5", "is not a number"]);
        assert_says(&error, Code::CsvNumber, &["joints.csv:5", "marker 4"]);
    "#;
    let found: Vec<usize> = searches_for_words(text).into_iter().map(|(line, _)| line).collect();
    assert_eq!(found, [1, 2, 3, 4, 5, 6, 7, 12]);
}
