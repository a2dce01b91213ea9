//! Who imports whom, read from the sources: `use` lines with all their braces and the paths that stand in the code, each followed
//! through re-exports to the file that defines the name.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Path of a module or of a name from the root of the crate.
pub type Module = Vec<String>;

/// A source file as far as its imports go.
struct Source {
    file: PathBuf,
    /// What its `use` lines bring in: name -> full path.
    names: BTreeMap<String, Module>,
    /// Modules of which everything is brought in.
    globs: Vec<Module>,
    /// Full paths that it uses.
    used: BTreeSet<Module>,
}

/// Files that import each other.
pub struct Circle {
    /// What ties them, a line an import.
    pub ties: Vec<String>,
}

/// All source files of the crate by their modules.
pub struct Sources(BTreeMap<Module, Source>);

/// Rust files below a folder, in order.
pub fn files_below(folder: &Path, into: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files_below(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

fn module_of(file: &Path) -> Module {
    let path = file.with_extension("");
    let parts = path.iter().map(|p| p.to_string_lossy().into_owned());
    parts.filter(|p| !["mod", "lib", "main"].contains(&p.as_str())).collect()
}

/// The code before the unit tests of a file.
fn without_tests(text: &str) -> &str {
    text.split("#[cfg(test)]\nmod ").next().unwrap_or("")
}

/// Names, `::` and single signs; without comments and texts.
fn tokens(code: &str) -> Vec<String> {
    let part_of_name = |c: char| c.is_alphanumeric() || c == '_';
    let mut out = Vec::new();
    let mut rest = code;
    while let Some(c) = rest.chars().next() {
        let raw = ["r\"", "r#\""].iter().find(|o| rest.starts_with(**o));
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if let Some(open) = raw {
            let close = format!("\"{}", "#".repeat(open.len() - 2));
            open.len() + rest[open.len()..].find(&close).unwrap() + close.len()
        } else if c == '"' {
            let mut escaped = false;
            let end = rest[1..].find(|c| {
                let ends = c == '"' && !escaped;
                escaped = c == '\\' && !escaped;
                ends
            });
            end.unwrap() + 2
        } else if rest.starts_with("'\"'") {
            3
        } else if part_of_name(c) {
            let end = rest.find(|c| !part_of_name(c)).unwrap_or(rest.len());
            out.push(rest[..end].to_owned());
            end
        } else {
            let sign = if rest.starts_with("::") { "::" } else { &rest[..c.len_utf8()] };
            if !c.is_whitespace() {
                out.push(sign.to_owned());
            }
            sign.len()
        };
        rest = &rest[length..];
    }
    out
}

/// Leaves of a `use` tree that starts at `tokens[at]`: path and the name that it gets; and where the tree ends.
fn use_tree(tokens: &[String], mut at: usize, before: &[String], leaves: &mut Vec<(Module, String)>) -> usize {
    let mut path = before.to_vec();
    loop {
        match tokens[at].as_str() {
            "{" => {
                at += 1;
                while tokens[at] != "}" {
                    at = use_tree(tokens, at, &path, leaves);
                    at += usize::from(tokens[at] == ",");
                }
                return at + 1;
            }
            "::" => at += 1,
            "self" if !path.is_empty() => at += 1,
            "as" => {
                leaves.push((path, tokens[at + 1].clone()));
                return at + 2;
            }
            "," | ";" | "}" => {
                let name = path.last().unwrap().clone();
                leaves.push((path, name));
                return at;
            }
            part => {
                path.push(part.to_owned());
                at += 1;
            }
        }
    }
}

/// `crate`, `super` and `self` at the start of a path taken away; `None` for a path that starts otherwise.
fn from_root(own: &[String], path: &[String]) -> Option<Module> {
    let mut base = match path.first()?.as_str() {
        "crate" | "robotcal" => Vec::new(),
        "super" => own[..own.len().checked_sub(1)?].to_vec(),
        "self" => own.to_vec(),
        _ => return None,
    };
    for part in &path[1..] {
        match part.as_str() {
            "super" => drop(base.pop()),
            _ => base.push(part.clone()),
        }
    }
    Some(base)
}

fn source(file: &Path, text: &str) -> Source {
    let own = module_of(file);
    let tokens = tokens(text);
    let mut source = Source { file: file.to_owned(), names: BTreeMap::new(), globs: Vec::new(), used: BTreeSet::new() };
    let children: BTreeSet<&String> =
        tokens.windows(3).filter(|w| w[0] == "mod" && w[2] == ";").map(|w| &w[1]).collect();
    let full = |path: &[String]| {
        let child = || children.contains(&path[0]).then(|| [&own[..], path].concat());
        from_root(&own, path).or_else(child)
    };
    let mut at = 0;
    while at < tokens.len() {
        // `use<'a>` says what an `impl` captures.
        if tokens[at] == "use" && tokens.get(at + 1).is_some_and(|t| t != "<") {
            let handed_on = at > 0 && (tokens[at - 1] == "pub" || tokens[at - 1] == ")");
            let mut leaves = Vec::new();
            at = use_tree(&tokens, at + 1, &[], &mut leaves);
            for (path, name) in leaves {
                let Some(path) = full(&path) else { continue };
                if name == "*" {
                    source.globs.push(path[..path.len() - 1].to_vec());
                    continue;
                }
                // A name that is only handed on is no import.
                let at_home = || tokens.iter().filter(|t| **t == name).count() > 1;
                if !handed_on || at_home() {
                    source.used.insert(path.clone());
                }
                source.names.insert(name, path);
            }
            continue;
        }
        let start = at;
        while tokens.get(at + 1).is_some_and(|t| t == "::") && tokens.get(at + 2).is_some_and(|t| t != "<" && t != "{")
        {
            at += 2;
        }
        if at > start {
            let path: Vec<String> = tokens[start..=at].iter().step_by(2).cloned().collect();
            let imported = || source.names.get(&path[0]).map(|p| [&p[..], &path[1..]].concat());
            if let Some(path) = full(&path).or_else(imported) {
                source.used.insert(path);
            }
        }
        at += 1;
    }
    source
}

/// Rooms that a file (its path inside `src`) names, in its unit tests, too.
pub fn rooms(file: &Path, text: &str) -> BTreeSet<String> {
    let source = source(file, text);
    let paths = source.used.iter().chain(source.names.values()).chain(&source.globs);
    paths.filter_map(|p| p.first().cloned()).collect()
}

impl Sources {
    /// The sources of this crate.
    pub fn read() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let mut files = Vec::new();
        files_below(&root, &mut files);
        assert!(files.len() > 30, "found only {} source files", files.len());
        let inside = |f: &PathBuf| f.strip_prefix(&root).unwrap().to_owned();
        Self::of(files.iter().map(|f| (inside(f), fs::read_to_string(f).unwrap())).collect())
    }

    /// Sources with the given paths and texts.
    pub fn of(files: Vec<(PathBuf, String)>) -> Self {
        let files = files.into_iter().filter(|(f, _)| !f.ends_with("main.rs"));
        Self(files.map(|(file, text)| (module_of(&file), source(&file, without_tests(&text)))).collect())
    }

    /// The module whose file defines what a full path names, and `None` for what names a whole module.
    fn defined_in(&self, path: &[String], depth: usize) -> Option<Module> {
        let known = (0..=path.len()).rev().find(|k| self.0.contains_key(&path[..*k]))?;
        let name = path.get(known)?;
        let source = &self.0[&path[..known]];
        if depth > 0 {
            if let Some(target) = source.names.get(name) {
                return self.defined_in(&[&target[..], &path[known + 1..]].concat(), depth - 1);
            }
            let through = |g: &Module| self.defined_in(&[&g[..], &path[known..]].concat(), depth - 1);
            if let Some(found) = source.globs.iter().filter(|_| known > 0).find_map(through) {
                return Some(found);
            }
        }
        Some(path[..known].to_vec())
    }

    /// Files that each file takes names from, and which names.
    fn imports(&self) -> BTreeMap<&Module, BTreeMap<Module, BTreeSet<&str>>> {
        let mut all: BTreeMap<&Module, BTreeMap<Module, BTreeSet<&str>>> = BTreeMap::new();
        for (module, source) in &self.0 {
            let of = all.entry(module).or_default();
            for path in &source.used {
                if let Some(definer) = self.defined_in(path, 5).filter(|d| d != module) {
                    of.entry(definer).or_default().insert(path.last().unwrap());
                }
            }
        }
        all
    }

    /// Groups of files that import each other in a circle.
    pub fn circles(&self) -> Vec<Circle> {
        let imports = self.imports();
        let reached = |from: &Module| {
            let mut seen: BTreeSet<Module> = BTreeSet::new();
            let mut open = vec![from.clone()];
            while let Some(next) = open.pop() {
                open.extend(imports[&next].keys().filter(|m| seen.insert((*m).clone())).cloned());
            }
            seen
        };
        let reach: BTreeMap<&Module, BTreeSet<Module>> = self.0.keys().map(|m| (m, reached(m))).collect();
        let mut circles = Vec::new();
        let mut done: BTreeSet<&Module> = BTreeSet::new();
        for module in self.0.keys().filter(|m| reach[m].contains(*m)) {
            let circle: Vec<&Module> =
                self.0.keys().filter(|m| reach[module].contains(*m) && reach[m].contains(module)).collect();
            if done.contains(module) {
                continue;
            }
            done.extend(&circle);
            let file = |m: &Module| self.0[m].file.as_path();
            let ties = circle.iter().flat_map(|a| {
                let within = imports[*a].iter().filter(|(b, _)| circle.contains(b));
                within.map(|(b, names)| {
                    let names: Vec<&str> = names.iter().copied().collect();
                    format!("{} -> {}: {}", file(a).display(), file(b).display(), names.join(", "))
                })
            });
            circles.push(Circle { ties: ties.collect() });
        }
        circles
    }
}
