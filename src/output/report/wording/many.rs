//! Of very many images some are shown, so that the page can be mailed; all of them stand in the record of the result.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::path::Path;

use maud::{Markup, html};

use crate::output::photogrammetry::Photogrammetry;
use crate::output::solution_json::ImageRecord;
use crate::series::{InputFile, spread};

/// Most images of a drawing or a table.
const MOST_IMAGES: usize = 300;

/// Those that are drawn, in the order of the series: spread over all of them.
pub(in crate::output::report) fn drawn<T>(mut all: Vec<T>) -> Vec<T> {
    let mut some = spread(all.len(), MOST_IMAGES).peekable();
    let mut place = 0..;
    all.retain(|_| place.next().is_some_and(|k| some.next_if_eq(&k).is_some()));
    all
}

/// Those that are listed, in the order of the series: left-out ones, then those of which the residual or another error, of each image if it has
/// one, is largest beside that of all.
pub(in crate::output::report) fn listed<'a>(
    images: &'a [ImageRecord],
    other: &[Option<f64>],
) -> Vec<(usize, &'a ImageRecord)> {
    let errors = |k: usize| [images[k].rms_px, other[k]].map(Option::unwrap_or_default);
    let all = [0, 1].map(|e| (0..images.len()).map(|k| errors(k)[e]).sum::<f64>().max(f64::MIN_POSITIVE));
    let size = |k: usize| f64::max(errors(k)[0] / all[0], errors(k)[1] / all[1]);
    let mut order: Vec<(usize, &ImageRecord)> = images.iter().enumerate().collect();
    let is_out = |i: &ImageRecord| !i.is_used();
    order.sort_by(|(a, i), (b, j)| is_out(j).cmp(&is_out(i)).then(size(*b).total_cmp(&size(*a))));
    order.truncate(MOST_IMAGES);
    order.sort_by_key(|(k, _)| *k);
    order
}

/// Files that were read: all, or those that are no images where these are very many.
pub(in crate::output::report) fn files(r: Photogrammetry<'_>) -> Vec<&InputFile> {
    let are_many = r.inputs.len() > MOST_IMAGES;
    let images: HashSet<&OsStr> = r.images.iter().filter_map(|i| Path::new(&i.name).file_name()).collect();
    let is_image = |f: &InputFile| f.path.file_name().is_some_and(|name| images.contains(name));
    r.inputs.iter().filter(|f| !(are_many && is_image(f))).collect()
}

/// Says that not all are drawn.
pub(in crate::output::report) fn note(drawn: usize, all: usize) -> Markup {
    html! { @if drawn < all { p.note { (drawn) " of " (all) " images are drawn, spread over all of them." } } }
}
