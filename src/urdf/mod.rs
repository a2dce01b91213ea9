//! Robot descriptions: read by `urdf-rs`, patched as text so that every other byte stays.

mod added_links;
mod chain;
mod collisions;
mod elements;
mod inertial;
mod limits;
mod masses;
mod patch;
mod pose_robot;
mod read;
mod second_arm;
mod skeleton;
mod tips;
mod tree;

pub use added_links::{AddedLink, add_links};
pub use chain::{CarriedMass, Chain, Drive, FoundOrigin, Joint, JointKind};
pub use collisions::CarriedCapsule;
pub use elements::{SEARCHED_M, UNLIMITED_M, UNLIMITED_RAD};
pub use inertial::Inertial;
pub use masses::Payload;
pub use patch::patch_origins;
pub use pose_robot::{PoseCoordinates, pose_robot};
pub use read::{RobotDescription, read};
pub use second_arm::{BASE_FROM_BASE, SECOND_ARM_PREFIX};
