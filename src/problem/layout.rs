//! Names to columns.

use std::ops::Range;

use nalgebra::Vector6;

use super::body::{BODY, Instrument};
use super::{Image, State};
use crate::model::camera::{Camera, MAX_PARAMETERS};
use crate::model::joint_terms::{JointTerm, Term};
use crate::model::plate_modes;
use crate::model::robot::Kinematics;
use crate::urdf::{BASE_FROM_BASE, Chain, Joint};

/// One scalar unknown of the dense part of the problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name, `block.component`, for example `robot/joint_3/origin.rx`.
    pub name: String,
    /// Unit: "m", "rad", "px" or "1".
    pub unit: &'static str,
    /// Prior mean where there is a prior (in the unit).
    pub prior_mean: f64,
    /// Prior sigma; infinite where there is none.
    pub prior_sigma: f64,
    /// False where the parameter stays at its value.
    pub free: bool,
}

/// Columns of the dense part: robot, mountings, placements, instruments and bodies (which act through poses), then cameras and plate
/// shapes (which act on the pixels directly). Markers and what is latent at stops have no columns of their own.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// All columns.
    pub columns: Vec<Column>,
    /// Columns of the twists of the joints (six each).
    pub twists: Range<usize>,
    /// Columns of the joint terms.
    pub terms: Range<usize>,
    /// Those of them that are local errors: latent noise, not properties of the robot.
    pub locals: Range<usize>,
    /// Six columns a mounting.
    pub mountings: Vec<Range<usize>>,
    /// Six columns a placement.
    pub placements: Vec<Range<usize>>,
    /// Six columns an instrument (`base_from_instrument`).
    pub instruments: Vec<Range<usize>>,
    /// Six columns a body that the tip carries (`tip_from_body`).
    pub bodies: Vec<Range<usize>>,
    /// Columns of each camera.
    pub cameras: Vec<Range<usize>>,
    /// Those of them that are its displacement field, at their end; empty for a lens without one.
    pub fields: Vec<Range<usize>>,
    /// Columns of each plate's modes.
    pub shapes: Vec<Range<usize>>,
}

/// Names of everything that has columns of its own beside the robot.
#[derive(Debug, Clone, Copy, Default)]
pub struct Names<'a> {
    /// Mountings.
    pub mountings: &'a [String],
    /// Placements.
    pub placements: &'a [String],
    /// Instruments.
    pub instruments: &'a [Instrument],
    /// Bodies that the tip carries.
    pub bodies: &'a [String],
    /// Cameras.
    pub cameras: &'a [String],
    /// Plates.
    pub plates: &'a [String],
}

const TWIST: [(&str, &str); 6] = [("x", "m"), ("y", "m"), ("z", "m"), ("rx", "rad"), ("ry", "rad"), ("rz", "rad")];

/// Prior sigmas of a joint origin: metres for the translations, rad for the rotations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OriginPrior {
    /// Per axis, m.
    pub translation_m: f64,
    /// Per axis, rad.
    pub rotation_rad: f64,
}

impl OriginPrior {
    /// Of the base of another arm somewhere in the same hall.
    const UNKNOWN: Self = Self { translation_m: 10.0, rotation_rad: 3.0 };
}

impl Default for OriginPrior {
    fn default() -> Self {
        Self { translation_m: 1e-3, rotation_rad: 2e-3 }
    }
}

#[derive(Default)]
struct Builder {
    columns: Vec<Column>,
}

impl Builder {
    fn add(&mut self, name: String, unit: &'static str, prior_sigma: f64) {
        self.columns.push(Column { name, unit, prior_mean: 0.0, prior_sigma, free: true });
    }

    fn block(&mut self, add: impl FnOnce(&mut Self)) -> Range<usize> {
        let start = self.columns.len();
        add(self);
        start..self.columns.len()
    }

    fn camera(&mut self, name: &str, camera: &Camera) -> Range<usize> {
        self.block(|b| {
            for (k, p) in camera.parameter_names().enumerate() {
                let part = camera.parameter_block(k);
                b.add(format!("camera/{name}/{part}.{p}"), camera.parameter_unit(k), camera.prior_sigma(k));
            }
        })
    }

    fn pose(&mut self, block: &str) -> Range<usize> {
        self.block(|b| TWIST.iter().for_each(|(c, unit)| b.add(format!("{block}.{c}"), unit, f64::INFINITY)))
    }

    fn twist(&mut self, joint: &Joint) {
        let first = self.columns.len();
        let part = if joint.states_origin() { "origin" } else { "motion" };
        let prior = if joint.is_between_bases() { OriginPrior::UNKNOWN } else { OriginPrior::default() };
        for (c, unit) in TWIST {
            let sigma = if unit == "m" { prior.translation_m } else { prior.rotation_rad };
            self.add(format!("robot/{}/{part}.{c}", joint.name), unit, sigma);
        }
        self.columns[first..].iter_mut().for_each(|c| c.free = joint.states_origin());
    }

    fn term(&mut self, JointTerm { reading, term, .. }: &JointTerm, chain: &Chain) {
        let kind = chain.reading_kinds[*reading];
        let name = format!("robot/{}.{}", chain.readings[*reading], term.name());
        self.add(name, term.unit(kind), term.prior_sigma(kind));
    }

    fn shape(&mut self, block: &str) -> Range<usize> {
        self.block(|b| {
            for (k, mode) in plate_modes::NAMES.iter().enumerate() {
                b.add(format!("{block}.{mode}"), if k < 3 { "1" } else { "m" }, plate_modes::PRIOR_SIGMA[k]);
            }
        })
    }
}

/// `hand_camera` when there is one, else `hand_camera/name`.
fn named(block: &str, name: &str, count: usize) -> String {
    if count == 1 { block.to_owned() } else { format!("{block}/{name}") }
}

impl Layout {
    /// Columns for the unknowns in `state`, with default priors.
    pub fn new(state: &State, names: &Names) -> Self {
        let Names { mountings, placements, instruments, bodies, cameras, plates } = *names;
        let mut b = Builder::default();
        let twists = b.block(|b| state.robot.chain.joints.iter().for_each(|joint| b.twist(joint)));
        let terms = b.block(|b| state.robot.terms.iter().for_each(|term| b.term(term, &state.robot.chain)));
        let local_count = state.robot.terms.iter().rev().take_while(|t| matches!(t.term, Term::Local(_))).count();
        let locals = terms.end - local_count..terms.end;
        let mountings = mountings.iter().map(|m| b.pose(&named("hand_camera", m, mountings.len()))).collect();
        let placements = placements.iter().map(|p| b.pose(&format!("plate/{p}"))).collect();
        let instruments = instruments.iter().map(|i| b.pose(&format!("{}/{}", i.kind.block(), i.name))).collect();
        let bodies = bodies.iter().map(|body| b.pose(&format!("{BODY}/{body}"))).collect();
        let cameras: Vec<Range<usize>> =
            (cameras.iter().zip(&state.cameras)).map(|(name, camera)| b.camera(name, camera)).collect();
        let fields = (cameras.iter().zip(&state.cameras))
            .map(|(range, camera)| range.start + camera.parametric()..range.end)
            .collect();
        let shapes = plates.iter().map(|plate| b.shape(&named("plate_shape", plate, plates.len()))).collect();
        Self {
            columns: b.columns,
            twists,
            terms,
            locals,
            mountings,
            placements,
            instruments,
            bodies,
            cameras,
            fields,
            shapes,
        }
    }

    /// The columns with those of camera `index` for another lens, and where and by how many columns those behind it moved. Parameters that
    /// both lenses have stay free or fixed as they were.
    pub fn with_camera(&self, index: usize, name: &str, camera: &Camera) -> (Self, usize, isize) {
        let mut own = Builder::default();
        own.camera(name, camera);
        let mut next = self.clone();
        let old = self.cameras[index].clone();
        for column in &mut own.columns {
            let before = self.columns[old.clone()].iter().find(|c| c.name == column.name);
            column.free = before.is_none_or(|c| c.free);
        }
        let moved = own.columns.len() as isize - old.len() as isize;
        next.columns.splice(old.clone(), own.columns);
        let behind = next.cameras.iter_mut().chain(&mut next.fields).chain(&mut next.shapes);
        for range in behind.filter(|r| r.start >= old.end) {
            *range = range.start.saturating_add_signed(moved)..range.end.saturating_add_signed(moved);
        }
        next.cameras[index] = old.start..old.end.saturating_add_signed(moved);
        next.fields[index] = old.start + camera.parametric()..next.cameras[index].end;
        (next, old.end, moved)
    }

    /// Columns of what belongs to the robot: twists and joint terms, without the local errors.
    pub fn robot(&self) -> Range<usize> {
        self.twists.start..self.locals.start
    }

    /// True for a column of the pose between the bases of two arms, which is no property of either.
    pub fn is_between_bases(&self, column: usize) -> bool {
        self.columns[column].name.strip_prefix("robot/").is_some_and(|n| n.split('/').next() == Some(BASE_FROM_BASE))
    }

    /// Number of columns.
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// True without any column.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// Derivative of the pose of the tip, as its body twist, by a column of the robot.
    pub fn derivative(&self, kinematics: &Kinematics, column: usize) -> Vector6<f64> {
        if self.twists.contains(&column) {
            let component = column - self.twists.start;
            kinematics.d_twists[component / 6].column(component % 6).into_owned()
        } else {
            kinematics.d_terms[column - self.terms.start]
        }
    }

    /// Number of leading columns that act through poses (robot, mountings, placements, instruments, bodies).
    pub fn theta_len(&self) -> usize {
        self.cameras.first().map_or(self.len(), |c| c.start)
    }

    /// Column of every intrinsic unknown of an image that touches some control points of the field, in their order ([`super::E`]); `None` for padding.
    pub fn intrinsics(&self, image: &Image, touched: &[usize]) -> Vec<Option<usize>> {
        let (camera, field) = (&self.cameras[image.camera], &self.fields[image.camera]);
        let formula = (camera.start..field.start).map(Some).chain(std::iter::repeat(None)).take(MAX_PARAMETERS);
        let points = touched.iter().flat_map(|k| [0, 1].map(|d| field.start + 2 * k + d));
        formula.chain(self.shapes[image.plate].clone().map(Some)).chain(points.map(Some)).collect()
    }

    /// Index of a column by its full name.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|c| c.name == name)
    }
}
