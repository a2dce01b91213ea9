//! Coupling of unknowns with markers, by blocks of markers beside each other.
//!
//! An image shows a part of the plate. Unknowns of images that show no marker of a block are not coupled with it, and have no row there.

use std::ops::Range;

use nalgebra::{DMatrix, Matrix3};
use rayon::prelude::*;

use super::alike::MOST;
use super::runs::{Run, runs, upper_part};
use super::seen_markers::SeenMarkers;
use crate::linalg::{
    COLUMNS_A_BLOCK, add_combination, mirror_upper, part_of_gram, product_with_rows, transposed_product, wide,
};
use crate::problem::{E, Equations};
use crate::solve::linear::LinearImage;

/// Coupling of some unknowns with the markers that were seen, unknowns x 3 markers.
#[derive(Debug, Clone)]
pub struct MarkerRows {
    rows: usize,
    pub blocks: Vec<MarkerBlock>,
}

/// The same with some markers.
#[derive(Debug, Clone)]
pub struct MarkerBlock {
    /// Their numbers among those that were seen.
    pub markers: Range<usize>,
    /// Rows that are not zero, from their places here to those among all unknowns.
    runs: Vec<Run>,
    /// Rows that are not zero x 3 markers.
    pub values: DMatrix<f64>,
}

/// The equations of an image of a plate, and the rows of its unknowns.
pub struct ImageRows<'a> {
    pub plate: usize,
    pub equations: &'a Equations,
    /// The first of the six of its pose.
    pub pose: usize,
    /// Those of its intrinsics, each where it has one.
    pub intrinsics: Vec<Option<usize>>,
}

impl<'a> ImageRows<'a> {
    /// Of an image whose pose begins at a row, and its columns at those that `row_of` says.
    pub fn of(
        own: &LinearImage,
        equations: &'a Equations,
        pose: usize,
        row_of: impl Fn(usize) -> Option<usize>,
    ) -> Self {
        let intrinsics = own.columns().into_iter().map(|c| c.and_then(&row_of)).collect();
        Self { plate: own.image.plate, equations, pose, intrinsics }
    }
}

/// An image with its observations in the order of the markers that were seen.
struct Ordered<'a> {
    image: &'a ImageRows<'a>,
    /// From rows of the equations to those of the unknowns.
    runs: Vec<Run>,
    /// Number of the marker and place among the observations of the image.
    order: Vec<(usize, usize)>,
}

impl<'a> Ordered<'a> {
    fn new(image: &'a ImageRows<'a>, seen: &SeenMarkers) -> Self {
        let ImageRows { plate, equations, pose, intrinsics } = image;
        let row_of = |e: usize| Some((equations.intrinsic_row(e)?, intrinsics[e]?));
        let runs = runs(equations.pose_rows().zip(*pose..).chain((0..E).filter_map(row_of)));
        let number = &seen.number[*plate];
        let numbered = equations.markers.iter().enumerate();
        let mut order: Vec<(usize, usize)> = numbered.filter_map(|(k, &m)| Some((number[m]?, k))).collect();
        order.sort_unstable();
        Self { image, runs, order }
    }

    /// Its observations of some markers.
    fn of(&self, markers: &Range<usize>) -> &[(usize, usize)] {
        let place = |at: usize| self.order.partition_point(|own| own.0 < at);
        &self.order[place(markers.start)..place(markers.end)]
    }

    /// The rows of its unknowns.
    fn rows(&self) -> impl Iterator<Item = usize> {
        let with_runs = self.runs.iter().flat_map(|run| run.into..run.into + run.length);
        with_runs.chain(self.image.intrinsics[E..].iter().flatten().copied())
    }

    /// Adds the coupling with some markers to their columns, in which a row has another place.
    fn add_to(&self, values: &mut DMatrix<f64>, markers: &Range<usize>, place: &[usize]) {
        let (rows, columns, own) = (values.nrows(), values.as_mut_slice(), self.of(markers));
        let sight = |observation: usize| self.image.equations.sight(observation);
        wide(
            #[inline(always)]
            || {
                for &(at, observation) in own {
                    let sight = sight(observation);
                    let of_marker = columns[3 * (at - markers.start) * rows..].chunks_exact_mut(rows);
                    for (into, w) in of_marker.zip(sight.by_marker().row_iter()) {
                        for run in &self.runs {
                            let of = sight.row_range(run.from..run.from + run.length);
                            let into = &mut into[place[run.into]..][..run.length];
                            add_combination(into, of, [w[0], w[1]]);
                        }
                    }
                }
            },
        );
        for &(at, observation) in own {
            let sight = sight(observation);
            for (point, d) in sight.by_field() {
                let coupling = sight.by_marker() * d;
                for (component, column) in coupling.column_iter().enumerate() {
                    if let Some(row) = self.image.intrinsics[E + 2 * point + component] {
                        (0..3).for_each(|d| values[(place[row], 3 * (at - markers.start) + d)] += column[d]);
                    }
                }
            }
        }
    }
}

/// Numbers of so many markers, block by block.
fn blocks(markers: usize) -> Vec<Range<usize>> {
    (0..markers).step_by(MOST).map(|first| first..(first + MOST).min(markers)).collect()
}

impl MarkerRows {
    /// Of so many unknowns of some images.
    pub fn of(rows: usize, seen: &SeenMarkers, images: &[ImageRows]) -> Self {
        let images: Vec<Ordered> = images.iter().map(|image| Ordered::new(image, seen)).collect();
        let block = |markers: Range<usize>| MarkerBlock::of(rows, &images, markers);
        Self { rows, blocks: blocks(seen.order.len()).into_par_iter().map(block).collect() }
    }

    /// All rows of a matrix.
    pub fn whole(all: &DMatrix<f64>) -> Self {
        let rows = all.nrows();
        let block = |markers: Range<usize>| MarkerBlock {
            values: all.columns(3 * markers.start, 3 * markers.len()).into_owned(),
            runs: runs((0..rows).zip(0..rows)),
            markers,
        };
        Self { rows, blocks: blocks(all.ncols() / 3).into_iter().map(block).collect() }
    }

    /// Multiplies the columns of every marker from the right by a matrix of its own.
    pub fn times_right(&mut self, matrices: &[Matrix3<f64>]) {
        self.blocks.par_iter_mut().for_each(|block| times_right(&mut block.values, &matrices[block.markers.clone()]));
    }

    /// Its product with its transpose.
    pub fn gram(&self) -> DMatrix<f64> {
        let rows = self.rows;
        let mut gram = DMatrix::zeros(rows, rows);
        gram.as_mut_slice().par_chunks_mut(COLUMNS_A_BLOCK * rows.max(1)).enumerate().for_each(|(k, into)| {
            let first = k * COLUMNS_A_BLOCK;
            let own = first..first + into.len() / rows;
            let mut of_block = DMatrix::zeros(own.end, own.len());
            self.blocks.iter().for_each(|block| block.add_gram_to(into, &own, &mut of_block));
        });
        mirror_upper(&mut gram);
        gram
    }

    /// Product with a matrix of 3 markers rows.
    pub fn times(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(self.rows, right.ncols());
        for block in &self.blocks {
            let own = product_with_rows(&block.values, right, 3 * block.markers.start..3 * block.markers.end);
            for Run { from, into, length } in &block.runs {
                let mut sum = all.rows_mut(*into, *length);
                sum += own.rows(*from, *length);
            }
        }
        all
    }

    /// Product of its transpose with a matrix over the unknowns.
    pub fn transposed_times(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        let markers = self.blocks.last().map_or(0, |block| block.markers.end);
        let mut all = DMatrix::zeros(3 * markers, right.ncols());
        for block in &self.blocks {
            let own = transposed_product(&block.values, &block.rows_of(right));
            all.rows_mut(3 * block.markers.start, own.nrows()).copy_from(&own);
        }
        all
    }

    /// Adds its product with a matrix on its left.
    pub fn add_product_to(&self, sum: &mut DMatrix<f64>, left: &DMatrix<f64>) {
        let left = left.transpose();
        let own = |block: &MarkerBlock| transposed_product(&block.rows_of(&left), &block.values);
        let products: Vec<DMatrix<f64>> = self.blocks.par_iter().map(own).collect();
        for (block, own) in self.blocks.iter().zip(products) {
            let mut into = sum.columns_mut(3 * block.markers.start, own.ncols());
            into += own;
        }
    }
}

impl MarkerBlock {
    fn of(rows: usize, images: &[Ordered], markers: Range<usize>) -> Self {
        let images = || images.iter().filter(|image| !image.of(&markers).is_empty());
        let mut is_used = vec![false; rows];
        images().flat_map(Ordered::rows).for_each(|row| is_used[row] = true);
        let mut place = vec![0; rows];
        let used = || (0..rows).filter(|row| is_used[*row]);
        used().enumerate().for_each(|(at, row)| place[row] = at);
        let mut values = DMatrix::zeros(used().count(), 3 * markers.len());
        images().for_each(|image| image.add_to(&mut values, &markers, &place));
        Self { runs: runs(used().enumerate()), values, markers }
    }

    /// With all of so many rows.
    pub fn whole(&self, rows: usize) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(rows, self.values.ncols());
        for Run { from, into, length } in &self.runs {
            all.rows_mut(*into, *length).copy_from(&self.values.rows(*from, *length));
        }
        all
    }

    /// Those of the rows of a matrix over all unknowns that it has.
    pub fn rows_of(&self, all: &DMatrix<f64>) -> DMatrix<f64> {
        let mut own = DMatrix::zeros(self.values.nrows(), all.ncols());
        for Run { from, into, length } in &self.runs {
            own.rows_mut(*from, *length).copy_from(&all.rows(*into, *length));
        }
        own
    }

    /// The upper triangle of the part of a matrix over all unknowns that belongs to its rows.
    pub fn upper_part_of(&self, all: &DMatrix<f64>) -> DMatrix<f64> {
        upper_part(&self.runs, all)
    }

    /// Place of the first row that it has from `row` on.
    fn place(&self, row: usize) -> usize {
        let after = self.runs.partition_point(|run| run.into + run.length <= row);
        self.runs.get(after).map_or(self.values.nrows(), |run| run.from + row.saturating_sub(run.into))
    }

    /// Adds its product with its transpose, down to the diagonal, to the columns `own`; by way of `gram`.
    fn add_gram_to(&self, into: &mut [f64], own: &Range<usize>, gram: &mut DMatrix<f64>) {
        let (first, end) = (self.place(own.start), self.place(own.end));
        part_of_gram(gram, &self.values, first..end);
        let rows = into.len() / own.len();
        for of in &self.runs {
            for column in of.into.max(own.start)..(of.into + of.length).min(own.end) {
                let sums = &mut into[(column - own.start) * rows..][..rows];
                let height = gram.nrows();
                let gram = &gram.as_slice()[(of.from + column - of.into - first) * height..][..height];
                for Run { from, into, length } in self.runs.iter().take_while(|run| run.into <= column) {
                    let length = (*length).min(column + 1 - into);
                    let sums = sums[*into..][..length].iter_mut();
                    sums.zip(&gram[*from..][..length]).for_each(|(sum, value)| *sum += value);
                }
            }
        }
    }
}

/// Multiplies the columns of every marker from the right by a matrix of its own.
pub(super) fn times_right(values: &mut DMatrix<f64>, matrices: &[Matrix3<f64>]) {
    let rows = values.nrows();
    let each = values.as_mut_slice().chunks_exact_mut(3 * rows.max(1)).zip(matrices);
    wide(
        #[inline(always)]
        || each.for_each(|(columns, m)| times_right_of_three(columns, m)),
    );
}

/// Multiplies three columns by `m` from the right.
#[inline(always)]
fn times_right_of_three(columns: &mut [f64], m: &Matrix3<f64>) {
    let (x, rest) = columns.split_at_mut(columns.len() / 3);
    let (y, z) = rest.split_at_mut(x.len());
    for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
        let old = [*x, *y, *z];
        let new = |k: usize| old[0] * m[(0, k)] + old[1] * m[(1, k)] + old[2] * m[(2, k)];
        (*x, *y, *z) = (new(0), new(1), new(2));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks of which the first has rows 0..3 and 5..7, the second all of them but the last.
    fn rows() -> (DMatrix<f64>, MarkerRows) {
        let (rows, count) = (COLUMNS_A_BLOCK + 9, MOST + 5);
        let is_used = |row: usize, marker: usize| match marker < MOST {
            true => !(3..5).contains(&row) && row + 2 != rows,
            false => row + 1 != rows,
        };
        let value = |i: usize, j: usize| if is_used(i, j / 3) { ((3 * i + 7 * j) as f64).sin() } else { 0.0 };
        let all = DMatrix::from_fn(rows, 3 * count, value);
        let block = |markers: Range<usize>| {
            let used: Vec<usize> = (0..rows).filter(|row| is_used(*row, markers.start)).collect();
            let values = all.columns(3 * markers.start, 3 * markers.len()).select_rows(&used);
            MarkerBlock { runs: runs(used.into_iter().enumerate()), values, markers }
        };
        let blocks = blocks(count).into_iter().map(block).collect();
        (all.clone(), MarkerRows { rows, blocks })
    }

    #[test]
    fn products_by_blocks_are_those_of_the_whole() {
        let (all, own) = rows();
        let near = |a: &DMatrix<f64>, b: &DMatrix<f64>| assert!((a - b).amax() < 1e-11, "{}", (a - b).amax());
        let right = DMatrix::from_fn(all.ncols(), 3, |i, j| ((i + 5 * j) as f64).cos());
        let left = DMatrix::from_fn(4, all.nrows(), |i, j| ((2 * i + j) as f64).cos());
        near(&own.gram(), &(&all * all.transpose()));
        near(&own.times(&right), &(&all * &right));
        near(&own.transposed_times(&left.transpose()), &(all.transpose() * left.transpose()));
        let mut sum = DMatrix::from_element(4, all.ncols(), 1.0);
        own.add_product_to(&mut sum, &left);
        near(&sum, &(&left * &all).add_scalar(1.0));
        near(&MarkerRows::whole(&all).gram(), &own.gram());
    }
}
