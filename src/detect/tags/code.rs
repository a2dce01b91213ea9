//! Reading the code of a square tag.

use calib_targets_aruco::Dictionary;

use super::quads::Quad;
use crate::detect::Picture;
use crate::geom::PlaneMap;
use crate::linalg::median_by;
use crate::series::{TagPrint, Tags};

/// Share of the modules of the border that must be dark.
const LEAST_BORDER: f64 = 0.9;
/// One module in so many may be read wrongly.
const ONE_WRONG_IN: usize = 16;
/// The next best reading must differ in at least this many modules more.
const MARGIN: u32 = 2;
/// A square all of whose places within its border are darker than this share of the way from ink to paper has no code, by so many places along
/// a side.
const DARK: f32 = 0.25;
const PLACES: usize = 12;
/// From where on within a square it is looked at, as a share of it: about where the narrowest borders end.
const NARROWEST: f64 = 0.13;
/// A reading counts alone when fewer than one in two to the power of this is one by chance.
pub const SURE_BITS: f64 = 18.0;
/// Contrast of light and dark modules, as a part of the light.
const LEAST_CONTRAST: f32 = 0.15;

/// What a quadrilateral says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Number of the tag in its dictionary.
    pub id: u32,
    /// Its corners, counter-clockwise from the bottom-left as printed.
    pub corners: Quad,
    /// So many modules are wrong.
    pub wrong: u32,
}

/// The codes of a dictionary, as they are printed.
pub struct Reader {
    bits: usize,
    border: usize,
    codes: Vec<u64>,
    /// The least and the greatest number of dark modules of a code.
    dark: [u32; 2],
}

impl Reader {
    pub fn of(tags: &Tags, dictionary: &Dictionary) -> Self {
        let (bits, border) = (dictionary.marker_size(), tags.print.border());
        let code = |id: u32| {
            let modules = tags.modules(dictionary, id);
            let inner = modules[border..border + bits].iter().flat_map(|line| &line[border..border + bits]);
            inner.enumerate().fold(0u64, |code, (k, dark)| code | u64::from(*dark) << k)
        };
        let codes: Vec<u64> = (0..dictionary.codes().len() as u32).map(code).collect();
        let counts = || codes.iter().map(|code| code.count_ones());
        let dark = [counts().min().unwrap_or(0), counts().max().unwrap_or(0)];
        Self { bits, border, codes, dark }
    }

    /// Of markers as OpenCV prints them.
    pub fn of_opencv(dictionary: &Dictionary) -> Self {
        let name = dictionary.name().to_owned();
        let tags = Tags { dictionary: name, print: TagPrint::Opencv, side_m: 1.0, gap_m: 0.0, first_id: 0 };
        Self::of(&tags, dictionary)
    }

    /// Modules along a side, with the border.
    pub fn side(&self) -> usize {
        self.bits + 2 * self.border
    }

    /// Width of the border, modules.
    pub fn border(&self) -> usize {
        self.border
    }

    /// Whether a module of the code of a tag is light, by row and column from the top-left as printed.
    pub fn is_light(&self, id: u32, row: usize, column: usize) -> bool {
        self.codes.get(id as usize).is_some_and(|code| code >> (row * self.bits + column) & 1 == 0)
    }

    fn wrong_allowed(&self) -> u32 {
        (self.bits * self.bits / ONE_WRONG_IN) as u32
    }

    /// Bits by which a reading as one of so many tags, with so many modules wrong, exceeds chance.
    pub fn bits_beyond_chance(&self, wrong: u32, among: usize) -> f64 {
        let n = (self.bits * self.bits) as f64;
        let ways: f64 = (0..wrong).map(|k| ((n - f64::from(k)) / f64::from(k + 1)).log2()).sum();
        n - ways - (4.0 * among as f64).log2()
    }

    /// A reading as one of so many tags, with so many modules wrong, is no chance.
    pub fn is_sure(&self, wrong: u32, among: usize) -> bool {
        self.bits_beyond_chance(wrong, among) >= SURE_BITS
    }

    /// Number of tags in the dictionary.
    pub fn count(&self) -> usize {
        self.codes.len()
    }

    /// Reads a quadrilateral; `None` where it is no tag of the dictionary. `mirrored` reads it as in a mirror.
    pub fn read(&self, picture: &Picture, quad: &Quad, mirrored: bool) -> Option<Reading> {
        let modules = self.modules(picture, quad)?;
        if !self.may_be_code(&modules) {
            return None;
        }
        let mut best: Option<(u32, u32, usize)> = None;
        let mut second = u32::MAX;
        for turn in 0..4 {
            let seen = self.code(&modules, turn, mirrored);
            for (id, code) in (0..).zip(&self.codes) {
                let wrong = (seen ^ code).count_ones();
                if best.is_none_or(|(least, ..)| wrong < least) {
                    second = best.map_or(u32::MAX, |(least, ..)| least);
                    best = Some((wrong, id, turn));
                } else {
                    second = second.min(wrong);
                }
            }
        }
        let (wrong, id, turn) = best?;
        let good = wrong <= self.wrong_allowed() && second >= wrong + MARGIN;
        good.then(|| Reading { id, corners: as_printed(quad, turn), wrong })
    }

    /// Whether a code with so many dark modules is there: a dark square has none.
    fn may_be_code(&self, modules: &[Vec<bool>]) -> bool {
        let dark = modules.iter().flatten().filter(|dark| **dark).count() as u32;
        let ([least, most], wrong) = (self.dark, self.wrong_allowed());
        dark + wrong >= least && dark <= most + wrong
    }

    /// Whether a tag stands where its corners (as printed) are predicted; one module in eight may be wrong.
    pub fn confirms(&self, picture: &Picture, id: u32, corners: &Quad) -> bool {
        let [bottom_left, bottom_right, top_right, top_left] = *corners;
        let quad = [top_left, top_right, bottom_right, bottom_left];
        let Some(modules) = self.modules(picture, &quad) else { return false };
        let wrong = self.codes.get(id as usize).map(|code| (self.code(&modules, 0, false) ^ code).count_ones());
        wrong.is_some_and(|wrong| wrong <= 2 * self.wrong_allowed())
    }

    /// Dark modules within the border, from the first corner of the quadrilateral; `None` where the border is not dark.
    fn modules(&self, picture: &Picture, quad: &Quad) -> Option<Vec<Vec<bool>>> {
        let side = self.side();
        let n = side as f64;
        let unit = [[0.0, 0.0], [n, 0.0], [n, n], [0.0, n]];
        let map = PlaneMap::fit(&unit.into_iter().zip(*quad).collect::<Vec<_>>())?;
        let value = |x: f64, y: f64| sample(picture, map.apply([x, y])?);
        let module = |column: usize, row: usize| {
            let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
            let places = [(0.0, 0.0), (-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2)];
            let mut sum = 0.0;
            for (dx, dy) in places {
                sum += value(x + dx, y + dy)?;
            }
            Some(sum / places.len() as f32)
        };
        let all: Vec<Vec<f32>> =
            (0..side).map(|row| (0..side).map(|column| module(column, row)).collect()).collect::<Option<_>>()?;
        let within = self.border..self.border + self.bits;
        let on_border = |row: usize, column: usize| !within.contains(&row) || !within.contains(&column);
        let cells = || (0..side).flat_map(|row| (0..side).map(move |column| (row, column)));
        let dark = median_by(cells().filter(|(r, c)| on_border(*r, *c)).map(|(r, c)| all[r][c]), f32::total_cmp)?;
        let beside = (1..side).flat_map(|k| {
            let k = k as f64;
            [(k, -0.7), (k, n + 0.7), (-0.7, k), (n + 0.7, k)]
        });
        let light = median_by(beside.filter_map(|(x, y)| value(x, y)), f32::total_cmp)?;
        if light - dark < LEAST_CONTRAST * light.abs() {
            return None;
        }
        let threshold = 0.5 * (dark + light);
        let border = cells().filter(|(r, c)| on_border(*r, *c));
        let (good, count) = border.fold((0, 0), |(g, n), (r, c)| (g + u32::from(all[r][c] < threshold), n + 1));
        let enough = f64::from(good) >= LEAST_BORDER * f64::from(count);
        let inner = |row: usize| within.clone().map(|column| all[row][column] < threshold).collect();
        enough.then(|| within.clone().map(inner).collect())
    }

    /// The code when the modules are turned so many quarters.
    fn code(&self, modules: &[Vec<bool>], turn: usize, mirrored: bool) -> u64 {
        let last = self.bits - 1;
        let at = |row: usize, column: usize| {
            let column = if mirrored { last - column } else { column };
            let (r, c) = match turn {
                0 => (row, column),
                1 => (column, last - row),
                2 => (last - row, last - column),
                _ => (last - column, row),
            };
            modules[r][c]
        };
        let cells = (0..self.bits).flat_map(|row| (0..self.bits).map(move |column| (row, column)));
        cells.enumerate().fold(0, |code, (k, (row, column))| code | u64::from(at(row, column)) << k)
    }
}

/// Whether a quadrilateral is one dark square, as those of boards and cloths are: no code of any dictionary is there.
pub fn is_dark_square(picture: &Picture, quad: &Quad) -> bool {
    let unit = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let Some(map) = PlaneMap::fit(&unit.into_iter().zip(*quad).collect::<Vec<_>>()) else { return false };
    let value = |x: f64, y: f64| sample(picture, map.apply([x, y])?);
    let along = |k: usize| NARROWEST + (1.0 - 2.0 * NARROWEST) * k as f64 / (PLACES - 1) as f64;
    let within = (0..PLACES * PLACES).filter_map(|k| value(along(k % PLACES), along(k / PLACES)));
    let [darkest, lightest] = within.fold([f32::MAX, f32::MIN], |[low, high], v| [low.min(v), high.max(v)]);
    let beside = (0..PLACES).map(along).flat_map(|k| [(k, -0.1), (k, 1.1), (-0.1, k), (1.1, k)]);
    let paper = median_by(beside.filter_map(|(x, y)| value(x, y)), f32::total_cmp);
    paper.is_some_and(|paper| lightest - darkest < DARK * (paper - darkest))
}

/// Corners counter-clockwise from the bottom-left of the print, whose top-left is corner `turn` of the quadrilateral.
fn as_printed(quad: &Quad, turn: usize) -> Quad {
    let corner = |k: usize| quad[(turn + k) % 4];
    [corner(3), corner(2), corner(1), corner(0)]
}

/// Bilinear; `None` outside the picture.
fn sample(picture: &Picture, [u, v]: [f64; 2]) -> Option<f32> {
    let inside = u >= 0.0 && v >= 0.0 && u < picture.width as f64 - 1.0 && v < picture.height as f64 - 1.0;
    inside.then(|| {
        let (x, y) = (u as usize, v as usize);
        let (fx, fy) = ((u - x as f64) as f32, (v - y as f64) as f32);
        let row = |y: usize| picture.at(x, y) * (1.0 - fx) + picture.at(x + 1, y) * fx;
        row(y) * (1.0 - fy) + row(y + 1) * fy
    })
}
