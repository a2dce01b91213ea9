//! No two files import each other, directly or in a circle: what both need stands in a file of its own.

use std::path::{Path, PathBuf};

use crate::imports::{Sources, rooms};

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

/// The test above finds what it has to find: circles through nested braces, re-exports, paths in the code and the file of a folder.
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
