//! What may differ between stops of the same robot, and a way to divide stops by it; for [`super::pose_step`].

use std::collections::BTreeSet;
use std::ops::Range;
use std::rc::Rc;

use nalgebra::{DMatrix, Vector3};

use crate::problem::{Adjustment, InstrumentKind, Layout, Problem};

/// What may be another from some stop on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Changed {
    /// The pose of a plate.
    Placement(usize),
    /// The pose of a camera.
    Mounting(usize),
    /// The frame of a tracker, or of given places; a socket.
    Instrument(usize),
    /// Where a given place is stated to be, in its frame: that of the first measurement of it, and its instrument.
    Place { first: usize, instrument: usize },
    /// A body on the tip.
    Target(usize),
    /// All targets on the tip together: what holds them.
    Bracket,
    /// All sockets together: what they are fixed to.
    Fixture,
    /// The zero of a reading.
    Zero(usize),
    /// The focal lengths of a camera.
    Focal(usize),
    /// The principal point of a camera: its pictures are cut out elsewhere.
    Centre(usize),
}

impl Changed {
    /// Directions of it that have to be told: where a place is, is said along all axes.
    pub(super) const fn least_told(self) -> usize {
        match self {
            Self::Place { .. } => 3,
            _ => 1,
        }
    }

    pub(super) fn columns(self, layout: &Layout, zeros: &[Option<usize>]) -> Range<usize> {
        let told = |range: &Range<usize>| {
            let count = range.clone().take_while(|c| layout.columns[*c].free).count();
            range.start..range.start + count
        };
        match self {
            Self::Placement(p) => layout.placements[p].clone(),
            Self::Mounting(m) => layout.mountings[m].clone(),
            Self::Instrument(i) => told(&layout.instruments[i]),
            // A place that stands elsewhere in its frame is as that frame shifted where it was touched.
            Self::Place { instrument, .. } => {
                let start = layout.instruments[instrument].start;
                told(&(start..start + 3))
            }
            Self::Target(b) => told(&layout.bodies[b]),
            // No columns of their own: they move those of all targets, or sockets.
            Self::Bracket | Self::Fixture => 0..0,
            Self::Zero(reading) => zeros[reading].map_or(0..0, |c| c..c + 1),
            Self::Focal(c) => layout.cameras[c].start..layout.cameras[c].start + 2,
            Self::Centre(c) => layout.cameras[c].start + 2..layout.cameras[c].start + 4,
        }
    }
}

/// By how much a twist of all targets together moves the columns of each: about their middle, along the axes of the tip. None of a single one.
pub(super) fn bracket(Adjustment { problem, state }: &Adjustment) -> DMatrix<f64> {
    let seen = |b: &usize| problem.used_bodies().any(|(_, m)| m.body == *b && problem.is_by_tracker(m));
    let targets: Vec<usize> = (0..state.bodies.len()).filter(seen).collect();
    let columns = problem.layout.len();
    if targets.len() < 2 {
        return DMatrix::zeros(columns, 0);
    }
    let middle = targets.iter().map(|b| state.bodies[*b].translation).sum::<Vector3<f64>>() / targets.len() as f64;
    let mut all = DMatrix::zeros(columns, 6);
    for body in targets {
        let pose = &state.bodies[body];
        let turn = pose.rotation.transpose();
        let by_turn = turn * -(pose.translation - middle).cross_matrix();
        for (k, column) in Changed::Target(body).columns(&problem.layout, &[]).enumerate() {
            for axis in 0..3 {
                let (shift, angle) =
                    if k < 3 { (turn[(k, axis)], by_turn[(k, axis)]) } else { (0.0, turn[(k - 3, axis)]) };
                all[(column, axis)] = shift;
                all[(column, 3 + axis)] = angle;
            }
        }
    }
    all
}

/// By how much a twist of all sockets together moves the columns of each: about their middle, along the axes of the base. None of a single one.
pub(super) fn fixture(Adjustment { problem, state }: &Adjustment) -> DMatrix<f64> {
    let used: BTreeSet<usize> = problem.used_bodies().map(|(_, m)| m.instrument).collect();
    let sockets: Vec<usize> = used.into_iter().filter(|i| is_socket(problem, *i)).collect();
    let columns = problem.layout.len();
    if sockets.len() < 2 {
        return DMatrix::zeros(columns, 0);
    }
    let place = |socket: &usize| state.instruments[*socket].translation;
    let middle = sockets.iter().map(place).sum::<Vector3<f64>>() / sockets.len() as f64;
    let mut all = DMatrix::zeros(columns, 6);
    for socket in sockets {
        let by_turn = -(place(&socket) - middle).cross_matrix();
        for (k, column) in Changed::Instrument(socket).columns(&problem.layout, &[]).enumerate().take(3) {
            all[(column, k)] = 1.0;
            (0..3).for_each(|axis| all[(column, 3 + axis)] = by_turn[(k, axis)]);
        }
    }
    all
}

pub(super) fn is_socket(problem: &Problem, instrument: usize) -> bool {
    problem.instruments[instrument].kind == InstrumentKind::Socket
}

/// How the stops are divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// By rows, or as they are given: changed once.
    Time,
    /// By how far this axis of what the robot carries points up: held by its weight only.
    Up(usize),
    /// Not at all: it creeps with the rows.
    Drift,
    /// Not at all: another than in the other series, or than is stated.
    Whole,
}

/// Something that was measured at a stop.
#[derive(Debug, Clone, Copy)]
pub enum Shown {
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

    /// The socket that it was measured in.
    pub(super) fn socket(self, problem: &Problem) -> Option<usize> {
        let Self::Measurement(k) = self else { return None };
        Some(problem.body_measurements[k].instrument).filter(|i| is_socket(problem, *i))
    }

    /// The bodies that it is between: what it tells of them spans the whole pose that was seen.
    pub(super) fn between(self, problem: &Problem) -> [Changed; 2] {
        match self {
            Self::Image { index, .. } => {
                let image = &problem.images[index];
                [Changed::Placement(image.placement), Changed::Mounting(image.mounting)]
            }
            Self::Measurement(k) => {
                let measured = &problem.body_measurements[k];
                [Changed::Target(measured.body), Changed::Instrument(measured.instrument)]
            }
        }
    }

    pub(super) fn tells_of(self, problem: &Problem, changed: Changed) -> bool {
        match (self, changed) {
            (_, Changed::Zero(_)) => true,
            (Self::Image { index, .. }, Changed::Placement(p)) => problem.images[index].placement == p,
            (Self::Image { index, .. }, Changed::Mounting(m)) => problem.images[index].mounting == m,
            (Self::Image { index, .. }, Changed::Focal(c) | Changed::Centre(c)) => problem.images[index].camera == c,
            (Self::Measurement(k), Changed::Instrument(i)) => problem.body_measurements[k].instrument == i,
            (Self::Measurement(k), Changed::Place { first, instrument }) => {
                let [own, first] = [k, first].map(|k| &problem.body_measurements[k]);
                own.instrument == instrument && own.seen.position() == first.seen.position()
            }
            (Self::Measurement(k), Changed::Target(b)) => problem.body_measurements[k].body == b,
            (Self::Measurement(k), Changed::Bracket) => problem.is_by_tracker(&problem.body_measurements[k]),
            (Self::Measurement(k), Changed::Fixture) => is_socket(problem, problem.body_measurements[k].instrument),
            _ => false,
        }
    }
}

/// A way to divide stops: the rows of [`Linear`] behind the step, from the last on.
#[derive(Clone)]
pub struct Candidate {
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
