//! Whether the descriptions and the programs that `compensate` was given are those that were meant.

use std::path::Path;

use super::compensate_frames::{SAME_ORIGIN, Side, Sides, solution};
use crate::diagnose::Weight;
use crate::error::{Code, Result};
use crate::geom::Pose;
use crate::model::robot::Robot;
use crate::output::compensated;
use crate::output::corrections::FileFinding;
use crate::output::written_programs::{WrittenAs, written_as};
use crate::programs::TextFile;
use crate::urdf::Chain;

/// Beside a corrected description.
const COMPENSATION: &str = "compensation.toml";

/// What is known of the origin of each joint by name is what the chain has.
fn has_origins(chain: &Chain, origin: impl Fn(&str) -> Option<Pose>) -> bool {
    let driven = chain.joints.iter().filter(|joint| joint.drive.is_some());
    driven.into_iter().all(|joint| {
        let distance = origin(&joint.name).map(|known| known.distance(&joint.origin));
        distance.is_some_and(|(rad, m)| rad < SAME_ORIGIN && m < SAME_ORIGIN)
    })
}

/// The robot that runs the program is the one for which it was made: nothing is to be corrected.
pub(super) fn equal(made_for: &Robot, sides: &Sides) -> Option<FileFinding> {
    let Side { robot, urdf, .. } = sides.to;
    let of_other = |name: &str| made_for.chain.joints.iter().find(|j| j.name == name).map(|j| j.origin);
    let text = format!(
        "{} is the robot for which the program was made, to the last origin: nothing is corrected (give the corrected URDF with --urdf, the one of the controller with --nominal)",
        urdf.display()
    );
    let is_same = has_origins(&robot.chain, of_other) && robot.terms == made_for.terms;
    is_same.then(|| FileFinding::new(Code::ModelsEqual, Weight::Gate, urdf.display(), [], text))
}

/// A program is what an earlier correction wrote: for the nominal robot it would be corrected twice. One that was taught on a real robot
/// (`--from`) may be.
pub(super) fn corrected_already(path: &Path, file: &TextFile, is_taught: bool) -> Option<FileFinding> {
    let (weight, is) = match written_as(path, &file.bytes)? {
        WrittenAs::Itself if !is_taught => (Weight::Gate, "is a corrected program, and would be corrected twice"),
        WrittenAs::Itself => {
            (Weight::Note, "is a corrected program: right where it was corrected for the robot of --from")
        }
        WrittenAs::Other => (
            Weight::Note,
            "has the name of a corrected program that the records beside it list: was it made of that, it is corrected twice",
        ),
    };
    let text = format!("{} {is} (give the program from which it was made)", path.display());
    Some(FileFinding::new(Code::CorrectedAlready, weight, path.display(), [], text))
}

/// `--nominal` is what a solution made of `--urdf`.
pub(super) fn exchanged(controller: &Robot, nominal: &Path, sides: &Sides) -> Result<Option<FileFinding>> {
    let side = Side { robot: controller, urdf: nominal, solution: None };
    let Ok(record) = solution(&side, None)? else { return Ok(None) };
    let started_from =
        |name: &str| record.robot.joints.iter().find(|j| j.name == name).map(|j| Pose::from(&j.nominal_origin));
    let Side { robot, urdf, .. } = sides.to;
    let is_exchanged = has_origins(&robot.chain, started_from) && !has_origins(&controller.chain, started_from);
    let text = format!(
        "{} was made from {}: the two are exchanged, and the correction goes the wrong way (--nominal is the model in the controller, --urdf the corrected one)",
        nominal.display(),
        urdf.display()
    );
    Ok(is_exchanged.then(|| FileFinding::new(Code::ModelsExchanged, Weight::Gate, nominal.display(), [], text)))
}

/// A compensation.toml of this very description stands beside it, and was not given.
pub(super) fn not_given(side: &Side, given: Option<&Path>, flag: &str) -> Option<FileFinding> {
    let beside = side.urdf.with_file_name(COMPENSATION);
    let is_there = given.is_none() && beside.is_file();
    let whole = is_there.then(|| compensated(side.robot.chain.clone(), Some(&beside))).and_then(Result::ok);
    let text = format!(
        "{} goes with {}, and was not given: what gears, sag and backlash do is left out ({flag})",
        beside.display(),
        side.urdf.display()
    );
    whole
        .filter(|robot| !robot.terms.is_empty())
        .map(|_| FileFinding::new(Code::CompensationNotGiven, Weight::Note, side.urdf.display(), [], text))
}
