//! What the program found out about the data: a closed set, one file each.

use std::fmt;

use super::camera_model::CameraModelMisfit;
use super::camera_pattern::ResidualPattern;
use super::cameras_contradict::CamerasContradict;
use super::computed_postures::ComputedPostures;
use super::contradicted_distances::ContradictedDistances;
use super::extrapolates::Extrapolates;
use super::few_images::FewImages;
use super::focus::FocusChange;
use super::held_near_nominal::HeldNearNominal;
use super::held_parameters::HeldContradicted;
use super::joint_noise::JointNoiseLarge;
use super::kind::{Kind, Quantity, Subject, Weight};
use super::left_out::exchanged_pictures::ExchangedPictures;
use super::left_out::exchanged_readings::ExchangedReadings;
use super::left_out::exchanged_targets::ExchangedTargets;
use super::left_out::left_out_bodies::MeasurementsLeftOut;
use super::left_out::left_out_images::ImagesLeftOut;
use super::left_out::left_out_observations::ObservationsLeftOut;
use super::left_out::many_left_out::ManyLeftOut;
use super::left_out::moved::BodyMoved;
use super::left_out::shifted_measurements::ShiftedMeasurements;
use super::left_out::shifted_readings::ShiftedReadings;
use super::length_standard::ContradictedLengths;
use super::lens_not_in_ros::LensNotInRos;
use super::marker_off::MarkerOff;
use super::measurement_scatter::MeasurementsScatter;
use super::mirror_image::MirrorImageFits;
use super::mistake::Mistake;
use super::no_gain::NoGain;
use super::noticed::Noticed;
use super::odd_image::OddImage;
use super::parameter_off::ParameterOff;
use super::plate_size::DoubtedSize;
use super::reading_ratio::ReadingRatio;
use super::repeated_measurements::RepeatedMeasurements;
use super::rounded_readings::ReadingsRounded;
use super::scatter::LargeScatter;
use super::small_gain::SmallGain;
use super::stated_noise::NoiseContradicted;
use super::steps::displaced::Displaced;
use super::steps::images_shifted::ImagesShifted;
use super::steps::loose_mounting::LooseMounting;
use super::steps::place_misstated::PlaceMisstated;
use super::steps::zero_moved::ZeroMoved;
use super::tag_size::TagsOff;
use super::tool_in_poses::ToolInPoses;
use super::undetermined::FlangeUndetermined;
use super::zeros_off::ZeroOff;
use crate::error::{Code, Error, Notice};

macro_rules! findings {
    ($($kind:ident,)+) => {
        /// One finding. A new kind is a file in this folder, its name in the list below, and a row in
        /// [`super::CHECKS`], unless it is found elsewhere (the head of [`super`] names those that are).
        #[derive(Debug, Clone, PartialEq)]
        #[allow(missing_docs)] // Each variant is named after its type, which says what it is.
        pub enum Finding {
            $($kind($kind),)+
        }

        impl Finding {
            fn kind(&self) -> &dyn Kind {
                match self {
                    $(Self::$kind(f) => f,)+
                }
            }
        }

        $(impl From<$kind> for Finding {
            fn from(found: $kind) -> Self {
                Self::$kind(found)
            }
        })+
    };
}

findings! {
    CameraModelMisfit,
    ComputedPostures,
    ContradictedDistances,
    ContradictedLengths,
    CamerasContradict,
    Displaced,
    DoubtedSize,
    ExchangedPictures,
    ExchangedReadings,
    ExchangedTargets,
    Extrapolates,
    FewImages,
    FlangeUndetermined,
    HeldContradicted,
    HeldNearNominal,
    FocusChange,
    ImagesLeftOut,
    ImagesShifted,
    JointNoiseLarge,
    LargeScatter,
    LensNotInRos,
    LooseMounting,
    ManyLeftOut,
    MarkerOff,
    MeasurementsLeftOut,
    MeasurementsScatter,
    MirrorImageFits,
    Mistake,
    BodyMoved,
    NoGain,
    NoiseContradicted,
    Noticed,
    ObservationsLeftOut,
    OddImage,
    ParameterOff,
    PlaceMisstated,
    RepeatedMeasurements,
    ReadingsRounded,
    ReadingRatio,
    ResidualPattern,
    ShiftedMeasurements,
    ShiftedReadings,
    SmallGain,
    TagsOff,
    ToolInPoses,
    ZeroMoved,
    ZeroOff,
}

impl Finding {
    /// Stable name of its kind for programs, `snake_case`.
    pub fn code(&self) -> Code {
        self.kind().code()
    }

    /// How much it weighs.
    pub fn weight(&self) -> Weight {
        self.kind().weight()
    }

    /// What it is about.
    pub fn subjects(&self) -> Vec<Subject> {
        self.kind().subjects()
    }

    /// Its numbers.
    pub fn quantities(&self) -> Vec<Quantity> {
        self.kind().quantities()
    }

    /// What was seen of what, and why it matters.
    pub fn seen(&self) -> String {
        let Notice { place, what, .. } = self.notice();
        format!("{place}: {what}")
    }

    /// What to do about it; empty where nothing is known.
    pub fn remedy(&self) -> String {
        self.notice().remedy
    }

    /// Place, what was seen and remedy apart, so that what is said of several places can be said once.
    pub fn notice(&self) -> Notice {
        let kind = self.kind();
        Notice::new(kind.code(), kind.place(), kind.seen(), kind.remedy())
    }

    /// The finding as the reason why there is no result.
    pub fn refusal(&self) -> Error {
        let Notice { code, place, what, remedy } = self.notice();
        Error { quantities: self.quantities(), ..Error::new(code, place, what, remedy) }
    }

    /// True where the result is not to be trusted.
    pub fn fails(&self) -> bool {
        self.weight() != Weight::Note
    }
}

/// What was seen, and what to do: of a note in brackets, else behind a semicolon.
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.fails(), self.remedy()) {
            (true, remedy) if !remedy.is_empty() => write!(f, "{}; {remedy}", self.seen()),
            _ => self.notice().fmt(f),
        }
    }
}

impl From<Notice> for Finding {
    fn from(notice: Notice) -> Self {
        Self::Noticed(Noticed(notice))
    }
}
