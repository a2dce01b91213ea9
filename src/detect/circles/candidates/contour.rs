//! Closed contours of the thresholded picture, with sub-pixel points.
//!
//! The contours run along the cracks between dark and light pixels with the dark side on the left; dark pixels hang
//! together over corners, so that thin rings stay closed. Every crack gives one point, where the counts between its
//! two pixels pass the threshold.

use super::levels::Levels;
use crate::detect::Picture;
use crate::linalg::wide;

const DARK: u8 = 1;
const SEEN: u8 = 2;
/// [`DARK`] in each of eight cells.
const ALL_DARK: u64 = u64::from_le_bytes([DARK; 8]);

/// What a contour encloses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::detect) enum Encloses {
    Dark,
    Light,
}

/// A closed contour.
#[derive(Debug, Clone)]
pub(in crate::detect) struct Contour {
    pub encloses: Encloses,
    /// Enclosed area, px^2.
    pub area: f64,
    pub points: Vec<[f32; 2]>,
    /// Mean step of the counts across the contour, counts per px along rows or columns.
    pub step: f32,
    /// The contour runs along the border of the picture.
    pub clipped: bool,
    /// It was longer than the limit; the points are those of its first part.
    pub too_long: bool,
    /// Middle of the bounding box.
    pub middle: [f64; 2],
}

/// All contours of at least `shortest` cracks; of longer ones than `longest` only the fact is kept.
pub(in crate::detect) fn contours(picture: &Picture, levels: &Levels, shortest: usize, longest: usize) -> Vec<Contour> {
    let mut map = DarkMap::of(picture, levels);
    let mut found = Vec::new();
    let mut tracer = Tracer { picture, levels, longest, points: Vec::new() };
    for y in 0..picture.height {
        let mut x = 1;
        while let Some(dark) = map.next(y + 1, x, |cells| cells & ALL_DARK) {
            if map.cells[(y + 1) * map.stride + dark] & SEEN == 0 {
                let contour = tracer.follow(&mut map, dark, y + 1);
                if contour.too_long || contour.points.len() >= shortest {
                    found.push(contour);
                }
            }
            // the frame ends every row with a light cell
            let Some(light) = map.next(y + 1, dark, |cells| !cells & ALL_DARK) else { break };
            x = light;
        }
    }
    found
}

/// One byte per pixel with a light frame around the picture, so that following a contour needs no bounds.
struct DarkMap {
    stride: usize,
    cells: Vec<u8>,
}

impl DarkMap {
    fn of(picture: &Picture, levels: &Levels) -> Self {
        let stride = picture.width + 2;
        let mut cells = vec![0u8; stride * (picture.height + 2)];
        let mut thresholds = vec![0.0f32; picture.width];
        let mut nodes = Vec::new();
        for (y, line) in picture.pixels.chunks_exact(picture.width).enumerate() {
            levels.threshold_row(y, &mut nodes, &mut thresholds);
            let out = &mut cells[(y + 1) * stride + 1..(y + 1) * stride + 1 + picture.width];
            wide(
                #[inline(always)]
                || {
                    for ((o, v), t) in out.iter_mut().zip(line).zip(&thresholds) {
                        *o = u8::from(v < t);
                    }
                },
            );
        }
        Self { stride, cells }
    }

    /// First column of a row, from `x` on, whose cell `pick` leaves something of; `pick` sees eight cells at once.
    fn next(&self, row: usize, mut x: usize, pick: impl Fn(u64) -> u64) -> Option<usize> {
        let cells = &self.cells[row * self.stride..(row + 1) * self.stride];
        while let Some(eight) = cells.get(x..)?.first_chunk() {
            let picked = pick(u64::from_le_bytes(*eight));
            if picked != 0 {
                return Some(x + picked.trailing_zeros() as usize / 8);
            }
            x += 8;
        }
        (x..self.stride).find(|&x| pick(u64::from(cells[x])) & u64::from(DARK) != 0)
    }
}

/// The cells north-east, south-east, south-west and north-west of a corner, which has the coordinates of the second.
fn cells_around([x, y]: [usize; 2]) -> [[usize; 2]; 4] {
    [[x, y - 1], [x, y], [x - 1, y], [x - 1, y - 1]]
}

struct Tracer<'a> {
    picture: &'a Picture,
    levels: &'a Levels,
    longest: usize,
    points: Vec<[f32; 2]>,
}

impl Tracer<'_> {
    /// Follows the contour whose first crack is the left side of the dark cell (x, y) of the framed map.
    fn follow(&mut self, map: &mut DarkMap, x: usize, y: usize) -> Contour {
        const SOUTH: usize = 1;
        self.points.clear();
        let stride = map.stride;
        let index = |[x, y]: [usize; 2]| y * stride + x;
        let start = [x, y];
        // Directions: east, south, west, north.
        let (mut corner, mut direction) = (start, SOUTH);
        let (mut length, mut step, mut clipped) = (0usize, 0.0f32, false);
        loop {
            let [x, y] = corner;
            let around = cells_around(corner);
            let (dark, light) = (around[direction], around[(direction + 1) % 4]);
            if direction == SOUTH {
                map.cells[index(dark)] |= SEEN;
            }
            length += 1;
            if length <= self.longest {
                match self.crossing(dark, light) {
                    Some((point, rise)) => {
                        self.points.push(point);
                        step += rise;
                    }
                    None => clipped = true,
                }
            }
            corner = match direction {
                0 => [x + 1, y],
                1 => [x, y + 1],
                2 => [x - 1, y],
                _ => [x, y - 1],
            };
            let ahead = cells_around(corner);
            let is_dark = |k: usize| map.cells[index(ahead[k % 4])] & DARK != 0;
            if is_dark(direction + 1) {
                direction = (direction + 1) % 4;
            } else if !is_dark(direction) {
                direction = (direction + 3) % 4;
            }
            if corner == start && direction == SOUTH {
                break;
            }
        }
        self.contour(length, step, clipped)
    }

    /// Sub-pixel point between a dark and a light cell and the rise of counts across; `None` at the frame.
    fn crossing(&self, dark: [usize; 2], light: [usize; 2]) -> Option<([f32; 2], f32)> {
        let ([dx, dy], [lx, ly]) = (dark, light);
        if lx == 0 || ly == 0 || lx > self.picture.width || ly > self.picture.height {
            return None;
        }
        let below = self.picture.at(dx - 1, dy - 1);
        let above = self.picture.at(lx - 1, ly - 1);
        let (fx, fy) = ((dx - 1) as f32, (dy - 1) as f32);
        let rise = above - below;
        let t = ((self.levels.threshold_at(fx, fy) - below) / rise).clamp(0.0, 1.0);
        let t = if t.is_finite() { t } else { 0.5 };
        Some(([fx + t * (lx as f32 - dx as f32), fy + t * (ly as f32 - dy as f32)], rise))
    }

    fn contour(&self, length: usize, step: f32, clipped: bool) -> Contour {
        let mut twice = 0.0f64;
        let (mut low, mut high) = ([f32::MAX; 2], [f32::MIN; 2]);
        if let Some(origin) = self.points.first().copied() {
            let mut last = self.points[self.points.len() - 1];
            for &p in &self.points {
                twice +=
                    f64::from((last[0] - origin[0]) * (p[1] - origin[1]) - (p[0] - origin[0]) * (last[1] - origin[1]));
                last = p;
                for k in 0..2 {
                    low[k] = low[k].min(p[k]);
                    high[k] = high[k].max(p[k]);
                }
            }
        }
        Contour {
            encloses: if twice < 0.0 { Encloses::Dark } else { Encloses::Light },
            area: twice.abs() / 2.0,
            points: self.points.clone(),
            step: step / self.points.len().max(1) as f32,
            clipped,
            too_long: length > self.longest,
            middle: [0, 1].map(|k| 0.5 * f64::from(low[k] + high[k])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(rows: &[&str]) -> Picture {
        let pixels = rows.iter().flat_map(|r| r.bytes().map(|b| if b == b'#' { 20.0 } else { 200.0 })).collect();
        Picture { width: rows[0].len(), height: rows.len(), pixels, full_scale: 255.0 }
    }

    #[test]
    fn a_ring_has_a_dark_and_a_light_contour_and_corners_connect() {
        let p =
            picture(&["........", "..###...", ".#...#..", ".#...#..", ".#...#..", "..###...", "........", "........"]);
        let levels = Levels::of(&p, 8.0, 0.5);
        let found = contours(&p, &levels, 4, 100);
        assert_eq!(found.len(), 2);
        let outer = found.iter().find(|c| c.encloses == Encloses::Dark).unwrap();
        let inner = found.iter().find(|c| c.encloses == Encloses::Light).unwrap();
        assert_eq!((outer.points.len(), inner.points.len()), (20, 12));
        assert!(outer.area > inner.area && !outer.clipped);
        assert_eq!(outer.middle, [3.0, 3.0]);
    }

    #[test]
    fn a_contour_at_the_border_is_clipped() {
        let p =
            picture(&["##......", "##......", "........", "........", "........", "........", "........", "........"]);
        let found = contours(&p, &Levels::of(&p, 8.0, 0.5), 2, 100);
        assert_eq!(found.len(), 1);
        assert!(found[0].clipped);
    }
}
