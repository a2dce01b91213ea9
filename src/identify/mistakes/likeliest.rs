//! Of mistakes that explain a misfit, the one that is named, with what the data do not tell from it.

use std::mem::discriminant;

use super::readings::signs_of_others;
use crate::assess::Limits;
use crate::diagnose::{HALF_TURN_DEG, MistakeKind};
use crate::error::Code;
use crate::model::mirror::mirror_images;
use crate::model::robot::Robot;

/// What is left with a mistake undone, and the mistake.
pub(in crate::identify) type Explained = (f64, MistakeKind);

/// The index of the mistake that is named, and what is said of it: the one that leaves least, or one of fewer joints that leaves as much. Where the
/// mirror image of the arm fits alike, that is said, too.
pub(in crate::identify) fn likeliest(
    tried: &[Explained],
    robot: &Robot,
    limits: &Limits,
) -> Option<(usize, MistakeKind)> {
    let by_left = |a: &usize, b: &usize| tried[*a].0.total_cmp(&tried[*b].0);
    let best = (0..tried.len()).min_by(by_left)?;
    let (least, kind) = &tried[best];
    let is_alike = |k: &usize| {
        let (left, other) = &tried[*k];
        joints(kind).is_some()
            && discriminant(other) == discriminant(kind)
            && limits.zeros_explain_share * left <= *least
    };
    let fewest = |a: &usize, b: &usize| joints(&tried[*a].1).cmp(&joints(&tried[*b].1)).then(by_left(a, b));
    let named = (0..tried.len()).filter(is_alike).min_by(fewest).unwrap_or(best);
    let kind = with_mirror_image(tried, named, robot, limits);
    let is_as_tried = kind == tried[named].1;
    Some((named, with_sign_or_zero(tried, named, limits).filter(|_| is_as_tried).unwrap_or(kind)))
}

/// How many joints it is about, where fewer may fit alike.
fn joints(kind: &MistakeKind) -> Option<usize> {
    match kind {
        MistakeKind::Signs(joints) | MistakeKind::Columns(joints) => Some(joints.len()),
        _ => None,
    }
}

/// What fits about as well as a mistake.
fn alike<'t>(tried: &'t [Explained], named: usize, limits: &Limits) -> impl Iterator<Item = &'t MistakeKind> {
    let least = tried[named].0 / limits.mistake_explains;
    tried.iter().filter(move |(left, _)| *left <= least).map(|(_, kind)| kind)
}

/// Where a wrong sign and a zero half a turn off fit alike, both.
pub(super) fn with_sign_or_zero(tried: &[Explained], named: usize, limits: &Limits) -> Option<MistakeKind> {
    let zero = |kind: &MistakeKind| match kind {
        MistakeKind::Zero { joint, lacking_deg } if lacking_deg.abs() == HALF_TURN_DEG => {
            Some((joint.clone(), *lacking_deg))
        }
        _ => None,
    };
    let sign = |kind: &MistakeKind| match kind {
        MistakeKind::Signs(joints) if joints.len() == 1 => Some(joints.clone()),
        _ => None,
    };
    let kind = &tried[named].1;
    let (joints, zero) = match (sign(kind), zero(kind)) {
        (Some(joints), _) => (joints, alike(tried, named, limits).find_map(zero)?),
        (_, Some(zero)) => (alike(tried, named, limits).find_map(sign)?, zero),
        _ => return None,
    };
    Some(MistakeKind::SignsOrZero { joints, zero: zero.0, lacking_deg: zero.1 })
}

/// The mistake with what fits alike as the mirror image of the arm, where that was tried.
fn with_mirror_image(tried: &[Explained], named: usize, robot: &Robot, limits: &Limits) -> MistakeKind {
    let kind = &tried[named].1;
    let mirrors = mirror_images(&robot.chain, limits.suspicious_misfit);
    let alike = || alike(tried, named, limits);
    let is_alike = |joints: &Vec<String>| alike().any(|kind| *kind == MistakeKind::Signs(joints.clone()));
    let others = |joints: &[String]| {
        let others = mirrors.iter().map(|mirror| signs_of_others(robot, joints, mirror));
        others.filter(|others| !others.is_empty()).find(is_alike)
    };
    let with_others = match kind {
        MistakeKind::Poses { .. } => axes_of(kind).zip(others(&[])),
        MistakeKind::Signs(joints) => {
            let is_mirror = mirrors.iter().any(|mirror| signs_of_others(robot, &[], mirror) == *joints);
            alike().find_map(axes_of).filter(|_| is_mirror).zip(Some(joints.clone()))
        }
        _ => None,
    };
    match (with_others, kind) {
        (Some((axes, joints)), _) => MistakeKind::MirrorImage { joints, axes: axes.to_owned() },
        (None, MistakeKind::Signs(joints)) => others(joints)
            .map_or_else(|| kind.clone(), |others| MistakeKind::SignsOrMirror { joints: joints.clone(), others }),
        _ => kind.clone(),
    }
}

/// What to do with left-handed axes, where the mistake is these.
fn axes_of(kind: &MistakeKind) -> Option<&str> {
    match kind {
        MistakeKind::Poses { code: Code::AxesMirrored, remedy, .. } => Some(remedy),
        _ => None,
    }
}
