//! Points that a program uses with several tools or work objects: each use asks for a correction, and the text has one.

use std::collections::BTreeMap;

use super::field::Edit;
use super::program::{PoseTarget, Target, TargetKind};
use super::reason::{LeftReason, Why};
use crate::geom::Pose;

/// How the pose of a target is written.
pub(super) struct Written {
    /// As a reader of the new text finds it.
    pub work_from_tool: Pose,
    /// Its codes.
    codes: Vec<Edit>,
}

impl Written {
    /// Of the pose of the flange that a reader of the new text finds.
    pub fn new(pose: &PoseTarget, base_from_flange: &Pose, codes: Vec<Edit>) -> Self {
        let work_from_tool = pose.base_from_work.inverse() * *base_from_flange * pose.flange_from_tool;
        Self { work_from_tool, codes }
    }
}

/// What becomes of the text of a target.
pub(super) enum Fate {
    /// Its own correction.
    Own,
    /// That of another use, which is the same.
    Said,
    /// It stays as it is.
    Left(Why),
}

/// What becomes of targets that have one text: all stay as they are, unless their corrections are the same to `within` m and rad.
pub(super) fn fates(targets: &[Target], written: &[Option<Written>], within: f64) -> Vec<Fate> {
    let mut uses = BTreeMap::<_, Vec<usize>>::new();
    for (k, target) in targets.iter().enumerate() {
        if matches!(&target.kind, TargetKind::Pose(pose) if pose.displaced.is_none()) {
            uses.entry((target.file, target.kind.first_byte())).or_default().push(k);
        }
    }
    let mut fates: Vec<Fate> = targets.iter().map(|_| Fate::Own).collect();
    for all in uses.into_values().filter(|all| all.len() > 1) {
        let ways: Option<Vec<&Written>> = all.iter().map(|&k| written[k].as_ref()).collect();
        let differs = ways.map_or(Some(None), |ways| apart(&ways, within).map(Some));
        match differs {
            None => all.iter().skip(1).for_each(|&k| fates[k] = Fate::Said),
            Some(by) => all.iter().for_each(|&k| fates[k] = Fate::Left(used_apart(&targets[k].name, by))),
        }
    }
    fates
}

/// How far the corrections of a point are apart, rad and m; `None` where they are the same.
fn apart(ways: &[&Written], within: f64) -> Option<(f64, f64)> {
    let (first, others) = ways.split_first()?;
    let far = others.iter().map(|other| other.work_from_tool.distance(&first.work_from_tool));
    let most = far.fold((0.0_f64, 0.0_f64), |a, b| (a.0.max(b.0), a.1.max(b.1)));
    let is_same = most.0 <= within && most.1 <= within && others.iter().all(|other| other.codes == first.codes);
    (!is_same).then_some(most)
}

fn used_apart(name: &str, by: Option<(f64, f64)>) -> Why {
    let ask = match by {
        Some((rad, m)) => format!("corrections that are {:.3} mm and {:.3} mrad apart", 1e3 * m, 1e3 * rad),
        None => "a correction that is not known for one of them".to_owned(),
    };
    let words = format!(
        "it is used with different tools or work objects, which ask for {ask}: it stays as it is for all (declare a second point for one of them)"
    );
    Why::of(name, LeftReason::FramesDiffer, words)
}
