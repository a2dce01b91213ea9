//! What tool and work object take up of the robot's errors, on average over the stops.

use nalgebra::DMatrix;

use super::equations::{Columns, Rows, Unknowns, rows};
use super::robot::KnownRobot;
use crate::linalg::{SymmetricFactor, product};
use crate::model::robot::Posture;

/// Most postures that stand for the region.
const MOST: usize = 120;
/// Share of the information that holds what these samples do not tell.
const HELD: f64 = 1e-9;

/// Where the robot is used, as far as anybody said: the stops of the identification, and these postures.
///
/// Not the box of their joint ranges: its corners are far from all of them, the robot is known badly there, and frames that are right on
/// average over them are wrong where programs run.
pub(super) fn region(robot: &KnownRobot, others: &[Posture]) -> Vec<Posture> {
    let count = robot.stops.len() + others.len();
    robot.stops.iter().chain(others).step_by(count.div_ceil(MOST).max(1)).cloned().collect()
}

/// `M L` by the columns of tool and work object; `None` where nothing is finite.
pub(super) fn absorbed(
    robot: &KnownRobot,
    unknowns: &Unknowns,
    columns: &Columns,
    region: &[Posture],
) -> Option<DMatrix<f64>> {
    let taking = columns.frames();
    let (mut n, mut right) = (DMatrix::zeros(taking, taking), DMatrix::zeros(taking, robot.columns().len()));
    for posture in region {
        for (body, own) in columns.tools.iter().enumerate() {
            let seen = unknowns.virtual_touch(robot, posture, body, own.len() == 6);
            let Rows { a, g, .. } = rows(robot, unknowns, columns, posture, (body, &seen));
            let mut a = a.columns(0, taking).into_owned();
            if !columns.tool_is_free() {
                a.columns_mut(0, columns.work.start).fill(0.0);
            }
            n += a.tr_mul(&a);
            right += a.tr_mul(&g);
        }
    }
    let scale = Some(n.diagonal().max()).filter(|s| *s > 0.0).unwrap_or(1.0);
    (0..taking).for_each(|k| n[(k, k)] += HELD * scale);
    let m = SymmetricFactor::new(&n).ok()?.solve_many(&right);
    Some(product(&m, robot.factor()))
}
