//! What a tracker saw, and joint readings, that have nothing to do with each other: two sessions in one folder.

use nalgebra::Vector3;

use super::points_start::{FEWEST_POINTS, Placed, PointAt, distances, point_at};
use crate::assess::Limits;
use crate::error::{Code, Error, Quantity, Result};
use crate::linalg::lower_median;
use crate::problem::{Adjustment, InstrumentKind};

/// Refuses measurements that miss where the tip carries the body by as much as they lie apart, where no usual mistake explains it: of rows without any
/// relation frame and body fit no better.
///
/// # Errors
/// These measurements.
pub(super) fn name_unrelated(
    adjustment: &Adjustment,
    (measured, placed): (&[usize], &Placed),
    limits: &Limits,
) -> Result<()> {
    let Adjustment { problem, state } = adjustment;
    let of = |&k: &usize| point_at(adjustment, &problem.body_measurements[k]);
    let points: Vec<PointAt> = measured.iter().filter_map(of).collect();
    let Some(&first) = measured.first() else { return Ok(()) };
    let instrument = &problem.instruments[problem.body_measurements[first].instrument];
    let is_told = instrument.kind == InstrumentKind::Tracker && points.len() > 2 * FEWEST_POINTS;
    if !is_told || state.robot.chain.pose_coordinates().is_some() {
        return Ok(());
    }
    let misfit = lower_median(distances(&points, placed));
    let middle = points.iter().map(|(at, _)| at).sum::<Vector3<f64>>() / points.len() as f64;
    let apart = lower_median(points.iter().map(|(at, _)| (at - middle).norm()));
    if misfit < limits.suspicious_misfit || misfit < 0.5 * apart {
        return Ok(());
    }
    let what = format!(
        "what it saw and the joint readings have nothing to do with each other: it misses where the tip carries the target by {:.0} mm (median), the places are {:.0} mm from their middle, and no shift of the rows by one, nor another usual mistake, explains it",
        1e3 * misfit,
        1e3 * apart
    );
    let remedy = "look whether joints.csv and the table of the tracker are of one session and one robot, and that each row names its own stop";
    let place = instrument.place();
    let quantities = vec![Quantity::new("misfit", misfit, "m"), Quantity::new("apart", apart, "m")];
    Err(Error { quantities, ..Error::new(Code::ReadingsContradict, place, what, remedy) })
}
