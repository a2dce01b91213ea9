//! Pose residuals: by how much the pose in every image differs from what the corrected model makes of its joint readings, in the order of the
//! series. What moved is told by the axes in which the residuals do not scatter.

use maud::{Markup, html};
use nalgebra::Vector6;

use crate::geom::Pose;
use crate::model::robot::Posture;
use crate::output::report::page::figure::pointed;
use crate::output::report::page::svg::{Anchor, Svg, round_below};
use crate::output::report::wording::describe::name;
use crate::output::report::wording::many;
use crate::output::report::wording::words::plain;
use crate::output::restore::found_model;
use crate::output::solution_json::{ImageRecord, SolutionRecord};

const WIDTH: f64 = 460.0;
const PANEL: f64 = 130.0;
const LEFT: f64 = 56.0;
const RIGHT: f64 = 10.0;
const TOP: f64 = 26.0;
const GAP: f64 = 22.0;
const BOTTOM: f64 = 26.0;
/// Half the size of a mark.
const MARK: f64 = 2.6;
/// Fewest images that show a course.
const FEWEST_IMAGES: usize = 3;

/// The residual of an image as a twist (m, rad) in the axes of the camera and of the plate.
struct PoseResidual<'a> {
    image: &'a ImageRecord,
    camera: Vector6<f64>,
    plate: Vector6<f64>,
}

/// Of every image in use on the robot.
fn residuals(r: &SolutionRecord) -> Option<Vec<PoseResidual<'_>>> {
    let robot = found_model(r).ok()?.robot;
    let of = |image: &ImageRecord| {
        let (readings, found) = image.readings.as_ref().zip(image.camera_from_plate.as_ref())?;
        let stop = Posture { readings: readings.clone(), approach: image.approach.clone() };
        let flange = robot.base_from_tip_at(&stop);
        let (mounting, placement) = (r.mountings.get(image.mounting)?, r.placements.get(image.placement)?);
        let (mounting, placement) = (Pose::from(&mounting.pose), Pose::from(&placement.pose));
        let predicted = image.camera_mount.camera_from_plate(&mounting, &flange, &placement);
        let found = Pose::from(found);
        let (camera, plate) = ((found * predicted.inverse()).log(), (predicted.inverse() * found).log());
        Some((camera, plate))
    };
    let used = r.images.iter().filter(|i| i.is_used());
    Some(used.filter_map(|image| of(image).map(|(camera, plate)| PoseResidual { image, camera, plate })).collect())
}

/// The chapter; empty for series without images.
pub(in crate::output::report) fn section(r: &SolutionRecord) -> Markup {
    let Some(all) = residuals(r).filter(|all| all.len() >= FEWEST_IMAGES) else { return html! {} };
    let of_all = all.len();
    let shown = many::drawn(all);
    html! {
        p {
            "The pose of the plate in every image, less what the corrected model makes of the joint readings. Good series scatter about zero. "
            "A jump or a slope in the axes of the camera says that the camera moved on its mount; in those of the plate, that the plate did; "
            "single images far off, that the arm did not stand still."
        }
        div.pair {
            (of_axes(r, &shown, "camera", |p| p.camera))
            (of_axes(r, &shown, "plate", |p| p.plate))
        }
        (many::note(shown.len(), of_all))
    }
}

fn of_axes(
    r: &SolutionRecord,
    shown: &[PoseResidual],
    body: &str,
    twist: impl Fn(&PoseResidual) -> Vector6<f64>,
) -> Markup {
    let of = |p: &PoseResidual| (name(r.photogrammetry(), p.image), twist(p));
    let caption = format!("In the axes of the {body}: displacement above, rotation below.");
    course(
        &shown.iter().map(of).collect::<Vec<_>>(),
        &format!("Pose residuals in the axes of the {body}, by image"),
        &caption,
    )
}

/// Twists (m, rad) by the name of their image, in the order of the series.
pub(in crate::output::report) fn course(shown: &[(String, Vector6<f64>)], label: &str, caption: &str) -> Markup {
    let height = TOP + 2.0 * PANEL + GAP + BOTTOM;
    let mut svg = Svg::new(WIDTH, height, label);
    for (k, class) in ["x", "y", "z"].into_iter().enumerate() {
        let at = [LEFT + 14.0 + 46.0 * k as f64, TOP - 14.0];
        mark(&mut svg, at, class);
        svg.text([at[0] + 8.0, at[1] + 4.0], Anchor::Start, class);
    }
    let step = (WIDTH - LEFT - RIGHT) / shown.len() as f64;
    for (panel, unit) in ["mm", "mrad"].into_iter().enumerate() {
        let top = TOP + (PANEL + GAP) * panel as f64;
        let part = |t: &Vector6<f64>| [0, 1, 2].map(|k| 1e3 * t[3 * panel + k]);
        let largest = shown.iter().map(|(_, t)| t).flat_map(part).map(f64::abs).fold(1e-6, f64::max);
        let y = |value: f64| top + PANEL / 2.0 * (1.0 - value / (1.1 * largest));
        svg.rect([LEFT, top], [WIDTH - LEFT - RIGHT, PANEL], "frame");
        let round = round_below(largest);
        for value in [-round, 0.0, round] {
            let class = if value == 0.0 { "axis" } else { "grid" };
            svg.line([LEFT, y(value)], [WIDTH - RIGHT, y(value)], class);
            svg.text([LEFT - 6.0, y(value) + 4.0], Anchor::End, &plain(value));
        }
        svg.text_upwards([13.0, top + PANEL / 2.0], unit);
        for (k, (name, twist)) in shown.iter().enumerate() {
            let (x, values) = (LEFT + step * (k as f64 + 0.5), part(twist));
            let [a, b, c] = values.map(|v| format!("{v:.3}"));
            svg.titled(&format!("{name}: {a}, {b}, {c} {unit}"), |svg| {
                values.into_iter().zip(["x", "y", "z"]).for_each(|(value, class)| mark(svg, [x, y(value)], class));
            });
        }
    }
    svg.text([LEFT + (WIDTH - LEFT - RIGHT) / 2.0, height - 8.0], Anchor::Middle, "images in the order of the series");
    pointed(&svg.finish(), caption)
}

/// The mark of an axis: a disc for x, a square for y, a cross for z.
fn mark(svg: &mut Svg, [x, y]: [f64; 2], class: &str) {
    match class {
        "x" => svg.circle([x, y], MARK, "mark x"),
        "y" => svg.rect([x - MARK, y - MARK], [2.0 * MARK, 2.0 * MARK], "mark y"),
        _ => {
            let (long, half) = (2.0 * MARK, MARK);
            let strokes = [([x - half, y - half], [long, long]), ([x - half, y + half], [long, -long])];
            svg.vectors(strokes.into_iter(), "mark z");
        }
    }
}
