//! Declared positions that no motion of the files goes to.

use super::{Module, Value};
use crate::programs::names::plain;
use crate::programs::program::Target;
use crate::programs::reason::{DeclaredPoint, LeftReason, Why};

impl Module<'_> {
    /// Declared positions that no motion of the files goes to and that are no frames: by their own motion data (`XP1` with `FP1`), or by the flags.
    pub(super) fn unvisited(&mut self) {
        self.now.0 = self.begun().0;
        for (name, file, line) in std::mem::take(&mut self.declared) {
            let Some(Value::Aggregate(a)) = self.values.get(&name).filter(|_| !self.uses.is_frame(&name)) else {
                continue;
            };
            let own = name.strip_prefix('X').map(|n| format!("F{n}"));
            let data = own.and_then(|own| match self.values.get(&own).or_else(|| self.values.get(&plain(&own))) {
                Some(Value::Aggregate(data)) => self.data_frames(data),
                _ => None,
            });
            let kind = self.kind(a, &data.unwrap_or_default());
            if let Ok(kind) = &kind
                && self.way.has(file, kind)
            {
                continue;
            }
            let program = &self.way.program;
            let visited = program.targets.iter().any(|t| t.file == file && t.line == line && t.name == name);
            // A motion that goes there said why it stays.
            if visited || program.left.iter().any(|l| l.why.about.as_deref() == Some(&name)) {
                continue;
            }
            let used = self.uses.of(&name).map(|by| Why::new(LeftReason::NotATarget, format!("{by} depends on it")));
            let done =
                used.map_or(kind, Err).map(|kind| self.way.declare(Target::at((file, line), name.clone(), kind)));
            if let Err(why) = done {
                let words = format!("no motion of the files goes there, and {}", why.words);
                self.leave_at(file, line, &name, Why::new(LeftReason::Unvisited, words));
            }
        }
    }

    /// The declared points from which the target of a motion starts that is an expression.
    pub(super) fn points_in(&self, value: &Value, file: usize, line: usize) -> Vec<DeclaredPoint> {
        let names = self.uses.in_motion(file, line).filter(|_| matches!(value, Value::Expression));
        let point = |name: &String| match self.values.get(name)? {
            Value::Aggregate(a) | Value::Copied(Ok((a, _))) => {
                Some(DeclaredPoint { name: name.clone(), file: a.file, line: a.line })
            }
            _ => None,
        };
        names.filter_map(point).collect()
    }
}
