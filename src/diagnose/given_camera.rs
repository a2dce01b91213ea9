//! What to do about a camera that was given by a file: no lens can be named beside it.

use crate::problem::MeasuredSeries;

/// Whether a camera was given by a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum GivenCamera {
    /// It was found from the data.
    #[default]
    Not,
    /// The adjustment began with it and keeps its lens.
    Start,
    /// It is held.
    Held,
}

impl GivenCamera {
    /// Of the cameras by this name, or of all: held where one is.
    pub fn of(series: &[MeasuredSeries], camera: Option<&str>) -> Self {
        let own = series.iter().filter(|s| s.has_images && camera.is_none_or(|name| name == s.camera));
        let given = own.map(|s| match &s.known_camera {
            None => Self::Not,
            Some(known) if known.held => Self::Held,
            Some(_) => Self::Start,
        });
        given.max().unwrap_or_default()
    }

    /// What to do where the camera does not fit; none where it was not given.
    pub(super) fn remedy(self) -> Option<&'static str> {
        match self {
            Self::Not => None,
            Self::Start => Some(
                "the lens is that of --camera-file: correct the file, or leave --camera-file out, for the data to choose (with --from, where the solution has it from there, --camera auto sets it aside)",
            ),
            Self::Held => Some(
                "the camera of --camera-file is held, and is the likely cause: correct the file (lens, pixel of the origin, focus, resolution), or \
                 leave --hold-camera out (with --from, where the solution holds it, --camera auto or --camera LENS sets it aside)",
            ),
        }
    }
}
