//! Random numbers are the same on every machine: results are promised to the last bit.

use std::fs;
use std::path::Path;

use super::imports::files_below;

/// Generators whose numbers differ between machines, or between versions of their crate.
const UNSTABLE: [&str; 5] = ["SmallRng", "StdRng", "ThreadRng", "SysRng", "rand::rng("];

#[test]
fn random_numbers_come_from_a_generator_that_is_stable() {
    let mut files = Vec::new();
    files_below(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut files);
    let texts: Vec<(String, String)> =
        files.iter().map(|path| (path.display().to_string(), fs::read_to_string(path).unwrap())).collect();
    assert!(texts.iter().filter(|(_, text)| text.contains("ChaCha8Rng")).count() > 5);
    let unstable = |(_, text): &&(String, String)| UNSTABLE.iter().any(|name| text.contains(name));
    let found: Vec<&String> = texts.iter().filter(unstable).map(|(path, _)| path).collect();
    assert!(found.is_empty(), "take ChaCha8Rng: {found:#?}");
}
