//! No two files import each other, directly or in a circle, and no two folders of a room: what both need stands in a file of its own, or in a folder
//! below both.

use std::path::{Path, PathBuf};

use crate::imports::{Circle, Sources, rooms};

/// Sources of a crate that is made up: path and text.
fn crate_of(files: &[(&str, &str)]) -> Sources {
    Sources::of(files.iter().map(|(path, text)| (PathBuf::from(path), (*text).to_owned())).collect())
}

#[test]
fn files_do_not_import_each_other_in_a_circle() {
    let circles = Sources::read().circles();
    let shown: Vec<String> = circles.iter().map(|c| c.ties.join("\n  ")).collect();
    assert!(circles.is_empty(), "{} circles of files:\n  {}", circles.len(), shown.join("\n\n  "));
}

/// Circles of folders that may stay: what imports each other, and why.
const STAY: [(&[&str], &str); 2] = [
    (
        &["detect/circles", "detect/detection.rs", "detect/size_seen.rs"],
        "a detection of any plate holds what only circles tell, and the detector of grids of dots hands one back",
    ),
    (
        &["diagnose/finding.rs", "diagnose/focus.rs", "diagnose/steps"],
        "the closed set of findings names all kinds, and one check of steps finds several of them",
    ),
];

#[test]
fn folders_do_not_import_each_other_in_a_circle() {
    let circles = Sources::read().circles_of_folders();
    let may_stay =
        |circle: &&Circle| STAY.iter().any(|(entries, _)| circle.entries.iter().eq(entries.iter().map(Path::new)));
    let (stay, others): (Vec<&Circle>, Vec<&Circle>) = circles.iter().partition(may_stay);
    let shown: Vec<String> = others.iter().map(|c| c.ties.join("\n  ")).collect();
    assert!(others.is_empty(), "{} circles of folders:\n  {}", others.len(), shown.join("\n\n  "));
    assert_eq!(stay.len(), STAY.len(), "circles that are gone are still allowed");
}

/// The test above finds circles of folders whose files are in none, also through a file beside the folders and at a lower level.
#[test]
fn a_circle_of_folders_is_found() {
    let low = |path| (path, "pub fn low() {}");
    let direct = [
        ("a/one/x.rs", "use crate::a::two::y::low;"),
        low("a/two/y.rs"),
        ("a/two/z.rs", "use crate::a::one::w::low;"),
        low("a/one/w.rs"),
    ];
    let through = [
        ("a/b/one/x.rs", "use crate::a::b::beside::low;"),
        ("a/b/beside.rs", "use crate::a::b::two::y::low as lower;\npub fn low() { lower() }"),
        low("a/b/two/y.rs"),
        ("a/b/two/z.rs", "use crate::a::b::one::w::low;"),
        low("a/b/one/w.rs"),
    ];
    for (files, entries) in
        [(&direct[..], &["a/one", "a/two"][..]), (&through, &["a/b/beside.rs", "a/b/one", "a/b/two"])]
    {
        let sources = crate_of(files);
        assert!(sources.circles().is_empty());
        let found = sources.circles_of_folders();
        assert_eq!(found.len(), 1);
        assert!(found[0].entries.iter().eq(entries.iter().map(Path::new)), "{:?}", found[0].entries);
    }
    assert!(crate_of(&direct[..2]).circles_of_folders().is_empty());
}

/// The tests above find what they have to find: circles through nested braces, re-exports, paths in the code and the file of a folder.
#[test]
fn a_circle_is_found_however_it_is_written() {
    let face = ("a/mod.rs", "mod one; mod two; pub use one::One; pub use two::{Two, two};");
    let by_braces = ("a/one.rs", "use crate::{a::{two::Two}, b};\npub struct One(Two);");
    let by_reexport = ("a/two.rs", "use super::One;\npub struct Two;\npub fn two(_: One) {}");
    let by_path = ("a/two.rs", "pub struct Two;\npub fn two() { crate::a::one::work(\"//\") }");
    let in_words = (
        "a/two.rs",
        "pub struct Two; // crate::a::one::work()\n/// See [`super::One`].\npub fn two() -> &'static str { \"crate::a::One\" }",
    );
    let in_tests = ("a/two.rs", "pub struct Two;\n#[cfg(test)]\nmod tests { use super::super::One; }");
    let files = |two| crate_of(&[("lib.rs", "mod a; mod b;"), face, by_braces, two, ("b.rs", "pub fn b() {}")]);
    for (two, count) in [(by_reexport, 1), (by_path, 1), (in_words, 0), (in_tests, 0)] {
        assert_eq!(files(two).circles().len(), count, "{}", two.1);
    }
    let child = ("c/child.rs", "use super::Shared;\npub fn work(_: Shared) {}");
    let parent = ("c/mod.rs", "mod child;\npub struct Shared;\npub fn all() { child::work(Shared) }");
    assert_eq!(crate_of(&[parent, child]).circles().len(), 1);
}

#[test]
fn rooms_are_seen_through_nested_braces() {
    let text =
        "use crate::{b::{X, Y as Z}, c};\nfn f() { crate::d::e() }\n#[cfg(test)]\nmod tests { use crate::{f::*}; }";
    let named: Vec<String> = rooms(Path::new("a.rs"), text).into_iter().collect();
    assert_eq!(named, ["b", "c", "d", "f"]);
}
