//! Where the squares of a chessboard end sharply in view, and the places on the board that those ends leave.
//!
//! A hand, a sheet or glare hides squares, and what it leaves looks as if the board ended there. A board ends along one of its lines: over
//! the width of a few pixels, beside all squares of the line, and with squares of full contrast before it.

use super::labels::{Labelling, Shader, parity};
use super::seen::{Beyond, Range, SQUARES, even_cells, followed, trimmed};
use crate::detect::corners::lattice::{BoardSize, Placement};

/// How far from the end of the squares they are looked at, px ...
const BESIDE_PX: f64 = 2.5;
/// ... and in squares.
const BESIDE: [f64; 2] = [0.12, 0.25];
/// Two neighbours with less of the usual contrast are not seen.
const SEEN: f64 = 0.25;
/// Contrast that is left beyond a sharp end, over that before it.
const LEFT: f64 = 0.3;
/// Contrast just before a sharp end over that further inside; light that hides squares fades them.
const UNFADED: f64 = 0.7;
/// Contrast of the next line, in the other order, over that before it.
const NEXT: f64 = 0.5;
/// Pairs of neighbours that must end sharply ...
const LEAST_PAIRS: usize = 3;
/// ... and how many times as many as do not.
const MOST: usize = 2;

/// The squares that are seen for certain.
#[derive(Debug, Clone, Copy)]
pub struct Ends {
    range: Range,
    /// Whether the board ends there.
    sharp: [[bool; 2]; 2],
    /// Whether cells with an even sum are light.
    even_light: bool,
}

impl Ends {
    /// `None` where the lattice does not have the colours of a board.
    pub fn of(shader: &Shader) -> Option<Self> {
        let range = trimmed(shader.lattice())?;
        let even = even_cells(shader, range).filter(|mean| mean.abs() >= SQUARES)?;
        let even_light = even > 0.0;
        let (range, sharp) = followed(range, |range, axis, end| side(shader, even_light, range, axis, end));
        Some(Self { range, sharp, even_light })
    }

    /// The place of the squares on the board, if there is one only.
    pub fn place(&self, board: BoardSize) -> Option<Labelling> {
        let all: Vec<Placement> = Placement::around(board, self.range).filter(|p| self.allow(*p)).collect();
        let upright = all.iter().min_by_key(|p| p.tilt())?;
        let one = all.iter().all(|p| p.range() == upright.range());
        one.then_some(if all.len() == 1 { Labelling::Unique(*upright) } else { Labelling::Symmetric(*upright) })
    }

    /// Whether squares are seen beyond the outer ones of a placement: then the board is a larger one.
    pub fn exceed(&self, placement: Placement) -> bool {
        let range = placement.range();
        (0..2).any(|axis| self.range[axis][0] < range[axis][0] || self.range[axis][1] > range[axis][1])
    }

    /// Whether the squares are the only ones of the board that a placement says, whatever hides the others.
    pub fn leave_only(&self, board: BoardSize, placement: Placement) -> bool {
        let mut all = Placement::around(board, self.range).filter(|p| self.allow(*p)).map(Placement::range).peekable();
        all.peek().is_some() && all.all(|range| range == placement.range())
    }

    /// Whether a placement has the colours that are seen, and does not go on beyond an end.
    fn allow(&self, placement: Placement) -> bool {
        let range = placement.range();
        let within = |axis: usize, end: usize| !self.sharp[axis][end] || range[axis][end] == self.range[axis][end];
        let even_cell = (0, 0);
        placement.is_dark(even_cell) != self.even_light
            && [0, 1].into_iter().all(|axis| within(axis, 0) && within(axis, 1))
    }
}

/// What is seen along one side of the last squares.
fn side(shader: &Shader, even_light: bool, range: &Range, axis: usize, end: usize) -> Beyond {
    let ([low, high], [first, last]) = (range[1 - axis], range[axis]);
    let at = if end == 0 { first - 1 } else { last };
    let cell = |across: i32| if axis == 0 { (at, across) } else { (across, at) };
    let light = |(u, v): (i32, i32)| (parity(u, v) > 0.0) == even_light;
    let usual = shader.contrast();
    let (mut sharp, mut next, mut seen) = (0, 0, 0);
    for across in low - 1..high {
        let (one, two) = (cell(across), cell(across + 1));
        let Some(beside) = shader.side_px(one, axis).map(|px| (BESIDE_PX / px).clamp(BESIDE[0], BESIDE[1])) else {
            continue;
        };
        // Of the light neighbour over the dark one, so far outside the end of the squares.
        let contrast = |outside: f64| {
            let along = if end == 0 { -outside } else { 1.0 + outside };
            let place = if axis == 0 { [along, 0.5] } else { [0.5, along] };
            let step = shader.brightness(one, place)? - shader.brightness(two, place)?;
            Some(if light(one) { step } else { -step })
        };
        let (Some(deep), Some(inside), Some(outside)) = (contrast(-3.0 * beside), contrast(-beside), contrast(beside))
        else {
            continue;
        };
        if deep.min(inside) < SEEN * usual {
            continue;
        }
        seen += 1;
        sharp += usize::from(outside.abs() < LEFT * inside && inside > UNFADED * deep);
        next += usize::from(outside < -NEXT * inside);
    }
    if sharp >= LEAST_PAIRS && sharp >= MOST * (seen - sharp) {
        Beyond::Nothing
    } else if next >= LEAST_PAIRS && next >= MOST * (seen - next) {
        Beyond::Squares
    } else {
        Beyond::Unclear
    }
}
