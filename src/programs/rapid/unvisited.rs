//! Declared targets to which no known move goes: by what other statements do with them, or by the flags.

use super::switched::{DISPLACES, OFFSETS};
use super::untold::Untold;
use super::uses::{Does, Use};
use super::value::{Node, array_of, element, is_of_external_axes, is_placeholder, node};
use super::{Datum, Task};
use crate::error::Result;
use crate::programs::program::{Left, Target, TargetKind, Understood};
use crate::programs::reason::{LeftReason, Why};
use crate::programs::scan::Reader;

impl Task<'_> {
    /// Notes the points that a statement uses; the reader stands on its first word.
    pub(super) fn used(&mut self, reader: &mut Reader<'_>, by: &str, end: usize) -> Result<()> {
        let (mut names, mut work) = (Vec::new(), None);
        let mut computes = DISPLACES.contains(&by) || OFFSETS.contains(&by);
        reader.at += 1;
        while reader.at < end {
            let is_switch = reader.ahead_is_mark(-1, b'\\');
            let Some(word) = reader.name() else {
                computes |= reader.is_mark(b':') && reader.ahead_is_mark(1, b'=');
                reader.at += 1;
                continue;
            };
            reader.at += 1;
            if is_switch && reader.take_mark(b'?') {
                // What it hands on may be there or not.
                reader.at += 1;
                work = if word == "WOBJ" { Some(Node::Perhaps) } else { work };
                continue;
            }
            let assigned = is_switch && reader.is_mark(b':') && reader.ahead_is_mark(1, b'=');
            if assigned {
                reader.at += 2;
            }
            if assigned && word == "WOBJ" {
                work = Some(node(reader)?);
            } else if !is_switch {
                names.push(element(reader, word));
            }
        }
        // Axis angles with which something is computed are what they are.
        let is_point = |name: &&String| {
            let kind = self.data.get(*name).map_or("", |d| &d.kind);
            kind == "ROBTARGET" || (kind == "JOINTTARGET" && !computes)
        };
        let points: Vec<String> = names.iter().filter(is_point).cloned().collect();
        let tool = names.into_iter().find(|name| self.is_tool(name));
        for point in points {
            let does = if computes { Does::Compute } else { Does::Go { tool: tool.clone(), work: work.clone() } };
            self.uses.entry(point).or_default().push(Use { by: by.to_owned(), does });
        }
        Ok(())
    }

    /// What a declared target says to which no known move goes, one for each tool and work object with which it is used.
    fn unvisited_kinds(&self, name: &str, value: &Node, file: usize) -> Understood<Vec<TargetKind>> {
        let untold = || {
            let words = "its work object is not named; give --work, and --tool where no tool is named either";
            Err(Untold::Nowhere(Why::new(LeftReason::FrameUnknown, words)))
        };
        let uses = self.uses.get(name).map(Vec::as_slice).unwrap_or_default();
        let mut found: Vec<TargetKind> = Vec::new();
        for Use { by, does } in uses {
            let Does::Go { tool, work } = does else {
                return Err(Why::new(LeftReason::NotATarget, format!("{by} depends on it")));
            };
            let base = work.as_ref().map_or_else(untold, |work| self.work(Some(work)));
            let kind = self.kind(value, file, tool.as_deref(), base)?;
            let known = found.iter_mut().find(|other| other.has_frames_of(&kind));
            match (known, kind) {
                (Some(TargetKind::Joints(before)), TargetKind::Joints(joints)) => before.again(&joints.frames),
                (Some(_), _) => {}
                (None, kind) => found.push(kind),
            }
        }
        if found.is_empty() { self.kind(value, file, None, untold()).map(|kind| vec![kind]) } else { Ok(found) }
    }

    /// Declared targets to which no move of the files goes.
    pub(super) fn unvisited(&mut self) {
        self.may_carry();
        let all: Vec<(String, Datum)> = self.data.iter().map(|(n, d)| (n.clone(), d.clone())).collect();
        for (name, datum) in all.into_iter().filter(|(_, d)| d.kind.ends_with("TARGET")) {
            let seen =
                self.way.program.targets.iter().any(|t| t.file == datum.file && t.line == datum.line && t.name == name);
            let some = array_of(&name).map(|array| format!("{array}{{}}"));
            let about = |left: &Left| left.why.about.as_ref().is_some_and(|a| *a == name || Some(a) == some.as_ref());
            let known = self.way.program.left.iter().any(about);
            let Some(value) = datum.value.filter(|_| !seen && (!known || self.bases.contains_key(&name))) else {
                continue;
            };
            // Its numbers are those of another, and stand there.
            if self.meant(&name) != name && self.declared(&name).is_ok() {
                continue;
            }
            // Nothing of it is the arm's, or it has no value yet.
            if is_of_external_axes(&value) || is_placeholder(&value) {
                continue;
            }
            let place = (datum.file, datum.line);
            if let Some(base) = self.bases.remove(&name) {
                self.way.declare(base);
                continue;
            }
            match self.unvisited_kinds(&name, &value, datum.file) {
                Ok(kinds) => kinds.into_iter().for_each(|k| self.way.declare(Target::at(place, name.clone(), k))),
                Err(why) => {
                    let words = format!("no known move of the files goes there, and {}", why.words);
                    self.leave(place, &name, Why::new(LeftReason::Unvisited, words));
                }
            }
        }
    }
}
