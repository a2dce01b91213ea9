//! Tool and work object in the notations of controllers, and in the URDF.
//!
//! A new notation is one file and one row in [`files`].

mod krl;
mod rapid;
mod urscript;
mod written;

use std::collections::BTreeMap;

use crate::error::Result;
use crate::urdf::{AddedLink, add_links};

use written::NAME;
pub use written::{Frames, Named};

/// Name of the file and its text.
type Writer = (&'static str, fn(&Frames) -> String);

/// All notations: name -> bytes.
pub fn files(frames: &Frames) -> BTreeMap<String, Vec<u8>> {
    let all: [Writer; 3] = [("src", krl::text), ("mod", rapid::text), ("script", urscript::text)];
    all.into_iter().map(|(kind, text)| (format!("{NAME}.{kind}"), text(frames).into_bytes())).collect()
}

/// The corrected URDF with tool and work object as fixed links; every other byte as it is in `text`. `base_from_work` is meant in `base`.
///
/// # Errors
/// Names that are taken; text that cannot be edited.
pub fn urdf(text: &str, frames: &Frames) -> Result<String> {
    let link = |frame: &Option<Named>, parent: &str| {
        let named = frame.as_ref()?;
        // Places that are given in the base itself make a frame beside it.
        let name = if named.name == parent { format!("{parent}_work") } else { named.name.clone() };
        Some(AddedLink { name, parent: parent.to_owned(), origin: named.pose })
    };
    let links: Vec<AddedLink> =
        [link(&frames.tool, &frames.tip), link(&frames.work, &frames.base)].into_iter().flatten().collect();
    add_links(text, &links)
}
