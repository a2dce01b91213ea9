//! Joint vectors at which a robot is to be right.

use std::path::Path;

use crate::error::{Code, Error, Result};
use crate::series::Stops;
use crate::urdf::{Chain, JointKind};

/// Fewest targets whose error says something: the nine numbers of the frames take up less than a third of theirs.
const LEAST_TARGETS: usize = 10;

/// Joint vectors of a file, in degrees (m for prismatic joints), as rad and m in the order of the chain.
pub(super) fn targets(path: &Path, chain: &Chain) -> Result<Vec<Vec<f64>>> {
    let stops = Stops::read(path, &mut Vec::new())?;
    let column = |name: &String| {
        let at = stops.joints.iter().position(|j| j == name);
        at.ok_or_else(|| {
            Error::new(
                Code::JointMissing,
                path.display(),
                format!("has no column \"{name}\""),
                "name every joint of the chain",
            )
        })
    };
    let columns: Vec<usize> = chain.readings.iter().map(column).collect::<Result<_>>()?;
    let in_si = |raw: &Vec<f64>| {
        let one = |(c, kind): (&usize, &JointKind)| {
            if *kind == JointKind::Revolute { raw[*c].to_radians() } else { raw[*c] }
        };
        columns.iter().zip(&chain.reading_kinds).map(one).collect()
    };
    let targets: Vec<Vec<f64>> = stops.stops.iter().filter_map(|s| s.raw_readings.as_ref()).map(in_si).collect();
    if targets.len() < LEAST_TARGETS {
        let what = format!(
            "{} targets are too few: base frame and a point of the flange are brought together there, which three fit exactly",
            targets.len()
        );
        return Err(Error::new(
            Code::TargetsTooFew,
            path.display(),
            what,
            format!("give at least {LEAST_TARGETS}, spread over where the robot works"),
        ));
    }
    Ok(targets)
}
