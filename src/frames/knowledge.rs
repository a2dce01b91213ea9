//! What frames and covariance say of the tool at a target.
//!
//! `A u + G dtheta` is the error of the tool in the work object: `u` that of tool and work object, `dtheta` that of the robot. Without
//! frames `u` is zero, and base and flange are known by the priors of the robot's origins.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::equations::{Columns, Unknowns, rows};
use super::robot::KnownRobot;
use super::touch::TouchPlace;
use crate::geom::Pose;
use crate::linalg::product;
use crate::model::robot::Posture;

/// Covariance of tool and work object together with the robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Knowledge {
    /// Of `u`: three columns of the tool (six where its orientation was seen), then six of the work object.
    pub frames: DMatrix<f64>,
    /// Of `u` with `dtheta`: a column for each of [`KnownRobot::columns`].
    pub cross: DMatrix<f64>,
    /// What the touches say of `dtheta` beyond the solution, which the robot as written has not.
    pub learned: DVector<f64>,
    /// What of it tool and work object have taken up, by their columns.
    pub taken: DVector<f64>,
}

impl Knowledge {
    /// Of the first body. `inverse` is `P` of the free columns and `z`, `absorbed` is `M L`.
    pub(super) fn new(
        robot: &KnownRobot,
        columns: &Columns,
        (inverse, step): (&DMatrix<f64>, &DVector<f64>),
        absorbed: &DMatrix<f64>,
    ) -> Self {
        let (x, z) = (columns.free.len(), absorbed.ncols());
        let kept: Vec<usize> = columns.tools[0].clone().chain(columns.work.clone()).collect();
        // u = S (dx, z): the step of the free frames less what they take up.
        let mut s = DMatrix::zeros(kept.len(), x + z);
        for (row, &column) in kept.iter().enumerate() {
            let Some(k) = columns.free.iter().position(|c| *c == column) else { continue };
            s[(row, k)] = 1.0;
            s.view_mut((row, x), (1, z)).copy_from(&-absorbed.row(column));
        }
        // The robot is written as it is, not as the touches would move it.
        let mut p = inverse.clone();
        p.view_mut((x, x), (z, z)).copy_from(&DMatrix::identity(z, z));
        let sp = product(&s, &p);
        let frames = product(&sp, &s.transpose());
        let cross = product(&sp.columns(x, z).into_owned(), &robot.factor().transpose());
        let found = step.rows(x, z).into_owned();
        let taken = absorbed * &found;
        let taken = DVector::from_iterator(kept.len(), kept.iter().map(|&column| taken[column]));
        Self { frames: (&frames + frames.transpose()) * 0.5, cross, learned: robot.factor() * &found, taken }
    }

    /// Tool and work object where the description says: nothing was measured of them.
    pub fn none(robot: &KnownRobot) -> Self {
        let n = robot.columns().len();
        let (learned, taken) = (DVector::zeros(n), DVector::zeros(9));
        Self { frames: DMatrix::zeros(9, 9), cross: DMatrix::zeros(9, n), learned, taken }
    }

    /// Covariance of the position of the tool in the work object at a posture, along the axes of the base, m^2.
    pub fn position_covariance(&self, robot: &KnownRobot, posture: &Posture, tool: &Pose, work: &Pose) -> Matrix3<f64> {
        let (columns, unknowns) = single(self.frames.nrows() - 6, tool, work);
        let seen =
            TouchPlace::Point(unknowns.work.inverse().transform(&robot.at(posture).0.transform(&tool.translation)));
        let rows = rows(robot, &unknowns, &columns, posture, (0, &seen));
        let a = rows.a.columns(0, columns.frames()).into_owned();
        let mixed = product(&product(&a, &self.cross), &rows.g.transpose());
        let c = product(&product(&a, &self.frames), &a.transpose())
            + product(&product(&rows.g, robot.covariance()), &rows.g.transpose())
            + &mixed
            + mixed.transpose();
        Matrix3::from_column_slice(c.as_slice())
    }

    /// Where the tool is beside where the robot as written has it, as far as the touches tell: `G' dtheta` along the axes of the base, m.
    pub fn error_m(&self, robot: &KnownRobot, posture: &Posture, tool: &Pose, work: &Pose) -> Vector3<f64> {
        let (columns, unknowns) = single(self.frames.nrows() - 6, tool, work);
        let seen =
            TouchPlace::Point(unknowns.work.inverse().transform(&robot.at(posture).0.transform(&tool.translation)));
        let rows = rows(robot, &unknowns, &columns, posture, (0, &seen));
        let e = &rows.g * &self.learned - rows.a.columns(0, columns.frames()) * &self.taken;
        Vector3::new(e[0], e[1], e[2])
    }

    /// Root of its trace, m.
    pub fn sigma_m(&self, robot: &KnownRobot, posture: &Posture, tool: &Pose, work: &Pose) -> f64 {
        self.position_covariance(robot, posture, tool, work).trace().max(0.0).sqrt()
    }
}

/// What the joint noise does to the tool at a posture: root of the summed variances, m.
pub fn scatter_m(robot: &KnownRobot, posture: &Posture, tool: &Pose) -> f64 {
    let (columns, unknowns) = single(3, tool, &Pose::identity());
    let rows = rows(robot, &unknowns, &columns, posture, (0, &TouchPlace::Point(Vector3::zeros())));
    rows.h.norm()
}

/// One body, whose tool has so many columns.
fn single(of_tool: usize, tool: &Pose, work: &Pose) -> (Columns, Unknowns) {
    (Columns::of_one(of_tool), Unknowns { tools: vec![*tool], work: *work, places: Vec::new() })
}
