//! The pattern of marker classes that says where on the plate a window lies and how it is turned.
//!
//! A lattice of symbols from a small alphabet is wanted such that every window of 4 rows x 5 columns, seen in any of four
//! rotations, differs from every other one (and from itself turned) in many cells. Where the same holds against the
//! mirrored windows, a mirrored image is recognised as well. The search starts from random symbols and changes single
//! cells inside the worst pairs of windows as long as the number of too similar pairs does not grow.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::linalg::wide;

/// Number of symbols; two bits in a packed window.
pub const SYMBOLS: u8 = 4;
/// Short side of the window in cells.
pub const WINDOW_SHORT: usize = 4;
/// Long side of the window in cells.
pub const WINDOW_LONG: usize = 5;
/// Cells in a window.
const CELLS: usize = WINDOW_SHORT * WINDOW_LONG;

/// A lattice of symbols with the distances that it reaches.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlateCode {
    /// Columns of the lattice.
    pub columns: usize,
    /// Rows of the lattice.
    pub rows: usize,
    /// Symbols 0..4, row-major from the top-left.
    pub symbols: Vec<u8>,
}

/// In how many cells two different windows differ at least.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CodeDistance {
    /// Against every other window in every rotation, and against itself turned.
    pub rotated: u32,
    /// Against every mirrored window in every rotation, its own mirror image included.
    pub mirrored: u32,
}

impl CodeDistance {
    /// The smaller of both.
    pub fn least(self) -> u32 {
        self.rotated.min(self.mirrored)
    }
}

/// How a window is read into the packed 4 x 5 form.
#[derive(Debug, Clone, Copy)]
struct Reading {
    row: usize,
    column: usize,
    /// The window lies upright on the plate (5 rows x 4 columns) and is turned by a quarter.
    upright: bool,
}

/// Packed windows: as they are read, turned by a half, mirrored, and both.
///
/// A quarter turn needs no form of its own, since each window is read in the one orientation that makes it 4 x 5.
struct Windows {
    readings: Vec<Reading>,
    forms: [Vec<u64>; 4],
}

fn readings(columns: usize, rows: usize) -> Vec<Reading> {
    let mut all = Vec::new();
    for upright in [false, true] {
        let (height, width) = if upright { (WINDOW_LONG, WINDOW_SHORT) } else { (WINDOW_SHORT, WINDOW_LONG) };
        for row in 0..(rows + 1).saturating_sub(height) {
            for column in 0..(columns + 1).saturating_sub(width) {
                all.push(Reading { row, column, upright });
            }
        }
    }
    all
}

/// Symbols of a window in the order in which it is read: four rows of five.
fn read(symbols: &[u8], columns: usize, at: Reading) -> [u8; CELLS] {
    let mut cells = [0; CELLS];
    for (k, cell) in cells.iter_mut().enumerate() {
        let (i, j) = (k / WINDOW_LONG, k % WINDOW_LONG);
        let (row, column) = if at.upright { (j, WINDOW_SHORT - 1 - i) } else { (i, j) };
        *cell = symbols[(at.row + row) * columns + at.column + column];
    }
    cells
}

fn pack(cells: impl Iterator<Item = u8>) -> u64 {
    cells.fold(0, |word, s| word << 2 | u64::from(s))
}

/// The window as read and turned by a half; then the same of its mirror image.
fn forms(cells: &[u8; CELLS]) -> [u64; 4] {
    let mirror = |k: usize| cells[k / WINDOW_LONG * WINDOW_LONG + WINDOW_LONG - 1 - k % WINDOW_LONG];
    let [plain, turned] = [pack(cells.iter().copied()), pack(cells.iter().rev().copied())];
    [plain, turned, pack((0..CELLS).map(mirror)), pack((0..CELLS).rev().map(mirror))]
}

/// In how many cells two packed windows differ.
#[inline(always)]
fn distance(a: u64, b: u64) -> u32 {
    let different = a ^ b;
    ((different | different >> 1) & 0x5555_5555_5555_5555).count_ones()
}

/// How far a distance stays below `target`, squared.
#[inline(always)]
fn shortfall(distance: u32, target: u32) -> u64 {
    let short = target.saturating_sub(distance);
    u64::from(short * short)
}

impl Windows {
    fn new(symbols: &[u8], columns: usize, rows: usize) -> Self {
        let readings = readings(columns, rows);
        let mut windows = Self { forms: std::array::from_fn(|_| vec![0; readings.len()]), readings };
        (0..windows.readings.len()).for_each(|k| windows.read(k, symbols, columns));
        windows
    }

    /// Reads window `k` anew.
    fn read(&mut self, k: usize, symbols: &[u8], columns: usize) {
        let forms = forms(&read(symbols, columns, self.readings[k]));
        self.forms.iter_mut().zip(forms).for_each(|(all, form)| all[k] = form);
    }

    /// Distances of window `i` to window `j`: both rotations, then both mirrored ones.
    fn distances(&self, i: usize, j: usize) -> [u32; 4] {
        std::array::from_fn(|f| distance(self.forms[0][i], self.forms[f][j]))
    }

    fn code_distance(&self) -> CodeDistance {
        let mut least = CodeDistance { rotated: CELLS as u32, mirrored: CELLS as u32 };
        for i in 0..self.readings.len() {
            for j in i..self.readings.len() {
                let [same, turned, m, n] = self.distances(i, j);
                let rotated = if i == j { turned } else { same.min(turned) };
                least.rotated = least.rotated.min(rotated);
                least.mirrored = least.mirrored.min(m).min(n);
            }
        }
        least
    }

    /// Sum over pairs of how far the distance stays below `target`, squared; only pairs with a window in `touched`.
    fn penalty_of(&self, touched: &[usize], target: u32) -> u64 {
        let of_window = |(k, &i): (usize, &usize)| {
            // Pairs of two of them count once.
            let again: u64 = touched[..k].iter().map(|&j| self.pair_penalty(i, j, target)).sum();
            self.window_penalty(i, 0, target) - again
        };
        touched.iter().enumerate().map(of_window).sum()
    }

    /// The same of the pairs of window `i` with all from `first` on, `i` among them.
    fn window_penalty(&self, i: usize, first: usize, target: u32) -> u64 {
        let form = self.forms[0][i];
        let of_all = wide(
            #[inline(always)]
            || {
                let mut sum = 0;
                for windows in &self.forms {
                    for &window in &windows[first..] {
                        sum += shortfall(distance(form, window), target);
                    }
                }
                sum
            },
        );
        // As it is read, a window is no pair with itself.
        of_all - shortfall(0, target)
    }

    fn pair_penalty(&self, i: usize, j: usize, target: u32) -> u64 {
        let skip = usize::from(i == j);
        self.distances(i, j).iter().skip(skip).map(|&d| shortfall(d, target)).sum()
    }

    /// All pairs of windows that are nearer than `target`.
    fn conflicts(&self, target: u32) -> Vec<(usize, usize)> {
        let n = self.readings.len();
        let near = (0..n).filter(|&i| self.window_penalty(i, i, target) > 0);
        near.flat_map(|i| (i..n).map(move |j| (i, j))).filter(|&(i, j)| self.pair_penalty(i, j, target) > 0).collect()
    }
}

/// State of the search: symbols, packed windows, and which windows see a cell.
struct Search {
    columns: usize,
    symbols: Vec<u8>,
    windows: Windows,
    seen_by: Vec<Vec<usize>>,
}

impl Search {
    fn new(columns: usize, rows: usize, rng: &mut impl Rng) -> Self {
        let symbols: Vec<u8> = (0..columns * rows).map(|_| rng.random_range(0..SYMBOLS)).collect();
        let windows = Windows::new(&symbols, columns, rows);
        let mut seen_by = vec![Vec::new(); symbols.len()];
        for (k, &reading) in windows.readings.iter().enumerate() {
            cells_of(columns, reading).for_each(|cell| seen_by[cell].push(k));
        }
        Self { columns, symbols, windows, seen_by }
    }

    fn set(&mut self, cell: usize, symbol: u8) {
        self.symbols[cell] = symbol;
        for &k in &self.seen_by[cell] {
            self.windows.read(k, &self.symbols, self.columns);
        }
    }

    /// Tries single-cell changes inside conflicting pairs until no pair is nearer than `target`; `false` when `tries` ran out.
    fn reach(&mut self, target: u32, tries: usize, rng: &mut impl Rng) -> bool {
        let mut conflicts = self.windows.conflicts(target);
        let mut fresh = 0;
        for _ in 0..tries {
            if fresh >= conflicts.len().max(8) {
                conflicts = self.windows.conflicts(target);
                fresh = 0;
            }
            if conflicts.is_empty() {
                return true;
            }
            fresh += 1;
            let (i, j) = conflicts[rng.random_range(0..conflicts.len())];
            let window = self.windows.readings[if rng.random_bool(0.5) { i } else { j }];
            let cells: Vec<usize> = cells_of(self.columns, window).collect();
            let cell = cells[rng.random_range(0..cells.len())];
            let old = self.symbols[cell];
            let new = (old + rng.random_range(1..SYMBOLS)) % SYMBOLS;
            let touched = self.seen_by[cell].clone();
            let before = self.windows.penalty_of(&touched, target);
            self.set(cell, new);
            if self.windows.penalty_of(&touched, target) > before {
                self.set(cell, old);
            }
        }
        self.windows.conflicts(target).is_empty()
    }
}

fn cells_of(columns: usize, at: Reading) -> impl Iterator<Item = usize> {
    let (height, width) = if at.upright { (WINDOW_LONG, WINDOW_SHORT) } else { (WINDOW_SHORT, WINDOW_LONG) };
    (0..height * width).map(move |k| (at.row + k / width) * columns + at.column + k % width)
}

impl PlateCode {
    /// Searches a code for `columns` x `rows` cells; the same seed gives the same code.
    ///
    /// The aim is raised from 4 cells upwards as long as the search reaches it within `tries` single-cell changes.
    pub fn search(columns: usize, rows: usize, seed: u64, tries: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut search = Search::new(columns, rows, &mut rng);
        let mut best = search.symbols.clone();
        for target in 4..=CELLS as u32 {
            if !search.reach(target, tries, &mut rng) {
                break;
            }
            best.clone_from(&search.symbols);
        }
        Self { columns, rows, symbols: best }
    }

    /// The distances reached, from all pairs of windows.
    pub fn distance(&self) -> CodeDistance {
        Windows::new(&self.symbols, self.columns, self.rows).code_distance()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Independent witness: windows as plain tables, rotated and mirrored by index arithmetic, compared cell by cell.
    fn distance_by_tables(code: &PlateCode) -> CodeDistance {
        type Table = Vec<Vec<u8>>;
        let quarter =
            |t: &Table| -> Table { (0..t[0].len()).map(|j| (0..t.len()).rev().map(|i| t[i][j]).collect()).collect() };
        let mirror = |t: &Table| -> Table { t.iter().map(|r| r.iter().rev().copied().collect()).collect() };
        let mut windows: Vec<Table> = Vec::new();
        for (height, width) in [(4, 5), (5, 4)] {
            for r in 0..(code.rows + 1).saturating_sub(height) {
                for c in 0..(code.columns + 1).saturating_sub(width) {
                    let row = |i: usize| code.symbols[(r + i) * code.columns + c..][..width].to_vec();
                    windows.push((0..height).map(row).collect());
                }
            }
        }
        let mut least = CodeDistance { rotated: 20, mirrored: 20 };
        for (a, first) in windows.iter().enumerate() {
            for (b, second) in windows.iter().enumerate() {
                let mut turned = second.clone();
                for turn in 0..4 {
                    for (flip, t) in [(false, turned.clone()), (true, mirror(&turned))] {
                        if t.len() != first.len() || (a == b && turn == 0 && !flip) {
                            continue;
                        }
                        let d = first.iter().flatten().zip(t.iter().flatten()).filter(|(x, y)| x != y).count() as u32;
                        let slot = if flip { &mut least.mirrored } else { &mut least.rotated };
                        *slot = (*slot).min(d);
                    }
                    turned = quarter(&turned);
                }
            }
        }
        least
    }

    #[test]
    fn packed_distance_agrees_with_plain_tables() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for (columns, rows) in [(9, 7), (5, 4), (4, 11), (12, 6)] {
            let symbols = (0..columns * rows).map(|_| rng.random_range(0..SYMBOLS)).collect();
            let code = PlateCode { columns, rows, symbols };
            assert_eq!(code.distance(), distance_by_tables(&code), "{columns} x {rows}");
        }
    }

    #[test]
    fn the_penalty_of_touched_windows_is_that_of_their_pairs() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let search = Search::new(9, 8, &mut rng);
        let (windows, n) = (&search.windows, search.windows.readings.len());
        for (cell, target) in [(0, 13), (17, 11), (40, 14), (71, 20)] {
            let touched = &search.seen_by[cell];
            let mut pairs = (0..n).flat_map(|i| (i..n).map(move |j| (i, j))).collect::<Vec<_>>();
            let near: Vec<_> = pairs.iter().copied().filter(|&(i, j)| windows.pair_penalty(i, j, target) > 0).collect();
            assert_eq!(windows.conflicts(target), near);
            pairs.retain(|(i, j)| touched.contains(i) || touched.contains(j));
            let sum: u64 = pairs.iter().map(|&(i, j)| windows.pair_penalty(i, j, target)).sum();
            assert!(sum > 0);
            assert_eq!(windows.penalty_of(touched, target), sum);
        }
    }

    #[test]
    fn default_plate_reaches_six_cells_also_against_mirrors() {
        let code = PlateCode::search(28, 18, 1995, 4000);
        assert!(code.distance().least() >= 6, "{:?}", code.distance());
        assert_eq!(code, PlateCode::search(28, 18, 1995, 4000));
    }
}
