//! Unknowns that some stops touch between them, and products in their space.

use nalgebra::DMatrix;

use super::runs::{Run, runs, upper_part};
use crate::linalg::add_gram;

/// The unknowns that some stops touch between them.
pub struct Group {
    /// Ascending.
    rows: Vec<usize>,
    /// From their places here to those among all unknowns.
    runs: Vec<Run>,
}

/// What is in any of some ascending lists, ascending.
pub(super) fn union<'a>(lists: impl Iterator<Item = &'a Vec<usize>>) -> Vec<usize> {
    let mut is_in = Vec::new();
    for list in lists {
        let end = list.last().map_or(0, |last| last + 1);
        is_in.resize(is_in.len().max(end), false);
        list.iter().for_each(|&at| is_in[at] = true);
    }
    (0..is_in.len()).filter(|at| is_in[*at]).collect()
}

impl Group {
    /// Of the unknowns that each stop touches.
    pub fn of<'a>(touched: impl Iterator<Item = &'a Vec<usize>>) -> Self {
        let rows = union(touched);
        let runs = runs(rows.iter().copied().enumerate());
        Self { rows, runs }
    }

    /// Matrices over some of the unknowns each (ascending), side by side over those of the group.
    pub fn side_by_side<'a>(
        &self,
        parts: impl Iterator<Item = (&'a Vec<usize>, &'a DMatrix<f64>)> + Clone,
    ) -> DMatrix<f64> {
        let columns = parts.clone().map(|(_, own)| own.ncols()).sum();
        let mut all = DMatrix::zeros(self.rows.len(), columns);
        let mut into = all.column_iter_mut();
        for (touched, own) in parts {
            let mut at = 0;
            let places: Vec<usize> = (touched.iter())
                .map(|row| {
                    at += self.rows[at..].partition_point(|r| r < row);
                    at
                })
                .collect();
            for (own, mut into) in own.column_iter().zip(&mut into) {
                places.iter().zip(own.iter()).for_each(|(&place, value)| into[place] = *value);
            }
        }
        all
    }

    /// `a -= y y'` in the upper triangle of a matrix over all unknowns, with `y` over those of the group.
    pub fn subtract_gram(&self, a: &mut DMatrix<f64>, y: &DMatrix<f64>) {
        let mut own = DMatrix::zeros(self.rows.len(), self.rows.len());
        add_gram(&mut own, y, -1.0);
        self.add_upper(a, &own);
    }

    /// Adds the upper triangle of a matrix over those of the group to that of one over all unknowns.
    pub fn add_upper(&self, a: &mut DMatrix<f64>, own: &DMatrix<f64>) {
        for (j, &column) in self.rows.iter().enumerate() {
            let mut into = a.column_mut(column);
            for Run { from, into: row, length } in self.runs.iter().take_while(|run| run.from <= j) {
                let length = (*length).min(j + 1 - from);
                let mut into = into.rows_mut(*row, length);
                into += own.view((*from, j), (length, 1));
            }
        }
    }

    /// The upper triangle of the part of a symmetric matrix over all unknowns that belongs to those of the group, half of its diagonal:
    /// it and its transpose add up to that part.
    pub fn half_of(&self, all: &DMatrix<f64>) -> DMatrix<f64> {
        let mut half = upper_part(&self.runs, all);
        (0..half.nrows()).for_each(|j| half[(j, j)] *= 0.5);
        half
    }

    /// The part of a matrix over all unknowns that belongs to those of the group.
    pub fn part_of(&self, all: &DMatrix<f64>) -> DMatrix<f64> {
        let n = self.rows.len();
        let mut part = DMatrix::zeros(n, n);
        for (mut own, &column) in part.column_iter_mut().zip(&self.rows) {
            let of = all.column(column);
            for Run { from, into, length } in &self.runs {
                own.rows_mut(*from, *length).copy_from(&of.rows(*into, *length));
            }
        }
        part
    }
}
