//! Reading a series folder.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use super::controller_file;
use super::controller_poses::ControllerPoses;
use super::image_file;
use super::image_folder::{by_name, image_files, is_image, other_files};
use super::inputs::InputFile;
use super::joints::{SeriesStop, StopKey, Stops};
use super::light::{Light, lights_of, unused_light, unused_light_of_one};
use super::manifest::{Manifest, StopOrder};
use super::measurement_series::{Series, Source, file_name, own_manifest};
use super::observation_file;
use super::plate::Plate;
use super::plate_file::read_plate;
use super::recording::{is_recording, require_recording, written_in};
use super::rotation_kind::RotationKind;
use super::run::Run;
use super::spatial::SpatialFiles;
use super::stop_index::StopIndex;
use super::table::Table;
use super::views::{CameraView, WholeSeries, has_mixed_mounts};
use crate::error::{Code, Error, Notice, Result, plain_name};
use crate::files;

/// What to do with images of other formats.
const CONVERT: &str = "convert the images to png, tif, pgm, jpg or bmp, and name them so in the table";

/// Reads a series folder; `observations.csv` is used instead of images where it exists. A recording (an `.mcap` file or a
/// rosbag2 folder) may be given instead, with a manifest of its name or a `series.toml` beside it; its stops come with
/// [`Series::with_recording`].
///
/// # Errors
/// By file, line, image or joint: whatever does not follow the format or contradicts itself.
pub fn read(path: &Path) -> Result<Series> {
    if is_recording(path) {
        return read_recording(path);
    }
    read_folder(path, path.join("observations.csv").is_file())
}

/// Reads a series for its images, even where there is an `observations.csv`.
///
/// # Errors
/// As [`read`].
pub fn read_images(path: &Path) -> Result<Series> {
    if is_recording(path) {
        return read_recording(path);
    }
    read_folder(path, false)
}

fn read_recording(path: &Path) -> Result<Series> {
    // A bag of another kind is named as such before its manifest is missed.
    require_recording(path)?;
    let manifest_path = manifest_beside(path)?;
    let folder = manifest_path.parent().unwrap_or(path).to_path_buf();
    let mut inputs = Vec::new();
    let mut manifest = Manifest::read(&manifest_path, &mut inputs)?;
    manifest.mcap = Some(file_name(path));
    manifest.require_camera_and_plate(&manifest_path)?;
    let plate = plate_of(&manifest, &folder, &mut inputs)?;
    let name = own_manifest(path).file_stem().map_or_else(|| "series".into(), |n| n.to_string_lossy().into_owned());
    plain_name("series", &name, path.display())?;
    let source = Source::Recording(path.to_path_buf());
    let (stops, spatial, notices) = (Stops::default(), SpatialFiles::default(), Vec::new());
    Ok(Series { name, folder, manifest, plate, stops, source, controller: None, spatial, run: None, notices, inputs })
}

fn read_folder(folder: &Path, use_observations: bool) -> Result<Series> {
    let name = folder_name(folder)?;
    let manifest_path = folder.join("series.toml");
    if !manifest_path.exists() {
        return Err(no_manifest(folder));
    }
    let mut inputs = Vec::new();
    let manifest = Manifest::read(&manifest_path, &mut inputs)?;
    let by_cameras = manifest.mcap.is_none() && (manifest.cameras.len() > 1 || folder.join(image_file::NAME).is_file());
    let is_seen = by_cameras || manifest.mcap.is_some() || use_observations || !is_measured_in_space_alone(folder);
    if is_seen {
        manifest.require_camera_and_plate(&manifest_path)?;
    }
    let plate = plate_of(&manifest, folder, &mut inputs)?;
    let mut notices = Vec::new();
    let (mut stops, mut controller, mut spatial) = (Stops::default(), None, SpatialFiles::default());
    let source = if let Some(recording) = &manifest.mcap {
        let recording = folder.join(recording);
        // What is not there is said by what needs it.
        if recording.exists() {
            require_recording(&recording)?;
        }
        Source::Recording(recording)
    } else {
        (stops, controller) = stops_of(folder, &manifest, &manifest_path, &mut inputs)?;
        let table = folder.join(controller_file::table_of_stops(folder));
        if manifest.robot.order == StopOrder::Visited {
            notices.extend(stops.order_notice(&table));
        }
        spatial = SpatialFiles::read(folder, &stops, &mut inputs, &mut notices)?;
        if by_cameras {
            Source::NoImages
        } else if use_observations {
            let path = folder.join("observations.csv");
            observed(&path, &manifest, &plate, &stops, &mut inputs, &mut notices)?
        } else if is_seen {
            let lines: Vec<u64> = stops.stops.iter().map(|s| s.line).collect();
            let images = folder.join("images");
            let light = Light::of(&[&images, folder])?;
            pictured((&images, light), (&table, &lines), &mut stops, &mut notices)?
        } else {
            Source::NoImages
        }
    };
    let folder = folder.to_path_buf();
    let mut series =
        Series { name, folder, manifest, plate, stops, source, controller, spatial, run: None, notices, inputs };
    series.notices.extend(unused_light_of_one(&series));
    if by_cameras {
        let mut views = views_of(&mut series, use_observations)?;
        views.extend(measured_in_space(&series, &views));
        series.source = Source::Cameras(views);
    }
    Ok(series)
}

fn no_manifest(folder: &Path) -> Error {
    let recording = written_in(folder).into_iter().next().filter(|_| !folder.join("images").exists());
    let remedy = match recording {
        Some(recording) => format!("give the recording that it holds: {}", recording.display()),
        None => format!(
            "give the folder that holds it; `robotcal doctor {}` says what a series needs",
            files::word(folder.display())
        ),
    };
    Error::new(Code::SeriesMissing, folder.display(), "holds no series.toml", remedy)
}

/// What trackers and contacts measured at the stops of the cameras: a view of all stops, without images.
fn measured_in_space(series: &Series, views: &[Series]) -> Option<Series> {
    let is_taken = views.iter().any(|view| view.name == series.name);
    let name = if is_taken { format!("{} in space", series.name) } else { series.name.clone() };
    let rows = (0..series.stops.stops.len()).collect();
    let has_mixed_mounts = has_mixed_mounts(&series.manifest);
    let run = Some(Run { name: series.name.clone(), has_mixed_mounts, rows });
    (!series.spatial.is_empty()).then(|| Series {
        name,
        source: Source::NoImages,
        run,
        notices: Vec::new(),
        inputs: Vec::new(),
        ..series.clone()
    })
}

/// The views of the cameras of a series, by its images.csv.
fn views_of(series: &mut Series, use_observations: bool) -> Result<Vec<Series>> {
    let path = series.folder.join(image_file::NAME);
    if !path.is_file() {
        let what = "is missing: there are several [[camera]], and nothing says which took which image";
        let remedy = "write it with the columns stop, camera, image";
        return Err(Error::new(Code::FileMissing, path.display(), what, remedy));
    }
    let table = Table::read(&path, &mut series.inputs)?;
    let rows = image_file::rows(
        &table,
        &StopIndex::of(&series.stops, controller_file::table_of_stops(&series.folder)),
        &series.manifest.cameras,
    )?;
    let Series { name, folder, manifest, stops, controller, .. } = &*series;
    let all = WholeSeries { series: name, folder, manifest, stops, controller: controller.as_ref() };
    let views = all.views(&rows);
    if use_observations {
        require_names_of_their_own(&path, &views)?;
    }
    let mut inputs = Vec::new();
    let folders: Vec<PathBuf> = views.iter().map(|view| view.images.clone()).collect();
    let views = views.into_iter().zip(&folders).map(|(view, images)| {
        let light = lights_of(images, &folders, folder);
        one_view(series, &path, (view, &light), use_observations, &mut inputs)
    });
    let views = views.collect::<Result<Vec<_>>>()?;
    if !use_observations {
        series.notices.extend(unused_light(series, &folders, &views));
    }
    series.inputs.extend(inputs);
    series.inputs.dedup();
    Ok(views)
}

/// Observations name their image and no camera.
fn require_names_of_their_own(table: &Path, views: &[CameraView]) -> Result<()> {
    let mut names = BTreeSet::new();
    let images = views.iter().flat_map(|view| &view.stops.stops);
    match images.map(|stop| stop.image.as_str()).find(|name| !names.insert(*name)) {
        Some(name) => {
            let what = format!("\"{name}\" is an image of two cameras, which observations.csv does not tell apart");
            let remedy = "give the images of every camera names of their own, here and in observations.csv";
            Err(Error::new(Code::CsvRowTwice, table.display(), what, remedy))
        }
        None => Ok(()),
    }
}

fn one_view(
    series: &Series,
    table: &Path,
    (view, light): (CameraView, &[&Path]),
    use_observations: bool,
    inputs: &mut Vec<InputFile>,
) -> Result<Series> {
    let CameraView { name, manifest, images, mut stops, lines, rows, controller } = view;
    if stops.stops.is_empty() {
        let what = format!("has no image of camera \"{}\"", manifest.camera().name.as_deref().unwrap_or(&name));
        let remedy = "add its images, or remove the [[camera]] from series.toml";
        return Err(Error::new(Code::ImagesMissing, table.display(), what, remedy));
    }
    let mut notices = Vec::new();
    let source = if use_observations {
        // Images of the other cameras stand in the same file: that they are none of this one is no news.
        let path = series.folder.join("observations.csv");
        observed(&path, &manifest, &series.plate, &stops, inputs, &mut Vec::new())?
    } else {
        pictured((&images, Light::of(light)?), (table, &lines), &mut stops, &mut notices)?
    };
    let has_mixed_mounts = has_mixed_mounts(&series.manifest);
    let run = Some(Run { name: series.name.clone(), has_mixed_mounts, rows });
    let (folder, plate, spatial) = (series.folder.clone(), series.plate.clone(), SpatialFiles::default());
    Ok(Series { name, folder, manifest, plate, stops, source, controller, spatial, run, notices, inputs: Vec::new() })
}

/// The stops of joints.csv, or of controller.csv with their poses.
fn stops_of(
    folder: &Path,
    manifest: &Manifest,
    manifest_path: &Path,
    inputs: &mut Vec<InputFile>,
) -> Result<(Stops, Option<ControllerPoses>)> {
    let (joints, poses) = (folder.join("joints.csv"), folder.join(controller_file::NAME));
    if !poses.is_file() {
        manifest.require_joint_unit(manifest_path)?;
        return Ok((Stops::read(&joints, inputs)?, None));
    }
    if joints.is_file() {
        let what = "stands beside joints.csv: either of them tells where the robot stood";
        let remedy = "remove controller.csv; joint readings tell more";
        return Err(Error::new(Code::SettingConflict, poses.display(), what, remedy));
    }
    let Some(section) = &manifest.controller else {
        let names = RotationKind::ALL.map(RotationKind::name).join(", ");
        let what = "does not say how controller.csv writes rotations";
        let remedy = format!("add [controller] with rotation = one of {names}; there is no default on purpose");
        return Err(Error::new(Code::SettingMissing, manifest_path.display(), what, remedy));
    };
    let (stops, mut poses) = controller_file::read(&poses, section.rotation, inputs)?;
    if let Some(first) = poses.base_from_flange.iter().position(Option::is_some) {
        poses.stated_deg[first].clone_from(&section.first_stop_deg);
    }
    Ok((stops, Some(poses)))
}

fn is_measured_in_space_alone(folder: &Path) -> bool {
    !folder.join("images").is_dir() && SpatialFiles::NAMES.iter().any(|name| folder.join(name).is_file())
}

/// The plate that a manifest names; none where it names none.
pub(super) fn plate_of(manifest: &Manifest, folder: &Path, inputs: &mut Vec<InputFile>) -> Result<Plate> {
    manifest.plate_in(folder).map_or_else(|| Ok(Plate::none()), |path| read_plate(&path, inputs))
}

pub(super) fn folder_name(folder: &Path) -> Result<String> {
    let full = folder.canonicalize().map_err(|e| Error::io(folder, &e))?;
    if !full.is_dir() {
        let remedy = "give the folder that holds series.toml";
        return Err(Error::new(Code::SeriesMissing, folder.display(), "is not a series folder", remedy));
    }
    let name = full.file_name().map_or_else(|| "series".into(), |n| n.to_string_lossy().into_owned());
    plain_name("series", &name, folder.display())?;
    Ok(name)
}

fn observed(
    path: &Path,
    manifest: &Manifest,
    plate: &Plate,
    stops: &Stops,
    inputs: &mut Vec<InputFile>,
    notices: &mut Vec<Notice>,
) -> Result<Source> {
    let own: BTreeSet<&str> = stops.stops.iter().map(|s| s.image.as_str()).collect();
    let size = |image: &str| manifest.camera().size_px().filter(|_| own.contains(image));
    let images = observation_file::read(path, plate, &size, inputs)?;
    let (ordered, strange) = observation_file::in_order(images, stops.stops.iter().map(|s| s.image.as_str()));
    let table = controller_file::table_of_stops(path.parent().unwrap_or(path));
    let seen: BTreeSet<&str> = ordered.iter().map(|i| i.image.as_str()).collect();
    let unseen: Vec<_> = stops.stops.iter().map(|s| s.image.clone()).filter(|i| !seen.contains(i.as_str())).collect();
    let alike = alike(&strange, &unseen).map(|(here, there)| {
        format!("\"{here}\" is \"{there}\" in {table}: write the names alike, with case and ending")
    });
    let remedy = alike.as_deref().unwrap_or("compare the image names in both files");
    observation_file::require_some(path, table, &ordered, remedy)?;
    if !strange.is_empty() {
        let what = format!("observes {} that {table} does not name: {}", count(strange.len()), some(&strange));
        let remedy = alike.as_deref().unwrap_or("they are not used; add rows with empty joint cells to use them");
        notices.push(Notice::new(Code::ImageUnlisted, path.display(), what, remedy));
    }
    if !unseen.is_empty() {
        let what = format!("has no observation of {} in {table}: {}", count(unseen.len()), some(&unseen));
        notices.push(Notice::new(Code::ObservationsMissing, path.display(), what, "they are left out"));
    }
    Ok(Source::Observations(ordered))
}

/// Finds the image of every stop, which a table names in these lines, and tells of images without one.
fn pictured(
    (images, light): (&Path, Light),
    (csv, lines): (&Path, &[u64]),
    stops: &mut Stops,
    notices: &mut Vec<Notice>,
) -> Result<Source> {
    let on_disk = by_name(image_files(images)?);
    let names: BTreeSet<String> = on_disk.keys().cloned().collect();
    let others_on_disk = other_files(images, &names)?;
    let others: BTreeSet<String> = others_on_disk.keys().cloned().collect();
    for stop in stops.stops.iter_mut().filter(|_| stops.key == StopKey::Stop) {
        name_image(stop, &names);
    }
    // What is no image by its name is looked at like one: what is wrong with it is said of it then.
    let path_of = |image: &str| {
        let directly = on_disk.get(image).or_else(|| others_on_disk.get(image)).cloned();
        directly.or_else(|| within(images, image))
    };
    let missing = find_paths(stops, lines, path_of);
    let remedy = |name: &str| match (similar(name, &names), similar(name, &others)) {
        (Some(there), _) => format!("\"{there}\" is there: write the name exactly"),
        (None, Some(there)) => format!("\"{there}\" is there, and its format is not read: {CONVERT}"),
        (None, None) => "copy the image or remove the row".to_string(),
    };
    refuse_other_formats((csv, lines), stops, &others)?;
    // Some images lost among many are left out by name; most images lost is a wrong folder or wrong names.
    if let Some((line, name)) = missing.first().filter(|_| 2 * missing.len() > stops.stops.len()) {
        let what = format!(
            "image \"{name}\" is not in {} ({} of {} images are missing; {} are there)",
            images.display(),
            missing.len(),
            stops.stops.len(),
            names.len()
        );
        return Err(Error::new(Code::ImageNotThere, format!("{}:{line}", csv.display()), what, remedy(name)));
    }
    for (line, name) in &missing {
        let what = format!("image \"{name}\" is not in {} and is left out", images.display());
        notices.push(Notice::new(Code::ImageNotThere, format!("{}:{line}", csv.display()), what, remedy(name)));
    }
    let named: BTreeSet<&str> = stops.stops.iter().map(|s| s.image.as_str()).collect();
    let unnamed: Vec<String> = names.iter().filter(|n| !named.contains(n.as_str())).cloned().collect();
    notices.extend((!unnamed.is_empty()).then(|| unlisted(images, csv, &unnamed)));
    let Light { dark, white } = light;
    Ok(Source::Images { folder: images.to_path_buf(), dark, white })
}

/// Gives every stop the path of its image; returns line and name of those without one.
fn find_paths(stops: &mut Stops, lines: &[u64], path_of: impl Fn(&str) -> Option<PathBuf>) -> Vec<(u64, String)> {
    let mut missing = Vec::new();
    for (stop, line) in stops.stops.iter_mut().zip(lines) {
        match path_of(&stop.image) {
            Some(path) => stop.path = Some(path),
            None => missing.push((*line, stop.image.clone())),
        }
    }
    missing
}

/// Refuses a series most of whose images are of formats that are not read: `others` names these files.
fn refuse_other_formats((csv, lines): (&Path, &[u64]), stops: &Stops, others: &BTreeSet<String>) -> Result<()> {
    let unread = |(stop, _): &(&SeriesStop, &u64)| others.contains(&stop.image);
    let of_unread: Vec<(&SeriesStop, &u64)> = stops.stops.iter().zip(lines).filter(unread).collect();
    let Some((stop, line)) = of_unread.first().filter(|_| 2 * of_unread.len() > stops.stops.len()) else {
        return Ok(());
    };
    let (count, all) = (of_unread.len(), stops.stops.len());
    let what = format!("image \"{}\" is of a format that is not read ({count} of {all} images)", stop.image);
    Err(Error::new(Code::ImageUnreadable, format!("{}:{line}", csv.display()), what, CONVERT))
}

/// The file in a folder below that of the images.
fn within(images: &Path, name: &str) -> Option<PathBuf> {
    let is_below = Path::new(name).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    Some(images.join(name)).filter(|path| is_below && path.is_file())
}

/// Images that no row of the table names.
fn unlisted(images: &Path, csv: &Path, unnamed: &[String]) -> Notice {
    let table = csv.file_name().unwrap_or_default().display();
    let what = format!("{} that no row of {table} names: {}", count(unnamed.len()), some(unnamed));
    let remedy = "they are not used; add a row with empty joint cells to use one";
    Notice::new(Code::ImageUnlisted, images.display(), what, remedy)
}

/// The image of a stop that joints.csv names without the ending of its file.
fn name_image(stop: &mut SeriesStop, names: &BTreeSet<String>) {
    let is_its_own = |file: &&String| file.rsplit_once('.').is_some_and(|(stem, _)| stem == stop.image);
    if let Some(file) = names.iter().find(is_its_own).filter(|_| !names.contains(&stop.image)) {
        stop.image.clone_from(file);
    }
}

/// A name on disk that differs by case or extension only.
fn similar<'a>(name: &str, names: &'a BTreeSet<String>) -> Option<&'a str> {
    let stem = |s: &str| s.rsplit_once('.').map_or(s, |(stem, _)| stem).to_lowercase();
    let same = |there: &&String| {
        there.eq_ignore_ascii_case(name) || stem(there) == stem(name) || stem(there) == name.to_lowercase()
    };
    names.iter().find(same).map(String::as_str)
}

/// The first of these names that is one of the others but for case and ending, and that.
fn alike<'a>(names: &'a [String], others: &'a [String]) -> Option<(&'a str, &'a str)> {
    let bare = |name: &str| {
        let stem = Path::new(name).file_stem().filter(|_| is_image(Path::new(name)));
        stem.map_or_else(|| name.to_lowercase(), |stem| stem.to_string_lossy().to_lowercase())
    };
    let others: BTreeMap<String, &str> = others.iter().map(|name| (bare(name), name.as_str())).collect();
    names.iter().find_map(|name| others.get(&bare(name)).map(|other| (name.as_str(), *other)))
}

fn count(images: usize) -> String {
    if images == 1 { "1 image".into() } else { format!("{images} images") }
}

/// The first few names.
fn some(names: &[String]) -> String {
    let more = if names.len() > 3 { ", ..." } else { "" };
    format!("{}{more}", names[..names.len().min(3)].join(", "))
}

/// The manifest of a recording that is given by itself: `<its name>.toml` or `series.toml` beside it.
pub(super) fn manifest_beside(recording: &Path) -> Result<PathBuf> {
    let candidates = [own_manifest(recording), recording.with_file_name("series.toml")];
    let found = candidates.iter().find(|p| p.is_file()).cloned();
    found.ok_or_else(|| {
        let what = format!(
            "nothing beside it says which plate was seen: neither {} nor {} exists",
            candidates[0].display(),
            candidates[1].display()
        );
        let within = written_in(recording).into_iter().find(|part| part.with_extension("toml").is_file());
        let remedy = match within {
            Some(part) => format!("give the recording in it that has one: {}", part.display()),
            None => {
                "write one: format = 1, camera_mount = \"hand\", plate = \"plate.toml\", and base and tip if needed"
                    .to_owned()
            }
        };
        Error::new(Code::SeriesMissing, recording.display(), what, remedy)
    })
}
