//! Detection over the images of a series.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::dot_sizes::{told_by_others, with_dots_alike};
use super::size_seen::{line_missing, nowhere_whole};
use super::{Detection, Loaded, Outline, examine_loaded, other_kind, tags};
use crate::error::{Code, Error, Notice, Result};
use crate::files::{batches, is_turned_by_viewers, page_of, picture_size};
use crate::series::{Plate, PlateKind, spread};

/// Of a picture of three colours and its grey values.
const BYTES_PER_PX: u64 = 7;
/// Memory of pictures that are looked at together, bytes.
const MOST_IN_FLIGHT: u64 = 1 << 30;
/// Images, or a few more, in which a plate of another kind is looked for.
const MOST_LOOKED_AT: usize = 8;

/// One image of a series with what was found in it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SeriesImage {
    /// Width and height in px; `None` for an image that could not be read.
    pub size: Option<(usize, usize)>,
    /// What was found, or why nothing was.
    pub detection: Detection,
}

impl SeriesImage {
    /// An image in which nothing was found, with the reason.
    pub fn failed(reason: Error) -> Self {
        Self { size: None, detection: Detection { failure: Some(reason), ..Detection::default() } }
    }
}

/// What the markers of a plate are printed in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ink {
    /// Darker than the ground.
    Dark,
    /// Brighter than the ground.
    Bright,
}

/// Dots, and tags that tell their numbers: the squares of a chessboard are dark and bright alike.
const fn may_be_bright(kind: PlateKind) -> bool {
    match kind {
        PlateKind::CodedCircles
        | PlateKind::CircleGrid
        | PlateKind::Charuco
        | PlateKind::Aprilgrid
        | PlateKind::ArucoGrid
        | PlateKind::Tag => true,
        PlateKind::Chessboard | PlateKind::Puzzleboard | PlateKind::Points => false,
    }
}

/// Detects the plate in all images of a series; where none shows it, in their negatives.
///
/// Results stand in the order of `images`, whatever the number of threads; an image that cannot be read or shows no
/// plate is a failure in its own place only, and so is one whose size differs from that of most; where outer lines of a chessboard or a grid
/// of dots are missing in view, or one ends where the plate file does not say, and no image shows all of it, all are failures. Each thread holds one image at a
/// time, which `picture` reads, and all of them together a gigabyte or one image; `progress` is called after every image, from any thread.
pub fn detect_series<P: Into<Loaded>>(
    images: &[PathBuf],
    plate: &Plate,
    picture: impl Fn(&Path) -> Result<P> + Sync,
    progress: impl Fn(&Path) + Sync,
) -> Vec<SeriesImage> {
    let picture = |path: &Path| picture(path).map(Into::<Loaded>::into);
    let one = |path: &Path, plate: &Plate, ink: Ink| {
        let mut image = match picture(path) {
            Err(error) => SeriesImage::failed(error),
            Ok(loaded) => {
                let size = Some((loaded.picture.width, loaded.picture.height));
                let is_of_negative = ink == Ink::Bright;
                let loaded = if is_of_negative { loaded.negative() } else { loaded };
                SeriesImage { size, detection: Detection { is_of_negative, ..examine_loaded(&loaded, plate) } }
            }
        };
        name_image(&mut image.detection, path);
        image.detection.notices.extend(page_of(path).map(several_pages));
        image.detection.notices.extend((ink == Ink::Bright).then(bright));
        image
    };
    let mut ink = Ink::Dark;
    let mut found = in_batches(images, |path| {
        let image = one(path, plate, ink);
        progress(path);
        image
    });
    let shows = |image: &SeriesImage| !image.detection.observations.is_empty();
    if may_be_bright(plate.kind) && !found.iter().any(shows) {
        let negatives = in_batches(images, |path| one(path, plate, Ink::Bright));
        if negatives.iter().any(shows) {
            (ink, found) = (Ink::Bright, negatives);
        }
    }
    let detections: Vec<&Detection> = found.iter().map(|image| &image.detection).collect();
    if let Some((measured, open)) = told_by_others(plate, &detections) {
        let paths: Vec<&PathBuf> = open.iter().map(|&k| &images[k]).collect();
        let again = in_batches(&paths, |path| one(path, &measured, ink));
        open.into_iter().zip(again).for_each(|(k, image)| found[k] = image);
    }
    refuse_unproven_boards(images, plate, &mut found);
    note_board_nowhere_whole(plate, &mut found);
    note_unseen_tags(images, plate, &mut found);
    refuse_odd_sizes(images, &mut found);
    refuse_odd_dots(images, plate, &mut found);
    let detections: Vec<_> = found.iter().map(|image| (image.size, &image.detection)).collect();
    if let Some((alike, open)) = with_dots_alike(plate, &detections) {
        let paths: Vec<&PathBuf> = open.iter().map(|&k| &images[k]).collect();
        let again = in_batches(&paths, |path| one(path, &alike, ink));
        open.into_iter().zip(again).for_each(|(k, image)| found[k].detection.leave_turn_open(image.detection));
    }
    note_turned(images, &mut found);
    if !found.iter().any(shows) {
        name_other_kind(images, plate, picture, &mut found);
    }
    found
}

/// Where no image shows the plate, one of another kind may be in view. Some images are looked at, up to the first that shows one; it stands for
/// all that fail like that one.
fn name_other_kind(
    images: &[PathBuf],
    plate: &Plate,
    picture: impl Fn(&Path) -> Result<Loaded> + Sync,
    found: &mut [SeriesImage],
) {
    // A board of another size is of this kind.
    let is_of_kind = |image: &SeriesImage| [Outline::OtherSize, Outline::Beyond].contains(&image.detection.outline);
    let in_doubt = images.iter().zip(&*found).filter(|(_, image)| image.size.is_some() && !is_of_kind(image));
    let in_doubt = in_doubt.filter_map(|(path, image)| Some((path.as_path(), image.detection.failure.as_ref()?)));
    let failures: Vec<(&Path, &Error)> = in_doubt.collect();
    let some: Vec<(&Path, &Error)> = spread(failures.len(), MOST_LOOKED_AT).map(|k| failures[k]).collect();
    let bytes: Vec<u64> = some.iter().map(|(path, _)| bytes_of(path)).collect();
    let look = |k: usize| {
        let (path, why) = some[k];
        Some((path, other_kind::named(&picture(path).ok()?.picture, plate, why)?))
    };
    let mut all = batches(&bytes, MOST_IN_FLIGHT).into_iter();
    let Some((shows, named)) = all.find_map(|batch| batch.into_par_iter().find_map_first(look)) else { return };
    let name = shows.file_name().unwrap_or_default().to_string_lossy();
    let what = if failures.len() == 1 { named.what.clone() } else { format!("in {name} {}", named.what) };
    for image in found.iter_mut().filter(|image| image.size.is_some() && !is_of_kind(image)) {
        if let Some(failure) = image.detection.failure.as_mut().filter(|failure| failure.code == named.code) {
            *failure = Error { place: failure.place.clone(), what: what.clone(), ..named.clone() };
        }
    }
}

/// Looks at images, as many at a time as memory holds; in their order.
fn in_batches<P: AsRef<Path> + Sync>(images: &[P], look: impl Fn(&Path) -> SeriesImage + Sync) -> Vec<SeriesImage> {
    let sizes: Vec<u64> = images.iter().map(|path| bytes_of(path.as_ref())).collect();
    let mut found = Vec::with_capacity(images.len());
    for batch in batches(&sizes, MOST_IN_FLIGHT) {
        found.par_extend(images[batch].par_iter().map(|path| look(path.as_ref())));
    }
    found
}

/// Memory of a picture.
fn bytes_of(path: &Path) -> u64 {
    picture_size(path).map_or(0, |(w, h)| BYTES_PER_PX * u64::from(w) * u64::from(h))
}

/// The dots that are larger tell how a grid is turned: images that show others than most, or none of them, have ids that nobody can trust. Larger dots
/// that fewer images show than there are which show all dots in these places alike are none: a speck, or two dots that ran into each other.
fn refuse_odd_dots(images: &[PathBuf], plate: &Plate, found: &mut [SeriesImage]) {
    let large = |i: &SeriesImage| {
        let sizes = i.detection.circles.as_ref().filter(|_| i.detection.failure.is_none()).map(|c| &c.sizes);
        sizes.filter(|s| !s.radii_m.is_empty()).map(|s| s.large.clone())
    };
    let mut counts: BTreeMap<Vec<u32>, usize> = BTreeMap::new();
    for seen in found.iter().filter_map(large).filter(|seen| !seen.is_empty()) {
        *counts.entry(seen).or_default() += 1;
    }
    let Some((most, count)) = counts.into_iter().max_by_key(|(_, count)| *count) else { return };
    let places = in_all_turns(plate, &most);
    let shows_none = |i: &SeriesImage| {
        let seen: BTreeSet<u32> = i.detection.observations.iter().map(|o| o.marker).collect();
        large(i).is_some_and(|large| large.is_empty()) && places.is_subset(&seen)
    };
    let without = found.iter().filter(|i| shows_none(i)).count();
    let (usual, most_are) = if without < count { (most, count) } else { (Vec::new(), without) };
    for (path, image) in images.iter().zip(found) {
        let Some(seen) = large(image).filter(|seen| *seen != usual) else { continue };
        let of_others = format!("of {most_are} other images");
        let what = match (seen.is_empty(), usual.is_empty()) {
            (true, _) => format!("shows none of the larger dots {of_others}: its ids cannot be told"),
            (false, true) => format!("dots are larger that are not so in {most_are} images: its ids cannot be told"),
            (false, false) => format!("the larger dots are not those {of_others}: its ids cannot be told"),
        };
        let remedy =
            "take the image so that all larger dots are seen, or state them in plate.toml: large = [[column, row], ..]";
        image.detection.observations.clear();
        image.detection.notices.retain(|notice| notice.code != Code::PlateSymmetric);
        image.detection.failure = Some(Error::new(Code::PlateIncomplete, path.display(), what, remedy));
    }
}

/// Places of dots, however the grid is turned.
fn in_all_turns(plate: &Plate, dots: &[u32]) -> BTreeSet<u32> {
    let turned = plate.turns().into_iter().flat_map(|turn| dots.iter().map(move |id| turn.id(*id)).collect::<Vec<_>>());
    dots.iter().copied().chain(turned).collect()
}

/// A line of a board that is missing in view may be covered only where another image shows the whole board: else the board is not as large
/// as the plate says, and every id is in doubt. An image that shows where the board ends says how large it is.
fn refuse_unproven_boards(images: &[PathBuf], plate: &Plate, found: &mut [SeriesImage]) {
    let of = |outline: Outline| found.iter().find(|i| i.detection.outline == outline);
    let beyond = of(Outline::Beyond);
    if of(Outline::Whole).or_else(|| of(Outline::Beside)).is_some() && beyond.is_none() {
        return refuse_parts_of_another(images, plate, found);
    }
    let parts: Vec<[u32; 2]> =
        found.iter().filter(|i| i.detection.failure.is_none()).map(|i| i.detection.span(plate)).collect();
    // A board of which others show more is covered.
    let holds_all = |i: &&SeriesImage| {
        i.detection.outline == Outline::OtherSize && parts.iter().all(|part| i.detection.may_hold(*part))
    };
    let other = beyond.or_else(|| found.iter().find(holds_all));
    let other = other.and_then(|i| i.detection.failure.as_ref()).map(named);
    let missing = || found.iter().filter(|i| i.detection.outline == Outline::LineMissing);
    let line = || {
        // No line is missing of a board of which another image shows them all.
        if of(Outline::Lines).is_some() {
            return None;
        }
        let told = missing().find(|i| i.detection.size_seen.is_some()).or_else(|| missing().next())?;
        Some(line_missing(plate, &told.detection))
    };
    let Some(error) = other.or_else(line) else { return };
    for (path, image) in images.iter().zip(found).filter(|(_, image)| image.detection.failure.is_none()) {
        image.detection.observations.clear();
        image.detection.failure = Some(Error { place: path.display().to_string(), ..error.clone() });
    }
}

/// The reason of one image where it is said of others.
fn named(failure: &Error) -> Error {
    let name = Path::new(&failure.place).file_name().unwrap_or_default().to_string_lossy();
    Error { what: format!("in {name} {}", failure.what), ..failure.clone() }
}

/// Where some images show the stated board whole, and one another board: what is seen in part may be of either, unless it is more than the
/// other board has.
fn refuse_parts_of_another(images: &[PathBuf], plate: &Plate, found: &mut [SeriesImage]) {
    let shows_another = |i: &SeriesImage| [Outline::Beside, Outline::OtherSize].contains(&i.detection.outline);
    let is_part =
        |i: &SeriesImage| [Outline::Open, Outline::Lines, Outline::LineMissing].contains(&i.detection.outline);
    let remedy = "take the other board out of view, or take the image so that all of the stated one is in view";
    let refused = |path: &PathBuf, image: &SeriesImage| {
        let span = Some(image).filter(|i| is_part(i) && i.detection.failure.is_none())?.detection.span(plate);
        let at = found.iter().position(|other| shows_another(other) && other.detection.may_hold(span))?;
        let what = format!("another board is in view of {}: this may be a part of it", images[at].display());
        Some(Error::new(Code::PlateIncomplete, path.display(), what, remedy))
    };
    let refusals: Vec<Option<Error>> = images.iter().zip(&*found).map(|(path, image)| refused(path, image)).collect();
    for (image, refusal) in found.iter_mut().zip(refusals).filter(|(_, refusal)| refusal.is_some()) {
        image.detection.observations.clear();
        image.detection.failure = refusal;
    }
}

/// A board without a code that no image shows from end to end has the size that the plate file says.
fn note_board_nowhere_whole(plate: &Plate, found: &mut [SeriesImage]) {
    let is_whole = |i: &SeriesImage| [Outline::Whole, Outline::Beside].contains(&i.detection.outline);
    if ![PlateKind::Chessboard, PlateKind::CircleGrid].contains(&plate.kind) || found.iter().any(is_whole) {
        return;
    }
    if let Some(image) = found.iter_mut().find(|i| i.detection.failure.is_none()) {
        image.detection.notices.push(nowhere_whole(plate));
    }
}

/// Tags have numbers, so that an outer line which no image shows puts no marker in doubt; only the middle of the plate.
fn note_unseen_tags(images: &[PathBuf], plate: &Plate, found: &mut [SeriesImage]) {
    if found.iter().any(|i| i.detection.outline == Outline::Whole) {
        return;
    }
    let without = |i: &&mut SeriesImage| i.detection.outline == Outline::TagsMissing;
    if let Some((path, image)) = images.iter().zip(found).find(|(_, i)| without(i)) {
        image.detection.notices.push(Notice { place: path.display().to_string(), ..tags::unseen_line(plate) });
    }
}

/// One camera records one size: images of another than the most frequent one are failures.
fn refuse_odd_sizes(images: &[PathBuf], found: &mut [SeriesImage]) {
    let identified = |i: &&SeriesImage| i.detection.failure.is_none();
    let mut counts: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for size in found.iter().filter(identified).filter_map(|i| i.size) {
        *counts.entry(size).or_default() += 1;
    }
    let Some((&usual, &count)) = counts.iter().max_by_key(|(_, count)| **count) else { return };
    for (path, image) in images.iter().zip(found) {
        if let Some(size) = image.size.filter(|s| *s != usual && image.detection.failure.is_none()) {
            image.detection.observations.clear();
            image.detection.failure = Some(Error::new(
                Code::ImageSizeDiffers,
                path.display(),
                format!("is {} x {} px, but {count} images are {} x {} px", size.0, size.1, usual.0, usual.1),
                "record a series with one camera at one resolution; put other images into a series of their own",
            ));
        }
    }
}

/// What is said of images that are turned or mirrored by viewers, with the first of them: a camera does not turn when a viewer turns what it took.
pub fn turned_by_viewers(images: &[impl AsRef<Path>]) -> Option<(usize, Notice)> {
    let turned: Vec<usize> = (0..images.len()).filter(|k| is_turned_by_viewers(images[*k].as_ref())).collect();
    let what = format!(
        "EXIF data of {} of {} images ask viewers to turn or mirror them; their pixels are taken as they are stored, and so is the camera",
        turned.len(),
        images.len()
    );
    let remedy = "read images so elsewhere, too (in OpenCV with IMREAD_IGNORE_ORIENTATION)";
    turned.first().map(|first| (*first, Notice::new(Code::ImageTurned, "images", what, remedy)))
}

fn note_turned(images: &[PathBuf], found: &mut [SeriesImage]) {
    if let Some((first, notice)) = turned_by_viewers(images) {
        found[first].detection.notices.push(notice);
    }
}

/// Previews, and stacks of images.
fn several_pages((pages, taken): (usize, usize)) -> Notice {
    let what =
        format!("the file holds {pages} pages, of which page {taken} is taken, the largest, or the first of such");
    Notice::new(Code::ImagePages, "image", what, "write one image to each file")
}

/// Markers on glass in reflected light, for one.
fn bright() -> Notice {
    Notice::new(
        Code::MarkersBright,
        "image",
        "its markers are brighter than the ground, and are measured in its negative",
        "nothing is lost by that; if the images were inverted by mistake, take them as they are",
    )
}

/// Names the image where the detector could only say `image`.
fn name_image(detection: &mut Detection, path: &Path) {
    if let Some(failure) = detection.failure.as_mut().filter(|f| f.place == "image") {
        failure.place = path.display().to_string();
    }
}
