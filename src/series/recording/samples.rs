//! Readings of joints as the messages have them.

use std::rc::Rc;

/// Some joints at one time.
#[derive(Debug, Clone)]
pub(super) struct JointSample {
    pub time_ns: i64,
    pub names: Rc<Vec<String>>,
    /// As recorded: angles in rad or deg, lengths in m.
    pub positions: Vec<f64>,
    /// Joints of the message without a position that is a number.
    pub unread: Rc<Vec<String>>,
    /// What tells its publisher from others, see `JointState::marks`.
    pub marks: Rc<Vec<String>>,
}

/// Publishers of one topic that may take turns.
const MOST_IN_TURN: usize = 8;

/// The names of one of the last samples where they are the same; memory that others need is added to `held`.
pub(super) fn shared(
    samples: &[JointSample],
    of: impl Fn(&JointSample) -> &Rc<Vec<String>>,
    names: Vec<String>,
    held: &mut usize,
) -> Rc<Vec<String>> {
    match samples.iter().rev().take(MOST_IN_TURN).map(of).find(|last| ***last == names) {
        Some(last) => Rc::clone(last),
        None => {
            *held += names.iter().map(|n| n.len() + size_of::<String>()).sum::<usize>();
            Rc::new(names)
        }
    }
}
