//! Sums over the pixels of a window: normal matrix, right side and squares of the residuals.

use super::model::{Block, LANES, Lanes, PARAMETERS, Prediction};

/// Sums of every fourth lane: to add lanes up for each block would take as long as the rest.
type Lanewise = [f64; 4];

/// Normal matrix (lower triangle), right side, squares of the residuals.
#[derive(Clone, Copy)]
pub(super) struct Sum {
    pub normal: [[f64; PARAMETERS]; PARAMETERS],
    pub right: [f64; PARAMETERS],
    pub squares: f64,
}

/// The same as long as there are pixels to come.
pub(super) struct RunningSums {
    normal: [[Lanewise; PARAMETERS]; PARAMETERS],
    right: [Lanewise; PARAMETERS],
    squares: Lanewise,
}

impl RunningSums {
    pub const ZERO: Self =
        Self { normal: [[[0.0; 4]; PARAMETERS]; PARAMETERS], right: [[0.0; 4]; PARAMETERS], squares: [0.0; 4] };

    #[inline(always)]
    pub fn add(&mut self, block: &Block, predicted: &Prediction, full_scale: f64) {
        let (mut residual, mut open) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let value = predicted.value[lane];
            let clipped = value >= full_scale;
            residual[lane] = block.weight[lane] * (block.value[lane] - if clipped { full_scale } else { value });
            open[lane] = if clipped { 0.0 } else { block.weight[lane] };
        }
        add_products(&mut self.squares, &residual, &residual);
        for i in 0..PARAMETERS {
            let mut row = predicted.gradient[i];
            row.iter_mut().zip(&open).for_each(|(g, open)| *g *= open);
            add_products(&mut self.right[i], &row, &residual);
            for j in 0..=i {
                add_products(&mut self.normal[i][j], &row, &predicted.gradient[j]);
            }
        }
    }

    pub fn total(&self) -> Sum {
        let total = |[a, b, c, d]: Lanewise| (a + c) + (b + d);
        Sum {
            normal: self.normal.map(|row| row.map(total)),
            right: self.right.map(total),
            squares: total(self.squares),
        }
    }
}

/// In a fixed order.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "lanes of many arrays beside each other")]
fn add_products(sums: &mut Lanewise, a: &Lanes, b: &Lanes) {
    let mut next = *sums;
    for (a, b) in a.as_chunks::<4>().0.iter().zip(b.as_chunks::<4>().0) {
        for lane in 0..4 {
            next[lane] += a[lane] * b[lane];
        }
    }
    *sums = next;
}
