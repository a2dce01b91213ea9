//! Markers of a ChArUco board, read in the cells of a lattice of corners, each by the map of its own corners, or of its neighbourhood where it lacks one.

use super::charuco_markers::Print;
use super::labels::Shader;
use crate::detect::Picture;
use crate::detect::corners::lattice::Lattice;
use crate::detect::tags::code::Reader;
use crate::geom::PlaneMap;

/// Reads the markers of a print in the cells of a lattice.
pub(super) struct Cells<'a> {
    picture: &'a Picture,
    lattice: &'a Lattice,
    shader: Shader<'a>,
    reader: Reader,
    /// Where in a cell a marker begins and ends.
    ends: [f64; 2],
}

/// What a cell says.
pub(super) struct CellReading {
    pub id: u32,
    /// Quarter turns of the marker on the lattice.
    pub turns: u8,
    /// Bits that were read otherwise.
    pub wrong_bits: u8,
}

impl<'a> Cells<'a> {
    pub fn of(picture: &'a Picture, lattice: &'a Lattice, print: &Print) -> Option<Self> {
        let ends = [0.5 * (1.0 - print.ratio), 0.5 * (1.0 + print.ratio)];
        Some(Self {
            picture,
            lattice,
            shader: Shader::of(picture, lattice)?,
            reader: Reader::of_opencv(&print.dictionary),
            ends,
        })
    }

    /// The marker in the cell whose least corner is this one.
    pub fn read(&self, cell: (i32, i32)) -> Option<CellReading> {
        let [low, high] = self.ends;
        let [a, b, c, d] = [[low, low], [high, low], [high, high], [low, high]].map(|at| self.place(cell, at));
        let quad = [a?, b?, c?, d?];
        let reading = self.reader.read(self.picture, &quad, false)?;
        let [.., top_left] = reading.corners;
        let turns = (0..4).zip(quad).find_map(|(turns, corner)| (corner == top_left).then_some(turns))?;
        Some(CellReading { id: reading.id, turns, wrong_bits: u8::try_from(reading.wrong).ok()? })
    }

    /// Where a place in the frame of a cell lies, px.
    fn place(&self, (u, v): (i32, i32), [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let corner = |[i, j]: [i32; 2]| Some(([f64::from(i), f64::from(j)], *self.lattice.get(&(u + i, v + j))?));
        let own: Vec<_> = [[0, 0], [1, 0], [1, 1], [0, 1]].into_iter().filter_map(corner).collect();
        if own.len() == 4 { PlaneMap::fit(&own)?.apply([x, y]) } else { self.shader.place((u, v), [x, y]) }
    }
}
