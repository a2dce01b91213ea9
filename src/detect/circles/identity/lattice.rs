//! Lattices of neighbouring candidates, grown from neighbour to neighbour without any knowledge of the camera.
//!
//! The ellipse of a candidate says how the plate is foreshortened there: in the frame where it is the unit circle the
//! neighbours of a marker sit on a square cross. Growth then follows the lattice by local extrapolation, which keeps
//! up with perspective and distortion.

use std::collections::{BTreeMap, VecDeque};

use crate::detect::circles::candidates::candidate::Candidate;

/// Cell of a lattice: steps along its two basis directions, turning from the first to the second clockwise on the
/// screen (as columns and rows do).
pub type Cell = (i32, i32);

/// Candidates (by index) on the cells of one lattice.
#[derive(Debug, Clone, Default)]
pub struct Lattice {
    pub cells: BTreeMap<Cell, Site>,
}

/// One candidate on a lattice.
#[derive(Debug, Clone, Copy)]
pub struct Site {
    pub candidate: usize,
    /// Image vectors of one step along either direction, px.
    pub basis: [[f64; 2]; 2],
}

impl Site {
    /// Radius of the candidate's outer contour in units of the local pitch.
    pub fn relative_radius(&self, candidate: &Candidate) -> f64 {
        let [a, b] = self.basis;
        candidate.ellipse.mean_radius() / (a[0] * b[1] - a[1] * b[0]).abs().sqrt()
    }
}

/// How far apart markers may be, in semi-axes of their images.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Apart {
    /// No more than on a plate with a code.
    Near,
    /// As far as dots are that leave most of the paper blank.
    Far,
}

impl Apart {
    /// Distances within which neighbours are sought, until there are enough.
    fn reaches(self) -> &'static [f64] {
        match self {
            Self::Near => &[9.0],
            Self::Far => &[9.0, 18.0, 36.0],
        }
    }
}

/// Neighbours that are looked at: those of a square lattice at up to two steps.
const NEIGHBOURS: usize = 12;

/// All lattices of at least `smallest` candidates, larger ones first.
pub fn lattices(candidates: &[Candidate], smallest: usize, apart: Apart) -> Vec<Lattice> {
    let index = Buckets::of(candidates);
    let mut seeds: Vec<Seed> = (0..candidates.len()).filter_map(|i| seed(i, candidates, &index, apart)).collect();
    seeds.sort_by(|a, b| (a.missing, a.error).partial_cmp(&(b.missing, b.error)).unwrap_or(std::cmp::Ordering::Equal));
    let mut taken = vec![false; candidates.len()];
    let mut found = Vec::new();
    for s in seeds {
        if taken[s.candidate] {
            continue;
        }
        let lattice = grow(&s, candidates, &index, &taken);
        if lattice.cells.len() < smallest {
            continue;
        }
        lattice.cells.values().for_each(|site| taken[site.candidate] = true);
        found.push(lattice);
    }
    found.sort_by_key(|l| std::cmp::Reverse(l.cells.len()));
    found
}

/// A candidate with neighbours on a cross.
struct Seed {
    candidate: usize,
    basis: [[f64; 2]; 2],
    missing: u32,
    error: f64,
}

/// The nearest candidates around one within `reach`, in the frame where its ellipse is the unit circle: place, distance, index.
fn around(i: usize, candidates: &[Candidate], index: &Buckets, reach: f64) -> Vec<([f64; 2], f64, usize)> {
    let ellipse = &candidates[i].ellipse;
    let n = ellipse.normaliser();
    let mut near = Vec::new();
    index.within(ellipse.centre, reach * ellipse.semi_axes()[0], |j| {
        if j != i {
            let c = candidates[j].ellipse.centre;
            let d = [c[0] - ellipse.centre[0], c[1] - ellipse.centre[1]];
            let w = [n[0][0] * d[0] + n[0][1] * d[1], n[1][0] * d[0] + n[1][1] * d[1]];
            let length = w[0].hypot(w[1]);
            if length < reach {
                near.push((w, length, j));
            }
        }
    });
    near.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.2.cmp(&b.2)));
    near.truncate(NEIGHBOURS);
    near
}

fn seed(i: usize, candidates: &[Candidate], index: &Buckets, apart: Apart) -> Option<Seed> {
    let ellipse = &candidates[i].ellipse;
    let mut near = Vec::new();
    for reach in apart.reaches() {
        near = around(i, candidates, index, *reach);
        if near.len() == NEIGHBOURS {
            break;
        }
    }
    let (first, length, _) = *near.first()?;
    let nearest = |target: [f64; 2]| {
        near.iter()
            .map(|(w, _, j)| ((w[0] - target[0]).hypot(w[1] - target[1]) / length, *j))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|(e, _)| *e < 0.3)
    };
    let cross = [first, [-first[1], first[0]], [-first[0], -first[1]], [first[1], -first[0]]].map(nearest);
    let missing = cross.iter().filter(|c| c.is_none()).count() as u32;
    if missing > 1 {
        return None;
    }
    let step = |forward: Option<(f64, usize)>, backward: Option<(f64, usize)>| -> Option<[f64; 2]> {
        let centre = ellipse.centre;
        let ahead = |k: usize| [0, 1].map(|a| candidates[k].ellipse.centre[a] - centre[a]);
        match (forward, backward) {
            (Some((_, f)), Some((_, b))) => Some([0, 1].map(|a| 0.5 * (ahead(f)[a] - ahead(b)[a]))),
            (Some((_, f)), None) => Some(ahead(f)),
            (None, Some((_, b))) => Some(ahead(b).map(|v| -v)),
            (None, None) => None,
        }
    };
    let basis = [step(cross[0], cross[2])?, step(cross[1], cross[3])?];
    let error = cross.iter().flatten().map(|c| c.0).sum();
    // The normaliser keeps the orientation, so the basis turns clockwise on the screen.
    Some(Seed { candidate: i, basis, missing, error })
}

const STEPS: [Cell; 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

fn grow(seed: &Seed, candidates: &[Candidate], index: &Buckets, taken: &[bool]) -> Lattice {
    let mut lattice = Lattice::default();
    let mut used: BTreeMap<usize, Cell> = BTreeMap::new();
    let mut queue = VecDeque::from([(0, 0)]);
    lattice.cells.insert((0, 0), Site { candidate: seed.candidate, basis: seed.basis });
    used.insert(seed.candidate, (0, 0));
    let mut jumps: VecDeque<Cell> = VecDeque::new();
    loop {
        let (cell, stride) = match (queue.pop_front(), jumps.pop_front()) {
            (Some(c), back) => {
                if let Some(b) = back {
                    jumps.push_front(b);
                }
                (c, 1)
            }
            (None, Some(c)) => (c, 2),
            (None, None) => break,
        };
        refresh_basis(&mut lattice, cell, candidates);
        for step in STEPS {
            let target = (cell.0 + stride * step.0, cell.1 + stride * step.1);
            let between = (cell.0 + step.0, cell.1 + step.1);
            if lattice.cells.contains_key(&target) || (stride > 1 && lattice.cells.contains_key(&between)) {
                continue;
            }
            let Some((j, basis)) = neighbour(&lattice, cell, step, stride, candidates, index) else { continue };
            if taken[j] || used.contains_key(&j) {
                continue;
            }
            used.insert(j, target);
            lattice.cells.insert(target, Site { candidate: j, basis });
            queue.push_back(target);
        }
        if stride == 1 {
            jumps.push_back(cell);
        }
    }
    let all: Vec<Cell> = lattice.cells.keys().copied().collect();
    all.into_iter().for_each(|c| refresh_basis(&mut lattice, c, candidates));
    lattice
}

fn position(lattice: &Lattice, cell: Cell, candidates: &[Candidate]) -> Option<[f64; 2]> {
    lattice.cells.get(&cell).map(|s| candidates[s.candidate].ellipse.centre)
}

/// The candidate `stride` steps on, and the basis it starts with.
fn neighbour(
    lattice: &Lattice,
    cell: Cell,
    step: Cell,
    stride: i32,
    candidates: &[Candidate],
    index: &Buckets,
) -> Option<(usize, [[f64; 2]; 2])> {
    let site = lattice.cells.get(&cell)?;
    let here = candidates[site.candidate].ellipse.centre;
    let (axis, sign) = if step.0 != 0 { (0, f64::from(step.0)) } else { (1, f64::from(step.1)) };
    let at = |k: i32| position(lattice, (cell.0 + k * step.0, cell.1 + k * step.1), candidates);
    let s = f64::from(stride);
    let along = match (at(-1), at(-2)) {
        // extrapolation to second order: the change of scale over a few cells is large at close range
        (Some(b), Some(c)) => [0, 1].map(|a| {
            let (v, w) = (here[a] - b[a], here[a] - 2.0 * b[a] + c[a]);
            s * v + 0.5 * s * (s + 1.0) * w
        }),
        (Some(b), None) => [0, 1].map(|a| s * (here[a] - b[a])),
        _ => site.basis[axis].map(|v| sign * s * v),
    };
    let guess = [here[0] + along[0], here[1] + along[1]];
    let shorter = site.basis.iter().map(|v| v[0].hypot(v[1])).fold(f64::MAX, f64::min);
    let mut best: Option<(f64, usize)> = None;
    index.within(guess, 0.38 * shorter, |j| {
        let c = candidates[j].ellipse.centre;
        let d = (c[0] - guess[0]).hypot(c[1] - guess[1]);
        if best.is_none_or(|(b, k)| (d, j) < (b, k)) {
            best = Some((d, j));
        }
    });
    let (_, j) = best?;
    let there = candidates[j].ellipse.centre;
    let mut basis = site.basis;
    basis[axis] = [0, 1].map(|a| sign * (there[a] - here[a]) / s);
    Some((j, basis))
}

/// Basis of a cell from the neighbours known so far.
fn refresh_basis(lattice: &mut Lattice, cell: Cell, candidates: &[Candidate]) {
    let Some(here) = position(lattice, cell, candidates) else { return };
    let mut basis = [None, None];
    for (axis, b) in basis.iter_mut().enumerate() {
        let (di, dj) = if axis == 0 { (1, 0) } else { (0, 1) };
        let next = position(lattice, (cell.0 + di, cell.1 + dj), candidates);
        let last = position(lattice, (cell.0 - di, cell.1 - dj), candidates);
        *b = match (next, last) {
            (Some(n), Some(l)) => Some([0, 1].map(|a| 0.5 * (n[a] - l[a]))),
            (Some(n), None) => Some([0, 1].map(|a| n[a] - here[a])),
            (None, Some(l)) => Some([0, 1].map(|a| here[a] - l[a])),
            (None, None) => None,
        };
    }
    if let Some(site) = lattice.cells.get_mut(&cell) {
        for (axis, b) in basis.iter().enumerate() {
            if let Some(b) = b {
                site.basis[axis] = *b;
            }
        }
    }
}

/// Candidates by square buckets of the image.
pub struct Buckets {
    cols: usize,
    rows: usize,
    buckets: Vec<Vec<(usize, [f64; 2])>>,
}

const BUCKET_PX: f64 = 32.0;

impl Buckets {
    pub fn of(candidates: &[Candidate]) -> Self {
        let extent = |a: usize| candidates.iter().map(|c| c.ellipse.centre[a]).fold(0.0, f64::max);
        let count = |v: f64| (v / BUCKET_PX) as usize + 1;
        let (cols, rows) = (count(extent(0)), count(extent(1)));
        let mut buckets = vec![Vec::new(); cols * rows];
        for (i, c) in candidates.iter().enumerate() {
            let [x, y] = c.ellipse.centre.map(|v| (v.max(0.0) / BUCKET_PX) as usize);
            buckets[y * cols + x].push((i, c.ellipse.centre));
        }
        Self { cols, rows, buckets }
    }

    /// Calls `visit` for every candidate within `radius` of a point.
    pub fn within(&self, point: [f64; 2], radius: f64, mut visit: impl FnMut(usize)) {
        let range = |v: f64, count: usize| {
            let first = ((v - radius).max(0.0) / BUCKET_PX) as usize;
            let last = ((v + radius).max(0.0) / BUCKET_PX) as usize;
            first..(last + 1).min(count)
        };
        for y in range(point[1], self.rows) {
            for x in range(point[0], self.cols) {
                for &(i, c) in &self.buckets[y * self.cols + x] {
                    if (c[0] - point[0]).hypot(c[1] - point[1]) <= radius {
                        visit(i);
                    }
                }
            }
        }
    }
}
