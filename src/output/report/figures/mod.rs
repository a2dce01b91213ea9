//! What is drawn or shown as a picture: `maps` and `plots` of the numbers of a result, its `scene` in space, `plan_pictures` of a plan, `thumbnails` of images.

pub(super) mod maps;
pub(super) mod plan_pictures;
pub(super) mod plots;
pub(super) mod scene;
pub(super) mod thumbnails;
