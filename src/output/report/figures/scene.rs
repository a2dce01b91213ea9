//! Camera views and plate in three dimensions, with arm and region of the stops where there is a robot: a drawing that a small script turns.

use std::f64::consts::FRAC_PI_4;
use std::fmt::Write as _;

use maud::{Markup, PreEscaped, html};
use nalgebra::{Vector2, Vector3};

use crate::geom::Pose;
use crate::model::camera::Camera;
use crate::model::robot::Robot;
use crate::output::photogrammetry::Photogrammetry;
use crate::output::report::page::svg::escaped;
use crate::output::report::wording::describe::describe;
use crate::output::report::wording::many;
use crate::output::restore::{camera, found_model};
use crate::output::solution_json::{ImageRecord, PlateRecord, SolutionRecord};
use crate::series::CameraMount;

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 520.0;
/// Direction of view at first, rad: azimuth and elevation.
const VIEW: [f64; 2] = [-0.9, 0.45];
/// Length of a drawn camera view, as a share of the size of the scene.
const VIEW_LENGTH: f64 = 0.05;
/// Most places of the region that are drawn.
const MOST_PLACES: usize = 120;

type Line = Vec<Vector3<f64>>;

/// Everything in the base frame, or without a robot in that of the plate, m.
#[derive(Default)]
struct Scene {
    /// Images of which some are drawn.
    images: usize,
    /// Through the origins of the joints, for each image on the robot; none without one.
    arms: Vec<(usize, Line)>,
    cameras: Vec<(usize, Pose)>,
    plates: Vec<(usize, Line)>,
    places: Vec<Vector3<f64>>,
}

impl Scene {
    fn of(r: &SolutionRecord) -> Option<Self> {
        let robot = found_model(r).ok()?.robot;
        let images = r.images.iter().enumerate();
        let stops: Vec<_> = images.filter_map(|(k, image)| Some((k, image.readings.as_ref()?))).collect();
        let mut scene = Self { images: stops.len(), ..Self::default() };
        let mut placed = Vec::new();
        for (k, readings) in many::drawn(stops) {
            let image = &r.images[k];
            let links = robot.link_poses(readings);
            let Some(flange) = links.last() else { continue };
            let (Some(mounting), Some(placement)) =
                (r.mountings.get(image.mounting), r.placements.get(image.placement))
            else {
                continue;
            };
            let (x, z) = (Pose::from(&mounting.pose), Pose::from(&placement.pose));
            let plate = r.plates.get(image.plate)?;
            let (camera, plate_pose) = match image.camera_mount {
                CameraMount::Hand => (*flange * x, z),
                CameraMount::Fixed => (x, *flange * z),
            };
            if !r.has_no_robot() {
                scene.arms.push((k, arm(&robot, &links)));
            }
            scene.cameras.push((k, camera));
            let stands = image.camera_mount == CameraMount::Hand;
            if !(stands && placed.contains(&image.placement)) {
                placed.push(image.placement);
                scene.plates.push((k, outline(plate, &plate_pose)));
            }
        }
        let covered: Vec<_> = r.workspace.iter().filter(|w| w.covered).map(|w| Vector3::from(w.xyz_m)).collect();
        let step = covered.len().div_ceil(MOST_PLACES).max(1);
        scene.places = covered.into_iter().step_by(step).collect();
        (!scene.cameras.is_empty()).then_some(scene)
    }

    /// A plate with the images of it whose pose is known.
    fn of_plate(p: Photogrammetry, plate: usize) -> Option<Self> {
        let own = p.images.iter().enumerate().filter(|(_, image)| image.plate == plate && image.is_used());
        let own: Vec<_> = own.filter_map(|(k, image)| Some((k, image.camera_from_plate.as_ref()?))).collect();
        let mut scene = Self { images: own.len(), ..Self::default() };
        scene.cameras = many::drawn(own).into_iter().map(|(k, pose)| (k, Pose::from(pose).inverse())).collect();
        let (first, _) = scene.cameras.first()?;
        scene.plates.push((*first, outline(p.plates.get(plate)?, &Pose::identity())));
        Some(scene)
    }

    /// Middle and half of the size.
    fn bounds(&self) -> (Vector3<f64>, f64) {
        let lines = self.arms.iter().chain(&self.plates).flat_map(|(_, l)| l.iter().copied());
        let all: Line = lines.chain(self.cameras.iter().map(|(_, c)| c.translation)).collect();
        let end = |k: usize, pick: fn(f64, f64) -> f64| all.iter().map(|p| p[k]).reduce(pick).unwrap_or(0.0);
        let low = Vector3::from_fn(|k, _| end(k, f64::min));
        let high = Vector3::from_fn(|k, _| end(k, f64::max));
        ((low + high) / 2.0, ((high - low).norm() / 2.0).max(1e-3))
    }
}

/// From the base through the joints to the tip.
fn arm(robot: &Robot, links: &[Pose]) -> Line {
    let mut line = vec![Vector3::zeros()];
    for (joint, pose) in robot.chain.joints.iter().zip(links) {
        let moves = joint.drive.is_some();
        if moves || line.len() < 2 {
            line.push(pose.translation);
        }
    }
    line.extend(links.last().map(|l| l.translation));
    line
}

/// The edge of the markers.
fn outline(plate: &PlateRecord, pose: &Pose) -> Line {
    let end = |k: usize, pick: fn(f64, f64) -> f64| plate.position_m.iter().map(|p| p[k]).reduce(pick).unwrap_or(0.0);
    let ([x0, x1], [y0, y1]) = ([end(0, f64::min), end(0, f64::max)], [end(1, f64::min), end(1, f64::max)]);
    [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)].map(|(x, y)| pose.transform(&Vector3::new(x, y, 0.0))).into()
}

/// The view of a camera as one line: its edges from the centre, and the frame of the image.
fn view(r: Photogrammetry, image: &ImageRecord, pose: &Pose, length: f64) -> Line {
    let Some(c) = r.cameras.get(image.camera).map(camera) else { return Vec::new() };
    let (w, h) = (f64::from(c.width_px) - 1.0, f64::from(c.height_px) - 1.0);
    let corner = |u: f64, v: f64| {
        let ray = c.ray(&Vector2::new(u, v)).unwrap_or_else(|| straight(&c, u, v));
        pose.transform(&(length * ray / ray.norm().max(1e-9)))
    };
    let (a, b, c, d, eye) = (corner(0.0, 0.0), corner(w, 0.0), corner(w, h), corner(0.0, h), pose.translation);
    vec![eye, a, b, eye, c, d, eye, d, a, b, c]
}

/// Where a camera without distortion sees a pixel: no marker tells what a lens does far outside of all that were seen.
fn straight(c: &Camera, u: f64, v: f64) -> Vector3<f64> {
    let [fx, fy, cx, cy] = [0, 1, 2, 3].map(|k| c.parameters[k]);
    Vector3::new((u - cx) / fx, (v - cy) / fy, 1.0)
}

/// How a place is seen: the same formula stands in the script.
fn seen(p: &Vector3<f64>, centre: &Vector3<f64>, size: f64) -> [f64; 2] {
    let ([sa, ca], [se, ce]) = ([VIEW[0].sin(), VIEW[0].cos()], [VIEW[1].sin(), VIEW[1].cos()]);
    let d = p - centre;
    let scale = HEIGHT / 2.0 / size;
    let (right, up) = (-sa * d.x + ca * d.y, -se * ca * d.x - se * sa * d.y + ce * d.z);
    [WIDTH / 2.0 + scale * right, HEIGHT / 2.0 - scale * up]
}

/// What is needed to draw lines.
struct Drawing {
    centre: Vector3<f64>,
    size: f64,
    body: String,
}

impl Drawing {
    fn line(&mut self, class: &str, points: &[Vector3<f64>], title: &str) {
        let at = |p: &Vector3<f64>| seen(p, &self.centre, self.size);
        let places: Vec<String> = points.iter().map(at).map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let title = if title.is_empty() { String::new() } else { format!("<title>{}</title>", escaped(title)) };
        // Writing to a String cannot fail.
        let _ = write!(
            self.body,
            "<g><polyline class=\"{class}\" points=\"{}\" data-p=\"{}\">{title}</polyline></g>",
            places.join(" "),
            coordinates(points)
        );
    }
}

fn coordinates(points: &[Vector3<f64>]) -> String {
    let all: Vec<String> = points.iter().map(|p| format!("{:.4} {:.4} {:.4}", p.x, p.y, p.z)).collect();
    all.join(" ")
}

/// What is said of a scene.
struct Words<'a> {
    /// What is drawn, as its label.
    label: &'a str,
    /// Whose axes are drawn.
    frame: &'a str,
    /// What the slider goes through.
    slider: &'a str,
}

/// The chapter of a robot.
pub(in crate::output::report) fn section(r: &SolutionRecord) -> Markup {
    let Some(scene) = Scene::of(r) else { return html! {} };
    let [arm, the_arm, postures] = match r.has_no_robot() {
        true => ["", "The view", ""],
        false => ["Arm, ", "The arm at one stop, the view", ", with the arm in many postures"],
    };
    let label = format!("{arm}{} camera poses, plate and region of the stops", scene.cameras.len());
    html! {
        p {
            (the_arm) " of the camera at every stop (red: left out), the plate (green), and the region in which the "
            "accuracy is stated (grey). Good series look at the plate from all sides, from near and far" (postures) "."
        }
        (scene.drawn(r.photogrammetry(), &Words { label: &label, frame: "base frame", slider: "stop" }))
    }
}

/// The chapter of images alone: each plate with the cameras that saw it.
pub(in crate::output::report) fn of_plates(p: Photogrammetry) -> Markup {
    let scenes: Vec<(&str, Scene)> = p
        .plates
        .iter()
        .enumerate()
        .filter_map(|(k, plate)| Some((plate.name.as_str(), Scene::of_plate(p, k)?)))
        .collect();
    html! {
        @if !scenes.is_empty() {
            p {
                "The view of the camera in every image that was used, and the plate (green), in the frame of the plate. "
                "Good series look at the plate from all sides, tilted and turned, from near and far."
            }
        }
        @for (plate, scene) in &scenes {
            @if p.plates.len() > 1 { h3 { "Plate of " (plate) } }
            @let label = format!("{} camera poses and plate", scene.cameras.len());
            (scene.drawn(p, &Words { label: &label, frame: "frame of the plate", slider: "image" }))
        }
    }
}

impl Scene {
    fn lines(&self, p: Photogrammetry, frame: &str) -> Drawing {
        let (centre, size) = self.bounds();
        let mut d = Drawing { centre, size, body: String::new() };
        let o = Vector3::zeros();
        if !self.arms.is_empty() {
            for k in 0..8 {
                let turn = |k: f64| 0.35 * size * Vector3::new((k * FRAC_PI_4).cos(), (k * FRAC_PI_4).sin(), 0.0);
                d.line("ground", &[turn(f64::from(k)), turn(f64::from(k) + 1.0)], "");
            }
        }
        for (k, class) in ["x", "y", "z"].into_iter().enumerate() {
            let tip = Vector3::from_fn(|row, _| if row == k { 0.22 * size } else { 0.0 });
            d.line(class, &[o, tip], &format!("{class} of the {frame}"));
        }
        self.places.iter().for_each(|p| d.line("reach", &[*p, *p], ""));
        self.plates.iter().for_each(|(_, line)| d.line("plate", line, "plate"));
        for (k, pose) in &self.cameras {
            let image = &p.images[*k];
            let class = if image.is_used() { "camera" } else { "camera gone" };
            d.line(class, &view(p, image, pose, VIEW_LENGTH * 2.0 * size), &describe(p, image));
        }
        if let Some((_, arm)) = self.arms.first() {
            d.line("arm", arm, "arm");
        }
        d
    }

    fn drawn(&self, p: Photogrammetry, words: &Words) -> Markup {
        let Drawing { centre, size, body } = self.lines(p, words.frame);
        let arms: Vec<String> = self.arms.iter().map(|(_, line)| coordinates(line)).collect();
        let arms = Some(arms.join("|")).filter(|arms| !arms.is_empty());
        let names: Vec<String> =
            self.cameras.iter().map(|(k, _)| describe(p, &p.images[*k]).replace('|', "/")).collect();
        let (label, last) = (words.label, names.len() - 1);
        html! {
            figure {
                (PreEscaped(format!(
                    "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"scene\" tabindex=\"0\" role=\"application\" aria-label=\"{label}. Arrow keys turn, plus and minus zoom.\" \
                     viewBox=\"0 0 {WIDTH} {HEIGHT}\" data-view=\"{} {}\" data-centre=\"{}\" data-size=\"{size:.4}\">{body}</svg>",
                    VIEW[0], VIEW[1], coordinates(&[centre])
                )))
                div.controls {
                    button type="button" data-turn="-0.2 0" { "turn left" }
                    button type="button" data-turn="0.2 0" { "turn right" }
                    button type="button" data-turn="0 0.15" { "from above" }
                    button type="button" data-turn="0 -0.15" { "from below" }
                    button type="button" data-zoom="1.25" { "nearer" }
                    button type="button" data-zoom="0.8" { "farther" }
                    label { (words.slider) " " input type="range" min="0" max=(last) value="0" data-arms=[arms] data-names=(names.join("|")); }
                }
                output aria-live="polite" {}
                figcaption { "Drag, pinch or use the arrow keys to turn it; point at a camera to see its image." }
            }
            (many::note(self.cameras.len(), self.images))
        }
    }
}
