//! From files to identified observations.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::cell::{CellFiles, Ends};
use super::pictures::Pictures;
use crate::assess::Limits;
use crate::error::{Code, Error, Notice, Result};
use crate::identify::{NamedSeries, bring_together, measure};
use crate::output::{recover, restore, solution_json::SolutionRecord};
use crate::problem::MeasuredSeries;
use crate::series::{self, InputFile, RecordingOptions, Series, Source};
use crate::stage::stage;
use crate::urdf::{self, Chain, RobotDescription};

/// Who wants to know of every image that was looked at: name of the series, number of its stops.
pub type Watch<'a> = &'a (dyn Fn(&str, usize) + Sync);

/// Robot and series as their files say; no image was looked at.
#[derive(Debug)]
pub struct Inputs {
    /// The robot as read.
    pub description: RobotDescription,
    /// The part of it that is identified.
    pub chain: Chain,
    /// The series.
    pub series: Vec<Series>,
    /// What to say where the tip was chosen among several leaves.
    pub tip_notice: Option<Notice>,
    /// Where the robot comes from; none where poses of the controller are all that is known of it.
    files: Vec<InputFile>,
    pictures: Pictures,
}

/// Robot and observations: what a solve goes from.
#[derive(Debug)]
pub struct Observed {
    /// The robot as read.
    pub description: RobotDescription,
    /// The part of it that is identified.
    pub chain: Chain,
    /// The series, with identified markers.
    pub series: Vec<MeasuredSeries>,
    /// What the user should know.
    pub notices: Vec<Notice>,
    /// All files that were read, with their hashes.
    pub files: Vec<InputFile>,
}

impl Inputs {
    /// Reads a URDF and series folders (or recordings, which are only opened).
    ///
    /// # Errors
    /// Files that cannot be read or do not go together; links that the URDF does not have.
    pub fn read(urdf: &Path, folders: &[PathBuf], ends: Ends) -> Result<Self> {
        Self::with_series(urdf, read_all(folders)?, ends)
    }

    /// Reads the URDFs of series that are at hand.
    ///
    /// # Errors
    /// As of [`Inputs::read`].
    pub fn with_series(urdf: &Path, series: Vec<Series>, ends: Ends) -> Result<Self> {
        let robot = CellFiles::read(urdf, &series, ends)?;
        Self::of(robot, Some(urdf), series, ends)
    }

    /// Reads series folders whose controllers say where the flange was: nothing is known, or identified, of the robot itself.
    ///
    /// # Errors
    /// Files that cannot be read; series with joint readings.
    pub fn without_robot(folders: &[PathBuf]) -> Result<Self> {
        let series = read_all(folders)?;
        let mut poses = Vec::new();
        for s in &series {
            let Some(controller) = &s.controller else {
                let what = "no robot is given, and the series has joint readings";
                let remedy = "give --urdf; only a series with controller.csv (poses of the flange) needs none";
                return Err(Error::new(Code::OptionMissing, s.folder.display(), what, remedy));
            };
            poses.extend(controller.base_from_flange.iter().flatten());
        }
        let robot = CellFiles { description: urdf::pose_robot(&poses)?, files: Vec::new(), second_tip: None };
        Self::of(robot, None, series, Ends::default())
    }

    fn of(robot: CellFiles, urdf: Option<&Path>, series: Vec<Series>, ends: Ends) -> Result<Self> {
        let CellFiles { description, files, second_tip } = robot;
        // Links that the series name are those of a robot that is not given.
        let own: &[Series] = if urdf.is_some() { &series } else { &[] };
        let [by_base, by_tip] = carriers(own)?;
        let base =
            second_tip.as_deref().or(by_base).or(agreed("base", ends.base, own, |s| s.manifest.base.as_deref())?);
        let tip = by_tip.or(agreed("tip", ends.tip, own, |s| s.manifest.tip.as_deref())?);
        let chain = description.chain(base, tip)?;
        let tip_notice = description.tip_notice(base, tip);
        Ok(Self { chain, tip_notice, files, pictures: Pictures::new(), series, description })
    }

    /// Takes the stops out of the recordings among the series.
    ///
    /// # Errors
    /// Recordings without stops or images; those of [`Series::with_recording`].
    pub fn with_recordings(self, options: &RecordingOptions) -> Result<Self> {
        let options = options.clone().of_chain(&self.chain);
        let series = self.pictures.of_recordings(self.series, &options)?;
        Ok(Self { series, ..self })
    }

    /// Looks at all images, with the limits of the solve.
    ///
    /// # Errors
    /// Series whose images show no plate; files that change meanwhile.
    pub fn observe(self, limits: &Limits, watch: Watch) -> Result<Observed> {
        let Self { description, chain, series: all, tip_notice, mut files, pictures: _until_the_end } = self;
        let mut notices = description.notices.clone();
        notices.extend(tip_notice);
        let hashes = all.iter().map(Series::image_hashes).collect::<Result<Vec<_>>>()?;
        for (s, hashes) in all.iter().zip(&hashes) {
            files.extend(s.inputs.iter().chain(hashes).cloned());
        }
        let mut series = Vec::with_capacity(all.len());
        for s in &all {
            let _stage = stage("images");
            if let Source::Cameras(_) = &s.source {
                notices.extend(s.notices.iter().cloned());
            }
            for view in s.views() {
                let named = NamedSeries { series: view, is_one_of_several: all.len() > 1 };
                let measured = measure(named, &chain, limits, |_| watch(&view.name, view.stops.stops.len()))?;
                // What the readings give reason to say is the same for every camera.
                let known: Vec<Notice> = measured.notices.into_iter().filter(|n| !notices.contains(n)).collect();
                notices.extend(known);
                series.push(measured.series);
            }
        }
        all.iter().zip(&hashes).try_for_each(|(s, before)| require_unchanged(before, &s.image_hashes()?))?;
        let views: Vec<&Series> = all.iter().flat_map(Series::views).collect();
        notices.extend(bring_together(&views, &hashes.concat(), &mut series)?);
        Ok(Observed { description, chain, series, notices, files })
    }
}

impl Observed {
    /// What an earlier solution went from; `path` is its file.
    ///
    /// # Errors
    /// A record that does not hang together; links with other joints between them.
    pub fn of_record(record: &SolutionRecord, path: &Path, ends: Ends) -> Result<Self> {
        let description = restore::robot_description(record)?;
        let base = ends.base.unwrap_or(&record.robot.base);
        let tip = ends.tip.unwrap_or(&record.robot.tip);
        let chain = restore::chain(record, &description, base, tip)?;
        if chain.readings != record.robot.readings {
            let what = format!("is of the joints {}", record.robot.readings.join(", "));
            return Err(Error::new(
                Code::SolutionDiffers,
                path.display(),
                what,
                "choose --base and --tip with the same joints between them",
            ));
        }
        let mut files = record.inputs.clone();
        files.push(InputFile::of_file(path)?);
        let notices = description.notices.clone();
        Ok(Self { chain, series: restore::measured_series(record)?, notices, files, description })
    }
}

/// The hashes in a result are those of what was looked at: the images of a series must be the same before and after, none more and none less.
///
/// # Errors
/// A file that changed, vanished or appeared.
pub fn require_unchanged(before: &[InputFile], after: &[InputFile]) -> Result<()> {
    let (old, new) = (by_path(before), by_path(after));
    let is_other = |path: &&&Path| old.get(**path) != new.get(**path);
    let Some(path) = old.keys().chain(new.keys()).find(is_other) else { return Ok(()) };
    let what = match (old.contains_key(path), new.contains_key(path)) {
        (true, true) => "changed while it was looked at",
        (true, false) => "could be read no more after it had been looked at",
        _ => "could be read only after the series had been looked at",
    };
    let remedy = "wait until nothing writes to the series any more, then run again";
    Err(Error::new(Code::SeriesChanged, path.display(), what, remedy))
}

fn by_path(files: &[InputFile]) -> BTreeMap<&Path, &str> {
    files.iter().map(|file| (file.path.as_path(), file.sha256.as_str())).collect()
}

fn read_all(folders: &[PathBuf]) -> Result<Vec<Series>> {
    let mut all: Vec<Series> = Vec::new();
    for folder in folders {
        recover(&folder.join("series.toml"))?;
        let s = series::read(folder)?;
        if let Some(twin) = all.iter().find(|a| a.name == s.name) {
            return Err(Error::new(
                Code::SeriesTwice,
                folder.display(),
                format!("is named '{}' like the series in {}", s.name, twin.folder.display()),
                "give every series folder a name of its own, and each series only once",
            ));
        }
        all.push(s);
    }
    Ok(all)
}

/// Links that carry what neither base nor tip does, the same in all series.
fn carriers(all: &[Series]) -> Result<[Option<&str>; 2]> {
    let Some(first) = all.first() else { return Ok([None, None]) };
    let links = first.manifest.carriers();
    match all.iter().find(|s| s.manifest.carriers() != links) {
        None => Ok(links),
        Some(other) => Err(Error::new(
            Code::SeriesDisagree,
            other.manifest_file().display(),
            format!("its camera and plate hang on other links than those of {}", first.name),
            "identify series with different links ([plate_mount] or link of the camera) one by one",
        )),
    }
}

/// A link that the flag or the manifests name; they must agree.
fn agreed<'a>(
    what: &str,
    flag: Option<&'a str>,
    all: &'a [Series],
    of: impl Fn(&'a Series) -> Option<&'a str>,
) -> Result<Option<&'a str>> {
    if flag.is_some() {
        return Ok(flag);
    }
    let mut named = all.iter().filter_map(|s| of(s).map(|link| (s, link)));
    let Some((first, link)) = named.next() else { return Ok(None) };
    match named.find(|(_, other)| *other != link) {
        None => Ok(Some(link)),
        Some((second, other)) => Err(Error::new(
            Code::SeriesDisagree,
            second.manifest_file().display(),
            format!("{what} = \"{other}\", while {} has {what} = \"{link}\"", first.name),
            format!("series of one robot share base and tip: correct one, or give --{what}"),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_that_changes_vanishes_or_appears_is_named() {
        let file = |path: &str, sha256: &str| InputFile { path: path.into(), sha256: sha256.into() };
        let [a, b, changed] = [file("a.png", "1"), file("b.png", "2"), file("b.png", "3")];
        let both = [a.clone(), b];
        assert!(require_unchanged(&both, &both).is_ok());
        for (before, after) in [(&both[..], &both[..1]), (&both[..1], &both[..]), (&both[..], &[a, changed][..])] {
            let error = require_unchanged(before, after).unwrap_err();
            assert_eq!((error.code, error.place.as_str()), (Code::SeriesChanged, "b.png"));
        }
    }
}
