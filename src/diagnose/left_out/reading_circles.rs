//! Whose readings do images fit that were left out as wrongly paired?

use crate::problem::{ImageRejection, Mismatch, Problem};

/// Wrongly paired images that fit the readings of others, and the circles of those that fit each other's.
#[derive(Debug)]
pub struct ReadingCircles {
    /// For every image the one whose readings it fits, and how well; none for others.
    fits: Vec<Option<(usize, f64)>>,
    /// True for those that come back to themselves from one to the next.
    is_in_circle: Vec<bool>,
}

impl ReadingCircles {
    /// Of the images that were left out as wrongly paired.
    pub fn of(problem: &Problem) -> Self {
        let fits: Vec<Option<(usize, f64)>> =
            (0..problem.images.len()).map(|image| whose_readings_fit(problem, image)).collect();
        let mut is_in_circle = vec![false; fits.len()];
        let mut is_met = vec![false; fits.len()];
        for first in 0..fits.len() {
            let (mut way, mut at) = (Vec::new(), first);
            while !is_met[at]
                && let Some((other, _)) = fits[at]
            {
                is_met[at] = true;
                way.push(at);
                at = other;
            }
            // A way that comes back to one of its own images ends in a circle.
            let back_at = way.iter().position(|image| *image == at);
            way.iter().skip(back_at.unwrap_or(way.len())).for_each(|image| is_in_circle[*image] = true);
        }
        Self { fits, is_in_circle }
    }

    /// True for an image of a circle.
    pub fn contain(&self, image: usize) -> bool {
        self.is_in_circle[image]
    }

    /// Of an image outside the circles the one whose readings it fits, and how well.
    pub fn fit_outside(&self, image: usize) -> Option<(usize, f64)> {
        self.fits[image].filter(|_| !self.contain(image))
    }

    /// The images of a circle from one of them on, each with how well it fits the readings of the next, the last those of the first.
    pub fn beginning_with(&self, first: usize) -> Vec<(usize, f64)> {
        let mut circle = Vec::new();
        let mut at = first;
        while let Some((next, misfit)) = self.fits[at] {
            circle.push((at, misfit));
            at = next;
            if at == first {
                break;
            }
        }
        circle
    }
}

/// The image of whose readings a wrongly paired one is, and how well it fits them.
fn whose_readings_fit(problem: &Problem, image: usize) -> Option<(usize, f64)> {
    let image = &problem.images[image];
    let Some(ImageRejection::WronglyPaired(Mismatch::Fit { fits: Some(fits), .. })) = &image.rejected else {
        return None;
    };
    let other = problem.images.iter().position(|i| i.series == image.series && i.name == fits.of)?;
    Some((other, fits.misfit))
}
