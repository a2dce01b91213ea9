//! What the text of a program alone does not say.

use super::external::ARM_AXES;
use crate::geom::Pose;
use crate::urdf::Chain;

/// What the text alone does not say.
#[derive(Debug, Clone)]
pub struct ProgramSetting<'a> {
    /// Chain of the controller's model, for names, kinds and the order of the joints.
    pub chain: &'a Chain,
    /// Reading of every axis of the program's language, in its order (A1.. or the list of a joint target, then external axes).
    pub axes: &'a [usize],
    /// rad per unit of the joint columns of a CSV table.
    pub rad_per_unit: Option<f64>,
    /// Frame in which the controller computes, in the base of the chain.
    pub base: Pose,
    /// `flange_from_tool` where the text sets none.
    pub tool: Option<Pose>,
    /// `base_from_work` (work object, `$BASE`) where the text sets none.
    pub work: Option<Pose>,
    /// True where external axes that the chain lacks move neither robot nor work.
    pub axes_apart: bool,
}

impl ProgramSetting<'_> {
    /// External axes that the chain has.
    pub(super) fn external_axes(&self) -> usize {
        self.axes.len().saturating_sub(ARM_AXES)
    }
}
