//! Columns by the names that people give them.
//!
//! `joint_2.offset`, `robot/joint_2.offset` and `robot.joint_2.offset` are the same; `joint_3.origin` means all six numbers of it;
//! `camera.front.k3` needs no `lens`; `*` stands for any letters (`*.cos_1`).

use std::ops::Range;

use super::Layout;
use crate::error::{Code, Error, Result, closest_name};

/// Most names that a message proposes.
const MOST_PROPOSED: usize = 3;

/// Name for people: without `robot/` and the part of the camera, levels parted by points.
pub fn short_name(column: &str) -> String {
    let name = column.strip_prefix("robot/").unwrap_or(column);
    let name = match name.strip_prefix("camera/") {
        Some(rest) => format!("camera/{}", rest.replacen("/pinhole.", ".", 1).replacen("/lens.", ".", 1)),
        None => name.to_owned(),
    };
    name.replace('/', ".")
}

/// True where `pattern` names `column` itself, a block that it belongs to, or fits by its `*`.
pub fn names(pattern: &str, column: &str) -> bool {
    let pattern = pattern.replace('/', ".");
    [column.replace('/', "."), short_name(column)].iter().any(|name| {
        let block = name.strip_prefix(pattern.as_str()).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
        block || (pattern.contains('*') && fits(&pattern, name))
    })
}

/// `*` stands for any letters, none included.
fn fits(pattern: &str, name: &str) -> bool {
    let Some((head, rest)) = pattern.split_once('*') else { return pattern == name };
    let Some(tail) = name.strip_prefix(head) else { return false };
    let mut starts = tail.char_indices().map(|(k, _)| k).chain([tail.len()]);
    starts.any(|k| fits(rest, &tail[k..]))
}

impl Layout {
    /// Columns that a name means.
    ///
    /// # Errors
    /// A name that fits no column, with the closest ones; `place` says where the name stands.
    pub fn named(&self, place: &str, pattern: &str) -> Result<Vec<usize>> {
        self.named_within(0..self.len(), place, pattern)
    }

    /// The same among some columns.
    ///
    /// # Errors
    /// As [`Layout::named`].
    pub fn named_within(&self, columns: Range<usize>, place: &str, pattern: &str) -> Result<Vec<usize>> {
        let found: Vec<usize> = columns.clone().filter(|&c| names(pattern, &self.columns[c].name)).collect();
        if !found.is_empty() {
            return Ok(found);
        }
        let known: Vec<String> = self.columns[columns].iter().map(|c| short_name(&c.name)).collect();
        let remedy = proposals(pattern, &known);
        Err(Error::new(Code::ParameterUnknown, place, format!("there is no parameter '{pattern}'"), remedy))
    }
}

fn proposals(pattern: &str, known: &[String]) -> String {
    let plain = pattern.replace('/', ".");
    let mut left: Vec<&str> = known.iter().map(String::as_str).collect();
    let mut close = Vec::new();
    while let Some(name) = closest_name(&plain, left.iter().copied()).filter(|_| close.len() < MOST_PROPOSED) {
        close.push(name.to_owned());
        left.retain(|n| *n != name);
    }
    if !close.is_empty() {
        return format!("is {} meant?", close.join(" or "));
    }
    let block = plain.rsplit_once('.').map_or(plain.as_str(), |(block, _)| block);
    let of_block: Vec<&str> = known
        .iter()
        .map(String::as_str)
        .filter(|n| n.strip_prefix(block).is_some_and(|r| r.starts_with('.')))
        .collect();
    if !of_block.is_empty() {
        return format!("{block} has {}", of_block.join(", "));
    }
    let mut blocks: Vec<&str> = known.iter().filter_map(|n| n.rsplit_once('.')).map(|(b, _)| b).collect();
    blocks.dedup();
    format!("parameters are named block.component; the blocks are {}", blocks.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_long_and_starred_names_mean_the_same_column() {
        for pattern in
            ["joint_2.offset", "robot/joint_2.offset", "robot.joint_2.offset", "joint_2", "*.offset", "joint_*.off*"]
        {
            assert!(names(pattern, "robot/joint_2.offset"), "{pattern}");
        }
        for pattern in ["camera.front.k3", "camera/front/lens.k3", "camera.front", "camera.*.k3"] {
            assert!(names(pattern, "camera/front/lens.k3"), "{pattern}");
        }
        for pattern in ["joint_2", "offset", "joint_21.offset", "*.off"] {
            assert!(!names(pattern, "robot/joint_21.offse"), "{pattern}");
        }
        assert_eq!(short_name("robot/joint_3/origin.rx"), "joint_3.origin.rx");
    }

    #[test]
    fn an_unknown_name_is_answered_with_the_closest_or_its_block() {
        let known = ["joint_1.offset".to_owned(), "joint_2.offset".into(), "joint_2.gear".into()];
        assert_eq!(proposals("joint_2.ofset", &known), "is joint_2.offset meant?");
        assert!(proposals("joint_7.offset", &known).contains("the blocks are joint_1, joint_2"));
        assert_eq!(proposals("joint_2.spring_rate", &known), "joint_2 has joint_2.offset, joint_2.gear");
        assert!(proposals("nothing", &known).contains("the blocks are joint_1, joint_2"));
    }
}
