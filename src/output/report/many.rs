//! Of very many images some are shown, so that the page can be mailed; all of them stand in solution.json.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::path::Path;

use maud::{Markup, html};

use crate::output::solution_json::{ImageRecord, SolutionRecord};
use crate::series::{InputFile, spread};

/// Most images of a drawing or a table.
const MOST_IMAGES: usize = 300;

/// Those that are drawn, in the order of the series: spread over all of them.
pub(super) fn drawn<T>(mut all: Vec<T>) -> Vec<T> {
    let mut some = spread(all.len(), MOST_IMAGES).peekable();
    let mut place = 0..;
    all.retain(|_| place.next().is_some_and(|k| some.next_if_eq(&k).is_some()));
    all
}

/// Those that are listed, in the order of the series: left-out ones, then those whose residual or held-out error is largest beside that of all.
pub(super) fn listed(r: &SolutionRecord) -> Vec<&ImageRecord> {
    let errors = |i: &ImageRecord| [i.rms_px, i.held_out_mm.map(|e| e[1])].map(Option::unwrap_or_default);
    let all = [0, 1].map(|k| r.images.iter().map(|i| errors(i)[k]).sum::<f64>().max(f64::MIN_POSITIVE));
    let size = |i: &ImageRecord| f64::max(errors(i)[0] / all[0], errors(i)[1] / all[1]);
    let mut order: Vec<(usize, &ImageRecord)> = r.images.iter().enumerate().collect();
    let is_out = |i: &ImageRecord| !i.is_used();
    order.sort_by(|(_, a), (_, b)| is_out(b).cmp(&is_out(a)).then(size(b).total_cmp(&size(a))));
    order.truncate(MOST_IMAGES);
    order.sort_by_key(|(k, _)| *k);
    order.into_iter().map(|(_, image)| image).collect()
}

/// Files that were read: all, or those that are no images where these are very many.
pub(super) fn files(r: &SolutionRecord) -> Vec<&InputFile> {
    let are_many = r.inputs.len() > MOST_IMAGES;
    let images: HashSet<&OsStr> = r.images.iter().filter_map(|i| Path::new(&i.name).file_name()).collect();
    let is_image = |f: &InputFile| f.path.file_name().is_some_and(|name| images.contains(name));
    r.inputs.iter().filter(|f| !(are_many && is_image(f))).collect()
}

/// Says that not all are drawn.
pub(super) fn note(drawn: usize, all: usize) -> Markup {
    html! { @if drawn < all { p.note { (drawn) " of " (all) " images are drawn, spread over all of them." } } }
}
