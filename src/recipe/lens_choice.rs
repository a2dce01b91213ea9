//! Which lens: that which predicts observations best that the adjustment has not seen.

use super::build::{MeasuredSeries, build};
use super::free_poses::adjust_free_poses;
use crate::error::{Error, Notice, Result};
use crate::model::camera::Lens;
use crate::model::robot::Robot;
use crate::problem::predict;
use crate::urdf::Chain;

/// One observation of so many is kept aside, in every image and of every marker in other images.
const KEPT_ASIDE: usize = 4;
/// A simpler lens is taken where its error is within this share of the best.
const AS_GOOD: f64 = 0.01;
/// Share of the largest errors that does not count: what is wrongly identified says nothing of the lens.
const OUTLIERS: f64 = 0.02;

/// Sets the lens of every camera by hold-out, and says why. Lenses with a displacement field are not among them: they cost three
/// to five times as much, and are asked for by name.
///
/// # Errors
/// Those of the adjustment, when no lens explains the images at all.
pub fn choose_lens(chain: &Chain, series: &mut [MeasuredSeries]) -> Result<Vec<Notice>> {
    let mut trials: Vec<(Lens, Vec<(String, f64)>)> = Vec::new();
    let mut last_error = None;
    for lens in Lens::ALL.into_iter().filter(|l| !l.has_field()) {
        match held_out_errors(chain, series, lens) {
            Ok(errors) => trials.push((lens, errors)),
            Err(error) => last_error = Some(error),
        }
    }
    if let (true, Some(error)) = (trials.is_empty(), last_error) {
        return Err(error);
    }
    let mut notices = Vec::new();
    let names: Vec<String> = trials.first().map_or_else(Vec::new, |t| t.1.iter().map(|e| e.0.clone()).collect());
    for (camera, name) in names.iter().enumerate() {
        let errors: Vec<(Lens, f64)> = trials.iter().map(|(lens, e)| (*lens, e[camera].1)).collect();
        let best = errors.iter().fold(f64::INFINITY, |m, e| m.min(e.1));
        let Some((lens, error)) = errors.iter().find(|e| e.1 <= (1.0 + AS_GOOD) * best) else {
            let what = "shows nothing that could tell one lens from another";
            return Err(Error::unsolved(format!("camera {name}"), what, "name its lens with --camera"));
        };
        series.iter_mut().filter(|s| s.camera == *name).for_each(|s| s.lens = *lens);
        let all: Vec<String> = errors.iter().map(|(l, e)| format!("{} {e:.4}", l.name())).collect();
        let what = format!(
            "lens '{}' is taken: {error:.4} px RMS over every {KEPT_ASIDE}th observation, which the adjustment had not seen ({}); a simpler \
             lens wins where it is within {:.0} % of the best",
            lens.name(),
            all.join(", "),
            100.0 * AS_GOOD
        );
        notices.push(Notice::new(format!("camera {name}"), what, ""));
    }
    Ok(notices)
}

/// Error of every camera over the observations kept aside, px RMS per point.
fn held_out_errors(chain: &Chain, series: &[MeasuredSeries], lens: Lens) -> Result<Vec<(String, f64)>> {
    let robot = Robot::nominal(chain.clone());
    let mut all = series.to_vec();
    all.iter_mut().for_each(|s| s.lens = lens);
    let (full, _) = build(&robot, &all, false)?;
    let aside = |image: usize, marker: usize| (marker + 7 * image).is_multiple_of(KEPT_ASIDE);
    let (mut problem, state) = build(&robot, &all, false)?;
    for (i, image) in problem.images.iter_mut().enumerate() {
        image.observations.retain(|o| !aside(i, o.marker));
    }
    let stated: Vec<Option<f64>> = (problem.cameras.iter())
        .map(|name| series.iter().find(|s| &s.camera == name && s.focal_px.is_some()).and_then(|s| s.focal_px))
        .collect();
    let (free, _) = adjust_free_poses(&mut problem, state, &stated)?;
    let mut squares: Vec<Vec<f64>> = vec![Vec::new(); problem.cameras.len()];
    for (i, image) in full.images.iter().enumerate() {
        let Some(pose) = &free.poses[i] else { continue };
        for o in image.observations.iter().filter(|o| aside(i, o.marker)) {
            let predicted = predict(image, &free.state, &pose.camera_from_plate, o);
            squares[image.camera].extend(predicted.map(|p| (p.uv - o.uv).norm_squared()));
        }
    }
    Ok(problem.cameras.iter().cloned().zip(squares.into_iter().map(trimmed_rms)).collect())
}

fn trimmed_rms(mut squares: Vec<f64>) -> f64 {
    squares.sort_by(f64::total_cmp);
    squares.truncate(((1.0 - OUTLIERS) * squares.len() as f64).ceil() as usize);
    if squares.is_empty() { f64::INFINITY } else { (squares.iter().sum::<f64>() / squares.len() as f64).sqrt() }
}
