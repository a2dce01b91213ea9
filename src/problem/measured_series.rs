//! A series as the adjustment takes it: everything that was measured, with identified markers.

use serde::{Deserialize, Serialize};

use super::body::{BodySeen, InstrumentKind};
use super::rejection::ImageRejection;
use super::shared::Shared;
use crate::error::Code;
use crate::model::camera::{Camera, Lens};
use crate::series::{CameraMount, Observation, Plate, PlateKind, ReadOtherwise};

/// Which lenses the evidence chooses among.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LensChoice {
    /// None: the lens is as stated.
    #[default]
    Settled,
    /// Those that camera.yaml can express.
    Exported,
    /// All, with and without a displacement field.
    All,
}

impl LensChoice {
    /// True where a lens is among them.
    pub fn has(self, lens: Lens) -> bool {
        match self {
            Self::Settled => false,
            Self::Exported => lens.is_in_ros(),
            Self::All => true,
        }
    }
}

/// A camera that is known beforehand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KnownCamera {
    /// It.
    pub camera: Camera,
    /// True where it is held, false where it is what the adjustment starts from.
    pub held: bool,
}

/// One series after detection, joint readings in SI and in the order of the chain.
#[derive(Debug, Clone)]
pub struct MeasuredSeries {
    /// Name of the series, for messages.
    pub name: String,
    /// Name of its stops, where other cameras saw them, too: series of one run follow each other.
    pub run: Option<String>,
    /// Series with the same camera share intrinsics.
    pub camera: String,
    /// Series with the same mounting share the hand-camera offset.
    pub mounting: String,
    /// Where the camera is.
    pub mount: CameraMount,
    /// Columns of the images.
    pub width_px: u32,
    /// Rows of the images.
    pub height_px: u32,
    /// Focal length as stated, px.
    pub focal_px: Option<f64>,
    /// The camera, where a file of it was given.
    pub known_camera: Option<KnownCamera>,
    /// Lens model.
    pub lens: Lens,
    /// Whether the evidence decides on the lens; the fit then begins with the simplest that explains the images.
    pub lens_choice: LensChoice,
    /// What an observation of a circle means: true for the centroid of its image, false for its imaged centre.
    pub centroid: bool,
    /// The plate.
    pub plate: Plate,
    /// Series with the same plate name share its shape.
    pub plate_name: String,
    /// True where the rows stand in the order of visiting.
    pub order_known: bool,
    /// Poses of a controller with a mistake undone, for each mistake that is usual; one a stop.
    pub otherwise: Vec<ReadOtherwise>,
    /// Where readings were computed from poses of a controller: other readings with which the nominal robot reaches the pose, for every stop.
    pub postures: Vec<Vec<Vec<f64>>>,
    /// False for a series without images: what it says of camera and plate is not used.
    pub has_images: bool,
    /// Stops in the order of the rows.
    pub stops: Vec<MeasuredStop>,
    /// What was measured of bodies that the tip carries.
    pub bodies: Vec<SeenBody>,
    /// Distances that were measured between places or bodies.
    pub lengths: Vec<SeenLength>,
}

impl MeasuredSeries {
    /// Whether readings were computed from poses of a controller that are reached in several postures.
    pub fn readings_are_computed(&self) -> bool {
        self.postures.iter().any(|others| !others.is_empty())
    }

    /// Whether poses of a controller were read in place of readings, as far as that is known.
    pub fn poses_were_read(&self) -> bool {
        !self.otherwise.is_empty() || self.readings_are_computed()
    }

    /// The file of the readings.
    pub fn readings_file(&self) -> &'static str {
        if self.poses_were_read() { "controller.csv" } else { "joints.csv" }
    }

    /// A series without images: stops, and nothing measured yet.
    pub fn without_images(name: &str, order_known: bool, stops: Vec<MeasuredStop>) -> Self {
        Self {
            name: name.to_owned(),
            run: None,
            camera: String::new(),
            mounting: String::new(),
            mount: CameraMount::Hand,
            width_px: 0,
            height_px: 0,
            focal_px: None,
            known_camera: None,
            lens: Lens::Brown,
            lens_choice: LensChoice::Settled,
            centroid: true,
            plate: Plate::lattice(PlateKind::Points, 0, 0, 0.0, 0.0),
            plate_name: String::new(),
            order_known,
            otherwise: Vec::new(),
            postures: Vec::new(),
            has_images: false,
            stops,
            bodies: Vec::new(),
            lengths: Vec::new(),
        }
    }
}

/// Name of a stop, by the index of its series and its own; with its series where another series has one of this name, too.
pub fn stop_name(all: &[MeasuredSeries], (series, stop): (usize, usize)) -> String {
    let Some(name) = all.get(series).and_then(|s| s.stops.get(stop)).map(|stop| &stop.image) else {
        return String::new();
    };
    let run = all[series].run.as_ref();
    let is_of_run = |other: &MeasuredSeries| run.is_some() && other.run.as_ref() == run;
    let has_it = |other: &MeasuredSeries| !is_of_run(other) && other.stops.iter().any(|stop| &stop.image == name);
    match all.iter().enumerate().any(|(k, other)| k != series && has_it(other)) {
        true => format!("{} {name}", all[series].name),
        false => name.clone(),
    }
}

/// What an instrument measured of a body at a stop.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenBody {
    /// Index of the stop in its series.
    pub stop: usize,
    /// Name of the instrument.
    pub instrument: String,
    /// What it is.
    pub kind: InstrumentKind,
    /// Name of the body.
    pub body: String,
    /// What it saw, m.
    pub seen: BodySeen,
    /// Stated sigma of a coordinate, m.
    pub sigma_m: f64,
    /// Stated sigma of the rotation about an axis, rad.
    pub sigma_rad: f64,
}

/// A measured distance between two instruments (sockets) or bodies, by name.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenLength {
    /// Names.
    pub between: [String; 2],
    /// Measured, m.
    pub distance_m: f64,
    /// Its sigma, m.
    pub sigma_m: f64,
}

/// One stop with what its image shows.
#[derive(Debug, Clone)]
pub struct MeasuredStop {
    /// Place among the stops of the run; rows of one place are images of one stop.
    pub row: usize,
    /// File name of the image.
    pub image: String,
    /// Readings, rad or m; `None` off the robot.
    pub readings: Option<Vec<f64>>,
    /// Where the plate stood.
    pub placement: String,
    /// What was seen.
    pub observations: Shared<Vec<Observation>>,
    /// Why the image is left out already (unreadable, nothing found).
    pub left_out: Option<ImageRejection>,
}

impl MeasuredStop {
    /// Whether it is left out because nothing in the image tells how the plate is turned: the ids are those of one of its turns.
    pub fn is_turn_open(&self) -> bool {
        let is_open = |why: &ImageRejection| matches!(why, ImageRejection::Unusable { why: Code::PlateTurnOpen, .. });
        self.left_out.as_ref().is_some_and(is_open) && !self.observations.is_empty()
    }
}

/// Index of a name among `names`, to which it is added where it is new.
pub fn intern(names: &mut Vec<String>, name: &str) -> usize {
    names.iter().position(|n| n == name).unwrap_or_else(|| {
        names.push(name.to_owned());
        names.len() - 1
    })
}
