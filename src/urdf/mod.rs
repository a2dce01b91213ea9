//! Robot descriptions: read by `urdf-rs`, patched as text so that every other byte stays.

mod chain;

pub use chain::{Chain, Drive, Joint, JointKind};
