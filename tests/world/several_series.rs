//! Several series folders: one print whose file is in each of them, and one recording that is given twice.

use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::robots::repo;
use robotcal::assess::Limits;
use robotcal::calibration::{Ends, Inputs, Observed};
use robotcal::identify::{Options, RobotModel, identify, stand_alone};
use robotcal::problem::ImageRejection;
use robotcal::{Code, Error};

const DATASET: &str = "datasets/ur10e_observations";

/// A series folder with some of the stops of the dataset and a plate.toml of its own.
fn with_stops(folder: &Path, name: &str, stops: Range<usize>) -> PathBuf {
    let run = folder.join(name);
    std::fs::create_dir(&run).unwrap();
    let own: Vec<String> = stops.map(|k| format!("img_{k:03}.png")).collect();
    for table in ["joints.csv", "observations.csv"] {
        let text = std::fs::read_to_string(repo(DATASET).join(table)).unwrap();
        let is_own = |line: &&str| own.iter().any(|image| line.split(',').next() == Some(image));
        let rows: Vec<&str> = text.lines().take(1).chain(text.lines().skip(1).filter(is_own)).collect();
        std::fs::write(run.join(table), rows.join("\n") + "\n").unwrap();
    }
    for file in ["series.toml", "plate.toml", "plate.csv"] {
        std::fs::copy(repo(DATASET).join(file), run.join(file)).unwrap();
    }
    edit(&run.join("series.toml"), |text| text + "name = \"front\"\nmounting = \"first\"\nmodel = \"brown\"\n");
    run
}

fn edit(file: &Path, change: impl Fn(String) -> String) {
    std::fs::write(file, change(std::fs::read_to_string(file).unwrap())).unwrap();
}

fn observed(series: &[PathBuf]) -> Result<Observed, Error> {
    let urdf = repo("robots/ur10e/ur10e.urdf");
    Inputs::read(&urdf, series, Ends::default())?.observe(&Limits::default(), &|_, _| ())
}

/// Number of plates, and series that are said to show one.
fn plates(series: &[PathBuf]) -> Result<(usize, Vec<String>), Error> {
    let observed = observed(series)?;
    let mut names: Vec<&String> = observed.series.iter().map(|s| &s.plate_name).collect();
    names.dedup();
    let alike = observed.notices.iter().filter(|n| n.code == Code::PlatesAlike);
    Ok((names.len(), alike.map(|n| n.place.clone()).collect()))
}

#[test]
fn plates_that_are_described_alike_are_one_plate_and_those_with_names_of_their_own_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b, c] =
        [("a", 0..10), ("b", 10..20), ("c", 20..30)].map(|(name, stops)| with_stops(folder.path(), name, stops));
    let all = [a.clone(), b.clone(), c.clone()];
    edit(&b.join("plate.toml"), |text| format!("# the print of tuesday\n{text}"));
    let (count, said) = plates(&all).unwrap();
    assert_eq!((count, said.as_slice()), (1, &["series a, b, c".to_owned()][..]));

    // One file: nothing to say.
    for run in [&b, &c] {
        edit(&run.join("series.toml"), |text| text.replace("plate.toml", "../a/plate.toml"));
    }
    assert_eq!(plates(&all).unwrap(), (1, vec![]));

    // Another description is another plate.
    let runs = [a.clone(), b.clone()];
    edit(&b.join("series.toml"), |text| text.replace("../a/plate.toml", "plate.toml"));
    let whole = std::fs::read_to_string(b.join("plate.toml")).unwrap();
    edit(&b.join("plate.toml"), |text| text.replace("tolerance_m = 0.0001", "tolerance_m = 0.0002"));
    assert_eq!(plates(&runs).unwrap(), (2, vec![]));

    // Names: another one is another plate, the same is the same, and has one description.
    let named = |run: &Path, name: &str| edit(&run.join("plate.toml"), |_| format!("name = \"{name}\"\n{whole}"));
    named(&b, "second");
    assert_eq!(plates(&runs).unwrap(), (2, vec![]));
    named(&a, "first");
    assert_eq!(plates(&runs).unwrap(), (2, vec![]));
    named(&a, "second");
    assert_eq!(plates(&runs).unwrap(), (1, vec![]));
    edit(&b.join("plate.toml"), |text| text.replace("tolerance_m = 0.0001", "tolerance_m = 0.0002"));
    assert_eq!(plates(&runs).unwrap_err().code, Code::SeriesDisagree);
}

/// Of four plates, each of a size of its own, the scale would seem twice as well known.
#[test]
fn the_scale_of_one_print_in_four_folders_is_as_well_known_as_by_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let all: Vec<PathBuf> =
        (0..4).map(|k| with_stops(folder.path(), &format!("run{k}"), 12 * k..12 * (k + 1))).collect();
    let options = Options { model: RobotModel::Rigid, ..Options::default() };
    let found = |series: &[PathBuf]| {
        let Observed { chain, series, .. } = observed(series).unwrap();
        let fit = identify(chain, &series, &options).unwrap().fit;
        assert_eq!((fit.problem.plates.len(), fit.problem.placements.len()), (1, 4));
        let scale = fit.problem.layout.shapes[0].start;
        (fit.state.plates[0].modes[0], fit.covariance.sigma(scale))
    };
    let copies = found(&all);
    for run in &all[1..] {
        edit(&run.join("series.toml"), |text| text.replace("plate.toml", "../run0/plate.toml"));
    }
    assert_eq!(copies, found(&all));
    // The plate file is believed to 1e-4, and the links say less.
    assert!(copies.1 > 0.8e-4, "{copies:?}");
}

#[test]
fn a_recording_that_is_given_twice_is_refused_and_images_given_twice_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let [first, copy, part, more] = [("first", 0..20), ("copy", 0..20), ("part", 5..15), ("more", 15..30)]
        .map(|(name, stops)| with_stops(folder.path(), name, stops));
    for (other, name) in [(&copy, "copy"), (&part, "part")] {
        let refused = observed(&[first.clone(), other.clone()]).map(|_| ()).unwrap_err();
        assert_eq!((refused.code, refused.place), (Code::SeriesRepeated, format!("series {name}")));
    }
    let seen = observed(&[first, more.clone()]).unwrap();
    let found = stand_alone(&seen.series, &Limits::default()).unwrap();
    let twice = found.fit.problem.images.iter().filter_map(|image| match &image.rejected {
        Some(ImageRejection::Duplicate { of }) => Some((image.series, image.name.clone(), of.clone())),
        _ => None,
    });
    let expected = (15..20).map(|k| (1, format!("img_{k:03}.png"), format!("first/img_{k:03}.png")));
    assert_eq!(twice.collect::<Vec<_>>(), expected.collect::<Vec<_>>());

    // Other readings: not the same stops.
    edit(&more.join("joints.csv"), |text| text.replace(".1", ".2").replace(".3", ".4"));
    let other = observed(&[folder.path().join("first"), more]).unwrap();
    let urdf = robotcal::urdf::read(&repo("robots/ur10e/ur10e.urdf")).unwrap();
    let robot = robotcal::model::robot::Robot::nominal(urdf.chain(Some("base_link"), Some("tool0")).unwrap());
    let built = robotcal::identify::build(&robot, &other.series, false, &Limits::default()).unwrap();
    let copies = built.problem.images.iter().filter(|i| matches!(i.rejected, Some(ImageRejection::Duplicate { .. })));
    let readings = |s: usize, name: &str| {
        let stop = other.series[s].stops.iter().find(|stop| stop.image == name);
        stop.map(|stop| stop.readings.clone())
    };
    let same = (15..20).map(|k| format!("img_{k:03}.png")).filter(|name| readings(0, name) == readings(1, name));
    assert_eq!(copies.map(|i| i.name.clone()).collect::<Vec<_>>(), same.collect::<Vec<_>>());
}
