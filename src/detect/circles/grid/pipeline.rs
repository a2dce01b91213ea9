//! Plain grids of dots: symmetric, asymmetric (every other row shifted by half a step), or with dots of another size that
//! tell the orientation.
//!
//! Such a grid carries no code beyond its outline and the sizes of its dots, so all of it must be in view. The markers
//! lie on a square lattice, along the axes or (asymmetric) along the diagonals; the lattice found in the picture is laid
//! on them in all four rotations, and the one that leaves the fewest cells unexplained wins.
//!
//! Sizes that the plate does not tell are taken from the picture. Where it does not tell which dots are larger either, the plate
//! is turned so that the first of them has the least id: that is the same corner in every picture. What no dot tells is left as the
//! more upright of the turns; so is a plate whose radii are stated and equal.

use std::collections::{BTreeMap, BTreeSet};

use super::dots::{Dot, Dots};
use super::missing::missing_dots;
use super::place::{Classes, Laid, place};
use super::seen::{Extent, Outer, Shape, View, outline};
use crate::detect::circles::candidates::candidate::Candidate;
use crate::detect::circles::identity::code::MarkerCode;
use crate::detect::circles::identity::lattice::{Apart, Cell, Lattice, Site};
use crate::detect::circles::identity::neighbour_check::{Board, Placed};
use crate::detect::circles::measuring::glare::allow_for_glare;
use crate::detect::circles::pipeline::{Cut, Identified, detect_coded};
use crate::detect::circles::smoothed::{LAST_SMOOTHING_PX, SMOOTHINGS_PX, as_before, smoothed};
use crate::detect::circles::types::{CircleDetection, Options, Outcome, Reason};
use crate::detect::size_seen::{Counted, beyond, other_rows, other_size, twin};
use crate::detect::{Detection, Outline, Picture, Sizes};
use crate::error::{Code, Error, Notice, Result};
use crate::linalg::median;
use crate::series::{Marker, Plate};

/// How far a marker may be from its place on the lattice, in steps.
const OFF_LATTICE: f64 = 0.2;
/// Smallest semi-axis of a dot, px: no code is to be read from it, and a whole lattice speaks for it.
const SMALLEST_PX: f64 = 1.5;
/// Lines beyond the lattice at which dots of the plate are looked for.
const FURTHER: i32 = 4;
/// A stated radius and the one seen differ by no more than this, as a logarithm.
const RADIUS_OFF: f64 = 0.4;

/// Finds the dots of a plain grid in one picture.
///
/// Observations are area centroids with covariance, as for coded circles. Ids are those of the plate's markers. Radii of the
/// markers may be zero: then they are those seen.
///
/// # Errors
/// Markers that do not lie on a square lattice. No grid in the picture, not all of it, or a mirrored one where
/// the dots show it (a grid without larger dots is mostly its own mirror image): see [`Detection::failure`].
pub fn detect_grid(picture: &Picture, plate: &Plate, options: &Options) -> Result<Detection> {
    let grid = Grid::of(plate)?;
    let options = &Options { smallest_semi_axis_px: options.smallest_semi_axis_px.min(SMALLEST_PX), ..*options };
    let (mut best, mut facts) = grid.look(picture, options, 0.0)?;
    for sigma_px in SMOOTHINGS_PX.into_iter().chain([LAST_SMOOTHING_PX]) {
        let is_last = sigma_px == LAST_SMOOTHING_PX;
        if !spoilt(&best) || is_last && !best.found.is_empty() {
            break;
        }
        let (found, other) = grid.look(&smoothed(picture, sigma_px), options, sigma_px)?;
        if found.found.len() > best.found.len() {
            best = as_before(found, sigma_px);
            allow_for_glare(&mut best, picture.full_scale, sigma_px);
            facts = other;
        }
    }
    let mut detection = Detection::from(best);
    detection.say(&facts);
    detection.notices.extend(facts.has_twin.then(twin));
    if let Some(circles) = &mut detection.circles {
        circles.sizes = facts.sizes;
    }
    if facts.is_mirror_of_large && detection.failure.as_ref().is_some_and(|f| f.code == Code::PlateMirrored) {
        detection.failure = Some(mirrored_or_large());
    }
    if facts.symmetric {
        detection.notices.push(symmetric_notice());
        detection.notices.extend((!facts.unstated.is_empty()).then(|| unstated_notice(&facts.unstated)));
    }
    Ok(detection)
}

impl Detection {
    /// What is known of the size of the grid.
    fn say(&mut self, facts: &Facts) {
        let is_found = |id: u32| self.observations.iter().any(|o| o.marker == id);
        let ambiguous = self.failure.as_ref().is_some_and(|f| f.code == Code::PlateIncomplete);
        match &facts.other_size {
            Some(error) if ambiguous => {
                (self.outline, self.failure) = (Outline::OtherSize, Some(error.clone()));
                self.other_lines = facts.other_lines;
            }
            None if ambiguous && facts.cut => self.failure = Some(cut_grid()),
            _ => {
                self.outline = outline(&facts.outer, is_found);
                self.size_seen = facts.size.filter(|_| self.outline == Outline::LineMissing);
            }
        }
    }
}

/// Dots are missing, or seen but not measured.
fn spoilt(found: &CircleDetection) -> bool {
    let of_fit = |r: Reason| matches!(r, Reason::EdgeModel | Reason::Saturated | Reason::NoConvergence);
    !matches!(found.outcome, Outcome::Identified { .. }) || found.dropped.iter().any(|d| of_fit(d.reason))
}

/// What is known of a grid beyond its dots.
#[derive(Debug, Clone, Default)]
struct Facts {
    /// It looks the same after a turn.
    symmetric: bool,
    /// Rows and columns of larger dots of a plate whose radii are stated and equal, where they tell how it is turned.
    unstated: Vec<(i32, i32)>,
    sizes: Sizes,
    /// Columns and rows of dots, where all ends are in view.
    size: Option<[u32; 2]>,
    /// Why it is not the grid of the plate.
    other_size: Option<Error>,
    /// Its columns and rows, where its rows are as those of the plate and all ends are in view.
    other_lines: [Option<u32>; 2],
    /// Only its dots of another size say that it is mirrored.
    is_mirror_of_large: bool,
    /// Not all of them end in view.
    cut: bool,
    /// The outer lines of the plate.
    outer: Vec<Vec<Outer>>,
    /// Another grid has as many rows and columns.
    has_twin: bool,
}

/// A plate of dots on a square lattice.
struct Grid<'a> {
    plate: &'a Plate,
    /// Of every marker.
    cells: Vec<Cell>,
    step_m: f64,
}

/// What the plate says about the sizes of its dots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StatedSizes {
    /// All radii, of more than one size.
    Radii,
    /// One radius for all dots: the outline alone tells how the plate is turned, however large light makes a dot look.
    Equal,
    /// Which of them are not as most are.
    Places,
    Nothing,
}

impl<'a> Grid<'a> {
    fn of(plate: &'a Plate) -> Result<Self> {
        let (cells, step_m) = cells(plate).ok_or_else(no_lattice)?;
        Ok(Self { plate, cells, step_m })
    }

    fn look(&self, picture: &Picture, options: &Options, smoothed_px: f64) -> Result<(CircleDetection, Facts)> {
        let mut facts = Facts::default();
        let found = detect_coded(picture, options, (Apart::Far, smoothed_px), |lattices, candidates| {
            let (identified, seen) = self.identify(picture, lattices, candidates)?;
            facts = seen;
            Ok(identified)
        })?;
        Ok((found, facts))
    }

    fn stated(&self) -> StatedSizes {
        let radius = |m: &Marker| m.outer_radius_m;
        let first = self.plate.markers.first().map_or(0.0, radius);
        if self
            .plate
            .markers
            .iter()
            .any(|m| radius(m) != first || m.inner_radius_m != self.plate.markers[0].inner_radius_m)
        {
            StatedSizes::Radii
        } else if !self.plate.large.is_empty() {
            StatedSizes::Places
        } else if first > 0.0 {
            StatedSizes::Equal
        } else {
            StatedSizes::Nothing
        }
    }

    /// Puts the largest lattice on the grid.
    fn identify(
        &self,
        picture: &Picture,
        lattices: &[Lattice],
        candidates: &[Candidate],
    ) -> Result<(Identified, Facts)> {
        let nothing = |outcome, facts| Ok((self.identified(self.plate.clone(), Board::new(), outcome)?, facts));
        let Some(lattice) = lattices.first() else {
            let outcome = if candidates.is_empty() { Outcome::NoCandidates } else { Outcome::NoLattice };
            return nothing(outcome, Facts::default());
        };
        let (stated, view) = (self.stated(), View { picture, lattice, candidates });
        let Some(mut dots) = self.dots(stated, &view) else { return nothing(Outcome::Ambiguous, Facts::default()) };
        let plate = self.unturned(stated, &dots);
        let code = self.code(&plate)?;
        let classes = match stated {
            StatedSizes::Radii | StatedSizes::Places => code.classes_of(lattice, candidates),
            StatedSizes::Equal | StatedSizes::Nothing => all_alike(lattice),
        };
        let (mut laid, outcome) = place(&code, &self.cells, &classes);
        let mut facts = self.outlined(&view, laid.first(), outcome);
        facts.is_mirror_of_large = outcome == Outcome::Mirrored && self.fits_without_sizes(&dots, lattice)?;
        if facts.other_size.is_some() {
            return nothing(Outcome::Ambiguous, facts);
        }
        let outline_tells = laid.len() == 1;
        if stated == StatedSizes::Nothing {
            self.turn_by_dots(&mut laid, &mut dots, &view);
        }
        let Some(chosen) = laid.iter().min_by(|a, b| a.lean(lattice).total_cmp(&b.lean(lattice))) else {
            return nothing(outcome, facts);
        };
        let plate = if stated == StatedSizes::Nothing { self.with_found(&dots, chosen) } else { plate };
        let elsewhere = others(chosen, &dots);
        if laid.len() > 1 && self.contradicts(&plate, &elsewhere) {
            return Err(dots_elsewhere(&elsewhere));
        }
        // Dots that tell the turn are seen as other than they are.
        if laid.iter().any(|other| chosen.is_told_from(other, &code, &self.cells)) {
            return nothing(Outcome::Ambiguous, Facts::default());
        }
        let classes = match stated {
            StatedSizes::Equal => all_alike(lattice),
            StatedSizes::Radii | StatedSizes::Places | StatedSizes::Nothing => {
                self.code(&plate)?.classes_of(lattice, candidates)
            }
        };
        let sizes = match stated {
            StatedSizes::Radii | StatedSizes::Equal => Sizes::default(),
            StatedSizes::Places | StatedSizes::Nothing => self.sizes(&plate, &dots),
        };
        facts.sizes = if outline_tells { Sizes { large: Vec::new(), ..sizes } } else { sizes };
        facts.symmetric = laid.len() > 1;
        facts.unstated = if stated == StatedSizes::Equal { larger_dots(&laid, chosen, &view) } else { Vec::new() };
        facts.outer = self.outer(&view, chosen);
        let size_of = |lattice| View { picture, lattice, candidates }.shape()?.0.columns_and_rows();
        facts.has_twin = lattices.get(1).and_then(size_of).is_some_and(|size| facts.size == Some(size));
        Ok((self.identified(plate, board(chosen, lattice, &classes), outcome)?, facts))
    }

    /// Whether the lattice lies on the plate unmirrored, its dots taken as alike.
    fn fits_without_sizes(&self, dots: &Dots, lattice: &Lattice) -> Result<bool> {
        let code = self.code(&self.with_large(dots, |_| false))?;
        Ok(matches!(place(&code, &self.cells, &all_alike(lattice)).1, Outcome::Identified { .. }))
    }

    /// The dots of a lattice; `None` where they are not of the sizes that the plate tells.
    fn dots(&self, stated: StatedSizes, view: &View) -> Option<Dots> {
        let of = if stated == StatedSizes::Equal { Dots::alike } else { Dots::of };
        let mut dots = of(view.lattice, view.candidates)?;
        if stated == StatedSizes::Nothing {
            dots.leave_out_uneven_light(view.lattice, view.candidates);
        }
        let are_told = stated != StatedSizes::Places || !dots.other.is_empty();
        (are_told && self.agrees(&dots)).then_some(dots)
    }

    /// The plate with the radii that are known before it is known how it is turned.
    fn unturned(&self, stated: StatedSizes, dots: &Dots) -> Plate {
        match stated {
            StatedSizes::Radii => self.plate.clone(),
            StatedSizes::Places => {
                self.with_large(dots, |marker| self.plate.large.contains(&self.plate.markers[marker].id))
            }
            StatedSizes::Equal | StatedSizes::Nothing => self.with_large(dots, |_| false),
        }
    }

    /// What the outline of a lattice tells that lies on the plate as `laid` says, or nowhere.
    fn outlined(&self, view: &View, laid: Option<&Laid>, outcome: Outcome) -> Facts {
        let shape = view.shape();
        let cut = shape.is_some_and(|(_, in_view)| !in_view);
        let shape = shape.filter(|(_, in_view)| *in_view).map(|(shape, _)| shape);
        let other_size = self.other_size(shape, view.lattice, laid, outcome);
        let is_alike = |seen: &Shape| self.extent().is_some_and(|stated| stated.shape.asymmetric == seen.asymmetric);
        let other_lines = shape.filter(is_alike).and_then(Shape::columns_and_rows).map_or([None; 2], |s| s.map(Some));
        Facts { cut, size: shape.and_then(Shape::columns_and_rows), other_size, other_lines, ..Facts::default() }
    }

    /// Keeps the turns in which the dots that are not as most are, those that are missing among them, have the least places.
    fn turn_by_dots(&self, laid: &mut Vec<Laid>, dots: &mut Dots, view: &View) {
        let View { picture, lattice, candidates } = *view;
        let Some(any) = laid.first() else { return };
        dots.add(missing_dots(picture, lattice, candidates, (any, &self.cells), &dots.usual));
        dots.leave_out_uneven_light(lattice, candidates);
        let first = laid.iter().map(|l| others(l, dots)).min();
        laid.retain(|l| first.as_ref() == Some(&others(l, dots)));
    }

    /// Why the dots are not those of the plate by their number, where they lie on it as `laid` says, or nowhere.
    fn other_size(
        &self,
        shape: Option<Shape>,
        lattice: &Lattice,
        laid: Option<&Laid>,
        outcome: Outcome,
    ) -> Option<Error> {
        let stated = self.extent()?;
        let goes_on = |laid: &Laid| {
            let on_plate: BTreeSet<Cell> = lattice.cells.keys().map(|cell| laid.apply(*cell)).collect();
            let there = |line: &Vec<Cell>| line.iter().filter(|cell| on_plate.contains(cell)).count();
            stated.sides(true).iter().any(|line| 2 * there(line) >= line.len())
        };
        let goes_on = laid.map_or(outcome == Outcome::Ambiguous, goes_on);
        let other = shape.filter(|shape| goes_on && !shape.is_as(stated.shape));
        let (of_plate, stated) = (stated.shape.columns_and_rows()?, stated.shape);
        match other.map(|shape| (shape.asymmetric, shape.columns_and_rows())) {
            Some((asymmetric, Some(seen))) => {
                let counted = if asymmetric { Counted::ShiftedDots } else { Counted::Dots };
                let alike = asymmetric == stated.asymmetric;
                Some(if alike { other_size(counted, seen, of_plate) } else { other_rows(counted, seen) })
            }
            Some((_, None)) => None,
            None => (goes_on && laid.is_some()).then(|| beyond(of_plate)),
        }
    }

    /// The outer lines of the plate, and of which of their dots there is only paper.
    fn outer(&self, view: &View, laid: &Laid) -> Vec<Vec<Outer>> {
        let Some(stated) = self.extent() else { return Vec::new() };
        let range = |pick: fn(&Cell) -> i32| {
            let all = view.lattice.cells.keys().map(pick);
            all.clone().min().unwrap_or(0) - FURTHER..=all.max().unwrap_or(0) + FURTHER
        };
        let around = range(|c| c.0).flat_map(|i| range(|c| c.1).map(move |j| (i, j)));
        let on_lattice: BTreeMap<Cell, Cell> = around.map(|cell| (laid.apply(cell), cell)).collect();
        let outer = |cell: &Cell| {
            let marker = self.cells.iter().position(|c| c == cell)?;
            Some((self.plate.markers[marker].id, on_lattice.get(cell).is_some_and(|at| view.is_blank(*at))))
        };
        stated.sides(false).iter().map(|line| line.iter().filter_map(outer).collect()).collect()
    }

    fn extent(&self) -> Option<Extent> {
        Extent::of(self.cells.iter().copied())
    }

    fn code(&self, plate: &Plate) -> Result<MarkerCode> {
        MarkerCode::of_cells(plate, &self.cells, self.step_m).ok_or_else(no_lattice)
    }

    fn identified(&self, mut plate: Plate, board: Board, outcome: Outcome) -> Result<Identified> {
        // a grid of which nothing is seen has no sizes
        plate
            .markers
            .iter_mut()
            .filter(|m| m.outer_radius_m <= 0.0)
            .for_each(|m| m.outer_radius_m = 0.25 * self.step_m);
        plate.pitch_m = self.step_m;
        Ok(Identified { code: self.code(&plate)?, plate, board, outcome, cut: Cut::Measured })
    }

    /// The dots are of the size that is stated, where one is.
    fn agrees(&self, dots: &Dots) -> bool {
        let usual = median(self.plate.markers.iter().map(|m| m.outer_radius_m / self.step_m));
        usual.is_none_or(|usual| usual <= 0.0 || (dots.usual.radius / usual).ln().abs() < RADIUS_OFF)
    }

    /// Whether dots that are not as most are stand at these rows and columns, none of which are those of the plate.
    fn contradicts(&self, plate: &Plate, seen: &[(i32, i32)]) -> bool {
        let Some(usual) = median(plate.markers.iter().map(|m| m.outer_radius_m)) else { return false };
        let others = self.cells.iter().zip(&plate.markers).filter(|(_, m)| (m.outer_radius_m - usual).abs() > 1e-9);
        let stated: BTreeSet<(i32, i32)> = others.map(|(&(column, row), _)| (row, column)).collect();
        !stated.is_empty() && !seen.is_empty() && !seen.iter().any(|place| stated.contains(place))
    }

    /// The plate with the radii seen; the large ones have those of the dots that are not as most are.
    fn with_large(&self, dots: &Dots, is_large: impl Fn(usize) -> bool) -> Plate {
        let other: Vec<Dot> = dots.other.values().copied().collect();
        let large = other.get(other.len() / 2).copied().unwrap_or(dots.usual);
        self.with_radii(|k| if is_large(k) { large } else { dots.usual })
    }

    /// The plate with the radii seen, each where it was seen.
    fn with_found(&self, dots: &Dots, laid: &Laid) -> Plate {
        let on_plate: Vec<(Cell, Dot)> = dots.other.iter().map(|(c, d)| (laid.apply(*c), *d)).collect();
        self.with_radii(|k| on_plate.iter().find(|(c, _)| *c == self.cells[k]).map_or(dots.usual, |(_, d)| *d))
    }

    /// The sizes of a plate with the radii seen: what blur and threshold do to them is taken off where the plate states what most are.
    fn sizes(&self, seen: &Plate, dots: &Dots) -> Sizes {
        let usual_m = dots.usual.radius * self.step_m;
        let is_usual = |m: &Marker| (m.outer_radius_m / usual_m).ln().abs() < 1e-9;
        let scale = self.plate.markers.first().map_or(0.0, |m| m.outer_radius_m) / usual_m;
        let scale = if scale > 0.0 { scale } else { 1.0 };
        let large = seen.markers.iter().filter(|m| !is_usual(m)).map(|m| m.id).collect();
        let radii = |m: &Marker| (m.id, [m.outer_radius_m, m.inner_radius_m].map(|r| scale * r));
        Sizes { radii_m: seen.markers.iter().map(radii).collect(), large }
    }

    fn with_radii(&self, dot: impl Fn(usize) -> Dot) -> Plate {
        let mut plate = self.plate.clone();
        for (k, marker) in plate.markers.iter_mut().enumerate() {
            let dot = dot(k);
            marker.outer_radius_m = dot.radius * self.step_m;
            marker.inner_radius_m = dot.ratio * marker.outer_radius_m;
        }
        plate
    }
}

/// Places on the grid of the dots that are not as most are, in the order of their ids.
fn others(laid: &Laid, dots: &Dots) -> Vec<(i32, i32)> {
    let mut all: Vec<(i32, i32)> = dots.other.keys().map(|c| laid.apply(*c)).map(|(i, j)| (j, i)).collect();
    all.sort_unstable();
    all
}

/// Places on the grid of larger dots, where they would tell how it is turned.
fn larger_dots(laid: &[Laid], chosen: &Laid, view: &View) -> Vec<(i32, i32)> {
    let Some(larger) = Dots::larger(view.lattice, view.candidates) else { return Vec::new() };
    let here = others(chosen, &larger);
    if laid.iter().all(|l| others(l, &larger) == here) { Vec::new() } else { here }
}

/// Every dot is of the only class.
fn all_alike(lattice: &Lattice) -> Classes {
    lattice.cells.keys().map(|cell| (*cell, Some(0))).collect()
}

fn board(laid: &Laid, lattice: &Lattice, classes: &Classes) -> Board {
    let placed = |(cell, site): (&Cell, &Site)| {
        (laid.apply(*cell), Placed { candidate: site.candidate, class: classes.get(cell).copied().flatten() })
    };
    lattice.cells.iter().map(placed).collect()
}

/// Cells of all markers (in their order) on the square lattice of the plate, rows downwards, and its step in m.
fn cells(plate: &Plate) -> Option<(Vec<Cell>, f64)> {
    let first = plate.markers.first()?.position_m;
    let distance = |k: usize| (plate.markers[k].position_m - first).norm();
    let step = (1..plate.markers.len()).map(distance).fold(f64::INFINITY, f64::min);
    let half = 0.5_f64.sqrt();
    for axes in [[[1.0, 0.0], [0.0, -1.0]], [[half, -half], [-half, -half]]] {
        let along = |axis: [f64; 2], k: usize| {
            let d = plate.markers[k].position_m - first;
            (axis[0] * d.x + axis[1] * d.y) / step
        };
        let found: Option<Vec<Cell>> = (0..plate.markers.len())
            .map(|k| {
                let [x, y] = axes.map(|axis| along(axis, k));
                let near = (x - x.round()).hypot(y - y.round()) < OFF_LATTICE;
                near.then(|| (x.round() as i32, y.round() as i32))
            })
            .collect();
        if let Some(found) = found
            && found.iter().collect::<BTreeSet<_>>().len() == found.len()
        {
            let low = [found.iter().map(|c| c.0).min()?, found.iter().map(|c| c.1).min()?];
            return Some((found.iter().map(|c| (c.0 - low[0], c.1 - low[1])).collect(), step));
        }
    }
    None
}

fn no_lattice() -> Error {
    Error::new(
        Code::PlateNotDetectable,
        "plate",
        "the markers do not lie on a square lattice",
        "check the positions in the plate file: a symmetric grid, or every other row shifted by half a step",
    )
}

/// Rows and columns as plate.toml has them.
fn written(seen: &[(i32, i32)]) -> String {
    seen.iter().map(|(row, column)| format!("[{column}, {row}]")).collect::<Vec<_>>().join(", ")
}

fn dots_elsewhere(seen: &[(i32, i32)]) -> Error {
    Error::new(
        Code::PlateContradicted,
        "image",
        format!(
            "the dots of another size stand at [column, row] = {} or the same after a turn, not as stated",
            written(seen)
        ),
        "correct columns, rows and large (or plate.csv) of the plate file: both count from 0 at the top-left dot",
    )
}

fn cut_grid() -> Error {
    Error::new(
        Code::PlateIncomplete,
        "image",
        "the dots reach the border of the image, or what covers them: neither their number nor their place on the plate can be told",
        "take the image so that all dots are in view with paper around them, and check columns and rows of the plate file",
    )
}

fn mirrored_or_large() -> Error {
    Error::new(
        Code::PlateMirrored,
        "image",
        "the dots of another size stand where the mirror image of the plate has them",
        "switch off the mirroring in the camera driver; if nothing is mirrored, correct large (or plate.csv) of the plate file: column and row count from 0 at the top-left dot",
    )
}

fn unstated_notice(seen: &[(i32, i32)]) -> Notice {
    let places = written(seen);
    let what = format!(
        "larger dots are seen at [column, row] = {places} or the same after a turn, though the stated radii are equal: they turn nothing"
    );
    let remedy =
        format!("write large = [{places}] into the plate file, or the same after a turn, if they are printed so");
    Notice::new(Code::PlateContradicted, "image", what, remedy)
}

fn symmetric_notice() -> Notice {
    Notice::new(
        Code::PlateSymmetric,
        "plate",
        "the grid of dots looks the same after a turn; ids assume that its top is up in the image",
        "keep the camera within 90 degrees of upright, or use an asymmetric grid or one with a larger dot",
    )
}
