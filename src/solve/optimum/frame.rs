//! The plate frame that the nominal markers define: position, rotation and scale of the markers as a whole are those of the nominal ones.
//!
//! Images do not change when the markers of a plate move as one body, grow or shrink as a whole, and the camera follows. With the nominal
//! positions `n` of the M markers that were seen, their positions `x`, their prior information `P` and the 3M x 7 matrix
//! `N = [I, -skew(n), n]` the frame holds `N' P (x - n) = 0`: it is the one in which the similarity that takes the nominal markers to the
//! real ones, weighted by least squares, is none (inner constraints: Blaha 1971; S-transformation: Baarda 1973).
//!
//! `g = (N' P G)^-1 N' P (x - n)` is what `x` is off this frame, with the motion `G = [I, -skew(x), x]` of the markers themselves, and
//! `x - G g`, and poses that have followed, are free of it. Positions are `x = n + B s + c` with modes `s` and corrections `c`: with
//! `N' P c = 0` held there remains `g = K s`, `K = (N' P G)^-1 N' P B`.

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector3};

use crate::error::{Code, Error, Result};
use crate::geom::{Pose, skew};
use crate::model::plate_modes::MODES;
use crate::problem::{Adjustment, PlateShape, Problem};

/// Motions of a body.
const RIGID: usize = 6;

/// A correction of the frame of one plate is small: the third is below rounding.
const CORRECTIONS: usize = 6;

/// Smallest diagonal of the scaled factor of `N' P N`: below it the markers lie on a line.
const LEAST_PIVOT: f64 = 1e-6;

/// A frame, of one plate or of several that can only move together.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Its plates.
    pub plates: Vec<usize>,
    /// Its markers that were seen, as (plate, marker).
    pub seen: BTreeSet<(usize, usize)>,
    /// `K`: motions x modes of all its plates. The motions are those of a body, then the scale of each plate.
    pub by_modes: DMatrix<f64>,
    /// What the tolerances of the markers alone leave open of the scale of each plate, squared.
    scale_variance: Vec<f64>,
}

/// Size of the markers of a plate as a whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlateScale {
    /// Size over the nominal one, less one.
    pub relative: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// Frames of all plates that images in use show. Plates that stood in a common placement of the robot move together.
///
/// # Errors
/// Where the markers seen of a plate lie on a line, so that they define no frame.
pub fn frames(adjustment: &Adjustment) -> Result<Vec<Frame>> {
    let shown: BTreeSet<usize> = adjustment.problem.used().map(|(_, i)| i.plate).collect();
    let mut frames: Vec<Frame> = Vec::new();
    for plate in shown {
        if !frames.iter().any(|f| f.plates.contains(&plate)) {
            frames.push(Frame::of(adjustment, tied_to(adjustment, plate))?);
        }
    }
    Ok(frames)
}

/// The placement of every image on the robot, with its plate.
fn placed(adjustment: &Adjustment) -> impl Iterator<Item = (usize, usize)> + '_ {
    let on_robot = adjustment.used().filter(|(_, _, tie)| !tie.is_free());
    on_robot.map(|(_, i, _)| (i.placement, i.plate))
}

/// Plates that move together with one.
fn tied_to(adjustment: &Adjustment, plate: usize) -> BTreeSet<usize> {
    let mut plates = BTreeSet::from([plate]);
    loop {
        let own = |p: &(usize, usize)| plates.contains(&p.1);
        let placements: BTreeSet<usize> = placed(adjustment).filter(own).map(|p| p.0).collect();
        let tied = placed(adjustment).filter(|p| placements.contains(&p.0)).map(|p| p.1);
        let all: BTreeSet<usize> = tied.chain(plates.iter().copied()).collect();
        if all.len() == plates.len() {
            return plates;
        }
        plates = all;
    }
}

/// `[I, -skew(x)]` and the marker itself in the column of the scale of its plate.
fn motions(x: &Vector3<f64>, plate: usize, plates: usize) -> DMatrix<f64> {
    let mut n = DMatrix::zeros(3, RIGID + plates);
    n.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    n.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(x));
    n.fixed_view_mut::<3, 1>(0, RIGID + plate).copy_from(x);
    n
}

/// `N' P N`, `N' P G` and what turns the latter into a matrix of one unit, for plates with positions.
struct Normal {
    of_motions: DMatrix<f64>,
    unit: DVector<f64>,
    /// `(N' P N)^-1` in those units.
    inverse: DMatrix<f64>,
}

impl Normal {
    fn of<'a>(
        seen: impl Iterator<Item = (DMatrix<f64>, DMatrix<f64>, f64)> + 'a,
        size: usize,
        plate: &str,
    ) -> Result<Self> {
        let (mut of_nominal, mut of_motions) = (DMatrix::zeros(size, size), DMatrix::zeros(size, size));
        for (n, g, information) in seen {
            of_nominal.gemm_tr(information, &n, &n, 1.0);
            of_motions.gemm_tr(information, &n, &g, 1.0);
        }
        let unit = of_nominal.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
        let scaled = DMatrix::from_fn(size, size, |i, j| of_nominal[(i, j)] * unit[i] * unit[j]);
        let factor = scaled.cholesky().filter(|c| c.l_dirty().diagonal().min() > LEAST_PIVOT);
        let inverse = factor.map(|c| c.inverse()).ok_or_else(|| no_frame(plate))?;
        Ok(Self { of_motions, unit, inverse })
    }

    /// `(N' P G)^-1 b`.
    fn solve(&self, b: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let (n, unit) = (self.unit.len(), &self.unit);
        let scaled = DMatrix::from_fn(n, n, |i, j| self.of_motions[(i, j)] * unit[i] * unit[j]);
        let b = DMatrix::from_fn(n, b.ncols(), |i, j| b[(i, j)] * unit[i]);
        let x = scaled.lu().solve(&b)?;
        Some(DMatrix::from_fn(n, x.ncols(), |i, j| x[(i, j)] * unit[i]))
    }
}

fn no_frame(plate: &str) -> Error {
    Error::new(
        Code::FitUndetermined,
        plate,
        "the markers that were seen lie on a line and define no frame",
        "take images of more of the plate",
    )
}

impl Frame {
    fn of(Adjustment { problem, state }: &Adjustment, plates: BTreeSet<usize>) -> Result<Self> {
        let plates: Vec<usize> = plates.into_iter().collect();
        let images = problem.used().map(|(_, i)| i).filter(|i| plates.contains(&i.plate));
        let seen: BTreeSet<(usize, usize)> = images.flat_map(|i| i.used().map(|o| (i.plate, o.marker))).collect();
        let mut frame = Self { plates, seen, by_modes: DMatrix::zeros(0, 0), scale_variance: Vec::new() };
        let rows = frame.seen.iter().map(|&(p, m)| {
            let shape = &state.plates[p];
            let information = problem.marker_information(p, m);
            (frame.motions(p, &shape.nominal[m]), frame.motions(p, &shape.position(m)), information)
        });
        let normal = Normal::of(rows, frame.len(), "plate")?;
        let mut pull = DMatrix::zeros(frame.len(), MODES * frame.plates.len());
        for &(p, m) in &frame.seen {
            let shape = &state.plates[p];
            let n = frame.motions(p, &shape.nominal[m]) * problem.marker_information(p, m);
            let mut own = pull.columns_mut(MODES * frame.place(p), MODES);
            own += n.transpose() * shape.modes_at(m);
        }
        let by_modes = normal.solve(&pull).ok_or_else(|| no_frame("plate"))?;
        let scales = RIGID..frame.len();
        frame.scale_variance = scales.map(|k| normal.inverse[(k, k)] * normal.unit[k].powi(2)).collect();
        frame.by_modes = by_modes;
        Ok(frame)
    }

    /// Number of motions.
    fn len(&self) -> usize {
        RIGID + self.plates.len()
    }

    fn place(&self, plate: usize) -> usize {
        self.plates.iter().position(|p| *p == plate).unwrap_or(0)
    }

    fn motions(&self, plate: usize, x: &Vector3<f64>) -> DMatrix<f64> {
        motions(x, self.place(plate), self.plates.len())
    }

    /// `P N` of one marker: the combination of corrections that is held.
    pub(super) fn held(&self, problem: &Problem, plate: usize, marker: usize) -> DMatrix<f64> {
        let nominal = &problem.plates[plate].markers[marker].position_m;
        self.motions(plate, nominal) * problem.marker_information(plate, marker)
    }

    /// What moves a marker in this frame with the modes, by the first column of the modes of a plate.
    pub(super) fn moved_by_modes(
        &self,
        Adjustment { problem, state }: &Adjustment,
        (plate, marker): (usize, usize),
    ) -> Vec<(usize, SMatrix<f64, 3, MODES>)> {
        let shape = &state.plates[plate];
        let follows = self.motions(plate, &shape.position(marker)) * &self.by_modes;
        let of = |(k, &p): (usize, &usize)| {
            let own = if p == plate { shape.modes_at(marker) } else { SMatrix::zeros() };
            (problem.layout.shapes[p].start, own - follows.fixed_view::<3, MODES>(0, MODES * k))
        };
        self.plates.iter().enumerate().map(of).collect()
    }

    /// How a camera pose (`camera_from_plate`) off this frame moves with the modes, and not with what the camera sees: six rows.
    pub(super) fn pose_by_modes(&self, plate: usize, camera_from_plate: &Pose) -> DMatrix<f64> {
        let mut by_modes = self.placement_by_modes();
        let towards_camera = camera_from_plate.rotation.transpose() * camera_from_plate.translation;
        let mut translation = by_modes.rows_mut(0, 3);
        translation += towards_camera * self.by_modes.row(RIGID + self.place(plate));
        by_modes
    }

    /// The same for the pose of the plate.
    pub(super) fn placement_by_modes(&self) -> DMatrix<f64> {
        -self.by_modes.rows(0, RIGID).into_owned()
    }

    /// Prior variance of the scale of a plate by the tolerances of its markers alone.
    pub(super) fn scale_variance(&self, plate: usize) -> f64 {
        self.scale_variance[self.place(plate)]
    }

    /// Sigma of the scale of a plate where the modes have this covariance: `all` gives the entry of two columns.
    fn scale_sigma_by(&self, problem: &Problem, plate: usize, all: impl Fn(usize, usize) -> f64) -> f64 {
        let row = self.by_modes.row(RIGID + self.place(plate));
        let columns: Vec<usize> = self.plates.iter().flat_map(|&p| problem.layout.shapes[p].clone()).collect();
        let of = |(i, &a): (usize, &usize)| -> f64 {
            columns.iter().enumerate().map(|(k, &b)| row[i] * all(a, b) * row[k]).sum()
        };
        columns.iter().enumerate().map(of).sum::<f64>().max(0.0).sqrt()
    }

    /// Sigma of the scale of a plate, from the covariance of the dense columns in this frame.
    pub fn scale_sigma(&self, problem: &Problem, covariance: &DMatrix<f64>, plate: usize) -> f64 {
        self.scale_sigma_by(problem, plate, |a, b| covariance[(a, b)])
    }

    /// Sigma of the scale of a plate as it was made: by tolerances and modes, no image used.
    pub fn scale_sigma_of_priors(&self, problem: &Problem, plate: usize) -> f64 {
        let columns = &problem.layout.columns;
        let prior = |a: usize, b: usize| if a == b && columns[a].free { columns[a].prior_sigma.powi(2) } else { 0.0 };
        self.scale_sigma_by(problem, plate, prior).hypot(self.scale_variance(plate).sqrt())
    }
}

/// A similarity for the plates of one frame: what is seen of them stays when their markers are put into the frame and poses follow.
#[derive(Debug, Clone)]
pub struct Similarity {
    /// `old plate frame <- frame`.
    pub motion: Pose,
    /// Plates with their size in the old frame over that in the frame.
    sizes: Vec<(usize, f64)>,
}

impl Similarity {
    /// From the frame that the nominal markers define, at nominal scales, to the one in which its plates stand.
    ///
    /// # Errors
    /// Markers that lie on a line.
    pub fn of(frame: &Frame, Adjustment { problem, state }: &Adjustment) -> Result<Self> {
        let sizes = frame.plates.iter().map(|&plate| (plate, 1.0)).collect();
        let mut found = Self { motion: Pose::identity(), sizes };
        for _ in 0..CORRECTIONS {
            let at = |p: usize, m: usize| found.undo(p, &state.plates[p].position(m));
            let nominal = |p: usize, m: usize| frame.motions(p, &state.plates[p].nominal[m]);
            let seen = || frame.seen.iter().map(|&(p, m)| (p, m, problem.marker_information(p, m)));
            let rows = seen().map(|(p, m, information)| (nominal(p, m), frame.motions(p, &at(p, m)), information));
            let normal = Normal::of(rows, frame.len(), "plate")?;
            let mut pull = DMatrix::zeros(frame.len(), 1);
            for (p, m, information) in seen() {
                let off = at(p, m) - state.plates[p].nominal[m];
                pull.gemm_tr(information, &nominal(p, m), &DMatrix::from_column_slice(3, 1, off.as_slice()), 1.0);
            }
            let step = normal.solve(&pull).ok_or_else(|| no_frame("plate"))?;
            let size = found.sizes.iter().map(|(_, size)| size).sum::<f64>() / found.sizes.len() as f64;
            found.motion.translation += size * found.motion.rotation * step.fixed_view::<3, 1>(0, 0);
            found.motion.rotation *= crate::geom::exp_so3(&step.fixed_view::<3, 1>(3, 0).into_owned());
            found.sizes.iter_mut().enumerate().for_each(|(k, (_, size))| *size *= 1.0 + step[RIGID + k]);
        }
        Ok(found)
    }

    /// Size of a plate of the frame over the nominal one.
    pub fn size(&self, plate: usize) -> f64 {
        self.sizes.iter().find(|(p, _)| *p == plate).map_or(1.0, |(_, size)| *size)
    }

    /// A place of a plate in the old frame, in the frame.
    fn undo(&self, plate: usize, x: &Vector3<f64>) -> Vector3<f64> {
        self.motion.inverse().transform(x) / self.size(plate)
    }

    /// The shape of a plate in the frame, `size` times as large as nominal; its modes stay.
    pub fn shape(&self, plate: usize, shape: &PlateShape, size: f64) -> PlateShape {
        let mut moved = shape.clone();
        for m in 0..shape.nominal.len() {
            moved.corrections[m] += self.undo(plate, &shape.position(m)) * size - shape.position(m);
        }
        moved
    }

    /// A camera pose (`camera_from_plate`) that has followed.
    pub fn pose(&self, plate: usize, camera_from_plate: &Pose, size: f64) -> Pose {
        let followed = *camera_from_plate * self.motion;
        Pose::new(followed.rotation, followed.translation * (size / self.size(plate)))
    }
}
