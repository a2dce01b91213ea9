//! The finding that a plate or a camera stands elsewhere in some of the images; [`super::pose_step`] looks for it.

use crate::diagnose::kind::{Kind, Quantity, Subject, Weight, some_of};
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
    /// A tracker.
    Instrument,
    /// What given places are fixed to.
    Places,
    /// One socket.
    Socket,
    /// What a tracker or a socket sees of the tip.
    Target,
    /// What holds all targets on the tip.
    Bracket,
    /// What all sockets are fixed to.
    Fixture,
    /// What some sockets are fixed to: the others were not touched both before and behind, and nothing tells of them.
    FixtureOfSome,
}

/// In which images it stands elsewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Displacement {
    /// From the first of them on: moved once.
    FromThenOn,
    /// Where its axis x, y or z (0, 1, 2) points up: held by its weight only.
    AxisUp(usize),
    /// In these, and not in others that stand between them.
    ByTurns,
    /// More in each than in the one before: it creeps.
    AllThrough,
    /// In all of them: elsewhere than in the other series.
    InAll,
}

/// A body stands elsewhere in some images, by too little for any of them to be left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Displaced {
    /// Series.
    pub series: String,
    /// What.
    pub body: Carried,
    /// Names of the sockets that moved; none where it is another body.
    pub places: Vec<String>,
    /// Name of the mounting of its images, or of what measures it.
    pub mounting: String,
    /// How the images are divided.
    pub displacement: Displacement,
    /// Images or stops in which it stands elsewhere, in this order.
    pub images: Vec<String>,
    /// How far, m, and sigma per axis; of what creeps, from the first to the last image.
    pub distance_m: (f64, f64),
    /// By which angle, rad, and sigma per axis; none where points alone were seen.
    pub angle_rad: Option<(f64, f64)>,
    /// Share of the squares of the joint noise that this and the other displacements explain.
    pub share: f64,
    /// True where it, or one that was found after it, explains most of what was left.
    pub explains_most: bool,
    /// Gate where it is beyond what a good robot repeats to, and explains most.
    pub weight: Weight,
}

impl Displaced {
    /// True where it happened in the course of time, in images of this mounting.
    pub(in crate::diagnose) fn explains_two_places_of(&self, mounting: &str) -> bool {
        self.explains_most && !matches!(self.displacement, Displacement::AxisUp(_)) && self.mounting == mounting
    }

    /// True where it stands in two places by turns.
    pub(in crate::diagnose) fn is_by_turns(&self) -> bool {
        self.displacement == Displacement::ByTurns
    }

    /// True where measurements with this instrument scatter because of it.
    pub(in crate::diagnose) fn explains_scatter_of(&self, instrument: &str) -> bool {
        self.explains_most && self.is_measured() && self.mounting == instrument
    }

    /// True where it is told that it stands elsewhere, not only that residuals are smaller so.
    pub(in crate::diagnose) fn is_far(&self) -> bool {
        let is_told = |(by, sigma): (f64, f64)| by > 2.0 * sigma;
        is_told(self.distance_m) || self.angle_rad.is_some_and(is_told)
    }

    /// True where a tracker or contacts show it, not images.
    pub(in crate::diagnose) fn is_measured(&self) -> bool {
        !matches!(self.body, Carried::Plate | Carried::PlateInHand | Carried::CameraInHand | Carried::Camera)
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
            Carried::Instrument => "tracker",
            Carried::Places => "fixture of the given places",
            Carried::Socket => "socket",
            Carried::Target => "target on the tip",
            Carried::Bracket => "bracket of all targets on the tip",
            Carried::Fixture => "fixture of all sockets",
            Carried::FixtureOfSome => "fixture of sockets",
        }
    }

    /// How far it is elsewhere, with the sigmas.
    fn size(&self) -> String {
        let (far, far_sigma) = (1e3 * self.distance_m.0, 1e3 * self.distance_m.1);
        match self.angle_rad {
            Some((angle, sigma)) => format!(
                "{far:.2} mm, {:.2} mrad (sigma at most {far_sigma:.2} mm, {:.2} mrad per axis)",
                1e3 * angle,
                1e3 * sigma
            ),
            None => format!("{far:.2} mm (sigma at most {far_sigma:.2} mm per axis)"),
        }
    }

    /// What else than that it was moved looks the same.
    fn what_else(&self) -> String {
        match self.body {
            Carried::Camera | Carried::CameraInHand => ", creeps, or its lens was touched".to_owned(),
            Carried::Fixture => format!(" with {}, or the base of the robot", self.places.join(", ")),
            Carried::FixtureOfSome => ", or the base of the robot".to_owned(),
            _ => ", or creeps".to_owned(),
        }
    }

    /// Where it is elsewhere from one image or stop on.
    fn remedy_from_then_on(&self) -> String {
        match self.body {
            Carried::Camera | Carried::CameraInHand => format!(
                "fasten the camera, and take the series again, or put the images from {} on into a series of their own with the same [camera] name and another mounting",
                self.first()
            ),
            Carried::Plate | Carried::PlateInHand => format!(
                "write a column placement in joints.csv that differs from {} on, or fasten the plate and take the series again",
                self.first()
            ),
            Carried::Instrument => format!(
                "put the stops from {} on into a series of their own with another [tracker] name, or measure again",
                self.first()
            ),
            Carried::Places => format!(
                "put the stops from {} on into a series of their own with another [contact] frame, or measure again",
                self.first()
            ),
            Carried::Socket => format!(
                "give contact {} another name from {} on, or fasten the socket and measure again",
                self.places.join(", "),
                self.first()
            ),
            Carried::Target => format!(
                "give the target another name from {} on (of contacts, put them into a series of their own), or fasten it and measure again",
                self.first()
            ),
            Carried::Bracket => format!(
                "give all targets other names from {} on, or fasten their bracket and measure again",
                self.first()
            ),
            Carried::Fixture => {
                format!(
                    "give all contacts other names from {} on, or fasten the fixture and measure again",
                    self.first()
                )
            }
            Carried::FixtureOfSome => format!(
                "give contacts {} other names from {} on, or fasten them and measure again",
                self.places.join(", "),
                self.first()
            ),
        }
    }

    /// Where it is elsewhere in one of several series.
    fn remedy_between_series(&self) -> String {
        match self.body {
            Carried::Camera | Carried::CameraInHand => {
                format!("write another mounting under [camera] in the series.toml of {}", self.series)
            }
            Carried::Plate | Carried::PlateInHand => {
                format!("write a placement of its own into the joints.csv of {}", self.series)
            }
            Carried::Instrument => {
                format!("write another name under [tracker] in the series.toml of {}", self.series)
            }
            Carried::Places => format!("write another frame under [contact] in the series.toml of {}", self.series),
            Carried::Socket => format!("give contact {} another name in {}", self.places.join(", "), self.series),
            Carried::Target => format!("give the target another name in {}", self.series),
            Carried::Bracket => format!("give all targets other names in {}", self.series),
            Carried::Fixture => format!("give all contacts other names in {}", self.series),
            Carried::FixtureOfSome => {
                format!("give contacts {} other names in {}", self.places.join(", "), self.series)
            }
        }
    }
}

impl Kind for Displaced {
    fn code(&self) -> Code {
        let of = |displaced, drifts, loose| match self.displacement {
            Displacement::FromThenOn | Displacement::InAll | Displacement::ByTurns => displaced,
            Displacement::AllThrough => drifts,
            Displacement::AxisUp(_) => loose,
        };
        match self.body {
            Carried::Plate | Carried::PlateInHand => of(Code::PlateDisplaced, Code::PlateDrifts, Code::PlateLoose),
            Carried::Camera | Carried::CameraInHand => of(Code::CameraDisplaced, Code::CameraDrifts, Code::CameraLoose),
            Carried::Instrument => of(Code::TrackerDisplaced, Code::TrackerDrifts, Code::TrackerDisplaced),
            Carried::Target | Carried::Bracket => of(Code::TargetDisplaced, Code::TargetDrifts, Code::TargetDisplaced),
            Carried::Fixture | Carried::FixtureOfSome | Carried::Places | Carried::Socket => Code::WorkDisplaced,
        }
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        let mut all = vec![Subject::Series(self.series.clone()), Subject::Body(self.body().to_owned())];
        all.extend(self.places.iter().cloned().map(Subject::Body));
        if !matches!(self.displacement, Displacement::AllThrough | Displacement::InAll) {
            let subject = if self.is_measured() { Subject::Stop } else { Subject::Image };
            all.extend(self.images.iter().cloned().map(subject));
        }
        all
    }

    fn quantities(&self) -> Vec<Quantity> {
        let distance = Quantity::new("distance", self.distance_m.0, "m").with_sigma(self.distance_m.1);
        let angle = self.angle_rad.map(|(angle, sigma)| Quantity::new("angle", angle, "rad").with_sigma(sigma));
        let share = Quantity::new("share_of_joint_noise", self.share, "1");
        [Some(distance), angle, Some(share)].into_iter().flatten().collect()
    }

    fn place(&self) -> String {
        format!("series {}", self.series)
    }

    fn seen(&self) -> String {
        let body = match self.body {
            Carried::Socket | Carried::FixtureOfSome => format!("{} {}", self.body(), self.places.join(", ")),
            _ => self.body().to_owned(),
        };
        let size = self.size();
        let what = match self.displacement {
            Displacement::FromThenOn => {
                let stands = match self.body {
                    Carried::PlateInHand | Carried::CameraInHand | Carried::Target | Carried::Bracket => "sits",
                    _ => "stands",
                };
                format!(
                    "from {} on the {body} {stands} {size} elsewhere than before: it was moved{}",
                    self.first(),
                    self.what_else()
                )
            }
            Displacement::AxisUp(axis) => format!(
                "where its {} axis points up the {body} sits {size} elsewhere ({} images: {}): it is loose, or bends under its weight",
                ["x", "y", "z"][axis],
                self.images.len(),
                some_of(&self.images, MOST_IMAGES)
            ),
            Displacement::ByTurns => format!(
                "the {body} stands in two places by turns: in {} images ({}) {size} from where it is in the others",
                self.images.len(),
                some_of(&self.images, MOST_IMAGES)
            ),
            Displacement::AllThrough => {
                format!(
                    "from the first to the last {} the {body} creeps by {size}: it is not yet warm, or gives way",
                    if self.is_measured() { "stop" } else { "image" }
                )
            }
            Displacement::InAll => {
                format!("the {body} is {size} from where it is in the other series: it was moved between them")
            }
        };
        format!("{what} (this explains {:.0} % of the squares of the joint noise)", 100.0 * self.share)
    }

    fn remedy(&self) -> String {
        match self.displacement {
            Displacement::FromThenOn => self.remedy_from_then_on(),
            Displacement::InAll => self.remedy_between_series(),
            Displacement::ByTurns => {
                "give the rows of each place a placement of their own in joints.csv, or fasten it and take the series again".into()
            }
            Displacement::AxisUp(_) => "fasten it, and take the series again".into(),
            Displacement::AllThrough => {
                "let camera and robot warm up, fasten what creeps, and take the series again".into()
            }
        }
    }
}
