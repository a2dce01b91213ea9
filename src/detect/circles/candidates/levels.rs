//! Upper and lower envelope of the intensities, and from them the local threshold between ink and paper.
//!
//! Comparing a pixel with a fraction of the upper envelope is the division by the envelope without touching the
//! counts: the sub-pixel fit works on the counts themselves and brings its own illumination terms.

use crate::detect::Picture;

/// Side of the square cells of the envelope grid, px.
pub(super) const CELL: usize = 8;
const BLOCK: usize = 4;

/// Smooth local levels of a picture on a grid of cells of [`CELL`] px.
pub(in crate::detect) struct Levels {
    cols: usize,
    rows: usize,
    threshold: Vec<f32>,
    upper: Vec<f32>,
    /// Typical noise of a pixel, counts.
    pub noise: f32,
}

impl Levels {
    /// Levels of a picture whose markers are at most `marker_px` across. The threshold stands at `level` of the way
    /// from the lower to the upper envelope, and always several sigma of noise below the upper one.
    pub fn of(picture: &Picture, marker_px: f64, level: f32) -> Self {
        let noise = noise_of(picture);
        let (cols, rows) = (picture.width.div_ceil(CELL), picture.height.div_ceil(CELL));
        let (mut upper, mut lower) = cell_extremes(picture, cols, rows);
        let reach = ((marker_px / 2.0 / CELL as f64).ceil() as usize).clamp(1, cols.max(rows));
        let (larger, smaller) = (|a, b| if a > b { a } else { b }, |a, b| if a < b { a } else { b });
        upper = window(&window(&upper, cols, reach, larger), cols, reach, smaller);
        lower = window(&lower, cols, reach, smaller);
        for _ in 0..2 {
            smooth(&mut upper, cols, rows);
            smooth(&mut lower, cols, rows);
        }
        let threshold = upper.iter().zip(&lower).map(|(u, l)| (l + level * (u - l)).min(u - 6.0 * noise)).collect();
        Self { cols, rows, threshold, upper, noise }
    }

    /// Threshold at a pixel, by bilinear interpolation of the cells.
    pub fn threshold_at(&self, x: f32, y: f32) -> f32 {
        self.sample(&self.threshold, x, y)
    }

    /// Upper envelope at a pixel.
    pub fn upper_at(&self, x: f32, y: f32) -> f32 {
        self.sample(&self.upper, x, y)
    }

    fn sample(&self, grid: &[f32], x: f32, y: f32) -> f32 {
        let (c0, c1, fx) = split(x, self.cols);
        let (r0, r1, fy) = split(y, self.rows);
        let row = |r: usize| grid[r * self.cols + c0] * (1.0 - fx) + grid[r * self.cols + c1] * fx;
        row(r0) * (1.0 - fy) + row(r1) * fy
    }

    /// Thresholds of a whole pixel row into `out`; `nodes` is scratch.
    pub fn threshold_row(&self, y: usize, nodes: &mut Vec<f32>, out: &mut [f32]) {
        let (r0, r1, fy) = split(y as f32, self.rows);
        nodes.clear();
        nodes.extend(
            (0..self.cols)
                .map(|c| self.threshold[r0 * self.cols + c] * (1.0 - fy) + self.threshold[r1 * self.cols + c] * fy),
        );
        let half = CELL / 2;
        let lead = half.min(out.len());
        out[..lead].fill(nodes[0]);
        let mut segments = out[lead..].chunks_mut(CELL);
        for pair in nodes.windows(2) {
            let Some(segment) = segments.next() else { return };
            let slope = (pair[1] - pair[0]) / CELL as f32;
            for (k, v) in segment.iter_mut().enumerate() {
                *v = pair[0] + slope * (k as f32 + 0.5);
            }
        }
        for segment in segments {
            segment.fill(nodes[self.cols - 1]);
        }
    }
}

/// The two cells around a pixel coordinate and the weight of the second.
fn split(v: f32, count: usize) -> (usize, usize, f32) {
    let t = ((v - (CELL as f32 - 1.0) / 2.0) / CELL as f32).clamp(0.0, (count - 1) as f32);
    let i = (t as usize).min(count - 1);
    (i, (i + 1).min(count - 1), t - i as f32)
}

/// Largest and smallest of the block means in every cell.
fn cell_extremes(picture: &Picture, cols: usize, rows: usize) -> (Vec<f32>, Vec<f32>) {
    let mut upper = vec![f32::MIN; cols * rows];
    let mut lower = vec![f32::MAX; cols * rows];
    let mut sums = vec![0.0f32; picture.width];
    for (band, lines) in picture.pixels.chunks(picture.width * BLOCK).enumerate() {
        sums.fill(0.0);
        for line in lines.chunks_exact(picture.width) {
            sums.iter_mut().zip(line).for_each(|(s, v)| *s += v);
        }
        let height = lines.len() / picture.width;
        let row = band * BLOCK / CELL * cols;
        let cells = upper[row..row + cols].iter_mut().zip(&mut lower[row..row + cols]);
        for ((upper, lower), values) in cells.zip(sums.chunks(CELL)) {
            for block in values.chunks(BLOCK) {
                let mean = block.iter().sum::<f32>() / (block.len() * height) as f32;
                *upper = upper.max(mean);
                *lower = lower.min(mean);
            }
        }
    }
    (upper, lower)
}

/// Square window of `2 reach + 1` cells reduced by `pick` (a minimum or maximum), first down, then across.
fn window(grid: &[f32], cols: usize, reach: usize, pick: impl Fn(f32, f32) -> f32 + Copy) -> Vec<f32> {
    let rows = grid.len() / cols;
    let across = transposed(&window_down(grid, cols, reach, pick), cols);
    transposed(&window_down(&across, rows, reach, pick), rows)
}

/// The same along the columns only, by doubling: the span that every cell has seen grows with each round.
fn window_down(grid: &[f32], cols: usize, reach: usize, pick: impl Fn(f32, f32) -> f32) -> Vec<f32> {
    let last = grid.len() / cols - 1;
    let row = |k: usize| k.saturating_sub(reach).min(last) * cols;
    let mut run = Vec::with_capacity((last + 2 * reach + 1) * cols);
    (0..=last + 2 * reach).for_each(|k| run.extend_from_slice(&grid[row(k)..row(k) + cols]));
    let (wanted, mut span) = (2 * reach + 1, 1);
    while span < wanted {
        let step = span.min(wanted - span);
        run = run.iter().zip(&run[step * cols..]).map(|(a, b)| pick(*a, *b)).collect();
        span += step;
    }
    run
}

fn transposed(grid: &[f32], cols: usize) -> Vec<f32> {
    let rows = grid.len() / cols;
    let mut out = vec![0.0; grid.len()];
    for (r, line) in grid.chunks_exact(cols).enumerate() {
        out[r..].iter_mut().step_by(rows).zip(line).for_each(|(to, from)| *to = *from);
    }
    out
}

/// Binomial 3x3 smoothing, first along the rows.
fn smooth(grid: &mut [f32], cols: usize, rows: usize) {
    let mut across = grid.to_vec();
    for (out, line) in across.chunks_exact_mut(cols).zip(grid.chunks_exact(cols)) {
        for (o, three) in out[1..].iter_mut().zip(line.windows(3)) {
            *o = three[0] + 2.0 * three[1] + three[2];
        }
        let last = cols - 1;
        out[0] = line[0] + 2.0 * line[0] + line[last.min(1)];
        out[last] = line[last.saturating_sub(1)] + 2.0 * line[last] + line[last];
    }
    let row = |r: usize| &across[r * cols..(r + 1) * cols];
    for (r, out) in grid.chunks_exact_mut(cols).enumerate() {
        let (up, middle, down) = (row(r.saturating_sub(1)), row(r), row((r + 1).min(rows - 1)));
        for ((o, u), (m, d)) in out.iter_mut().zip(up).zip(middle.iter().zip(down)) {
            *o = (u + 2.0 * m + d) / 16.0;
        }
    }
}

/// Noise of a pixel from the median difference of horizontal neighbours; edges are a small part of all pairs.
pub fn noise_of(picture: &Picture) -> f32 {
    let step = (picture.height / 64).max(1);
    let mut differences: Vec<f32> = Vec::new();
    for y in (step / 2..picture.height).step_by(step) {
        let row = &picture.pixels[y * picture.width..(y + 1) * picture.width];
        differences.extend(row.chunks_exact(8).map(|c| (c[3] - c[4]).abs()));
    }
    if differences.is_empty() {
        return 0.0;
    }
    let middle = differences.len() / 2;
    let (_, median, _) = differences.select_nth_unstable_by(middle, f32::total_cmp);
    // 0.6745 is the median of |N(0,1)|; the floor is the rounding noise of a count.
    (*median / (0.6745 * std::f32::consts::SQRT_2)).max(0.29)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_is_the_extreme_of_its_cells() {
        let (cols, rows, reach) = (13, 9, 3);
        let grid: Vec<f32> = (0..cols * rows).map(|i| ((i * 7919) % 101) as f32).collect();
        let found = window(&grid, cols, reach, f32::max);
        for (i, v) in found.iter().enumerate() {
            let (c, r) = (i % cols, i / cols);
            let near = |k: &usize| (k % cols).abs_diff(c) <= reach && (k / cols).abs_diff(r) <= reach;
            let largest = (0..cols * rows).filter(near).map(|k| grid[k]).fold(0.0, f32::max);
            assert_eq!(*v, largest, "{c} {r}");
        }
    }

    #[test]
    fn rows_and_points_agree_and_follow_a_gradient() {
        let (width, height) = (203, 117);
        let pixels = (0..width * height)
            .map(|i| {
                let (x, y): (usize, usize) = (i % width, i / width);
                let paper = 100.0 + 0.5 * x as f32;
                let dark = (x % 40).abs_diff(20).pow(2) + (y % 40).abs_diff(20).pow(2) < 100;
                if dark { 0.2 * paper } else { paper }
            })
            .collect();
        let picture = Picture { width, height, pixels, full_scale: 255.0 };
        let levels = Levels::of(&picture, 40.0, 0.5);
        let (mut nodes, mut row) = (Vec::new(), vec![0.0; width]);
        for y in [0, 5, 60, height - 1] {
            levels.threshold_row(y, &mut nodes, &mut row);
            for (x, t) in row.iter().enumerate() {
                assert!((t - levels.threshold_at(x as f32, y as f32)).abs() < 1e-2);
                let paper = 100.0 + 0.5 * x as f32;
                assert!(*t > 0.25 * paper && *t < 0.9 * paper, "{x} {y} {t} {paper}");
            }
        }
    }
}
