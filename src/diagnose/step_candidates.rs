//! What may differ between stops of the same robot, and a way to divide stops by it; for [`super::pose_step`].

use std::ops::Range;
use std::rc::Rc;

use crate::problem::{Layout, Problem};

/// What may be another from some stop on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Changed {
    /// The pose of a plate.
    Placement(usize),
    /// The pose of a camera.
    Mounting(usize),
    /// The frame of a tracker, or of given places.
    Instrument(usize),
    /// A body on the tip.
    Target(usize),
    /// The zero of a reading.
    Zero(usize),
    /// The focal lengths of a camera.
    Focal(usize),
}

impl Changed {
    pub(super) fn columns(self, layout: &Layout, zeros: &[Option<usize>]) -> Range<usize> {
        let told = |range: &Range<usize>| {
            let count = range.clone().take_while(|c| layout.columns[*c].free).count();
            range.start..range.start + count
        };
        match self {
            Self::Placement(p) => layout.placements[p].clone(),
            Self::Mounting(m) => layout.mountings[m].clone(),
            Self::Instrument(i) => told(&layout.instruments[i]),
            Self::Target(b) => told(&layout.bodies[b]),
            Self::Zero(reading) => zeros[reading].map_or(0..0, |c| c..c + 1),
            Self::Focal(c) => layout.cameras[c].start..layout.cameras[c].start + 2,
        }
    }
}

/// How the stops are divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// By rows: changed once.
    Time,
    /// By how far this axis of what the robot carries points up: held by its weight only.
    Up(usize),
    /// Not at all: it creeps with the rows.
    Drift,
    /// Not at all: another than in the other series.
    Whole,
}

/// Something that was measured at a stop.
#[derive(Debug, Clone, Copy)]
pub(super) enum Shown {
    /// An image, with up in the axes of what the robot carries.
    Image { index: usize, up: [f64; 3] },
    /// A measurement of a body.
    Measurement(usize),
}

impl Shown {
    /// Its series, and its place in it.
    pub(super) fn place(self, problem: &Problem) -> (usize, usize) {
        match self {
            Self::Image { index, .. } => (problem.images[index].series, index),
            Self::Measurement(k) => problem.body_measurements[k].read,
        }
    }

    pub(super) fn series(self, problem: &Problem) -> usize {
        self.place(problem).0
    }

    pub(super) fn tells_of(self, problem: &Problem, changed: Changed) -> bool {
        match (self, changed) {
            (_, Changed::Zero(_)) => true,
            (Self::Image { index, .. }, Changed::Placement(p)) => problem.images[index].placement == p,
            (Self::Image { index, .. }, Changed::Mounting(m)) => problem.images[index].mounting == m,
            (Self::Image { index, .. }, Changed::Focal(c)) => problem.images[index].camera == c,
            (Self::Measurement(k), Changed::Instrument(i)) => problem.body_measurements[k].instrument == i,
            (Self::Measurement(k), Changed::Target(b)) => problem.body_measurements[k].body == b,
            _ => false,
        }
    }
}

/// A way to divide stops: the rows of [`Linear`] behind the step, from the last on.
#[derive(Clone)]
pub(super) struct Candidate {
    pub(super) changed: Changed,
    pub(super) order: Order,
    pub(super) group: usize,
    /// Rows in order; the step lies before `from`.
    pub(super) rows: Rc<Vec<usize>>,
    pub(super) from: usize,
    /// Fewest rows on either side; none where there is no other side.
    pub(super) fewest: usize,
}

/// Most steps that are tried in one order before those beside the best of them.
const MOST_TRIED: usize = 500;

/// Rows from one step that is tried to the next.
pub(super) fn stride(rows: usize) -> usize {
    rows.div_ceil(MOST_TRIED).max(1)
}

impl Candidate {
    /// Itself, and steps between it and the next that were tried, from the last on.
    pub(super) fn neighbours(&self) -> Vec<Self> {
        let near = if self.fewest == 0 { 0 } else { stride(self.rows.len()) - 1 };
        let first = self.from.saturating_sub(near).max(self.fewest);
        let last = (self.from + near).min(self.rows.len() - self.fewest);
        let at = |from| Self { rows: self.rows.clone(), from, ..*self };
        (first..=last).rev().map(at).collect()
    }

    /// The rows that it moves, and by which part of it.
    pub(super) fn moved(&self) -> impl Iterator<Item = (usize, f64)> {
        let last = self.rows.len().saturating_sub(1).max(1) as f64;
        let part = move |k: usize| if self.order == Order::Drift { k as f64 / last } else { 1.0 };
        self.rows.iter().enumerate().skip(self.from).map(move |(k, row)| (*row, part(k)))
    }
}
