//! What holds behind a statement with branches: only what holds behind every branch.

/// Something that statements set, as a tool, and that may depend on which branch was taken.
pub(super) trait Merged: Clone {
    /// What is known where either holds.
    fn merged(&self, other: &Self) -> Self;
}

/// Kinds of statements with branches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Branching {
    /// Its first branch begins with it.
    If,
    /// Nothing stands before its first branch.
    Cases,
    /// A loop that may not run at all.
    Loop,
    /// A loop that runs at least once.
    LoopTaken,
}

/// The statements with branches, and loops, that are open.
pub(super) struct Branches<T> {
    open: Vec<Open<T>>,
}

struct Open<T> {
    before: T,
    /// What holds at the end of the branches so far.
    ends: Vec<T>,
    /// False while none of the branches need be taken.
    one_is_taken: bool,
    /// False before the first branch.
    is_in_branch: bool,
}

impl<T: Merged> Branches<T> {
    /// None is open.
    pub fn new() -> Self {
        Self { open: Vec::new() }
    }

    /// A routine begins, where nothing is open.
    pub fn start_afresh(&mut self) {
        self.open.clear();
    }

    /// A statement begins where `now` holds.
    pub fn begin(&mut self, now: &T, kind: Branching) {
        self.open.push(Open {
            before: now.clone(),
            ends: Vec::new(),
            one_is_taken: kind == Branching::LoopTaken,
            is_in_branch: kind != Branching::Cases,
        });
    }

    /// Another branch begins, with what held before the statement; the last one is taken where no other is.
    pub fn next(&mut self, now: &mut T, is_last: bool) {
        if let Some(open) = self.open.last_mut() {
            let end = std::mem::replace(now, open.before.clone());
            open.ends.extend(std::mem::replace(&mut open.is_in_branch, true).then_some(end));
            open.one_is_taken |= is_last;
        }
    }

    /// The statement ends.
    pub fn end(&mut self, now: &mut T) {
        let Some(open) = self.open.pop() else { return };
        let not_taken = (!open.one_is_taken).then_some(open.before);
        for other in open.ends.iter().chain(&not_taken) {
            *now = now.merged(other);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Clone, PartialEq)]
    struct Tool(Option<u8>);

    impl Merged for Tool {
        fn merged(&self, other: &Self) -> Self {
            if self == other { self.clone() } else { Self(None) }
        }
    }

    /// Behind a statement whose branches leave these tools, begun with tool 0.
    fn behind(branches: &[u8], has_else: bool) -> Option<u8> {
        let both = [Branching::If, Branching::Cases].map(|kind| behind_a(kind, branches, has_else));
        assert_eq!(both[0], both[1]);
        both[0]
    }

    fn behind_a(kind: Branching, branches: &[u8], has_else: bool) -> Option<u8> {
        let (mut open, mut now) = (Branches::new(), Tool(Some(0)));
        open.begin(&now, kind);
        for (k, tool) in branches.iter().enumerate() {
            if k > 0 || kind == Branching::Cases {
                open.next(&mut now, has_else && k + 1 == branches.len());
            }
            assert_eq!(now, Tool(Some(0)));
            now = Tool(Some(*tool));
        }
        open.end(&mut now);
        now.0
    }

    #[test]
    fn what_all_branches_leave_alike_holds_behind_them() {
        assert_eq!(behind(&[1], false), None);
        assert_eq!(behind(&[0], false), Some(0));
        assert_eq!(behind(&[1, 1], true), Some(1));
        assert_eq!(behind(&[1, 1], false), None);
        assert_eq!(behind(&[1, 2], true), None);
    }

    #[test]
    fn a_loop_that_runs_at_least_once_leaves_what_its_body_does() {
        let (mut open, mut now) = (Branches::new(), Tool(Some(0)));
        open.begin(&now, Branching::LoopTaken);
        now = Tool(Some(1));
        open.end(&mut now);
        assert_eq!(now, Tool(Some(1)));
    }
}
