//! Identity: where on the plate a lattice of classes lies.

use std::collections::{BTreeMap, BTreeSet};

use super::lattice::{Cell, Lattice};
use crate::detect::circles::candidates::candidate::Candidate;
use crate::series::Plate;

/// One kind of marker on the plate.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Class {
    /// Outer radius in units of the pitch.
    radius: f64,
    /// Inner over outer radius; 0 for a disc.
    ratio: f64,
}

/// The pattern of classes on a plate.
#[derive(Debug, Clone)]
pub struct MarkerCode {
    columns: i32,
    rows: i32,
    classes: Vec<Class>,
    /// Marker index and class of every cell, row by row.
    cells: Vec<Option<(usize, u8)>>,
    /// Probability that two markers drawn at random are of the same class.
    coincidence: f64,
}

/// Position of a lattice on the plate: which way its first direction points, and where its origin lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Placement {
    turns: u8,
    mirrored: bool,
    offset: Cell,
}

impl Placement {
    /// Column and row on the plate of a lattice cell.
    pub fn apply(&self, cell: Cell) -> Cell {
        let (column, row) = turn(cell, self.turns, self.mirrored);
        (column + self.offset.0, row + self.offset.1)
    }
}

fn turn(cell: Cell, turns: u8, mirrored: bool) -> Cell {
    let (i, j) = if mirrored { (cell.1, cell.0) } else { cell };
    match turns {
        0 => (i, j),
        1 => (-j, i),
        2 => (-i, -j),
        _ => (j, -i),
    }
}

/// What the code says about a lattice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// One position, with its disagreeing cells and those of the next best position.
    Placed { placement: Placement, agreeing: usize, disagreeing: usize, runner_up: usize },
    /// The pattern is there, but seen in a mirror.
    Mirrored,
    /// Nothing stands out.
    Ambiguous,
}

/// A position counts when fewer than this many equally good ones are expected by chance.
pub(in crate::detect) const FALSE_ALARMS: f64 = 1e-6;
/// The next best position must disagree in at least this many cells more.
const MARGIN: usize = 3;
/// Side of the parts that a lattice is taken into, from one to the next half of it, and the fewest cells of one.
const PART: i32 = 6;
const LEAST_PART: usize = 12;

impl MarkerCode {
    /// Code of a plate of circles; `None` when its markers do not form a lattice.
    pub fn of(plate: &Plate) -> Option<Self> {
        let (columns, rows) = (plate.columns as i32, plate.rows as i32);
        let centre = |n: i32| f64::from(n - 1) / 2.0;
        let cells: Option<Vec<Cell>> = plate
            .markers
            .iter()
            .map(|m| {
                let column = (m.position_m.x / plate.pitch_m + centre(columns)).round();
                let row = (centre(rows) - m.position_m.y / plate.pitch_m).round();
                let inside = (0.0..f64::from(columns)).contains(&column) && (0.0..f64::from(rows)).contains(&row);
                inside.then_some((column as i32, row as i32))
            })
            .collect();
        Self::on_cells(plate, &cells?, plate.pitch_m, (columns, rows))
    }

    /// Code of a plate whose markers lie on these cells (not negative) of a lattice with this step.
    pub fn of_cells(plate: &Plate, cells: &[Cell], step_m: f64) -> Option<Self> {
        let size = (cells.iter().map(|c| c.0).max()? + 1, cells.iter().map(|c| c.1).max()? + 1);
        Self::on_cells(plate, cells, step_m, size)
    }

    fn on_cells(plate: &Plate, places: &[Cell], step_m: f64, (columns, rows): (i32, i32)) -> Option<Self> {
        let mut classes: Vec<Class> = Vec::new();
        let mut cells = vec![None; usize::try_from(columns * rows).ok()?];
        for (index, (m, (column, row))) in plate.markers.iter().zip(places).enumerate() {
            if !m.outer_radius_m.is_normal() {
                return None;
            }
            let class = Class { radius: m.outer_radius_m / step_m, ratio: m.inner_radius_m / m.outer_radius_m };
            let same = |c: &Class| (c.radius / class.radius).ln().abs() < 0.05 && (c.ratio - class.ratio).abs() < 0.05;
            let number = classes.iter().position(same).unwrap_or_else(|| {
                classes.push(class);
                classes.len() - 1
            });
            let cell = usize::try_from(row * columns + column).ok()?;
            *cells.get_mut(cell)? = Some((index, u8::try_from(number).ok()?));
        }
        let mut shares = vec![0.0; classes.len()];
        cells.iter().flatten().for_each(|(_, c)| shares[usize::from(*c)] += 1.0 / plate.markers.len() as f64);
        let coincidence = shares.iter().map(|p| p * p).sum();
        Some(Self { columns, rows, classes, cells, coincidence })
    }

    /// Marker index of a cell of the plate.
    pub fn marker_at(&self, cell: Cell) -> Option<usize> {
        self.at(cell).map(|(m, _)| m)
    }

    /// All cells with a marker, by columns.
    pub fn occupied(&self) -> impl Iterator<Item = Cell> {
        let cells = (0..self.columns).flat_map(|column| (0..self.rows).map(move |row| (column, row)));
        cells.filter(|cell| self.at(*cell).is_some())
    }

    /// Class of a cell of the plate.
    pub fn class_at(&self, cell: Cell) -> Option<u8> {
        self.at(cell).map(|(_, c)| c)
    }

    fn at(&self, (column, row): Cell) -> Option<(usize, u8)> {
        let inside = (0..self.columns).contains(&column) && (0..self.rows).contains(&row);
        if inside { self.cells[(row * self.columns + column) as usize] } else { None }
    }

    /// Class of a candidate whose outer radius is `radius` of the local pitch; `None` when it fits none.
    pub fn classify(&self, candidate: &Candidate, radius: f64) -> Option<u8> {
        let cost = |c: &Class| {
            let size = (radius / c.radius).ln();
            // A hole of a few pixels looks smaller than it is: its size tells classes apart only roughly.
            let hole = candidate.hole.filter(|_| c.ratio > 0.0).map_or(0.0, |h| h - c.ratio);
            (size / 0.12).powi(2) + (hole / 0.12).powi(2)
        };
        self.classes
            .iter()
            .enumerate()
            .filter(|(_, c)| (c.ratio > 0.0) == candidate.open && (radius / c.radius).ln().abs() < 0.4)
            .min_by(|a, b| cost(a.1).total_cmp(&cost(b.1)))
            .and_then(|(k, _)| u8::try_from(k).ok())
    }

    /// Range of outer radii in units of the pitch.
    pub fn radii(&self) -> [f64; 2] {
        let r = self.classes.iter().map(|c| c.radius);
        [r.clone().fold(f64::MAX, f64::min), r.fold(0.0, f64::max)]
    }

    /// Classes of the cells of a lattice, where they can be told.
    pub fn classes_of(&self, lattice: &Lattice, candidates: &[Candidate]) -> BTreeMap<Cell, Option<u8>> {
        let class = |(cell, site): (&Cell, &super::lattice::Site)| {
            let c = &candidates[site.candidate];
            (*cell, self.classify(c, site.relative_radius(c)))
        };
        lattice.cells.iter().map(class).collect()
    }

    /// Finds the position of the classes on the plate in any of four rotations, and the mirrored ones.
    pub fn locate(&self, classes: &BTreeMap<Cell, Option<u8>>) -> Verdict {
        self.locate_one_of(1, classes)
    }

    /// Positions of the parts of a lattice that slipped where it grew: as a whole it fits nowhere, or in two places.
    ///
    /// All parts together raise a false alarm as seldom as one whole lattice.
    pub fn locate_parts(&self, classes: &BTreeMap<Cell, Option<u8>>) -> Vec<(BTreeMap<Cell, Option<u8>>, Verdict)> {
        let corner = |(i, j): &Cell| (i.div_euclid(PART / 2), j.div_euclid(PART / 2));
        let corners: BTreeSet<Cell> = classes.keys().map(corner).collect();
        let part = |(a, b): Cell| {
            let within = |v: i32, from: i32| (from * PART / 2..from * PART / 2 + PART).contains(&v);
            let inside = classes.iter().filter(|((i, j), c)| c.is_some() && within(*i, a) && within(*j, b));
            inside.map(|(cell, class)| (*cell, *class)).collect::<BTreeMap<_, _>>()
        };
        let parts: Vec<_> = corners.into_iter().map(part).filter(|p| p.len() >= LEAST_PART).collect();
        let count = parts.len();
        let placed = parts.into_iter().map(|p| (self.locate_one_of(count, &p), p)).map(|(verdict, p)| (p, verdict));
        placed.filter(|(_, verdict)| *verdict != Verdict::Ambiguous).collect()
    }

    fn locate_one_of(&self, count: usize, classes: &BTreeMap<Cell, Option<u8>>) -> Verdict {
        let known: Vec<(Cell, u8)> = classes.iter().filter_map(|(cell, c)| c.map(|c| (*cell, c))).collect();
        let mut best = [(usize::MAX, None), (usize::MAX, None)];
        let mut tried = 0usize;
        for (turns, mirrored) in (0..4).flat_map(|t| [(t, false), (t, true)]) {
            let turned: Vec<(Cell, u8)> = spread(&known, turns, mirrored);
            for offset in self.offsets(&turned) {
                tried += 1;
                let wrong = self.disagreeing(&turned, offset, best[1].0);
                if wrong < best[1].0 {
                    best[1] = (wrong, Some(Placement { turns, mirrored, offset }));
                    if best[1].0 < best[0].0 {
                        best.swap(0, 1);
                    }
                }
            }
        }
        let [(wrong, Some(placement)), (runner_up, _)] = best else { return Verdict::Ambiguous };
        let chance = (count * tried) as f64 * binomial_tail(known.len(), wrong, 1.0 - self.coincidence);
        if chance > FALSE_ALARMS || runner_up.saturating_sub(wrong) < MARGIN {
            return Verdict::Ambiguous;
        }
        if placement.mirrored {
            return Verdict::Mirrored;
        }
        Verdict::Placed { placement, agreeing: known.len() - wrong, disagreeing: wrong, runner_up }
    }

    /// Offsets at which at least half of the extent of the cells lies on the plate.
    fn offsets(&self, turned: &[(Cell, u8)]) -> Vec<Cell> {
        let range = |pick: fn(&Cell) -> i32, size: i32| {
            let low = turned.iter().map(|(c, _)| pick(c)).min().unwrap_or(0);
            let high = turned.iter().map(|(c, _)| pick(c)).max().unwrap_or(0);
            // a few cells may hang over: clutter beside the plate can look like a continuation of the lattice
            let over = 2.min((high - low) / 2);
            -low - over..=(size - 1 - high + over).max(-low - over)
        };
        let columns = range(|c| c.0, self.columns);
        range(|c| c.1, self.rows).flat_map(|r| columns.clone().map(move |c| (c, r))).collect()
    }

    /// Cells that do not have the plate's class; counting stops at `limit`.
    fn disagreeing(&self, turned: &[(Cell, u8)], offset: Cell, limit: usize) -> usize {
        let mut wrong = 0;
        for ((i, j), class) in turned {
            if self.class_at((i + offset.0, j + offset.1)) != Some(*class) {
                wrong += 1;
                if wrong >= limit {
                    break;
                }
            }
        }
        wrong
    }
}

/// Turned cells in an order that meets disagreement early (neighbours are taken far apart).
fn spread(known: &[(Cell, u8)], turns: u8, mirrored: bool) -> Vec<(Cell, u8)> {
    let stride = (known.len() / 7).max(1);
    (0..stride)
        .flat_map(|s| known.iter().skip(s).step_by(stride))
        .map(|(cell, class)| (turn(*cell, turns, mirrored), *class))
        .collect()
}

/// Probability of at most `wrong` disagreements among `count` cells when each disagrees with probability `q`.
pub(in crate::detect) fn binomial_tail(count: usize, wrong: usize, q: f64) -> f64 {
    if q <= 0.0 {
        return 1.0;
    }
    let mut log_term = count as f64 * (1.0 - q).ln();
    let mut sum = log_term.exp();
    for k in 1..=wrong.min(count) {
        log_term += ((count - k + 1) as f64 / k as f64).ln() + q.ln() - (1.0 - q).ln();
        sum += log_term.exp();
    }
    sum.min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::circles::synth::random_plate;

    fn window(
        code: &MarkerCode,
        placement: impl Fn(Cell) -> Cell,
        columns: i32,
        rows: i32,
    ) -> BTreeMap<Cell, Option<u8>> {
        (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))).map(|c| (c, code.class_at(placement(c)))).collect()
    }

    #[test]
    fn a_window_is_placed_in_every_rotation_and_a_mirrored_one_refused() {
        let code = MarkerCode::of(&random_plate(28, 18, 0.018, 7)).unwrap();
        for turns in 0..4 {
            for mirrored in [false, true] {
                // invert the turn by trying all four: the verdict must map back onto the plate
                let truth = |c: Cell| {
                    let (i, j) = turn(c, turns, mirrored);
                    (i + 12, j + 9)
                };
                let verdict = code.locate(&window(&code, truth, 6, 5));
                match verdict {
                    Verdict::Mirrored => assert!(mirrored),
                    Verdict::Placed { placement, disagreeing, .. } => {
                        assert!(!mirrored && disagreeing == 0);
                        assert!((0..6).all(|i| placement.apply((i, 2)) == truth((i, 2))));
                    }
                    Verdict::Ambiguous => panic!("turns {turns} mirrored {mirrored}"),
                }
            }
        }
    }

    #[test]
    fn errors_are_tolerated_and_noise_is_not_placed() {
        let code = MarkerCode::of(&random_plate(28, 18, 0.018, 7)).unwrap();
        let mut cells = window(&code, |(i, j)| (i + 3, j + 4), 7, 6);
        for k in 0..4 {
            cells.insert((k, k), Some((code.class_at((k + 3, k + 4)).unwrap() + 1) % 4));
        }
        assert!(matches!(code.locate(&cells), Verdict::Placed { disagreeing: 4, .. }));
        let other = MarkerCode::of(&random_plate(28, 18, 0.018, 8)).unwrap();
        assert_eq!(code.locate(&window(&other, |(i, j)| (i + 3, j + 4), 7, 6)), Verdict::Ambiguous);
        assert_eq!(code.locate(&BTreeMap::new()), Verdict::Ambiguous);
    }

    #[test]
    fn a_lattice_that_slipped_is_placed_in_parts() {
        let code = MarkerCode::of(&random_plate(28, 18, 0.018, 7)).unwrap();
        // the right half lies one row too low
        let truth = |(i, j): Cell| (i + 5, j + if i < 7 { 2 } else { 3 });
        let cells = window(&code, truth, 14, 9);
        let parts = code.locate_parts(&cells);
        assert!(parts.len() >= 6, "{}", parts.len());
        for (part, verdict) in &parts {
            let Verdict::Placed { placement, .. } = verdict else { panic!("{verdict:?}") };
            let right = part.keys().filter(|c| placement.apply(**c) == truth(**c)).count();
            assert!(2 * right >= part.len(), "{right} of {}", part.len());
        }
        let other = MarkerCode::of(&random_plate(28, 18, 0.018, 8)).unwrap();
        assert!(other.locate_parts(&cells).is_empty());
    }

    #[test]
    fn the_tail_of_a_small_binomial_is_exact() {
        // 3 cells, q = 0.75: P(0) = 1/64, P(<=1) = 10/64
        assert!((binomial_tail(3, 0, 0.75) - 1.0 / 64.0).abs() < 1e-15);
        assert!((binomial_tail(3, 1, 0.75) - 10.0 / 64.0).abs() < 1e-15);
    }
}
