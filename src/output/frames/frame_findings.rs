//! What is to be said of measured frames.

use nalgebra::{DMatrix, Matrix3, Matrix6, Vector3};

use crate::assess::Limits;
use crate::diagnose::{Finding, Mistake, Weight};
use crate::error::Code;
use crate::frames::{FrameFit, TouchPlace, Touches};
use crate::geom::{Pose, adjoint};
use crate::output::corrections::FileFinding;
use crate::series::JointsBeside;

/// Stops that are named.
const NAMED: usize = 5;

/// Findings of a fit of tool and work object, and of the mistake that explains why it is bad; `subject` is the file of the touches.
pub fn frame_findings(
    (fit, mistake): (&FrameFit, Option<Mistake>),
    touches: &Touches,
    limits: &Limits,
    subject: &str,
) -> Vec<FileFinding> {
    if let Some(mistake) = mistake {
        return vec![of_mistake(mistake, subject)];
    }
    let mut all = left_out(fit, touches, limits, subject);
    all.extend(scattered((fit, &touches.beside), limits, subject));
    all.extend(robot_contradicted(fit, limits, subject));
    for (name, covariance) in touches.bodies.iter().zip(&fit.tool_covariances) {
        let Some(c) = covariance else { continue };
        let what = format!("the point of '{name}'");
        all.extend(weak(&what, &c.fixed_view::<3, 3>(0, 0).into_owned(), None, (limits, subject)));
    }
    if let (Some(c), false) = (&fit.work_covariance, touches.all.is_empty()) {
        let (c, spread) = at_the_places(c, touches);
        let [place, turn] = [0, 3].map(|k| c.fixed_view::<3, 3>(k, k).into_owned());
        all.extend(weak("the work object", &place, None, (limits, subject)));
        all.extend(weak("the turn of the work object about an axis", &turn, Some(spread), (limits, subject)));
    }
    all
}

fn of_mistake(mistake: Mistake, subject: &str) -> FileFinding {
    let (rms, undone) = (1e3 * mistake.misfit, 1e3 * mistake.misfit_undone.unwrap_or_default());
    let quantities = [("rms_mm", rms), ("rms_undone_mm", undone)];
    let found = Finding::from(mistake);
    let text =
        format!("{}; {} (touches miss by {rms:.2} mm RMS, by {undone:.2} mm without)", found.seen(), found.remedy());
    FileFinding::new(found.code(), Weight::Gate, subject, quantities, text)
}

fn left_out(fit: &FrameFit, touches: &Touches, limits: &Limits, subject: &str) -> Vec<FileFinding> {
    let left_out: Vec<usize> = (0..touches.all.len()).filter(|&k| fit.judged[k].left_out).collect();
    if left_out.is_empty() {
        return Vec::new();
    }
    let name = |&k: &usize| format!("{} ({:.2} mm)", touches.all[k].stop, 1e3 * fit.judged[k].residual_m.norm());
    let named: Vec<String> = left_out.iter().take(NAMED).map(name).collect();
    let more = if left_out.len() > NAMED { ", .." } else { "" };
    let text = format!(
        "{} of {} touches disagree with the others and are left out: {}{more}; look at them: another point, a slip, a wrong line",
        left_out.len(),
        touches.all.len(),
        named.join(", ")
    );
    let share = left_out.len() as f64 / touches.all.len() as f64;
    let weight = if share > limits.share_of_images_left_out { Weight::Gate } else { Weight::Note };
    let quantities = [("touches", left_out.len() as f64)];
    let mut all = vec![FileFinding::new(Code::TouchesLeftOut, weight, subject, quantities, text)];
    all.extend(places_left_out(fit, touches, subject));
    all
}

fn scattered((fit, beside): (&FrameFit, &JointsBeside), limits: &Limits, subject: &str) -> Option<FileFinding> {
    let cause = if beside.moved.is_empty() {
        let untold = match beside.untold.is_empty() {
            true => String::new(),
            false => format!(", or a work object that {} moved, of which no column is given", beside.untold.join(", ")),
        };
        format!(
            "a loose tip, another order of points, the wrong robot, or one that was identified with a plate of another size than stated{untold}; correct sigma_m if they are no better"
        )
    } else {
        let joints = beside.moved.join(", ");
        format!(
            "{joints} differ between the touches, and the robot of the solution does not take that up: a work object that they carry moved; touch it with {joints} at one value, or in a solution whose base is the link that carries it (identify --base)"
        )
    };
    let text = format!(
        "the touches scatter {:.1} times as much as their stated sigma ({:.3} mm RMS): {cause}",
        fit.factor,
        1e3 * fit.rms_m
    );
    let [moved, untold] = [&beside.moved, &beside.untold].map(|joints| joints.len() as f64);
    let quantities =
        [("factor", fit.factor), ("rms_mm", 1e3 * fit.rms_m), ("joints_moved", moved), ("joints_untold", untold)];
    let is_scattered = fit.factor > limits.touch_factor;
    is_scattered.then(|| FileFinding::new(Code::TouchesScatter, Weight::Gate, subject, quantities, text))
}

fn robot_contradicted(fit: &FrameFit, limits: &Limits, subject: &str) -> Option<FileFinding> {
    let in_one = fit.robot_sigmas > limits.sigmas_beyond_tolerance;
    let how_far = match in_one {
        true => format!("what is {:.1} sigmas from the solution", fit.robot_sigmas),
        false => format!("{:.1} times as much as the solution leaves open", fit.robot_factor),
    };
    let text = format!(
        "the touches say of the robot {how_far}: another robot, tool or mastering than that of the solution{}",
        if fit.tool_covariances[0].is_none() { ", or a tool that was given wrongly" } else { "" }
    );
    let quantities = [("factor", fit.robot_factor), ("sigmas", fit.robot_sigmas)];
    let is_other = fit.robot_factor > limits.touch_factor || in_one;
    is_other.then(|| FileFinding::new(Code::RobotContradicted, Weight::Gate, subject, quantities, text))
}

/// What is hardly told along an axis: of a point (m), or of a turn (rad) at places that reach so far (m).
fn weak(
    what: &str,
    covariance: &Matrix3<f64>,
    reach_m: Option<f64>,
    (limits, subject): (&Limits, &str),
) -> Option<FileFinding> {
    let eigen = covariance.symmetric_eigen();
    let k = eigen.eigenvalues.imax();
    let mm = 1e3 * reach_m.unwrap_or(1.0) * eigen.eigenvalues[k].max(0.0).sqrt();
    let d = eigen.eigenvectors.column(k);
    let where_to = if reach_m.is_some() { " at the places" } else { "" };
    let text = format!(
        "{what} is hardly told along ({:.2}, {:.2}, {:.2}): sigma {mm:.1} mm{where_to}; touch with the tip turned further, and points further apart",
        d[0], d[1], d[2]
    );
    let is_weak = mm > limits.frame_sigma_mm;
    is_weak.then(|| FileFinding::new(Code::FrameWeak, Weight::Gate, subject, [("sigma_mm", mm)], text))
}

/// Touches fit as well with the signs of these joints changed.
pub fn mirror_image_fits(joints: &[String], subject: &str) -> FileFinding {
    let text = format!(
        "the touches fit as well with the readings of {} negated, as those of the mirror image of the arm: were these of the wrong sign, the tool would lie mirrored; see that these joints count as in the series of the solution, or touch four known places that lie not in one plane",
        joints.join(", ")
    );
    FileFinding::new(Code::MirrorImageFits, Weight::Note, subject, [("joints", joints.len() as f64)], text)
}

/// Places of which every touch, of two and more, is left out: these agree with each other, so that the place is rather wrong than each of them.
fn places_left_out(fit: &FrameFit, touches: &Touches, subject: &str) -> Vec<FileFinding> {
    let mut places: Vec<(Vector3<f64>, Vec<usize>)> = Vec::new();
    for (k, touch) in touches.all.iter().enumerate() {
        let TouchPlace::Point(place) = touch.seen else { continue };
        match places.iter_mut().find(|(other, _)| *other == place) {
            Some((_, own)) => own.push(k),
            None => places.push((place, vec![k])),
        }
    }
    places.retain(|(_, own)| own.len() > 1 && own.iter().all(|&k| fit.judged[k].left_out));
    let finding = |(place, own): (Vector3<f64>, Vec<usize>)| {
        let missed: Vector3<f64> = own.iter().map(|&k| fit.judged[k].residual_m).sum();
        let missed_mm = 1e3 * (missed / own.len() as f64).norm();
        let stops: Vec<&str> = own.iter().map(|&k| touches.all[k].stop.as_str()).collect();
        let text = format!(
            "all touches of the place ({:.4}, {:.4}, {:.4}) m are left out ({}), {missed_mm:.2} mm away in their mean: it may be this place that is wrong; correct it in contacts.csv, or touch the point that was meant",
            place.x,
            place.y,
            place.z,
            stops.join(", ")
        );
        let quantities = [("missed_mm", missed_mm), ("touches", own.len() as f64)];
        FileFinding::new(Code::PlaceContradicted, Weight::Note, subject, quantities, text)
    };
    places.into_iter().map(finding).collect()
}

/// Covariance of a work object (body twist) in the middle of the places, and how far these reach from it, m RMS.
pub fn at_the_places(covariance: &DMatrix<f64>, touches: &Touches) -> (Matrix6<f64>, f64) {
    let places: Vec<Vector3<f64>> = touches.placed().map(|(_, p)| p).collect();
    let n = places.len().max(1) as f64;
    let mean = places.iter().sum::<Vector3<f64>>() / n;
    let spread = (places.iter().map(|p| (p - mean).norm_squared()).sum::<f64>() / n).sqrt();
    let shift = adjoint(&Pose::new(Matrix3::identity(), -mean));
    let c = Matrix6::from_column_slice(covariance.as_slice());
    (shift * c * shift.transpose(), spread)
}
