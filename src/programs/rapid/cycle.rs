//! The controller runs `main` again from its end, until it is stopped (ABB, *Operating manual*, run mode Continuous).

/// Stands for what holds where `main` begins again; no routine has a blank in its name.
pub(super) const AGAIN: &str = "main again";

/// Whether the routine that is being read is run again from its end.
#[derive(Debug, Default)]
pub(super) struct Cycle {
    /// True in `main` where no other routine calls it.
    pub is_main: bool,
    /// True behind a loop that never ends: the end of the routine is not reached.
    pub is_endless: bool,
    /// Branches and loops that are open.
    pub depth: usize,
}

impl Cycle {
    /// A routine begins.
    pub fn begins(&mut self, is_main: bool) {
        *self = Self { is_main, ..Self::default() };
    }

    /// A loop begins, which never ends (`WHILE TRUE DO`), or does.
    pub fn loops(&mut self, forever: bool) {
        self.is_endless |= forever && self.depth == 0;
    }
}
