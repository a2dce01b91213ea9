//! Edges between the dark and the light modules within a tag, whose number is known.

use std::ops::Range;

use super::beside::Printed;
use super::edge_line::{Beside, EdgeLine, Side};
use crate::detect::Picture;
use crate::geom::PlaneMap;

/// Modules beside an edge that are looked at: those beyond are too far away.
const DEEP: i64 = 2;

/// Modules in a line that have light on one side and ink on the other.
#[derive(Debug, Clone, PartialEq)]
pub struct CodeEdge {
    /// Axis that the edge lies across: 0 to the right, 1 down.
    pub axis: usize,
    /// 1 where the light is beyond the edge along the axis, -1 where it is before.
    pub to_light: f64,
    /// Modules before it along the axis, and which ones of the other axis it runs along.
    line: i64,
    along: Range<i64>,
}

/// All edges within a tag.
pub fn code_edges(tag: &Printed) -> Vec<CodeEdge> {
    let n = tag.reader.side() as i64;
    let mut edges: Vec<CodeEdge> = Vec::new();
    for (axis, line) in (0..2).flat_map(|axis| (1..n).map(move |line| (axis, line))) {
        for at in 0..n {
            let to_light = match [line - 1, line].map(|depth| is_light(tag, axis, depth, at)) {
                [false, true] => 1.0,
                [true, false] => -1.0,
                _ => continue,
            };
            match edges.last_mut() {
                Some(e) if e.axis == axis && e.line == line && e.along.end == at && e.to_light == to_light => {
                    e.along.end += 1;
                }
                _ => edges.push(CodeEdge { axis, to_light, line, along: at..at + 1 }),
            }
        }
    }
    edges
}

/// Whether a module is light, so many along the axis and the other one; around the tag is paper.
fn is_light(tag: &Printed, axis: usize, depth: i64, at: i64) -> bool {
    let (n, border) = (tag.reader.side() as i64, tag.reader.border() as i64);
    let [row, column] = if axis == 0 { [at, depth] } else { [depth, at] };
    let within = |range: Range<i64>| range.contains(&row) && range.contains(&column);
    let of_code = || tag.reader.is_light(tag.id, (row - border) as usize, (column - border) as usize);
    !within(0..n) || within(border..n - border) && of_code()
}

/// Modules, to the right and down.
fn place(axis: usize, depth: f64, at: f64) -> [f64; 2] {
    if axis == 0 { [depth, at] } else { [at, depth] }
}

impl CodeEdge {
    /// Its middle, modules to the right and down.
    pub fn middle(&self) -> [f64; 2] {
        place(self.axis, self.line as f64, 0.5 * (self.along.start + self.along.end) as f64)
    }

    /// Measures it; `map` leads from modules to the picture, and `off` says how far to the light of there a place of it is looked for, px.
    /// `None` where it is too short, or no edge.
    pub fn fit(
        &self,
        picture: &Picture,
        map: &PlaneMap,
        tag: &Printed,
        off: impl Fn([f64; 2]) -> f64,
    ) -> Option<EdgeLine> {
        let frame = Frame::of(self, map)?;
        let [from, to] = [(frame.from, frame.ends[0]), (frame.to, frame.ends[1])].map(|(p, end)| {
            let [x, y] = frame.along;
            [p[0] + y * off(end), p[1] - x * off(end)]
        });
        let [ink_px, paper_px] = [false, true].map(|light| frame.module_px * self.depth(tag, light) as f64);
        let side = Side { from, to, ink_px, paper_px, sharpness: [0.0; 2] };
        EdgeLine::fit(picture, &side, || self.beside(tag, map, &frame)).ok()
    }

    /// The module so many lines from the edge, 0 being next to it, on its light or on its dark side.
    fn beyond(&self, light: bool, lines: i64) -> i64 {
        if light == (self.to_light > 0.0) { self.line + lines } else { self.line - 1 - lines }
    }

    /// Lines of modules that are all light, or dark, from the edge on.
    fn depth(&self, tag: &Printed, light: bool) -> i64 {
        let alike = |lines: &i64| {
            let depth = self.beyond(light, *lines);
            self.along.clone().all(|at| is_light(tag, self.axis, depth, at) == light)
        };
        (0..DEEP).take_while(alike).count() as i64
    }

    /// Light modules on its dark side, and dark ones on its light side.
    fn beside(&self, tag: &Printed, map: &PlaneMap, frame: &Frame) -> Vec<Beside> {
        let around = self.along.start - DEEP..self.along.end + DEEP;
        let modules = [false, true].into_iter().flat_map(|light| (0..=DEEP).map(move |lines| (light, lines)));
        let modules = modules.flat_map(|(light, lines)| around.clone().map(move |at| (light, lines, at)));
        let other = |(light, lines, at): (bool, i64, i64)| {
            let depth = self.beyond(light, lines);
            if is_light(tag, self.axis, depth, at) == light {
                return None;
            }
            let (depth, at) = (depth as f64, at as f64);
            let seen = |depth: f64, at: f64| Some(frame.seen(map.apply(place(self.axis, depth, at))?));
            let along_px = sorted([seen(depth + 0.5, at)?[0], seen(depth + 0.5, at + 1.0)?[0]]);
            let depth_px = sorted([seen(depth, at + 0.5)?[1], seen(depth + 1.0, at + 0.5)?[1]]);
            Some(Beside { along_px, depth_px, step: if light { -1.0 } else { 1.0 } })
        };
        modules.filter_map(other).collect()
    }
}

fn sorted([a, b]: [f64; 2]) -> [f64; 2] {
    [a.min(b), a.max(b)]
}

/// An edge in the picture, its light to the left on the way.
struct Frame {
    from: [f64; 2],
    to: [f64; 2],
    /// The same in modules.
    ends: [[f64; 2]; 2],
    /// Unit vector of the way.
    along: [f64; 2],
    /// Width of a module across it.
    module_px: f64,
}

impl Frame {
    fn of(edge: &CodeEdge, map: &PlaneMap) -> Option<Self> {
        let line = edge.line as f64;
        let ends = [edge.along.start, edge.along.end].map(|at| place(edge.axis, line, at as f64));
        let turned = (edge.axis == 0) != (edge.to_light > 0.0);
        let ends = if turned { [ends[1], ends[0]] } else { ends };
        let (from, to) = (map.apply(ends[0])?, map.apply(ends[1])?);
        let way = [to[0] - from[0], to[1] - from[1]];
        let length = way[0].hypot(way[1]);
        let mut frame = Self { from, to, ends, along: way.map(|v| v / length), module_px: 0.0 };
        let middle = edge.middle();
        let next = |by: f64| {
            let mut next = middle;
            next[edge.axis] += by;
            Some(frame.seen(map.apply(next)?)[1])
        };
        frame.module_px = 0.5 * (next(1.0)? - next(-1.0)?).abs();
        Some(frame)
    }

    /// Along the edge from its middle, and towards its ink, px.
    fn seen(&self, p: [f64; 2]) -> [f64; 2] {
        let ([x, y], d) = (self.along, [0, 1].map(|a| p[a] - 0.5 * (self.from[a] + self.to[a])));
        [d[0] * x + d[1] * y, d[1] * x - d[0] * y]
    }
}
