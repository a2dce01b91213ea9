//! Dots of a grid that no contour showed, as those cut by the border of the picture: are they of another size?

use super::dots::Dot;
use super::place::Laid;
use crate::detect::Picture;
use crate::detect::circles::candidates::candidate::Candidate;
use crate::detect::circles::identity::lattice::{Cell, Lattice, Site};
use crate::detect::circles::identity::neighbour_check::{Board, Placed, neighbourhood};
use crate::linalg::median;

/// Rays from the middle of a dot; how many of them must end in the picture, and how far they go, in usual radii.
const RAYS: usize = 24;
const LEAST_RAYS: usize = 8;
const FARTHEST: f64 = 4.0;
/// Step along a ray, in usual radii.
const STEP: f64 = 0.05;
/// Up to here a dot is dark on every ray.
const WITHIN: f64 = 0.5;

/// The dots in the cells of the grid that the lattice lacks, by cell of the lattice, where their size can be told.
pub(super) fn missing_dots(
    picture: &Picture,
    lattice: &Lattice,
    candidates: &[Candidate],
    (laid, cells): (&Laid, &[Cell]),
    usual: &Dot,
) -> Vec<(Cell, Dot)> {
    let placed = |(cell, site): (&Cell, &Site)| (*cell, Placed { candidate: site.candidate, class: None });
    let board: Board = lattice.cells.iter().map(placed).collect();
    // Light may change over the board: the dots around tell it.
    let level = |cell: Cell, pick: fn(&Candidate) -> f32| {
        let is_near = |c: &Cell| (c.0 - cell.0).abs().max((c.1 - cell.1).abs()) <= 1;
        let near = lattice.cells.iter().filter(|(c, _)| is_near(c));
        median(near.map(|(_, site)| f64::from(pick(&candidates[site.candidate]))))
    };
    let dot = |cell: Cell| {
        let threshold = 0.5 * (level(cell, |c| c.paper)? + level(cell, |c| c.ink)?);
        let usual_image = neighbourhood(&board, cell, candidates)?.0.ellipse(usual.radius)?;
        let along = |k: usize| {
            let angle = k as f64 * std::f64::consts::TAU / RAYS as f64;
            edge(|relative| at(picture, usual_image.point(angle, relative)), threshold as f32)
        };
        let edges: Vec<f64> = (0..RAYS).filter_map(along).collect();
        let middle = median(&edges).filter(|_| edges.len() >= LEAST_RAYS)?;
        Some((cell, Dot { radius: usual.radius * middle, ratio: 0.0 }))
    };
    unseen(lattice, laid, cells).into_iter().filter_map(dot).collect()
}

/// Cells of the lattice that lie on the grid and have no dot.
fn unseen(lattice: &Lattice, laid: &Laid, cells: &[Cell]) -> Vec<Cell> {
    let range = |pick: fn(&Cell) -> i32| {
        let all = lattice.cells.keys().map(pick);
        all.clone().min().unwrap_or(0) - 1..=all.max().unwrap_or(0) + 1
    };
    let (columns, rows) = (range(|c| c.0), range(|c| c.1));
    let all = columns.flat_map(|i| rows.clone().map(move |j| (i, j)));
    all.filter(|c| !lattice.cells.contains_key(c) && cells.contains(&laid.apply(*c))).collect()
}

/// Where a ray passes from dark to light, in usual radii; `None` where it starts in the light or leaves the picture.
fn edge(value: impl Fn(f64) -> Option<f32>, threshold: f32) -> Option<f64> {
    let mut relative = 0.0;
    while relative < FARTHEST {
        if value(relative)? > threshold {
            return (relative > WITHIN).then_some(relative);
        }
        relative += STEP;
    }
    None
}

fn at(picture: &Picture, [u, v]: [f64; 2]) -> Option<f32> {
    let (x, y) = (u.round(), v.round());
    let inside = x >= 0.0 && y >= 0.0 && x < picture.width as f64 && y < picture.height as f64;
    inside.then(|| picture.at(x as usize, y as usize))
}
