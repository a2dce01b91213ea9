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

/// What a file imports of another one.
struct Tie {
    from: PathBuf,
    to: PathBuf,
    names: String,
}

/// Files or folders that import each other.
pub struct Circle {
    /// Their paths, in order.
    pub entries: Vec<PathBuf>,
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

    /// All imports of files from each other.
    fn ties(&self) -> Vec<Tie> {
        let file = |m: &Module| self.0[m].file.clone();
        let of = |(from, imports): (&Module, BTreeMap<Module, BTreeSet<&str>>)| {
            let tie = |(to, names): (Module, BTreeSet<&str>)| {
                let names: Vec<&str> = names.into_iter().collect();
                Tie { from: file(from), to: file(&to), names: names.join(", ") }
            };
            imports.into_iter().map(tie).collect::<Vec<_>>()
        };
        self.imports().into_iter().flat_map(of).collect()
    }

    /// Groups of files that import each other in a circle.
    pub fn circles(&self) -> Vec<Circle> {
        circles(&self.ties(), |file| Some(file.to_owned()))
    }

    /// Groups of folders beside each other whose files import each other in a circle, also through files that stand beside the folders.
    pub fn circles_of_folders(&self) -> Vec<Circle> {
        let folders: BTreeSet<&Path> = self.0.values().flat_map(|s| s.file.ancestors().skip(1)).collect();
        let ties = self.ties();
        let within =
            |folder: &Path| circles(&ties, |file| Some(folder.join(file.strip_prefix(folder).ok()?.iter().next()?)));
        let rooms = folders.into_iter().filter(|f| !f.as_os_str().is_empty());
        rooms.flat_map(within).filter(|circle| circle.entries.iter().any(|e| e.extension().is_none())).collect()
    }
}

/// Groups that import each other in a circle; `group` says to which a file belongs.
fn circles(ties: &[Tie], group: impl Fn(&Path) -> Option<PathBuf>) -> Vec<Circle> {
    let mut graph: BTreeMap<PathBuf, BTreeMap<PathBuf, Vec<String>>> = BTreeMap::new();
    for Tie { from, to, names } in ties {
        let (Some(own), Some(other)) = (group(from), group(to)) else { continue };
        graph.entry(other.clone()).or_default();
        let of = graph.entry(own.clone()).or_default();
        if own != other {
            of.entry(other).or_default().push(format!("{} -> {}: {names}", from.display(), to.display()));
        }
    }
    let reached = |from: &PathBuf| {
        let mut seen: BTreeSet<&PathBuf> = BTreeSet::new();
        let mut open: Vec<&PathBuf> = graph[from].keys().collect();
        while let Some(next) = open.pop() {
            if seen.insert(next) {
                open.extend(graph[next].keys());
            }
        }
        seen
    };
    let reach: BTreeMap<&PathBuf, BTreeSet<&PathBuf>> = graph.keys().map(|group| (group, reached(group))).collect();
    let mut circles: Vec<Circle> = Vec::new();
    for start in graph.keys().filter(|group| reach[group].contains(group)) {
        if circles.iter().any(|c| c.entries.contains(start)) {
            continue;
        }
        let is_tied = |group: &&PathBuf| reach[start].contains(group) && reach[group].contains(start);
        let entries: Vec<PathBuf> = graph.keys().filter(is_tied).cloned().collect();
        let of = |own: &PathBuf| entries.iter().filter_map(|other| graph[own].get(other)).flatten().cloned().collect();
        let ties = entries.iter().flat_map(|own| -> Vec<String> { of(own) }).collect();
        circles.push(Circle { entries, ties });
    }
    circles
}
