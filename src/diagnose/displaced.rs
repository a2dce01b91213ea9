//! The finding that a plate or a camera stands elsewhere in some of the images; [`super::pose_step`] looks for it.

use super::kind::{Kind, Quantity, Subject, Weight, some_of};
use crate::error::Code;

/// Most images that are named.
const MOST_IMAGES: usize = 5;

/// What stands elsewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Carried {
    /// The plate that stands still.
    Plate,
    /// The plate in the hand.
    PlateInHand,
    /// The camera on its mount in the hand.
    CameraInHand,
    /// The camera that stands still.
    Camera,
}

/// In which images it stands elsewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Displacement {
    /// From the first of them on: moved once.
    FromThenOn,
    /// Where its axis x, y or z (0, 1, 2) points up: held by its weight only.
    AxisUp(usize),
    /// More in each than in the one before: it creeps.
    AllThrough,
}

/// A body stands elsewhere in some images, by too little for any of them to be left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Displaced {
    /// Series.
    pub series: String,
    /// What.
    pub body: Carried,
    /// Name of the mounting of its images.
    pub mounting: String,
    /// How the images are divided.
    pub displacement: Displacement,
    /// Images in which it stands elsewhere, in this order.
    pub images: Vec<String>,
    /// How far, m, and sigma per axis; of what creeps, from the first to the last image.
    pub distance_m: (f64, f64),
    /// By which angle, rad, and sigma per axis.
    pub angle_rad: (f64, f64),
    /// Share of the squares of the joint noise that this and the other displacements explain.
    pub share: f64,
    /// Gate where it is beyond what a good robot repeats to.
    pub weight: Weight,
}

impl Displaced {
    /// True where it happened in the course of time, in images of this mounting.
    pub(super) fn explains_two_places_of(&self, mounting: &str) -> bool {
        !matches!(self.displacement, Displacement::AxisUp(_)) && self.mounting == mounting
    }

    fn is_camera(&self) -> bool {
        matches!(self.body, Carried::CameraInHand | Carried::Camera)
    }

    /// The first image in which it stands elsewhere.
    fn first(&self) -> &str {
        self.images.first().map_or("", String::as_str)
    }

    fn body(&self) -> &'static str {
        match self.body {
            Carried::Plate => "plate",
            Carried::PlateInHand => "plate in the hand",
            Carried::CameraInHand => "camera on its mount",
            Carried::Camera => "camera on its stand",
        }
    }
}

impl Kind for Displaced {
    fn code(&self) -> Code {
        match (self.displacement, self.is_camera()) {
            (Displacement::FromThenOn, false) => Code::PlateDisplaced,
            (Displacement::FromThenOn, true) => Code::CameraDisplaced,
            (Displacement::AllThrough, false) => Code::PlateDrifts,
            (Displacement::AllThrough, true) => Code::CameraDrifts,
            (Displacement::AxisUp(_), false) => Code::PlateLoose,
            (Displacement::AxisUp(_), true) => Code::CameraLoose,
        }
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        let mut all = vec![Subject::Series(self.series.clone()), Subject::Body(self.body().to_owned())];
        if self.displacement != Displacement::AllThrough {
            all.extend(self.images.iter().cloned().map(Subject::Image));
        }
        all
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![
            Quantity::new("distance", self.distance_m.0, "m").with_sigma(self.distance_m.1),
            Quantity::new("angle", self.angle_rad.0, "rad").with_sigma(self.angle_rad.1),
            Quantity::new("share_of_joint_noise", self.share, "1"),
        ]
    }

    fn place(&self) -> String {
        format!("series {}", self.series)
    }

    fn seen(&self) -> String {
        let body = self.body();
        let size = format!(
            "{:.2} mm, {:.2} mrad (sigma at most {:.2} mm, {:.2} mrad per axis)",
            1e3 * self.distance_m.0,
            1e3 * self.angle_rad.0,
            1e3 * self.distance_m.1,
            1e3 * self.angle_rad.1
        );
        let what = match self.displacement {
            Displacement::FromThenOn => {
                let stands = match self.body {
                    Carried::Plate | Carried::Camera => "stands",
                    Carried::PlateInHand | Carried::CameraInHand => "sits",
                };
                let touched = if self.is_camera() { ", creeps, or its lens was touched" } else { ", or creeps" };
                format!(
                    "from {} on the {body} {stands} {size} elsewhere than before: it was moved{touched}",
                    self.first()
                )
            }
            Displacement::AxisUp(axis) => format!(
                "where its {} axis points up the {body} sits {size} elsewhere ({} images: {}): it is loose, or bends under its weight",
                ["x", "y", "z"][axis],
                self.images.len(),
                some_of(&self.images, MOST_IMAGES)
            ),
            Displacement::AllThrough => {
                format!(
                    "from the first to the last image the {body} creeps by {size}: it is not yet warm, or gives way"
                )
            }
        };
        format!("{what} (this explains {:.0} % of the squares of the joint noise)", 100.0 * self.share)
    }

    fn remedy(&self) -> String {
        match self.displacement {
            Displacement::FromThenOn if self.is_camera() => format!(
                "fasten the camera, and take the series again, or put the images from {} on into a series of their own with the same [camera] name and another mounting",
                self.first()
            ),
            Displacement::FromThenOn => format!(
                "write a column placement in joints.csv that differs from {} on, or fasten the plate and take the series again",
                self.first()
            ),
            Displacement::AxisUp(_) => "fasten it, and take the series again".into(),
            Displacement::AllThrough => {
                "let camera and robot warm up, fasten what creeps, and take the series again".into()
            }
        }
    }
}
