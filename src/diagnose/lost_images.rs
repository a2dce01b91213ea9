//! What cost a series a good part of its images.

use std::collections::BTreeMap;

use super::kind::Quantity;
use crate::assess::Limits;
use crate::error::Code;
use crate::problem::Problem;

/// Images that were left out for one thing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LostImages {
    /// Why.
    pub code: Code,
    /// How many.
    pub images: usize,
    /// Of how many.
    pub of: usize,
}

impl LostImages {
    /// What cost most images, if it is a good part of them; whatever the caller did not want does not count.
    pub(super) fn of(problem: &Problem, limits: &Limits) -> Option<Self> {
        let mut counts: BTreeMap<&str, (Code, usize)> = BTreeMap::new();
        let codes = problem.images.iter().filter_map(|image| Some(image.rejected.as_ref()?.code()));
        for code in codes.filter(|code| *code != Code::ImageExcluded) {
            counts.entry(code.name()).or_insert((code, 0)).1 += 1;
        }
        let (code, images) = counts.into_values().max_by_key(|(_, images)| *images)?;
        let of = problem.images.len();
        (images as f64 > limits.share_of_images_left_out * of as f64).then_some(Self { code, images, of })
    }

    pub(super) fn quantity(&self) -> Quantity {
        Quantity::new("images_left_out", self.images as f64, "1")
    }

    pub(super) fn remedy(&self) -> String {
        let Self { code, images, of } = self;
        let more = match code {
            Code::ImageSizeDiffers => {
                ": record them all at one resolution, or put those of another size into a series of their own with a camera of its own"
            }
            _ => "",
        };
        format!("see first why {images} of {of} images were left out ({code}: {}){more}", code.meaning())
    }
}
