//! The report of `robotcal poses`: cameras, plates and poses from images alone. A new chapter is one function and one row in [`chapters`].

use maud::{Markup, html};

use super::chapters::{coverage, findings, gallery, images, parameters, pose_residuals, sections};
use super::figures::scene;
use super::figures::thumbnails::Thumbnails;
use super::first_page::{images_used, judged, sentence};
use super::page::frame::{Chapter, SCRIPT, STYLE, page_of_chapters};
use super::wording::many;
use super::wording::words::{count, fixed, significant};
use crate::error::Code;
use crate::identify::{PoseComparison, PoseDifference};
use crate::output::poses_record::{PosesRecord, usual, worst};
use crate::output::solution_json::ScaleRecord;
use crate::output::verdict::{Trust, Verdict};

/// The page.
pub fn poses_html(record: &PosesRecord, pictures: &Thumbnails) -> String {
    let verdict = Verdict::of_poses(record);
    let first = first_page(record, &verdict);
    page_of_chapters(&title(record), STYLE, SCRIPT, &first, &chapters(record, &verdict, pictures))
}

fn title(r: &PosesRecord) -> String {
    let names: Vec<&str> = r.series.iter().map(|s| s.name.as_str()).collect();
    format!("Camera poses of {}", names.join(", "))
}

/// All chapters; those without content are left out.
fn chapters(r: &PosesRecord, verdict: &Verdict, pictures: &Thumbnails) -> Vec<Chapter> {
    let seen = r.photogrammetry();
    vec![
        Chapter::new("findings", "Findings, and what to do", findings::section(verdict, &r.notices)),
        Chapter::new("left-out", "What was read, and what was left out", sections::images_left_out(seen)),
        Chapter::new("pictures", "Pictures: best, worst and left out", gallery::gallery(seen, pictures)),
        Chapter::new("images", "Poses and residuals by image", images::of_poses(r)),
        Chapter::new("scene", "Camera poses and plate", scene::of_plates(seen)),
        Chapter::new("against", "Beside other poses", against(r)),
        Chapter::new("coverage", "What the images covered", coverage::of_images(seen)),
        Chapter::new("residuals", "Residuals", sections::residuals(seen)),
        Chapter::new("cameras", "Camera", cameras(r)),
        Chapter::new("plate", "Plate", plates(r)),
        Chapter::new("starts", "Starting values", sections::starts(seen)),
        Chapter::new("record", "For the record", sections::record(seen, "")),
    ]
}

/// What is decided by: verdict, how well the poses are known, what to do.
fn first_page(r: &PosesRecord, verdict: &Verdict) -> Markup {
    html! {
        h1 { (title(r)) }
        p.sub {
            "Cameras, plate and camera poses from images alone; "
            (images_used(&r.statistics))
            (r.program.name) " " (r.program.version) "."
        }
        (judged(verdict, [
            "Good: the poses can be used",
            "Good, with doubts: look at the points below first",
            "Not to be trusted: do not use these poses before the cause is found",
        ]))
        (known(r, verdict.trust))
        h2 { "What to do" }
        ol.steps { @for step in steps(r, verdict) { li { (step) } } }
    }
}

/// Sigmas of the poses, and what all of them have in common.
fn known(r: &PosesRecord, trust: Trust) -> Markup {
    let Some((usual, worst)) = usual(&r.known).zip(worst(&r.known)) else { return html! {} };
    let rows = [
        (format!("Median of {}", count(r.known.len(), "image")), usual),
        (format!("Worst: {}", r.images[worst.image].name), [worst.position_m, worst.rotation_rad]),
    ];
    html! {
        h2 { "How well the poses are known" }
        @if trust == Trust::Failed { p { b { "These figures hold only if the checks above are wrong." } } }
        div.wide { table {
            thead { tr { th { "Pose of the camera" } th.n { "position, sigma" } th.n { "direction, sigma" } } }
            tbody { @for (name, [position_m, rotation_rad]) in rows { tr {
                th.name scope="row" { (name) }
                td.n { b { (significant(1e3 * position_m)) " mm" } }
                td.n { b { (significant(60.0 * rotation_rad.to_degrees())) " arcmin" } }
            } } }
        } }
        p.note {
            "Per axis, in the frame of the plate, by model and covariance (" a href="#images" { "of every image" } "). Residuals: "
            (fixed(r.statistics.rms_px, 4)) " px RMS per point over " (count(r.statistics.observations_used, "observation")) "."
        }
        @for (plate, scale) in scales(r) { p {
            "The size of the plate" (plate) " is known to " b { (significant(100.0 * scale.sigma)) " %" }
            ": it is common to all poses, and in none of these sigmas. 0.1 % is 1 mm a metre."
        } }
        @if let Some((file, compared)) = &r.against { p {
            "Beside the poses of " code { (file) } ", after the common frame: " b { (significant(1e3 * compared.rms[0])) " mm" } " and "
            b { (significant(arcmin(compared.rms[1]))) " arcmin" } " RMS per axis (" a href="#against" { "more" } ")."
        } }
    }
}

/// Scale of every plate that was seen, with its name where there are several.
fn scales(r: &PosesRecord) -> impl Iterator<Item = (String, ScaleRecord)> {
    let of = |plate: &str| sections::of_several(r.photogrammetry(), plate);
    r.plates.iter().filter_map(move |p| Some((of(&p.name), p.relative_scale_of_poses?)))
}

/// Remedies of a failed result; else what to use, and what is missing.
fn steps(r: &PosesRecord, verdict: &Verdict) -> Vec<Markup> {
    if verdict.trust == Trust::Failed {
        let remedies = verdict.remedies.iter().map(|remedy| html! { (sentence(remedy)) });
        return remedies.chain([html! { "Adjust again; do not use these poses until then." }]).collect();
    }
    let files = |start: &'static str, end: &'static str| {
        r.files.iter().filter(move |f| f.starts_with(start) && f.ends_with(end))
    };
    let mut all = vec![html! {
        "Use " code { "poses.csv" } ": " code { "plate_from_camera" } " of every image with its 6×6 covariance. "
        @if let Some(together) = files("poses_covariance", ".npy").next() {
            "The errors of two poses are correlated: " code { (together) } " has the covariance of all of them together."
        }
    }];
    let cameras: Vec<&String> = files("camera", ".yaml").collect();
    if !cameras.is_empty() {
        all.push(html! {
            "Use the camera elsewhere from " @for (k, file) in cameras.iter().enumerate() { @if k > 0 { ", " } code { (file) } }
            ", or hold it in the next series with " code { "--camera-file" } " and " code { "--hold-camera" } "."
        });
    }
    let unmeasured = r.plates.iter().filter(|p| p.scale.is_none() && p.relative_scale_of_poses.is_some());
    if unmeasured.count() > 0 {
        all.push(html! {
            "Measure the distance of two far markers and give " code { "[scale]" } " in plate.toml: all distances of the poses are those of the plate, "
            "whose size nobody measured."
        });
    }
    all
}

/// The cameras, with what was tried to choose their lenses.
fn cameras(r: &PosesRecord) -> Markup {
    let chosen: Vec<_> = r.notices.iter().filter(|n| n.code == Code::LensChosen).collect();
    html! {
        (parameters::cameras(r.photogrammetry()))
        @if !chosen.is_empty() {
            h3 { "Which lens the images support" }
            ul { @for n in chosen { li { code { (n.place) } " " (n.what) } } }
        }
    }
}

/// The plates, with the size that the poses are given in.
fn plates(r: &PosesRecord) -> Markup {
    html! {
        (sections::plates(r.photogrammetry()))
        @for (plate, scale) in scales(r) { p {
            "The poses are given for a plate" (plate) " of " (fixed(100.0 * (1.0 + scale.value), 4)) " % of its nominal size, which is known to "
            (significant(100.0 * scale.sigma)) " % (one sigma)."
        } }
    }
}

fn arcmin(rad: f64) -> f64 {
    60.0 * rad.to_degrees()
}

fn length(d: &PoseDifference) -> f64 {
    d.twist.fixed_rows::<3>(0).norm()
}

/// The poses of another source beside those found.
fn against(r: &PosesRecord) -> Markup {
    let Some((file, compared)) = &r.against else { return html! {} };
    let shown = many::drawn(compared.differences.iter().map(|d| (d.image.clone(), d.twist)).collect());
    html! {
        p {
            "The poses found, less those of " code { (file) } ", image by image. What two sources cannot have in common was fitted before: the frame, "
            "the size of the plate, and the place of the other body on the camera, where it is another one."
        }
        (differences(compared))
        (pose_residuals::course(
            &shown,
            "Differences of the poses in the axes of the camera, by image",
            "In the axes of the camera: displacement above, rotation below.",
        ))
        (many::note(shown.len(), compared.differences.len()))
    }
}

fn differences(compared: &PoseComparison) -> Markup {
    let worst = compared.differences.iter().max_by(|a, b| length(a).total_cmp(&length(b)));
    html! {
        div.wide { table {
            tbody {
                tr { th scope="row" { "Poses in common" } td.n { (compared.differences.len()) } }
                tr { th scope="row" { "Position, RMS per axis" } td.n { (significant(1e3 * compared.rms[0])) " mm" } }
                tr { th scope="row" { "Direction, RMS per axis" } td.n { (significant(arcmin(compared.rms[1]))) " arcmin" } }
                @if let Some(d) = worst {
                    tr { th.name scope="row" { "Worst position: " (d.image) } td.n { (significant(1e3 * length(d))) " mm" } }
                }
                tr { th scope="row" { "Size of the plate over theirs, less one" } td.n { (fixed(100.0 * compared.relative_scale, 4)) " %" } }
                tr { th scope="row" { "Normalised error squared" } td.n { (significant(compared.normalised)) } }
            }
        } }
        p.note { "The normalised error squared is by the stated covariances of the poses found alone: 1 where the other source is exact." }
    }
}
