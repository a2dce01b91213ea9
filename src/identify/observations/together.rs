//! What series that are given together have in common.

use super::plates::name_plates;
use super::repeated::leave_out_repeated;
use crate::error::{Notice, Result};
use crate::problem::MeasuredSeries;
use crate::series::{InputFile, Series};

/// Leaves out what was given twice, and gives series that show one plate one name of it. `views` are the series as their files say, in the
/// order of `measured`; `images` are the hashes of their images.
///
/// # Errors
/// A series that repeats one before it; plates of one `name` that are described otherwise.
pub fn bring_together(views: &[&Series], images: &[InputFile], measured: &mut [MeasuredSeries]) -> Result<Vec<Notice>> {
    leave_out_repeated(views, images, measured)?;
    name_plates(views, measured)
}
