//! Unknowns, their columns, and the equations of one measurement.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Vector3, Vector6};

use super::robot::KnownRobot;
use super::touch::{Touch, TouchPlace, Touches};
use crate::geom::{Pose, adjoint, skew};
use crate::linalg::dense;
use crate::model::robot::Posture;

/// What is known beside the touches.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Given {
    /// `tip_from_tool`, which is then not estimated.
    pub tool: Option<Pose>,
    /// `base_from_work` of the plate of the solution, whose columns the robot has; it is then not estimated.
    pub plate: Option<Pose>,
}

/// A value of every unknown.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Unknowns {
    /// `tip_from_tool` of every body.
    pub tools: Vec<Pose>,
    /// `base_from_work`; the identity where no place is known.
    pub work: Pose,
    /// Places of the contacts that are not known, in the work object, m.
    pub places: Vec<Vector3<f64>>,
}

/// Columns of the unknowns.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Columns {
    /// Three for a point along the axes of the tip, six for a pose.
    pub tools: Vec<Range<usize>>,
    /// Six.
    pub work: Range<usize>,
    /// Three each.
    pub places: Vec<Range<usize>>,
    /// Columns that are estimated, in order.
    pub free: Vec<usize>,
    /// All of them.
    pub len: usize,
}

impl Columns {
    pub fn new(touches: &Touches, given: &Given) -> Self {
        let mut len = 0;
        let mut block = |n: usize| {
            len += n;
            len - n..len
        };
        let tools: Vec<_> = (0..touches.bodies.len()).map(|b| block(if touches.is_pose(b) { 6 } else { 3 })).collect();
        let work = block(6);
        let places: Vec<_> = touches.contacts.iter().map(|_| block(3)).collect();
        let mut free: Vec<usize> = Vec::new();
        if given.tool.is_none() {
            free.extend(tools.iter().flat_map(Clone::clone));
        }
        if given.plate.is_none() && touches.frame.is_some() {
            free.extend(work.clone());
        }
        free.extend(places.iter().flat_map(Clone::clone));
        Self { tools, work, places, free, len }
    }

    /// Of one tool with three or six columns and its work object, all free.
    pub fn of_one(of_tool: usize) -> Self {
        let work = of_tool..of_tool + 6;
        Self {
            tools: std::iter::once(0..of_tool).collect(),
            free: (0..work.end).collect(),
            len: work.end,
            work,
            places: Vec::new(),
        }
    }

    /// Columns of tool and work object, which the robot's own base and flange act like.
    pub fn frames(&self) -> usize {
        self.work.end
    }

    /// True where the work object is estimated.
    pub fn work_is_free(&self) -> bool {
        self.free.contains(&self.work.start)
    }

    /// True where the tool is estimated.
    pub fn tool_is_free(&self) -> bool {
        self.tools.first().is_some_and(|t| self.free.contains(&t.start))
    }
}

impl Unknowns {
    /// These unknowns after a step in the free columns.
    pub fn stepped(&self, columns: &Columns, step: &DVector<f64>) -> Self {
        let mut all = DVector::zeros(columns.len);
        columns.free.iter().zip(step.iter()).for_each(|(c, s)| all[*c] = *s);
        let twist = |range: &Range<usize>| Vector6::from_iterator(all.rows(range.start, 6).iter().copied());
        let vector = |range: &Range<usize>| Vector3::from_iterator(all.rows(range.start, 3).iter().copied());
        let tool = |(pose, range): (&Pose, &Range<usize>)| match range.len() {
            3 => Pose::new(pose.rotation, pose.translation + vector(range)),
            _ => pose.perturbed(&twist(range)),
        };
        Self {
            tools: self.tools.iter().zip(&columns.tools).map(tool).collect(),
            work: self.work.perturbed(&twist(&columns.work)),
            places: self.places.iter().zip(&columns.places).map(|(p, range)| p + vector(range)).collect(),
        }
    }

    /// Where a body is in the work object, as the written robot has it.
    pub fn virtual_touch(&self, robot: &KnownRobot, posture: &Posture, body: usize, is_pose: bool) -> TouchPlace {
        let tool = robot.at(posture).0 * self.tools[body];
        let seen = self.work.inverse() * tool;
        if is_pose { TouchPlace::Pose(seen) } else { TouchPlace::Point(seen.translation) }
    }
}

/// The equations `r = A x + G dtheta + H dq` of one measurement.
#[derive(Debug, Clone)]
pub(super) struct Rows {
    /// By all columns of the unknowns.
    pub a: DMatrix<f64>,
    /// By the columns of the robot.
    pub g: DMatrix<f64>,
    /// By the joint noise in its sigmas.
    pub h: DMatrix<f64>,
    /// What is missing, m and rad.
    pub r: DVector<f64>,
}

/// `R [I, -[x]x]`: a point at `x` moved by a body twist of its frame.
fn moved(rotation: &Matrix3<f64>, point: &Vector3<f64>) -> DMatrix<f64> {
    let mut d = DMatrix::zeros(3, 6);
    d.view_mut((0, 0), (3, 3)).copy_from(rotation);
    d.view_mut((0, 3), (3, 3)).copy_from(&(-rotation * skew(point)));
    d
}

/// Equations of a measurement at a posture.
pub(super) fn rows(
    robot: &KnownRobot,
    unknowns: &Unknowns,
    columns: &Columns,
    posture: &Posture,
    (body, seen): (usize, &TouchPlace),
) -> Rows {
    let (tip, kinematics) = robot.at(posture);
    let (tool, work) = (&unknowns.tools[body], &unknowns.work);
    let place = match seen {
        TouchPlace::Point(place) => Ok(*place),
        TouchPlace::Unknown(contact) => Ok(unknowns.places[*contact]),
        TouchPlace::Pose(pose) => Err(pose),
    };
    let k = if place.is_ok() { 3 } else { 6 };
    let mut a = DMatrix::zeros(k, columns.len);
    let (by_tip, by_work, r);
    match place {
        Ok(place) => {
            by_tip = moved(&tip.rotation, &tool.translation);
            by_work = -moved(&work.rotation, &place);
            let missing = work.transform(&place) - tip.transform(&tool.translation);
            r = DVector::from_column_slice(missing.as_slice());
            let own = &columns.tools[body];
            let turned = if own.len() == 6 { tip.rotation * tool.rotation } else { tip.rotation };
            a.view_mut((0, own.start), (3, 3)).copy_from(&turned);
            if let TouchPlace::Unknown(contact) = seen {
                a.view_mut((0, columns.places[*contact].start), (3, 3)).copy_from(&-work.rotation);
            }
        }
        Err(pose) => {
            let base_from_tool = tip * *tool;
            by_tip = dense(&adjoint(&tool.inverse()));
            by_work = -dense(&adjoint(&(base_from_tool.inverse() * *work)));
            let missing = -((*work * *pose).inverse() * base_from_tool).log();
            r = DVector::from_column_slice(missing.as_slice());
            a.view_mut((0, columns.tools[body].start), (6, 6)).copy_from(&Matrix6::identity());
        }
    }
    let mut g = &by_tip * robot.d_theta(&kinematics);
    match robot.plate_column() {
        // The work object is the plate of the solution: it is known as the robot is.
        Some(first) => g.view_mut((0, first), (k, 6)).copy_from(&by_work),
        None => a.view_mut((0, columns.work.start), (k, 6)).copy_from(&by_work),
    }
    Rows { a, g, h: &by_tip * robot.d_noise(&kinematics), r }
}

/// Sigmas of the rows of a measurement as stated.
pub(super) fn sigmas(touch: &Touch) -> Vec<f64> {
    match touch.seen {
        TouchPlace::Pose(_) => [[touch.sigma_m; 3], [touch.sigma_rad; 3]].concat(),
        _ => vec![touch.sigma_m; 3],
    }
}
