//! What lies beside the sides of a tag, once it is decoded: the light modules of its code within, and the next tags.

use super::code::Reader;
use super::edge_line::Beside;
use super::quads::Quad;
use crate::geom::PlaneMap;

/// Lines of modules of the code that shine through the border: those beyond are too far away.
const LINES: usize = 2;

/// A tag in its grid.
pub struct Printed<'a> {
    pub reader: &'a Reader,
    pub id: u32,
    /// Gap to the next tags, modules.
    pub gap: f64,
    /// Whether there is another tag beyond the bottom, right, top and left.
    pub next: [bool; 4],
}

impl Printed<'_> {
    /// What lies beside side `k` (bottom, right, top, left as printed) of a tag with these corners (counter-clockwise from the bottom-left).
    pub fn beside(&self, corners: &Quad, k: usize) -> Vec<Beside> {
        let n = self.reader.side() as f64;
        let frame = Frame { printed: self, corners, side: k, n };
        let Some(map) = frame.map() else { return Vec::new() };
        let place = |along: f64, depth: f64| frame.place(&map, along, depth);
        // A rectangle in modules along the side and into the tag.
        let rectangle = |[from, to]: [f64; 2], [near, far]: [f64; 2], step: f64| {
            let (middle, depth) = (0.5 * (from + to), 0.5 * (near + far));
            let along = [place(from, depth)?[0], place(to, depth)?[0]];
            let depth_px = [place(middle, near)?[1], place(middle, far)?[1]];
            Some(Beside { along_px: along, depth_px, step })
        };
        let next = self.next[k].then(|| rectangle([0.0, n], [-self.gap - n, -self.gap], -1.0)).flatten();
        let light = self.light_runs(k).into_iter();
        let light = light.filter_map(|(line, [from, to])| {
            rectangle([from as f64, to as f64], [line as f64, line as f64 + 1.0], 1.0)
        });
        light.chain(next).collect()
    }

    /// Light modules that hang together, in the lines of the code nearest to a side: number of the line into the tag, first and last along it.
    fn light_runs(&self, k: usize) -> Vec<(usize, [usize; 2])> {
        let (n, border) = (self.reader.side(), self.reader.border());
        let within = border..n - border;
        let light = |along: usize, line: usize| {
            let [column, row] = turned(k, n - 1, along, line);
            self.reader.is_light(self.id, row - border, column - border)
        };
        let mut runs: Vec<(usize, [usize; 2])> = Vec::new();
        for line in within.clone().take(LINES) {
            for along in within.clone().filter(|along| light(*along, line)) {
                match runs.last_mut() {
                    Some((last, [_, end])) if *last == line && *end == along => *end += 1,
                    _ => runs.push((line, [along, along + 1])),
                }
            }
        }
        runs
    }
}

/// Column and row (from the top-left as printed) of a place along a side and into the tag, in a square from 0 to `last`.
fn turned<T: Copy + std::ops::Sub<Output = T>>(k: usize, last: T, along: T, depth: T) -> [T; 2] {
    match k {
        0 => [last - along, last - depth],
        1 => [last - depth, along],
        2 => [along, depth],
        _ => [depth, last - along],
    }
}

/// A side in the picture, from its second corner to its first: there the light lies to the left.
struct Frame<'a> {
    printed: &'a Printed<'a>,
    corners: &'a Quad,
    side: usize,
    n: f64,
}

impl Frame<'_> {
    /// From modules, rows downwards, to the picture.
    fn map(&self) -> Option<PlaneMap> {
        let n = self.printed.reader.side() as f64;
        let unit = [[0.0, n], [n, n], [n, 0.0], [0.0, 0.0]];
        PlaneMap::fit(&unit.into_iter().zip(*self.corners).collect::<Vec<_>>())
    }

    /// Along the side from its middle, and into the tag, px, of a place in modules.
    fn place(&self, map: &PlaneMap, along: f64, depth: f64) -> Option<[f64; 2]> {
        let p = map.apply(turned(self.side, self.n, along, depth))?;
        let (from, to) = (self.corners[(self.side + 1) % 4], self.corners[self.side]);
        let d = [to[0] - from[0], to[1] - from[1]];
        let length = d[0].hypot(d[1]);
        let (t, q) = ([d[0] / length, d[1] / length], [0, 1].map(|a| p[a] - 0.5 * (from[a] + to[a])));
        Some([q[0] * t[0] + q[1] * t[1], q[1] * t[0] - q[0] * t[1]])
    }
}
