//! The URDF that by itself comes nearest to the whole model.
//!
//! A URDF holds origins, and no errors of drives. Left out, these are missed at every reading; but much of what they do where the stops were,
//! other origins do as well. With the body twist `d(q)` from the robot without them to the whole one and the derivatives `A(q)` of its pose by
//! the twists of the origins, these minimise the mean of `|A x - d|^2` over the region of the stops, turns at the length of a tool. What that
//! does not tell stays as it is: with the prior `S`, `e^2 x' S^-1 x` is added.

use nalgebra::{DMatrix, DVector, Vector6};

use crate::linalg::SymmetricFactor;
use crate::model::joint_terms::Term;
use crate::model::robot::{Posture, Robot};
use crate::problem::Layout;

/// Gauss-Newton steps: errors of drives are small, and the second one changes nothing any more.
const STEPS: usize = 2;

/// Length of a tool, m: at its end turns count as displacements.
const TOOL_M: f64 = 0.2;

/// Displacement, m, that an origin must do away with before it moves by the sigma of its prior, `e`: a hundredth of a millimetre, which no robot
/// repeats to. Less would move origins far for next to nothing, and shows outside the region.
const HELD_M: f64 = 1e-5;

/// The robot without errors of its drives, its origins moved so that it comes nearest to the whole one at samples; `None` where it has none, or
/// no origin is free.
pub fn urdf_alone(whole: &Robot, layout: &Layout, samples: &[Posture]) -> Option<Robot> {
    let whole = whole.without_local_errors();
    let mut alone = whole.clone();
    alone.terms.retain(|t| t.term == Term::Offset);
    if alone.terms.len() == whole.terms.len() || samples.is_empty() {
        return None;
    }
    let columns: Vec<usize> = layout.twists.clone().filter(|&c| layout.columns[c].free).collect();
    let noiseless = |s: &Posture| vec![0.0; s.readings.len()];
    let weights = Vector6::from_fn(|k, _| if k < 3 { 1.0 } else { TOOL_M * TOOL_M }) / samples.len() as f64;
    let weights = DMatrix::from_diagonal(&DVector::from_column_slice(weights.as_slice()));
    for _ in 0..STEPS {
        let hold = |&c: &usize| (HELD_M / layout.columns[c].prior_sigma).powi(2);
        let mut normal = DMatrix::from_diagonal(&DVector::from_iterator(columns.len(), columns.iter().map(hold)));
        let moved = |&c: &usize| {
            let (joint, axis) = ((c - layout.twists.start) / 6, (c - layout.twists.start) % 6);
            alone.twists[joint][axis] - whole.twists[joint][axis]
        };
        let mut rhs = -DVector::from_iterator(columns.len(), columns.iter().map(|c| hold(c) * moved(c)));
        for sample in samples {
            let kinematics = alone.kinematics(sample, &noiseless(sample));
            let d = (kinematics.base_from_tip.inverse() * whole.pose_at(sample, &noiseless(sample))).log();
            let mut a = DMatrix::zeros(6, columns.len());
            for (&c, mut column) in columns.iter().zip(a.column_iter_mut()) {
                let twist = c - layout.twists.start;
                column.copy_from(&kinematics.d_twists[twist / 6].column(twist % 6));
            }
            let weighted = &weights * &a;
            rhs += weighted.tr_mul(&d);
            normal += a.tr_mul(&weighted);
        }
        let x = SymmetricFactor::new(&normal).ok().filter(|_| !columns.is_empty())?.solve(&rhs);
        for (&c, x) in columns.iter().zip(x.iter()) {
            let twist = c - layout.twists.start;
            alone.twists[twist / 6][twist % 6] += x;
        }
    }
    Some(alone)
}
