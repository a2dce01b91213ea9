//! images.csv: several cameras at the same stops.

use std::fs;

use robotcal::series::{CameraMount, Series, Source, read};
use robotcal::urdf::RobotDescription;
use robotcal::{Code, Error, Notice};
use tempfile::TempDir;

use crate::said::assert_says;

const MANIFEST: &str = "format = 1\njoint_unit = \"rad\"\nplate = \"plate.toml\"\n\
    [[camera]]\nname = \"left\"\nmount = \"fixed\"\n[[camera]]\nname = \"wrist\"\nmount = \"hand\"\nimages = \"pictures\"\n";
const PLATE: &str = "format = 1\nkind = \"chessboard\"\ncolumns = 3\nrows = 2\npitch_m = 0.02\ntolerance_m = 0.0001\n";
const JOINTS: &str = "stop,j1\none,0.1\ntwo,0.2\nthree,0.3\n";
const IMAGES: &str =
    "stop,camera,image\nthree,left,c.png\none,left,a.png\none,wrist,a.png\ntwo,wrist,b1.png\ntwo,wrist,b2.png\n";

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let good = [("series.toml", MANIFEST), ("plate.toml", PLATE), ("joints.csv", JOINTS), ("images.csv", IMAGES)];
    let images = ["images/left/a.png", "images/left/c.png", "pictures/a.png", "pictures/b1.png", "pictures/b2.png"];
    for (name, text) in good.iter().copied().chain(images.map(|i| (i, ""))).chain(files.iter().copied()) {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    folder
}

fn refusal(name: &str, text: &str) -> Error {
    let error = read(folder(&[(name, text)]).path()).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    error
}

fn seen(view: &Series) -> Vec<(usize, &str)> {
    view.stops.stops.iter().enumerate().map(|(k, s)| (view.row(k), s.image.as_str())).collect()
}

#[test]
fn every_camera_is_a_view_of_the_same_stops() {
    let folder = folder(&[]);
    let series = read(folder.path()).unwrap();
    assert!(matches!(series.source, Source::Cameras(_)));
    let views = series.views();
    assert_eq!(views.iter().map(|v| v.camera_name()).collect::<Vec<_>>(), ["left", "wrist"]);
    assert_eq!(views.iter().map(|v| v.manifest.mount()).collect::<Vec<_>>(), [CameraMount::Fixed, CameraMount::Hand]);
    assert_eq!(seen(&views[0]), [(0, "a.png"), (2, "c.png")]);
    assert_eq!(seen(&views[1]), [(0, "a.png"), (1, "b1.png"), (1, "b2.png")]);
    assert_eq!(views[1].stops.stops[2].raw_readings, Some(vec![0.2]));
    assert!(views[1].stops.stops[0].path.as_ref().unwrap().ends_with("pictures/a.png"));
    assert!(views.iter().all(|v| v.run_name() == series.name && v.run.as_ref().unwrap().has_mixed_mounts));
    assert_ne!(views[0].mounting(), views[1].mounting());
    assert_eq!(series.image_hashes().unwrap().len(), 5);
}

#[test]
fn what_was_measured_in_space_is_a_view_of_the_same_stops_without_images() {
    let points = ("points.csv", "stop,target,x_m,y_m,z_m\nthree,ball,0.1,0.2,0.3\n");
    let folder = folder(&[points, ("contacts.csv", "stop,contact\none,cone\ntwo,cone\n")]);
    let series = read(folder.path()).unwrap();
    let [left, wrist, space] = series.views() else { panic!("{} views", series.views().len()) };
    assert!(left.spatial.is_empty() && wrist.spatial.is_empty() && space.source == Source::NoImages);
    assert_eq!((space.spatial.points[0].stop, space.spatial.contacts.len()), (2, 2));
    assert_eq!(seen(space), [(0, "one"), (1, "two"), (2, "three")]);
    assert!(space.run_name() == wrist.run_name() && space.name != wrist.name && space.name != left.name);
    assert_eq!(series.image_hashes().unwrap().len(), 5);
}

/// Dark and white images of a view.
fn light(view: &Series) -> [usize; 2] {
    let Source::Images { dark, white, .. } = &view.source else { panic!("{:?}", view.source) };
    [dark.len(), white.len()]
}

#[test]
fn dark_and_white_images_of_every_camera_are_its_own() {
    let own = [("images/left/dark/1.png", ""), ("images/left/white/1.png", ""), ("images/white/2.png", "")];
    let common = [("dark/1.png", ""), ("white/1.png", ""), ("white/2.png", "")];
    let folder = folder(&[&own[..], &common].concat());
    let series = read(folder.path()).unwrap();
    let [left, wrist] = series.views() else { panic!("{} views", series.views().len()) };
    assert_eq!([light(left), light(wrist)], [[1, 1], [0, 0]]);
    let unused: Vec<&Notice> = series.notices.iter().filter(|n| n.code == Code::FlatFieldUnused).collect();
    let places: Vec<String> =
        unused.iter().map(|n| n.place.replace(&folder.path().display().to_string(), "")).collect();
    assert_eq!(places, ["/dark", "/white", "/images/white"]);
}

/// Two cameras with one folder, of neither of which the light is; and one camera with two folders of the same name.
#[test]
fn light_that_is_not_used_is_said() {
    let unused = |folder: &TempDir| {
        let series = read(folder.path()).unwrap();
        let of_light = series.notices.iter().filter(|n| n.code == Code::FlatFieldUnused);
        of_light.map(|n| n.place.replace(&folder.path().display().to_string(), "")).collect::<Vec<_>>()
    };
    let of_both =
        MANIFEST.replace("name = \"left\"", "name = \"left\"\nimages = \"images\"").replace("pictures", "images");
    let table = "stop,camera,image\none,left,a.png\nthree,wrist,c.png\n";
    let images = [("images/a.png", ""), ("images/c.png", ""), ("images/dark/1.png", "")];
    let two = folder(&[&[("series.toml", of_both.as_str()), ("images.csv", table)][..], &images].concat());
    assert_eq!(unused(&two), ["/images/dark"]);
    let of_one = format!("camera_mount = \"hand\"\n{}", MANIFEST.split("[[camera]]").next().unwrap());
    let joints = "image,j1\na.png,0.1\nc.png,0.2\n";
    let one = folder(
        &[&[("series.toml", of_one.as_str()), ("joints.csv", joints), ("dark/1.png", "")][..], &images].concat(),
    );
    fs::remove_file(one.path().join("images.csv")).unwrap();
    assert_eq!(unused(&one), ["/dark"]);
}

/// Of one camera they are its own wherever its images lie.
#[test]
fn dark_and_white_images_of_a_series_are_those_of_its_only_camera() {
    let manifest = MANIFEST
        .split("[[camera]]")
        .take(2)
        .collect::<Vec<_>>()
        .join("[[camera]]")
        .replace("name = \"left\"", "name = \"left\"\nimages = \"images/left\"");
    let images = "stop,image\none,a.png\nthree,c.png\n";
    let light_of_all = [("dark/1.png", ""), ("white/1.png", ""), ("white/2.png", "")];
    let folder = folder(&[&[("series.toml", manifest.as_str()), ("images.csv", images)][..], &light_of_all].concat());
    let series = read(folder.path()).unwrap();
    assert_eq!(light(&series.views()[0]), [1, 2]);
    std::fs::create_dir_all(folder.path().join("images/dark")).unwrap();
    let series = read(folder.path()).unwrap();
    assert!(!series.notices.iter().any(|n| n.code == Code::FlatFieldUnused), "{:?}", series.notices);
}

#[test]
fn an_image_may_lie_in_a_folder_below() {
    let table = IMAGES.replace("left,a.png", "left,first/a.png").replace("left,c.png", "left,../c.png");
    let folder = folder(&[("images.csv", &table), ("images/left/first/a.png", ""), ("images/c.png", "")]);
    let series = read(folder.path()).unwrap();
    let left = &series.views()[0];
    assert_eq!(seen(left), [(0, "first/a.png"), (2, "../c.png")]);
    assert!(left.stops.stops[0].path.as_ref().unwrap().ends_with("images/left/first/a.png"));
    assert_eq!(left.stops.stops[1].path, None);
    assert!(left.notices.iter().any(|n| n.code == Code::ImageNotThere && n.what.contains("../c.png")));
}

#[test]
fn a_bad_row_names_line_and_column() {
    let with = |from: &str, to: &str| refusal("images.csv", &IMAGES.replace(from, to));
    assert_says(&with("two,wrist,b1", "to,wrist,b1"), Code::StopUnknown, &["images.csv:5", "\"to\"", "\"two\""]);
    assert_says(&with("three,left", "three,lift"), Code::CameraUnknown, &["images.csv:2", "\"lift\"", "\"left\""]);
    assert_says(&with("b2.png", "b1.png"), Code::CsvRowTwice, &["images.csv:6", "b1.png", "line 5"]);
    assert_says(&with("b2.png", ""), Code::CsvCellEmpty, &["images.csv:6", "image"]);
    assert_says(&with("camera", "cam"), Code::CsvColumnUnknown, &["images.csv:1", "cam"]);
    assert_says(
        &refusal("images.csv", "stop,camera,image\none,left,a.png\n"),
        Code::ImagesMissing,
        &["images.csv", "wrist"],
    );
    let unmounted = MANIFEST.replace("mount = \"hand\"\n", "");
    assert_says(&refusal("series.toml", &unmounted), Code::SettingMissing, &["series.toml", "camera_mount"]);
    // Read for the camera that states none, and by nobody where all do.
    let with_default = |manifest: &str| manifest.replace("format = 1", "format = 1\ncamera_mount = \"fixed\"");
    let views = read(folder(&[("series.toml", &with_default(&unmounted))]).path()).unwrap();
    assert!(views.views().iter().all(|view| view.manifest.mount() == CameraMount::Fixed));
    assert_says(&refusal("series.toml", &with_default(MANIFEST)), Code::SettingConflict, &["camera_mount", "wrist"]);
    let folder = folder(&[]);
    fs::remove_file(folder.path().join("images.csv")).unwrap();
    assert_says(&read(folder.path()).unwrap_err(), Code::FileMissing, &["images.csv"]);
}

/// A reading stands in one line of joints.csv, however many cameras saw the stop.
#[test]
fn what_is_said_of_readings_is_said_once_with_their_line() {
    let urdf = "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><joint name=\"j1\" type=\"revolute\">\
        <parent link=\"a\"/><child link=\"b\"/><axis xyz=\"0 0 1\"/>\
        <limit lower=\"-1\" upper=\"0.15\" effort=\"0\" velocity=\"1\"/></joint></robot>";
    let chain = RobotDescription::from_text("r.urdf".as_ref(), urdf.into()).unwrap().chain(None, None).unwrap();
    let folder = folder(&[]);
    let series = read(folder.path()).unwrap();
    let said: Vec<Notice> = series.views().iter().flat_map(|v| v.reading_notices(&chain)).collect();
    let [said] = &Notice::said_once(&said)[..] else { panic!("{said:?}") };
    assert_eq!(said.code, Code::JointBeyondLimits);
    // The worst of "left" is at stop three, that of "wrist" at stop two.
    assert!(said.place.starts_with("2 places") && said.place.contains("joints.csv:4"), "{said:?}");
    // words: what is counted in images differs from view to view.
    assert!(said.place.contains("joints.csv:3") && !said.what.contains("images"), "{said:?}");
}

#[test]
fn observations_name_images_of_one_camera_alone() {
    let text = "image,marker,u,v\na.png,0,10,20\nb1.png,0,10,20\n";
    let error = refusal("observations.csv", text);
    assert_says(&error, Code::CsvRowTwice, &["images.csv", "\"a.png\""]);
}

#[test]
fn points_lie_within_the_image_of_their_own_camera() {
    let manifest = MANIFEST
        .replace("mount = \"fixed\"\n", "mount = \"fixed\"\nwidth_px = 1280\nheight_px = 1024\n")
        .replace("mount = \"hand\"\n", "mount = \"hand\"\nwidth_px = 640\nheight_px = 480\n");
    let images = "stop,camera,image\none,left,a.png\none,wrist,b1.png\ntwo,wrist,b2.png\n";
    let with = |text: &str| {
        let files = [("series.toml", &*manifest), ("images.csv", images), ("observations.csv", text)];
        read(folder(&files).path())
    };
    let series = with("image,marker,u,v\na.png,0,1000,900\nb1.png,0,600,20\n").unwrap();
    assert_eq!(series.views().iter().map(|view| view.stops.stops.len()).collect::<Vec<_>>(), [1, 2]);
    let error = with("image,marker,u,v\na.png,0,1000,900\nb1.png,0,700,20\n").unwrap_err();
    assert_says(&error, Code::CsvRange, &["observations.csv:3", "640 x 480"]);
}
