//! Symmetric block-diagonal matrices.

use nalgebra::{DMatrix, DMatrixView, DVector};

use crate::linalg::{SymmetricFactor, product};

/// Blocks along the diagonal, one after the other.
pub(super) struct BlockDiagonal {
    /// First row of each block, and the block.
    blocks: Vec<(usize, DMatrix<f64>)>,
}

impl BlockDiagonal {
    /// Of its blocks in their order.
    pub fn of(blocks: impl IntoIterator<Item = DMatrix<f64>>) -> Self {
        let mut first = 0;
        let placed = blocks.into_iter().map(|block| {
            first += block.nrows();
            (first - block.nrows(), block)
        });
        Self { blocks: placed.collect() }
    }

    /// The block that a row lies in, with its first row.
    fn around(&self, row: usize) -> usize {
        self.blocks.partition_point(|(first, _)| *first <= row) - 1
    }

    /// A square view on the diagonal that lies within one block.
    pub fn view(&self, first: usize, rows: usize) -> DMatrixView<'_, f64> {
        let (start, block) = &self.blocks[self.around(first)];
        block.view((first - start, first - start), (rows, rows))
    }

    /// Adds to a square on the diagonal that lies within one block.
    pub fn add(&mut self, first: usize, part: &DMatrix<f64>) {
        let at = self.around(first);
        let (start, block) = &mut self.blocks[at];
        let mut view = block.view_mut((first - *start, first - *start), part.shape());
        view += part;
    }

    /// The inverse; `None` where it is not positive definite.
    pub fn inverse(&self) -> Option<Self> {
        let inverse =
            |(first, block): &(usize, DMatrix<f64>)| Some((*first, SymmetricFactor::new(block).ok()?.inverse()));
        Some(Self { blocks: self.blocks.iter().map(inverse).collect::<Option<_>>()? })
    }

    /// Product with a matrix.
    pub fn times(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(m.nrows(), m.ncols());
        for (first, block) in &self.blocks {
            let own = product(block, &m.rows(*first, block.nrows()).into_owned());
            all.rows_mut(*first, block.nrows()).copy_from(&own);
        }
        all
    }

    /// Product with a vector.
    pub fn times_vector(&self, v: &DVector<f64>) -> DVector<f64> {
        let mut all = DVector::zeros(v.len());
        for (first, block) in &self.blocks {
            all.rows_mut(*first, block.nrows()).gemv(1.0, block, &v.rows(*first, block.nrows()), 0.0);
        }
        all
    }
}
