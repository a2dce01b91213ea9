//! The detector: the stages in their order.

use std::collections::{BTreeMap, BTreeSet};

use super::candidates::candidate::{Candidate, candidates, largest_marker};
use super::candidates::levels::Levels;
use super::drift::Drift;
use super::edge::model::Pixels;
use super::edge::refine::{Fit, refine_steadily};
use super::ellipse::Ellipse;
use super::identity::code::{MarkerCode, Verdict};
use super::identity::lattice::{Apart, Buckets, Cell, Lattice, lattices};
use super::identity::neighbour_check::{Board, Placed, around, check_neighbours, continuation, neighbourhood};
use super::measuring::agreement::{Inner, MeasuredMarker, agreement};
use super::measuring::bands::Bands;
use super::measuring::glare::allow_for_glare;
use super::measuring::measure::{Camera, THRESHOLD, Target, drop_target, learn, target_of};
use super::measuring::predicted::Predicted;
use super::measuring::rescue::{Figure, Place, rescue};
use super::smoothed::{SMOOTHINGS_PX, as_before, smoothed, variance_factor};
use super::types::{CircleDetection, DroppedCandidate, Found, InnerOuter, Options, Outcome, Reason};
use crate::detect::Picture;
use crate::error::{Code, Error, Result};
use crate::linalg::median;
use crate::series::Plate;

/// Smallest lattice that is worth a try; below it chance cannot be excluded.
const SMALLEST_LATTICE: usize = 9;

/// Finds, identifies and measures the markers of a coded plate in one picture.
///
/// `uv` of an observation is the area centroid of the contour's image, with the covariance of the fit. A picture
/// without markers, or in which they cannot be identified, is no error: see [`CircleDetection::outcome`].
///
/// # Errors
///
/// The plate has no code (its markers are no lattice of circles); the picture is empty.
pub fn detect(picture: &Picture, plate: &Plate, options: &Options) -> Result<CircleDetection> {
    let code = MarkerCode::of(plate).filter(|_| !plate.markers.is_empty()).ok_or_else(|| {
        let what = "its markers do not form a lattice of circles with a radius";
        Error::new(
            Code::PlateNotDetectable,
            "plate",
            what,
            "give a plate of kind coded-circles with plate.csv as made by `robotcal plate`",
        )
    })?;
    let look = |picture: &Picture, smoothed_px: f64| {
        detect_coded(picture, options, (Apart::Near, smoothed_px), |lattices, candidates| {
            let (board, outcome) = identify(&code, lattices, candidates);
            Ok(Identified { plate: plate.clone(), code: code.clone(), board, outcome, cut: Cut::Left })
        })
    };
    let mut best = look(picture, 0.0)?;
    for sigma_px in SMOOTHINGS_PX {
        let (reasons, is_unseen) = (best.spoilt_by(), best.outcome.is_unseen());
        if reasons.is_empty() && !is_unseen {
            break;
        }
        let mut others = as_before(look(&smoothed(picture, sigma_px), sigma_px)?, sigma_px);
        allow_for_glare(&mut others, picture.full_scale, sigma_px);
        if !is_unseen {
            best.complete(others, reasons);
        } else if !others.found.is_empty() {
            best = CircleDetection { smoothed: others.found.len(), ..others };
        }
    }
    Ok(best)
}

/// What was recognised.
pub(super) struct Identified {
    /// The plate with the sizes of its markers; its pitch is a step of the lattice.
    pub plate: Plate,
    pub code: MarkerCode,
    pub board: Board,
    pub outcome: Outcome,
    pub cut: Cut,
}

/// What is done with markers that the border of the picture cuts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cut {
    /// They are left to a second pass, when camera and pose tell their shape.
    Left,
    /// They are measured with the shape that their neighbours tell.
    Measured,
}

/// The stages around the identification, in a picture that was smoothed by so many px before.
pub(super) fn detect_coded(
    picture: &Picture,
    options: &Options,
    (apart, smoothed_px): (Apart, f64),
    identify: impl FnOnce(&[Lattice], &[Candidate]) -> Result<Identified>,
) -> Result<CircleDetection> {
    if picture.width < 16 || picture.height < 16 || picture.pixels.len() != picture.width * picture.height {
        let what = format!("{} x {} pixels with {} values", picture.width, picture.height, picture.pixels.len());
        return Err(Error::new(Code::ImageSizeImpossible, "image", what, "check the image file"));
    }
    let levels = Levels::of(picture, largest_marker(picture, options), THRESHOLD);
    let (candidates, mut dropped) = candidates(picture, &levels, options);
    let lattices = lattices(&candidates, SMALLEST_LATTICE, apart);
    let Identified { plate, code, mut board, outcome, cut } = identify(&lattices, &candidates)?;
    let mut refused = check_neighbours(&mut board, &code, &candidates);
    attach(&mut board, &code, &candidates);
    refused.extend(check_neighbours(&mut board, &code, &candidates));
    drop_unused(&board, &refused, &lattices, &candidates, &mut dropped);
    let pixels = Pixels::default();
    let mut work = Work { picture, plate: &plate, code: &code, cut, candidates: &candidates, pixels, smoothed_px };
    let measured = work.measure(&board, &levels, options, &mut dropped);
    Ok(work.detection(&board, measured, outcome, dropped))
}

/// As [`place`]; a picture that nothing fits is looked at once more turned over: what is placed then is a mirror image.
///
/// Lattices grow in an order that has a handedness, so that a mirror image may slip where its original does not.
fn identify(code: &MarkerCode, grown: &[Lattice], candidates: &[Candidate]) -> (Board, Outcome) {
    let (board, outcome) = place(code, grown, candidates);
    if outcome != Outcome::Ambiguous {
        return (board, outcome);
    }
    let last = candidates.iter().map(|c| c.ellipse.centre[0]).fold(0.0, f64::max);
    let turned = |c: &Candidate| Candidate { ellipse: c.ellipse.mirrored(last), ..*c };
    let turned: Vec<Candidate> = candidates.iter().map(turned).collect();
    match place(code, &lattices(&turned, SMALLEST_LATTICE, Apart::Near), &turned).1 {
        Outcome::Identified { .. } => (board, Outcome::Mirrored),
        _ => (board, outcome),
    }
}

/// Puts the lattices on the plate; where none fits as a whole, their parts.
fn place(code: &MarkerCode, lattices: &[Lattice], candidates: &[Candidate]) -> (Board, Outcome) {
    let mut board = Board::new();
    let mut outcome = match (candidates.is_empty(), lattices.is_empty()) {
        (true, _) => Outcome::NoCandidates,
        (false, true) => Outcome::NoLattice,
        _ => Outcome::Ambiguous,
    };
    let seen: Vec<(&Lattice, Classes)> = lattices.iter().map(|l| (l, code.classes_of(l, candidates))).collect();
    for (lattice, classes) in &seen {
        put(lattice, classes, code.locate(classes), &mut board, &mut outcome);
    }
    if outcome == Outcome::Ambiguous {
        for (lattice, classes) in &seen {
            for (part, verdict) in code.locate_parts(classes) {
                put(lattice, &part, verdict, &mut board, &mut outcome);
            }
        }
    }
    (board, outcome)
}

/// Classes of the cells of a lattice.
type Classes = BTreeMap<Cell, Option<u8>>;

/// Puts the cells of a lattice that have an entry in `classes` on the plate.
fn put(lattice: &Lattice, classes: &Classes, verdict: Verdict, board: &mut Board, outcome: &mut Outcome) {
    let identified = matches!(outcome, Outcome::Identified { .. });
    match verdict {
        Verdict::Ambiguous => {}
        // A reflection of the plate beside the plate itself is no reason to refuse the picture.
        Verdict::Mirrored => {
            if !identified {
                *outcome = Outcome::Mirrored;
            }
        }
        Verdict::Placed { placement, agreeing, disagreeing, runner_up } => {
            if !identified {
                *outcome = Outcome::Identified { agreeing, disagreeing, runner_up };
            }
            for (cell, class) in classes {
                if let Some(site) = lattice.cells.get(cell) {
                    board.entry(placement.apply(*cell)).or_insert(Placed { candidate: site.candidate, class: *class });
                }
            }
        }
    }
}

/// Cells of the plate at most `reach` from known ones that are not on the board.
fn open_cells(board: &Board, code: &MarkerCode, reach: i32) -> impl Iterator<Item = Cell> {
    let is_open = move |cell: &Cell| !board.contains_key(cell) && around(board, *cell, reach).next().is_some();
    code.occupied().filter(is_open)
}

/// How far a lattice is carried on over a gap, in cells, and how often.
const GAP: i32 = 3;
const ROUNDS: usize = 8;

/// Takes up candidates that no lattice reached but that lie where the plate has a marker of their class.
fn attach(board: &mut Board, code: &MarkerCode, candidates: &[Candidate]) {
    let mut used: BTreeSet<usize> = board.values().map(|p| p.candidate).collect();
    let index = Buckets::of(candidates);
    for _ in 0..ROUNDS {
        let mut taken = Vec::new();
        for cell in open_cells(board, code, GAP) {
            let Some(map) = continuation(board, cell, candidates) else { continue };
            let Some(unit) = map.ellipse(1.0) else { continue };
            let mut found = None;
            index.within(map.at([0.0, 0.0]), 0.2 * map.shorter_step(), |i| {
                let class = code.classify(&candidates[i], candidates[i].ellipse.mean_radius() / unit.mean_radius());
                if !used.contains(&i) && class == code.class_at(cell) {
                    found = found.or(Some(i));
                }
            });
            if let Some(i) = found {
                used.insert(i);
                taken.push((cell, Placed { candidate: i, class: code.class_at(cell) }));
            }
        }
        if taken.is_empty() {
            break;
        }
        board.extend(taken);
    }
}

fn drop_unused(
    board: &Board,
    refused: &[(Cell, usize, Reason)],
    lattices: &[Lattice],
    candidates: &[Candidate],
    dropped: &mut Vec<DroppedCandidate>,
) {
    let mut reasons: BTreeMap<usize, Reason> = (0..candidates.len()).map(|i| (i, Reason::OffLattice)).collect();
    for site in lattices.iter().flat_map(|l| l.cells.values()) {
        reasons.insert(site.candidate, Reason::NoIdentity);
    }
    for (_, i, reason) in refused {
        reasons.insert(*i, *reason);
    }
    for p in board.values() {
        reasons.remove(&p.candidate);
    }
    for (i, reason) in reasons {
        let ellipse = candidates[i].ellipse;
        dropped.push(DroppedCandidate { uv: ellipse.centre, reason, ellipse: Some(ellipse), marker: None });
    }
}

/// One measured marker with its cell.
struct Entry {
    cell: Cell,
    fit: Fit,
    rescued: bool,
}

struct Work<'a> {
    picture: &'a Picture,
    plate: &'a Plate,
    code: &'a MarkerCode,
    cut: Cut,
    candidates: &'a [Candidate],
    pixels: Pixels,
    smoothed_px: f64,
}

/// Measured markers, blur and noise of the picture.
struct Harvest {
    entries: Vec<Entry>,
    camera: Camera,
    inner_outer: Option<InnerOuter>,
}

impl Work<'_> {
    fn marker(&self, cell: Cell) -> Option<&crate::series::Marker> {
        self.code.marker_at(cell).map(|i| &self.plate.markers[i])
    }

    fn ratio(&self, cell: Cell) -> Option<f64> {
        self.marker(cell).map(|m| m.inner_radius_m / m.outer_radius_m).filter(|r| *r > 0.0)
    }

    /// Relative radius out to which the neighbours leave paper, for a marker with this minor semi-axis.
    fn clear(&self, cell: Cell, minor_px: f64, blur_px: f64) -> f64 {
        let own = self.marker(cell).map_or(0.3, |m| m.outer_radius_m / self.plate.pitch_m);
        (1.0 - self.code.radii()[1]) / own - 2.1 * blur_px / minor_px
    }

    /// Relative radius at which the border of the picture begins.
    fn room(&self, ellipse: &Ellipse) -> f64 {
        let half = ellipse.half_extent();
        let last = [self.picture.width, self.picture.height].map(|n| n as f64 - 1.0);
        let free = |a: usize| ellipse.centre[a].min(last[a] - ellipse.centre[a]) - half[a];
        1.0 + free(0).min(free(1)).max(0.0) / ellipse.semi_axes()[1]
    }

    fn target(&self, cell: Cell, placed: &Placed, blur_px: f64) -> Target {
        let c = &self.candidates[placed.candidate];
        let clear = self.clear(cell, c.ellipse.semi_axes()[1], blur_px).min(self.room(&c.ellipse));
        let mut target = target_of(c, self.ratio(cell), clear);
        if self.ratio(cell).is_none() {
            target.ratio = None;
        }
        target
    }

    fn measure(
        &mut self,
        board: &Board,
        levels: &Levels,
        options: &Options,
        dropped: &mut Vec<DroppedCandidate>,
    ) -> Harvest {
        let guess = median(board.values().map(|p| self.candidates[p.candidate].blur_px)).unwrap_or(f64::NAN);
        let mut targets: Vec<Target> = board.iter().map(|(cell, p)| self.target(*cell, p, guess)).collect();
        let mut camera = learn(self.picture, &mut targets, guess, levels.noise, &mut self.pixels);
        let (mut entries, mut refused) = (Vec::new(), Vec::new());
        let mut bands = Bands::of(self.picture, targets.len());
        for (&cell, target) in board.keys().zip(targets) {
            match refine_steadily(self.picture, &target.start(&camera, 0.3), &mut self.pixels) {
                Ok(fit) => {
                    bands.take(&fit, &self.pixels);
                    entries.push(Entry { cell, fit, rescued: false });
                }
                Err(reason) => refused.push((cell, target, reason)),
            }
        }
        camera.correlation = bands.correlation();
        bands.state(&camera.correlation, entries.iter_mut().map(|e: &mut Entry| &mut e.fit));
        if options.rescue {
            let rescued = self.rescue(board, &camera, dropped);
            entries.extend(rescued);
            entries.sort_by_key(|e| e.cell);
        }
        let inner_outer = self.agree(&mut entries, dropped);
        self.look_again(&mut entries, &mut refused, &camera);
        let lost = |(cell, target, reason): &(_, _, _)| drop_target(target, *reason, self.marker(*cell).map(|m| m.id));
        dropped.extend(refused.iter().map(lost));
        Harvest { entries, camera, inner_outer }
    }

    /// Measures small markers again with what their neighbours tell.
    fn look_again(&mut self, entries: &mut Vec<Entry>, refused: &mut Vec<(Cell, Target, Reason)>, camera: &Camera) {
        let figure = |cell| {
            let marker = self.marker(cell)?;
            Some(Figure { radius: marker.outer_radius_m / self.plate.pitch_m, ratio: self.ratio(cell) })
        };
        let place = |cell, ellipse: &Ellipse, first| {
            let clear = self.clear(cell, ellipse.semi_axes()[1], camera.blur_px);
            Some((cell, Place { figure: figure(cell)?, first, clear }))
        };
        let measured = entries.iter().filter_map(|e| place(e.cell, &e.fit.measured.outer.ellipse, Ok(e.fit)));
        let failed = refused.iter().filter_map(|(cell, target, _)| place(*cell, &target.ellipse, Err(*target)));
        let places: BTreeMap<_, _> = measured.chain(failed).collect();
        let fits = rescue(self.picture, camera, &places, &figure);
        entries.retain(|e| !fits.contains_key(&e.cell));
        refused.retain(|(cell, ..)| !fits.contains_key(cell));
        let rescued = |cell: &Cell| places[cell].first.is_err();
        entries.extend(fits.into_iter().map(|(cell, fit)| Entry { cell, rescued: rescued(&cell), fit }));
    }

    /// Looks where the neighbours say that a marker must be.
    fn rescue(&mut self, board: &Board, camera: &Camera, dropped: &mut Vec<DroppedCandidate>) -> Vec<Entry> {
        let mut found = Vec::new();
        // dots with a sheen are less even than paper
        let noise = if self.cut == Cut::Measured { [camera.noise[0].max(camera.noise[1]); 2] } else { camera.noise };
        let camera = &Camera { noise, ..*camera };
        for cell in open_cells(board, self.code, 1) {
            let enough = around(board, cell, 2).count() >= 6;
            let Some((map, _)) = neighbourhood(board, cell, self.candidates).filter(|_| enough) else { continue };
            let Some(marker) = self.marker(cell) else { continue };
            let Some(outer) = map.ellipse(marker.outer_radius_m / self.plate.pitch_m) else { continue };
            let half = if self.cut == Cut::Measured { [0.0; 2] } else { outer.half_extent() };
            let size = [self.picture.width as f64, self.picture.height as f64];
            if (0..2).any(|a| outer.centre[a] < half[a] + 1.0 || outer.centre[a] > size[a] - half[a] - 2.0) {
                continue;
            }
            let clear = self.clear(cell, outer.semi_axes()[1], camera.blur_px).min(self.room(&outer));
            let id = marker.id;
            let predicted = Predicted::at(id, outer, self.ratio(cell), clear);
            let result = predicted.measure(self.picture, camera, &mut self.pixels);
            match result {
                Ok(fit) => {
                    // the candidate that lay there was dropped with a reason: it is found after all
                    dropped.retain(|d| !predicted.lies_at(d.uv));
                    found.push(Entry { cell, fit, rescued: true });
                }
                Err(reason) => {
                    dropped.push(DroppedCandidate { uv: outer.centre, reason, ellipse: Some(outer), marker: Some(id) });
                }
            }
        }
        found
    }

    /// Drops annuli whose inner and outer centre do not agree.
    fn agree(&self, entries: &mut Vec<Entry>, dropped: &mut Vec<DroppedCandidate>) -> Option<InnerOuter> {
        let seen: Vec<MeasuredMarker> = entries.iter().filter_map(|e| self.seen(e)).collect();
        if seen.len() != entries.len() {
            return None;
        }
        let (good, summary) = agreement(&seen, [self.picture.width, self.picture.height]);
        let mut keep = good.iter();
        entries.retain(|e| {
            let ok = keep.next().copied().unwrap_or(true);
            if !ok {
                let ellipse = e.fit.measured.outer.ellipse;
                let marker = self.marker(e.cell).map(|m| m.id);
                dropped.push(DroppedCandidate {
                    uv: ellipse.centre,
                    reason: Reason::InnerOuter,
                    ellipse: Some(ellipse),
                    marker,
                });
            }
            ok
        });
        summary
    }

    fn seen(&self, entry: &Entry) -> Option<MeasuredMarker> {
        let marker = self.marker(entry.cell)?;
        let (measured, cross) = (&entry.fit.measured, entry.fit.cross);
        let inner = measured.inner.map(|i| {
            let (vi, vo) = (i.covariance, measured.outer.covariance);
            let factor = variance_factor(measured.blur_px, self.smoothed_px);
            let sigma = [0, 1].map(|a| (factor * (vi[2 * a] + vo[2 * a] - 2.0 * cross[a])).max(1e-10).sqrt());
            Inner { radius: marker.inner_radius_m / self.plate.pitch_m, centre: i.ellipse.centre, sigma }
        });
        let outer_radius = marker.outer_radius_m / self.plate.pitch_m;
        Some(MeasuredMarker { cell: entry.cell, outer_radius, outer: measured.outer.ellipse.centre, inner })
    }

    fn detection(
        &self,
        board: &Board,
        harvest: Harvest,
        outcome: Outcome,
        dropped: Vec<DroppedCandidate>,
    ) -> CircleDetection {
        let outcome = if board.is_empty() && matches!(outcome, Outcome::Identified { .. }) {
            Outcome::Ambiguous
        } else {
            outcome
        };
        let mut found: Vec<Found> = harvest
            .entries
            .iter()
            .filter_map(|e| {
                let marker = self.marker(e.cell)?.id;
                Some(Found { marker, measured: e.fit.measured, rescued: e.rescued })
            })
            .collect();
        found.sort_by_key(|f| f.marker);
        let observations = found.iter().flat_map(Found::observations).collect();
        let blur_px = median(found.iter().map(|f| f.measured.blur_px)).unwrap_or(f64::NAN);
        let noise = harvest.camera.noise.map(f64::sqrt);
        let skew = |e: &Entry| {
            let (sum, information) = e.fit.skew;
            (e.fit.measured.outer.ellipse.centre, [0, 1].map(|a| sum[a] / information[a]), information)
        };
        let size = [self.picture.width, self.picture.height];
        let lopsided = Drift::fit(harvest.entries.iter().map(skew), size);
        CircleDetection {
            observations,
            found,
            dropped,
            outcome,
            blur_px,
            noise,
            correlation: harvest.camera.correlation,
            inner_outer: harvest.inner_outer,
            lopsided,
            smoothed: 0,
        }
    }
}
