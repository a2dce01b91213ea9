//! Exact area coverage of polygons on a fine grid, and what a pixel behind a point-spread function sees of it.
//!
//! The coverage of every cell of a grid with [`OVERSAMPLING`] cells per pixel and axis is computed exactly (signed areas under
//! the edges, summed along the row). The kernel (point spread and pixel area) is then applied with the resolution of the
//! grid. What remains of aliasing is that of the fine grid: 1e-4 px in the centroid of a disc of radius 5 px.

use nalgebra::Vector2;

use super::psf::{OVERSAMPLING, Psf};

/// A rectangle of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelRect {
    /// First column.
    pub x: i32,
    /// First row.
    pub y: i32,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl PixelRect {
    /// The common part of two rectangles; `None` when they do not meet.
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        let x = self.x.max(other.x);
        let y = self.y.max(other.y);
        let right = (self.x + self.width as i32).min(other.x + other.width as i32);
        let bottom = (self.y + self.height as i32).min(other.y + other.height as i32);
        (right > x && bottom > y).then(|| Self { x, y, width: (right - x) as usize, height: (bottom - y) as usize })
    }

    /// The rectangle with `by` more pixels on each side.
    pub fn grown(&self, by: usize) -> Self {
        let m = by as i32;
        Self { x: self.x - m, y: self.y - m, width: self.width + 2 * by, height: self.height + 2 * by }
    }

    /// The rectangle of the pixels that hold all points, grown by `margin` pixels; `None` without points.
    pub fn around<'a>(points: impl Iterator<Item = &'a Vector2<f64>>, margin: usize) -> Option<Self> {
        let mut low = Vector2::repeat(f64::INFINITY);
        let mut high = Vector2::repeat(f64::NEG_INFINITY);
        points.for_each(|p| {
            low = low.inf(p);
            high = high.sup(p);
        });
        let bounded = low.iter().chain(high.iter()).all(|v| v.abs() < 1e6);
        bounded.then(|| {
            let m = margin as i32;
            let (x, y) = ((low.x + 0.5).floor() as i32, (low.y + 0.5).floor() as i32);
            let size = |high: f64, first: i32| ((high + 0.5).floor() as i32 - first + 1 + 2 * m) as usize;
            Self { x: x - m, y: y - m, width: size(high.x, x), height: size(high.y, y) }
        })
    }
}

/// A plane `value + slope . (uv - at)` that weights the coverage: illumination near a marker.
#[derive(Debug, Clone, Copy)]
pub struct Plane {
    /// Where `value` holds, px.
    pub at: Vector2<f64>,
    /// Value there.
    pub value: f64,
    /// Change per px.
    pub slope: Vector2<f64>,
}

impl Plane {
    /// The constant 1.
    pub fn one() -> Self {
        Self { at: Vector2::zeros(), value: 1.0, slope: Vector2::zeros() }
    }

    /// Value at a pixel position.
    pub fn at(&self, u: f64, v: f64) -> f64 {
        self.value + self.slope.x * (u - self.at.x) + self.slope.y * (v - self.at.y)
    }
}

/// What the pixels of a rectangle see: values row by row.
#[derive(Debug, Clone)]
pub struct Patch {
    /// Where it lies.
    pub rect: PixelRect,
    /// Values.
    pub values: Vec<f32>,
}

/// Reusable working memory; one per thread.
#[derive(Debug, Default)]
pub struct Rasteriser {
    /// Signed areas, one row of cells after the other.
    areas: Vec<f32>,
    /// Coverage of one row of cells, sorted by position within the pixel.
    phases: Vec<f32>,
    /// Rows of cells after the kernel along the row.
    rows: Vec<f32>,
}

impl Rasteriser {
    /// What the pixels around closed polygons (px) see of their covered area, weighted by `plane`.
    ///
    /// The sense of each polygon counts: an outline of the opposite sense is a hole. `None` when nothing lies within `frame`.
    pub fn cover(
        &mut self,
        polygons: &[Vec<Vector2<f64>>],
        psf: &Psf,
        plane: &Plane,
        frame: &PixelRect,
    ) -> Option<Patch> {
        let core = PixelRect::around(polygons.iter().flatten(), 0)?;
        let reach = psf.reach();
        let frame = frame.grown(reach);
        // Columns and rows of the core outside the frame are cut off; the sums along the rows start at its left border.
        let core = core.intersection(&frame)?;
        self.sum_areas(polygons, &core);
        let rect = core.grown(reach);
        let mut patch = Patch { rect, values: vec![0.0; rect.width * rect.height] };
        for lobe in psf.lobes() {
            self.filter_rows(&core, &rect, lobe.along_u, plane);
            self.filter_columns(&core, &mut patch, lobe.along_v);
        }
        Some(patch)
    }

    fn sum_areas(&mut self, polygons: &[Vec<Vector2<f64>>], core: &PixelRect) {
        let (columns, rows) = (core.width * OVERSAMPLING, core.height * OVERSAMPLING);
        self.areas.clear();
        self.areas.resize((columns + 2) * rows, 0.0);
        let mut grid = AreaGrid { areas: &mut self.areas, columns, rows };
        let s = OVERSAMPLING as f64;
        let to_grid =
            |p: &Vector2<f64>| Vector2::new((p.x + 0.5 - f64::from(core.x)) * s, (p.y + 0.5 - f64::from(core.y)) * s);
        for polygon in polygons {
            let mut from = polygon.last().map(to_grid).unwrap_or_default();
            for corner in polygon {
                let to = to_grid(corner);
                grid.add_edge(from, to);
                from = to;
            }
        }
    }

    /// Sums the areas to coverage, weights them, and applies the kernel along the rows.
    fn filter_rows(&mut self, core: &PixelRect, rect: &PixelRect, kernel: &[f32], plane: &Plane) {
        let s = OVERSAMPLING;
        let columns = core.width * s;
        let reach = (kernel.len() / s - 1) / 2;
        let padded = core.width + 4 * reach;
        self.phases.clear();
        self.phases.resize(padded * s, 0.0);
        self.rows.clear();
        self.rows.resize(rect.width * core.height * s, 0.0);
        for row in 0..core.height * s {
            let v = f64::from(core.y) - 0.5 + (row as f64 + 0.5) / s as f64;
            let start = plane.at(f64::from(core.x) - 0.5 + 0.5 / s as f64, v) as f32;
            let step = (plane.slope.x / s as f64) as f32;
            let mut cover = 0.0;
            for (k, area) in self.areas[row * (columns + 2)..][..columns].iter().enumerate() {
                cover += area;
                self.phases[(k % s) * padded + 2 * reach + k / s] = cover * (start + step * k as f32);
            }
            let out = &mut self.rows[row * rect.width..][..rect.width];
            for (tap, &w) in kernel.iter().enumerate() {
                let line = &self.phases[(tap % s) * padded + tap / s..][..rect.width];
                out.iter_mut().zip(line).for_each(|(o, c)| *o += w * c);
            }
        }
    }

    fn filter_columns(&self, core: &PixelRect, patch: &mut Patch, kernel: &[f32]) {
        let s = OVERSAMPLING;
        let width = patch.rect.width;
        let reach = (kernel.len() / s - 1) / 2;
        for (y, out) in patch.values.chunks_exact_mut(width).enumerate() {
            for (tap, &w) in kernel.iter().enumerate() {
                let Some(row) = (y * s + tap).checked_sub(2 * reach * s).filter(|r| *r < core.height * s) else {
                    continue;
                };
                let line = &self.rows[row * width..][..width];
                out.iter_mut().zip(line).for_each(|(o, c)| *o += w * c);
            }
        }
    }
}

/// Cells with, for each, the change of coverage against its left neighbour.
struct AreaGrid<'a> {
    areas: &'a mut [f32],
    columns: usize,
    rows: usize,
}

impl AreaGrid<'_> {
    /// Adds the signed area to the right of an edge, cell by cell.
    fn add_edge(&mut self, from: Vector2<f64>, to: Vector2<f64>) {
        if from.y == to.y {
            return;
        }
        let (sign, top, bottom) = if from.y < to.y { (1.0, from, to) } else { (-1.0, to, from) };
        let slope = (bottom.x - top.x) / (bottom.y - top.y);
        let first = top.y.floor().max(0.0) as usize;
        let end = (bottom.y.ceil().max(0.0) as usize).min(self.rows);
        for row in first..end {
            let y0 = top.y.max(row as f64);
            let y1 = bottom.y.min(row as f64 + 1.0);
            if y1 > y0 {
                let x0 = top.x + (y0 - top.y) * slope;
                let x1 = top.x + (y1 - top.y) * slope;
                self.add_in_row(row, sign * (y1 - y0), x0, x1);
            }
        }
    }

    /// Adds a piece of edge of signed height `height` between `x0` and `x1` within one row.
    fn add_in_row(&mut self, row: usize, height: f64, x0: f64, x1: f64) {
        let last = self.columns as f64;
        let line = &mut self.areas[row * (self.columns + 2)..][..self.columns + 2];
        let (left, right) = (x0.min(x1), x0.max(x1));
        if left >= last {
            return;
        }
        if right <= 0.0 {
            line[0] += height as f32;
            return;
        }
        let per_column = if right - left < 1e-12 { 0.0 } else { height / (right - left) };
        if left < 0.0 {
            line[0] += (per_column * -left) as f32;
        }
        let (left, right) = (left.max(0.0), right.min(last));
        let (i, j) = (left.floor() as usize, right.floor() as usize);
        if i == j {
            let inside = 1.0 - ((left + right) / 2.0 - i as f64);
            let piece = if per_column == 0.0 { height } else { per_column * (right - left) };
            line[i] += (piece * inside) as f32;
            line[i + 1] += (piece * (1.0 - inside)) as f32;
            return;
        }
        // Area to the right of the piece that lies in column k, spread over column k and the one after it.
        for k in i..=j.min(self.columns) {
            let a = left.max(k as f64);
            let b = right.min(k as f64 + 1.0);
            let piece = per_column * (b - a);
            let inside = 1.0 - ((a + b) / 2.0 - k as f64);
            line[k] += (piece * inside) as f32;
            line[k + 1] += (piece * (1.0 - inside)) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn circle(u: f64, v: f64, r: f64) -> Vec<Vector2<f64>> {
        let n = 400;
        // Radius of the polygon with the circle's area.
        let r = r * ((TAU / n as f64) / (TAU / n as f64).sin()).sqrt();
        (0..n).map(|k| TAU * k as f64 / n as f64).map(|a| Vector2::new(u + r * a.sin(), v + r * a.cos())).collect()
    }

    fn moments(patch: &Patch) -> (f64, Vector2<f64>) {
        let mut sum = (0.0, Vector2::zeros());
        for (k, &value) in patch.values.iter().enumerate() {
            let (x, y) = (k % patch.rect.width, k / patch.rect.width);
            let at = Vector2::new(f64::from(patch.rect.x) + x as f64, f64::from(patch.rect.y) + y as f64);
            sum.0 += f64::from(value);
            sum.1 += at * f64::from(value);
        }
        (sum.0, sum.1 / sum.0)
    }

    const FRAME: PixelRect = PixelRect { x: 0, y: 0, width: 64, height: 64 };

    #[test]
    fn area_and_centroid_of_a_blurred_disc() {
        let mut raster = Rasteriser::default();
        // Without blur the sampling by whole pixels itself moves the centroid of a small disc by some 0.001 px.
        for (k, sigma) in [0.5, 0.6, 0.8, 1.5].into_iter().enumerate() {
            for radius in [3.0, 5.0, 9.0] {
                let (u, v) = (30.0 + 0.137 * k as f64, 31.3 - 0.21 * radius);
                let patch =
                    raster.cover(&[circle(u, v, radius)], &Psf::gaussian(sigma), &Plane::one(), &FRAME).unwrap();
                let (area, centre) = moments(&patch);
                assert!((area / (TAU / 2.0 * radius * radius) - 1.0).abs() < 2e-4, "r {radius} sigma {sigma}: {area}");
                // Aliasing of the fine grid: largest at the smallest radius.
                assert!((centre - Vector2::new(u, v)).norm() < 5e-4, "r {radius} sigma {sigma}: {centre}");
            }
        }
    }

    #[test]
    fn a_square_is_covered_exactly() {
        let mut raster = Rasteriser::default();
        let square = [(9.75, 20.25), (9.75, 23.5), (14.25, 23.5), (14.25, 20.25)].map(|(x, y)| Vector2::new(x, y));
        let patch = raster.cover(&[square.to_vec()], &Psf::gaussian(0.0), &Plane::one(), &FRAME).unwrap();
        let at =
            |x: i32, y: i32| patch.values[(y - patch.rect.y) as usize * patch.rect.width + (x - patch.rect.x) as usize];
        assert!((at(12, 22) - 1.0).abs() < 1e-6);
        assert!((at(10, 22) - 0.75).abs() < 1e-6);
        assert!((at(14, 21) - 0.75).abs() < 1e-6);
        assert!((at(12, 20) - 0.25).abs() < 1e-6);
        assert!((at(12, 23) - 1.0).abs() < 1e-6);
        assert_eq!(patch.values.iter().filter(|v| **v > 1e-6).count(), 5 * 4);
    }

    #[test]
    fn clipping_at_the_frame_changes_nothing_inside() {
        let mut raster = Rasteriser::default();
        let psf = Psf::gaussian(0.9);
        let polygon = [circle(31.2, 30.1, 12.0)];
        let whole = raster.cover(&polygon, &psf, &Plane::one(), &FRAME).unwrap();
        let frame = PixelRect { x: 28, y: 25, width: 9, height: 30 };
        let part = raster.cover(&polygon, &psf, &Plane::one(), &frame).unwrap();
        for y in frame.y..frame.y + 17 {
            for x in frame.x..frame.x + 9 {
                let at = |p: &Patch| p.values[(y - p.rect.y) as usize * p.rect.width + (x - p.rect.x) as usize];
                assert!((at(&whole) - at(&part)).abs() < 1e-5, "({x}, {y})");
            }
        }
    }
}
