//! Identity of markers in random views: none may be wrong, few may be missed, a mirror and a strange plate must be seen through.

use std::collections::BTreeMap;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::identity_view::RandomView;
use crate::detect::{Detection, Picture, circles};
use crate::error::Result;
use crate::model::circle::centroid_uv;
use crate::plan::plate_design::{PlateRequest, design};
use crate::series::{Edge, Plate};

/// What is wished for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct IdentityRequest {
    /// Number of views.
    pub views: u64,
    /// Seed of the first view; the others follow, so that each can be repeated alone.
    pub seed: u64,
}

/// What a view was made to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Appearance {
    /// The plate.
    Plate,
    /// The plate, and then its mirror image.
    Mirror,
    /// A plate of the same make with another code.
    OtherPlate,
}

impl Appearance {
    /// Four views of five show the plate, of the fifth half a mirror image and half another plate.
    fn of(seed: u64) -> Self {
        match seed % 10 {
            0 => Self::Mirror,
            5 => Self::OtherPlate,
            _ => Self::Plate,
        }
    }
}

/// What became of one view.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentityView {
    /// Its seed.
    pub seed: u64,
    /// What it shows.
    pub sight: Appearance,
    /// Tilt of the plate, degrees.
    pub tilt_deg: f64,
    /// What disturbs it.
    pub disturbances: Vec<&'static str>,
    /// Markers wholly visible with a minor axis above the limit of the plate's design.
    pub visible: usize,
    /// Those of them that were found.
    pub found: usize,
    /// Whether any marker was identified.
    pub identified: bool,
    /// Observations that are not where their marker is.
    pub wrong: usize,
    /// Observations of the right marker, but off by more than [`DISPLACED_PX`] and [`DISPLACED_SIGMAS`] of their stated sigmas.
    pub displaced: usize,
    /// Why visible markers were not found, with counts.
    pub missed: BTreeMap<&'static str, usize>,
    /// What was said of the mirror image, where one was shown.
    pub mirror: Option<MirrorAnswer>,
}

/// What is said of a mirror image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MirrorAnswer {
    /// Refused as a mirror image.
    Named,
    /// Refused for another reason, as was the view itself.
    RefusedAsTheView,
    /// Refused for another reason, though the view itself was identified.
    RefusedOtherwise,
    /// Markers were identified in it.
    Accepted,
}

/// An observation of the right marker that is off by more, and by more than [`DISPLACED_SIGMAS`], is displaced: something else
/// disturbed its fit.
pub const DISPLACED_PX: f64 = 0.1;
/// See [`DISPLACED_PX`].
pub const DISPLACED_SIGMAS: f64 = 6.0;

impl IdentityView {
    /// Something that must not happen happened.
    pub fn failed(&self) -> bool {
        self.wrong > 0 || matches!(self.mirror, Some(MirrorAnswer::Accepted | MirrorAnswer::RefusedOtherwise))
    }
}

/// The study: all views in the order of their seeds.
#[derive(Debug, Clone, PartialEq)]
pub struct Identity {
    /// What was asked for.
    pub request: IdentityRequest,
    /// The views.
    pub views: Vec<IdentityView>,
}

/// The plates of the study.
pub struct Plates {
    own: Plate,
    other: Plate,
}

impl Plates {
    /// The standard plate, and one with another code.
    ///
    /// # Errors
    /// None in practice: both can be designed.
    pub fn standard() -> Result<Self> {
        let request = PlateRequest::default();
        let own = design(&request)?.plate;
        Ok(Self { own, other: design(&PlateRequest { seed: request.seed + 1, ..request })?.plate })
    }

    /// The plate that is looked for.
    pub fn own(&self) -> &Plate {
        &self.own
    }
}

/// Renders and judges all views; `progress` is called after each, from any thread.
///
/// # Errors
/// None in practice: the plates can be designed.
pub fn identity(request: IdentityRequest, progress: impl Fn() + Sync) -> Result<Identity> {
    let plates = Plates::standard()?;
    let one = |k: u64| {
        let (view, _, _) = identity_view(&plates, request.seed + k);
        progress();
        view
    };
    Ok(Identity { request, views: (0..request.views).into_par_iter().map(one).collect() })
}

/// One view with its picture (the mirror image where it was accepted) and what was found in it.
pub fn identity_view(plates: &Plates, seed: u64) -> (IdentityView, Picture, Detection) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let truth = RandomView::of(&plates.own, &mut rng);
    let sight = Appearance::of(seed);
    let shown = if sight == Appearance::OtherPlate { &plates.other } else { &plates.own };
    let picture = truth.picture(shown, seed);
    let detection = detect(&picture, &plates.own);
    let mut view = IdentityView {
        seed,
        sight,
        tilt_deg: truth.tilt_deg,
        disturbances: truth.disturbances(),
        visible: truth.visible.len(),
        found: 0,
        identified: !detection.observations.is_empty(),
        wrong: 0,
        displaced: 0,
        missed: BTreeMap::new(),
        mirror: None,
    };
    if sight == Appearance::OtherPlate {
        view.wrong = detection.observations.len();
        view.visible = 0;
        return (view, picture, detection);
    }
    judge(&mut view, &truth, &plates.own, &detection);
    if sight == Appearance::Mirror {
        let mirrored = mirrored(&picture);
        let seen = detect(&mirrored, &plates.own);
        let answer = mirror_answer(&seen, view.identified);
        view.mirror = Some(answer);
        if answer == MirrorAnswer::Accepted {
            view.wrong += seen.observations.len();
        }
        if view.failed() {
            return (view, mirrored, seen);
        }
    }
    (view, picture, detection)
}

fn detect(picture: &Picture, plate: &Plate) -> Detection {
    crate::detect::examine(picture, plate)
}

fn mirror_answer(seen: &Detection, identified: bool) -> MirrorAnswer {
    let outcome = seen.circles.as_ref().map(|c| c.outcome);
    match (seen.observations.is_empty(), outcome) {
        (false, _) => MirrorAnswer::Accepted,
        (true, Some(circles::Outcome::Mirrored)) => MirrorAnswer::Named,
        _ if identified => MirrorAnswer::RefusedOtherwise,
        _ => MirrorAnswer::RefusedAsTheView,
    }
}

fn mirrored(picture: &Picture) -> Picture {
    let rows = picture.pixels.chunks_exact(picture.width);
    Picture { pixels: rows.flat_map(|row| row.iter().rev().copied()).collect(), ..*picture }
}

/// Compares observations with the truth.
fn judge(view: &mut IdentityView, truth: &RandomView, plate: &Plate, detection: &Detection) {
    let place = |index: usize, radius: f64| {
        centroid_uv(&truth.camera, &truth.camera_from_plate, &plate.markers[index].position_m, radius)
    };
    let mut found = vec![false; plate.markers.len()];
    for o in &detection.observations {
        let Some(index) = plate.index_of(o.marker) else {
            view.wrong += 1;
            continue;
        };
        let marker = &plate.markers[index];
        let radius = if o.edge == Edge::Outer { marker.outer_radius_m } else { marker.inner_radius_m };
        let off = place(index, radius).map_or(f64::INFINITY, |uv| (uv[0] - o.uv[0]).hypot(uv[1] - o.uv[1]));
        // A neighbour is a whole pitch away; half of the smaller foreshortened one decides.
        let half_pitch = 0.5 * truth.shorter_pitch_px(plate, index);
        if off > half_pitch {
            view.wrong += 1;
        } else {
            let sigma = o.covariance.map_or(0.0, |c| (0.5 * (c[0] + c[2])).sqrt());
            view.displaced += usize::from(off > DISPLACED_PX.max(DISPLACED_SIGMAS * sigma));
            found[index] |= o.edge == Edge::Outer;
        }
    }
    view.found = truth.visible.iter().filter(|&&k| found[k]).count();
    for &k in truth.visible.iter().filter(|&&k| !found[k]) {
        let marker = &plate.markers[k];
        let Some(uv) = place(k, marker.outer_radius_m) else { continue };
        let near = truth.shorter_pitch_px(plate, k) * marker.outer_radius_m / plate.pitch_m;
        let dropped = detection.dropped.iter().find(|d| (d.uv[0] - uv[0]).hypot(d.uv[1] - uv[1]) < near);
        *view.missed.entry(dropped.map_or("no candidate", |d| d.reason)).or_default() += 1;
    }
}
