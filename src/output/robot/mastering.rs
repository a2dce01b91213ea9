//! mastering.csv: joint offsets for the controller, and the robot that is left once it has them.

use crate::identify::Solution;
use crate::model::robot::Robot;
use crate::output::{Context, Offsets};
use crate::series::to_csv;
use crate::urdf::JointKind;

/// Sigma of an offset that is worth entering whatever the offset is: half a millimetre at a metre.
const USEFUL_SIGMA_RAD: f64 = 0.5e-3;
const USEFUL_SIGMA_M: f64 = 0.05e-3;
/// Sigmas by which a less well known offset must differ from none.
const LEAST_SIGMAS: f64 = 2.0;
/// Steps in a unit of the table: six decimals are written.
const STEPS: f64 = 1e6;

/// The robot as the files of this result describe it: offsets folded into origins, those that the controller is to be given left out.
pub(super) fn exported(solution: &Solution, context: &Context) -> Robot {
    solution.fit.state.robot.mastered_by(&to_enter(solution, context))
}

/// What the controller is to add to its readings, rad or m: the offsets that are determined, as mastering.csv writes them, with the zeros that
/// were found before the fit; none for the other joints, whose offsets the origins hold.
pub fn to_enter(solution: &Solution, context: &Context) -> Vec<f64> {
    let entered = |row: Row| if row.is_entered(context) { row.written() } else { 0.0 };
    rows(solution).into_iter().map(entered).collect()
}

/// The offset of one reading.
struct Row {
    /// What the controller would add, rad or m.
    offset: f64,
    /// Its sigma; none where it was held.
    sigma: Option<f64>,
    determined: bool,
    kind: JointKind,
}

impl Row {
    /// Unit of the table and how many there are in a radian or metre.
    fn unit(&self) -> (&'static str, f64) {
        if self.kind == JointKind::Prismatic { ("mm", 1e3) } else { ("deg", 1f64.to_degrees()) }
    }

    /// The offset to the decimals of the table, rad or m: what it does not hold stays in the origins.
    fn written(&self) -> f64 {
        let (_, factor) = self.unit();
        (self.offset * factor * STEPS).round() / STEPS / factor
    }

    fn is_entered(&self, context: &Context) -> bool {
        context.offsets == Offsets::Mastering && self.determined
    }
}

fn rows(solution: &Solution) -> Vec<Row> {
    let (robot, layout) = (&solution.fit.state.robot, &solution.fit.problem.layout);
    let offsets = robot.zero_corrections();
    let row = |(reading, name): (usize, &String)| {
        let (kind, offset) = (robot.chain.reading_kinds[reading], offsets[reading]);
        let column = layout.find(&format!("robot/{name}.offset")).filter(|c| layout.columns[*c].free);
        let sigma = column.map(|c| solution.fit.covariance.reduced[(c, c)].max(0.0).sqrt());
        let determined = column.zip(sigma).is_some_and(|(c, sigma)| {
            is_determined(offset, sigma, layout.columns[c].prior_sigma, kind == JointKind::Prismatic)
        });
        Row { offset, sigma, determined, kind }
    };
    robot.chain.readings.iter().enumerate().map(row).collect()
}

/// An offset that the data decide (they say at least as much as the tolerance that was assumed), and whose entry makes the
/// robot better: known well, or far larger than its sigma.
fn is_determined(offset: f64, sigma: f64, prior: f64, prismatic: bool) -> bool {
    let useful = if prismatic { USEFUL_SIGMA_M } else { USEFUL_SIGMA_RAD };
    sigma < 0.5 * prior && (sigma <= useful || offset.abs() > LEAST_SIGMAS * sigma)
}

/// Joint offsets for the controller: one row for every joint.
pub(super) fn mastering_csv(solution: &Solution, context: &Context) -> String {
    let mut table = vec![["joint", "offset", "sigma", "unit", "determined", "in_urdf"].map(String::from).to_vec()];
    let word = |is_so: bool| if is_so { "yes" } else { "no" }.to_owned();
    for (row, name) in rows(solution).into_iter().zip(&solution.fit.state.robot.chain.readings) {
        let (unit, factor) = row.unit();
        let shown = |v: f64| format!("{:.6}", v * factor + 0.0);
        let sigma = row.sigma.map_or_else(String::new, shown);
        let (determined, in_urdf) = (word(row.determined), word(!row.is_entered(context)));
        table.push(vec![name.clone(), shown(row.offset), sigma, unit.into(), determined, in_urdf]);
    }
    let note = match context.offsets {
        Offsets::Folded => {
            "# They are in the corrected URDF already (in_urdf = yes): entering them in the controller as well would count them twice.\n"
        }
        Offsets::Mastering => {
            "# The corrected URDF belongs to a controller with those entered that it does not hold (in_urdf = no), and no others: those that are\n\
             # not determined are in it (in_urdf = yes), and entering them would count them twice.\n"
        }
    };
    format!(
        "# Joint offsets for the mastering (zero point) table of the controller: where it shows the angle q, the joint stands at q + offset,\n\
         # so that after the correction it has to show q + offset. Not determined (no): known only together with base, tool\n\
         # or the origins beside it, or within twice its sigma of none and that sigma beyond 0.5 mrad (0.05 mm); leave it. Without a sigma: held, not estimated.\n{note}{}",
        to_csv(&table)
    )
}

#[cfg(test)]
mod tests {
    use super::is_determined;

    #[test]
    fn an_offset_is_determined_where_entering_it_helps() {
        let determined = |offset: f64, sigma: f64| is_determined(offset.to_radians(), sigma.to_radians(), 10e-3, false);
        assert!(!determined(-0.0094, 0.132), "nothing beside its sigma");
        assert!(!determined(0.0, 0.57), "the prior alone");
        assert!(!determined(1.5, 0.5), "far from none, but the data say too little");
        assert!(determined(0.4, 0.13));
        assert!(determined(0.001, 0.02), "known to be none");
    }
}
