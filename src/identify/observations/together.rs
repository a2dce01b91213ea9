//! What series that are given together have in common.

use super::plates::name_plates;
use super::repeated::leave_out_repeated;
use crate::error::{Notice, Result};
use crate::problem::MeasuredSeries;
use crate::series::{InputFile, Series};

/// Leaves out pictures, and what trackers and contacts measured, that were given twice (of images without a picture see [`crate::identify::build`]),
/// and gives series that show one plate one name of it. `views` are the series as their files say, in the
/// order of `measured`; `images` are the hashes of their images.
///
/// # Errors
/// A series that repeats one before it; plates of one `name` that are described otherwise.
pub fn bring_together(views: &[&Series], images: &[InputFile], measured: &mut [MeasuredSeries]) -> Result<Vec<Notice>> {
    let mut notices = leave_out_repeated(views, images, measured)?;
    notices.extend(name_plates(views, measured)?);
    Ok(notices)
}
