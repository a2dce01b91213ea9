//! Images alone -> cameras, plates and camera poses; no robot takes part.
//!
//! `camera_start` says what is known before; `first_camera` tries focal lengths; `free_poses` is the adjustment that all else starts from; `numbering` names markers that are numbered
//! in another way than the plate file says.

pub(super) mod camera_start;
mod first_camera;
pub(super) mod free_poses;
mod numbering;
