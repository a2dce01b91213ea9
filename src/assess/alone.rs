//! The URDF that by itself comes nearest to the whole model.
//!
//! A URDF holds origins, and no errors of drives. Left out, these are missed at every reading; but much of what they do where the stops were,
//! other origins do as well. With the body twist `d(q)` from the robot without them to the whole one and the derivatives `A(q)` of its pose by
//! the twists of the origins, these minimise the mean of `|A x - d|^2` over the region of the stops, turns at the length of a tool. What that
//! does not tell stays as it is: with the prior `S`, `e^2 x' S^-1 x` is added.

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};

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
    let free: Vec<usize> = layout.twists.clone().filter(|&c| layout.columns[c].free).collect();
    let place = |c: &usize| ((c - layout.twists.start) / 6, (c - layout.twists.start) % 6);
    let hold = |&c: &usize| (HELD_M / layout.columns[c].prior_sigma).powi(2);
    let hold = DVector::from_iterator(free.len(), free.iter().map(hold));
    let noiseless = |s: &Posture| vec![0.0; s.readings.len()];
    let weights = Vector6::from_fn(|k, _| if k < 3 { 1.0 } else { TOOL_M * TOOL_M }) / samples.len() as f64;
    for _ in 0..STEPS {
        let moved = free.iter().map(place).map(|(joint, k)| alone.twists[joint][k] - whole.twists[joint][k]);
        let mut rhs = -hold.component_mul(&DVector::from_iterator(free.len(), moved));
        let mut normal = DMatrix::from_diagonal(&hold);
        for sample in samples {
            let kinematics = alone.kinematics(sample, &noiseless(sample));
            let d = (kinematics.base_from_tip.inverse() * whole.pose_at(sample, &noiseless(sample))).log();
            let mut a = DMatrix::zeros(6, free.len());
            for (&c, mut column) in free.iter().zip(a.column_iter_mut()) {
                column.copy_from(&layout.derivative(&kinematics, c));
            }
            let weighted = Matrix6::from_diagonal(&weights) * &a;
            rhs += weighted.tr_mul(&d);
            normal += a.tr_mul(&weighted);
        }
        let x = SymmetricFactor::new(&normal).ok().filter(|_| !free.is_empty())?.solve(&rhs);
        free.iter().map(place).zip(x.iter()).for_each(|((joint, k), x)| alone.twists[joint][k] += x);
    }
    Some(alone)
}
