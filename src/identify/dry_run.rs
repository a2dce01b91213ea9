//! Before any image is looked at: what the stops of a series can tell of the robot.

use super::controller::readings::readings_of;
use super::options::Options;
use crate::assess::{Identifiability, identifiability_of_stops};
use crate::error::{Code, Error, Result};
use crate::geom::Pose;
use crate::model::camera::{Camera, Lens};
use crate::model::robot::Posture;
use crate::problem::{Layout, Names, PlateShape, State};
use crate::series::{Series, StopOrder};
use crate::urdf::Chain;

/// Stops of series with the step from the stop before, in the order of the rows.
fn stops(series: &[Series], chain: &Chain) -> Result<Vec<Posture>> {
    let mut stops = Vec::new();
    for s in series {
        let order_known = s.manifest.robot.order == StopOrder::Visited;
        let readings = readings_of(s, chain)?;
        stops.extend(Posture::in_order(readings.iter().map(Option::as_deref), order_known).into_iter().flatten());
    }
    Ok(stops)
}

fn layout(options: &Options, chain: Chain, series: &[Series]) -> Result<(Layout, State)> {
    let views: Vec<&Series> = series.iter().flat_map(Series::views).collect();
    let cameras: Vec<String> = views.iter().map(|s| s.camera_name().to_owned()).collect();
    let mountings: Vec<String> = views.iter().map(|s| s.mounting().to_owned()).collect();
    let mut placements: Vec<String> = series.iter().flat_map(|s| &s.stops.stops).map(|s| s.placement.clone()).collect();
    placements.sort();
    placements.dedup();
    let lens = |s: &Series| s.manifest.camera().model.as_deref().and_then(Lens::from_name).unwrap_or(Lens::Brown);
    let mut state = State {
        robot: options.model.robot_with(chain, options.harmonics),
        mountings: vec![Pose::identity(); mountings.len()],
        placements: vec![Pose::identity(); placements.len()],
        instruments: Vec::new(),
        bodies: Vec::new(),
        cameras: views.iter().map(|s| Camera::pinhole(lens(s), 1, 1, 1.0)).collect(),
        plates: series.iter().map(|s| PlateShape::nominal(&s.plate)).collect(),
        joint_errors: Vec::new(),
        ties: Vec::new(),
    };
    let names: Vec<String> = series.iter().map(|s| s.name.clone()).collect();
    let mut layout = Layout::new(
        &state,
        &Names {
            mountings: &mountings,
            placements: &placements,
            cameras: &cameras,
            plates: &names,
            ..Names::default()
        },
    );
    options.selection.apply(&mut layout, &mut state, &options.limits)?;
    Ok((layout, state))
}

/// The files that say where the robot stood.
fn files(series: &[Series]) -> String {
    series.iter().map(|s| s.readings_file().display().to_string()).collect::<Vec<_>>().join(", ")
}

/// What the stops of `series` can tell of the robot, and what to add.
///
/// # Errors
/// Joint names that do not match, unknown parameters, no stop of the robot.
pub fn dry_run(chain: Chain, series: &[Series], options: &Options) -> Result<Identifiability> {
    let chain = chain.carrying(options.payload.as_ref())?;
    let stops = stops(series, &chain)?;
    if stops.is_empty() {
        return Err(Error::new(
            Code::ReadingsMissing,
            files(series),
            "no row has joint readings",
            "record the joints of every stop",
        ));
    }
    let (layout, state) = layout(options, chain, series)?;
    identifiability_of_stops(&state.robot, &layout, &stops, &options.limits).ok_or_else(|| {
        Error::new(Code::FitUndetermined, files(series), "what its stops tell is not finite", "check the readings")
    })
}
