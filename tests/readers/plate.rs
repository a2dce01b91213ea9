//! Reading and writing plates.

use std::fs;
use std::path::PathBuf;

use nalgebra::Vector3;
use robotcal::series::{Marker, Plate, PlateKind, ScaleBar, plate_csv, plate_files, plate_toml, read_plate};
use robotcal::{Code, Error};
use tempfile::TempDir;

use crate::said::assert_says;

fn plate_file(toml: &str, csv: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("plate.csv"), csv).unwrap();
    let path = folder.path().join("plate.toml");
    fs::write(&path, toml).unwrap();
    (folder, path)
}

fn plate(toml: &str, csv: &str) -> Plate {
    let (_folder, path) = plate_file(toml, csv);
    read_plate(&path, &mut Vec::new()).unwrap_or_else(|e| panic!("{e}"))
}

fn refusal(toml: &str, csv: &str) -> Error {
    let (_folder, path) = plate_file(toml, csv);
    let error = read_plate(&path, &mut Vec::new()).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    error
}

const CODED: &str = "format = 1\nkind = \"coded-circles\"\ncolumns = 2\nrows = 2\npitch_m = 0.02\n\
                     markers = \"plate.csv\"\ntolerance_m = 0.0002\n";
const HEADER: &str = "id,x_m,y_m,z_m,outer_radius_m,inner_radius_m,sigma_m\n";
const ROWS: &str = "2,-0.01,-0.01,0,0.006,0.003,\n0,-0.01,0.01,0,0.004,0,0.00005\n1,0.01,0.01,0.0001,0.006,0,\n\
                    3,0.01,-0.01,0,0.004,0.002,\n";

fn table(from: &str, to: &str) -> String {
    format!("{HEADER}{ROWS}").replace(from, to)
}

#[test]
fn coded_circles_come_in_the_order_of_their_ids() {
    let plate = plate(CODED, &table("", ""));
    assert_eq!((plate.kind, plate.columns, plate.rows, plate.pitch_m), (PlateKind::CodedCircles, 2, 2, 0.02));
    assert_eq!(plate.markers.iter().map(|m| m.id).collect::<Vec<_>>(), [0, 1, 2, 3]);
    assert_eq!(plate.markers[1].position_m, Vector3::new(0.01, 0.01, 1e-4));
    assert_eq!((plate.markers[0].sigma_m, plate.markers[1].sigma_m), (5e-5, 2e-4));
    assert_eq!((plate.markers[2].outer_radius_m, plate.markers[2].inner_radius_m), (0.006, 0.003));
}

#[test]
fn lattices_need_no_marker_file() {
    for (kind, expected) in
        [("chessboard", PlateKind::Chessboard), ("charuco", PlateKind::Charuco), ("circle-grid", PlateKind::CircleGrid)]
    {
        let toml = format!("format = 1\nkind = \"{kind}\"\ncolumns = 4\nrows = 3\npitch_m = 0.01\n");
        let read = plate(&toml, "");
        assert_eq!(read, Plate::lattice(expected, 4, 3, 0.01, 1e-4));
        assert_says(&refusal(&toml.replace("rows = 3\n", ""), ""), Code::SettingMissing, &["rows"]);
        assert_says(&refusal(&toml.replace("rows = 3", "rows = 1"), ""), Code::SettingRange, &["rows = 1"]);
        assert_says(&refusal(&toml.replace("0.01", "10"), ""), Code::PlateUnitUnlikely, &["pitch_m = 10"]);
        assert_says(&refusal(&toml.replace("0.01", "0"), ""), Code::SettingRange, &["pitch_m = 0"]);
    }
    let dots = "format = 1\nkind = \"circle-grid\"\ncolumns = 4\nrows = 3\npitch_m = 0.01\nradius_m = 0.003\n";
    assert!(plate(dots, "").markers.iter().all(|m| m.outer_radius_m == 0.003));
    assert_says(&refusal(&dots.replace("0.003", "0.006"), ""), Code::MarkersOverlap, &["0 and 4"]);
    assert_says(&refusal(&dots.replace("circle-grid", "chessboard"), ""), Code::SettingConflict, &["radius_m"]);
}

#[test]
fn a_bad_plate_names_line_column_and_marker() {
    assert_says(
        &refusal(&CODED.replace("pitch_m", "pitch"), ""),
        Code::SettingSyntax,
        &["plate.toml:5", "`pitch`", "\"pitch_m\""],
    );
    assert_says(
        &refusal(&CODED.replace("coded-circles", "coded"), ""),
        Code::SettingSyntax,
        &["plate.toml:2", "`coded`"],
    );
    assert_says(&refusal(&CODED.replace("markers = \"plate.csv\"\n", ""), ""), Code::SettingMissing, &["plate.csv"]);
    assert_says(&refusal(CODED, ""), Code::FileEmpty, &["plate.csv"]);
    assert_says(&refusal(CODED, HEADER), Code::FileEmpty, &["plate.csv"]);
    let bad = |from: &str, to: &str| refusal(CODED, &table(from, to));
    assert_says(&bad("outer_radius_m", "radius"), Code::CsvColumnUnknown, &["plate.csv:1", "\"radius\""]);
    assert_says(
        &bad(",outer_radius_m", ",outer_radius"),
        Code::CsvColumnUnknown,
        &["plate.csv:1", "\"outer_radius\"", "\"outer_radius_m\""],
    );
    assert_says(&bad("0.006,0.003", "0.003,0.006"), Code::CsvRange, &["plate.csv:2", "inner_radius_m", "0.006"]);
    assert_says(&bad("0.006,0.003", "0,0"), Code::CsvRange, &["plate.csv:2", "outer_radius_m"]);
    assert_says(&bad("0.00005", "-1"), Code::CsvRange, &["plate.csv:3", "sigma_m"]);
    assert_says(&bad("3,0.01,-0.01", "1,0.01,-0.01"), Code::CsvRowTwice, &["plate.csv:5", "marker 1", "line 4"]);
    assert_says(&bad("3,0.01,-0.01", "4,0.01,-0.01"), Code::MarkerUnknown, &["marker 4", "2 x 2"]);
    assert_says(&bad("0.004,0,", "0.015,0,"), Code::MarkersOverlap, &[]);
    assert_says(&bad("3,0.01,-0.01,0,", "3,10,-10,0,"), Code::MarkerMisplaced, &["marker 3"]);
    // y down is a mirrored plate
    let mirrored =
        table("", "").replace("0.01,-0.01", "T").replace("0.01,0.01", "0.01,-0.01").replace("T", "0.01,0.01");
    assert_says(&refusal(CODED, &mirrored), Code::MarkerMisplaced, &["marker 0"]);
}

#[test]
fn markers_of_a_charuco_board_are_stated_in_one_of_two_ways() {
    let board = |keys: &str| format!("format = 1\nkind = \"charuco\"\ncolumns = 8\nrows = 5\npitch_m = 0.03\n{keys}");
    let own = plate(&board("marker_m = 0.02\ndictionary = \"DICT_4X4_50\"\nlegacy = true\n"), "");
    let table = plate(&board("[aruco]\nside_m = 0.02\ndictionary = \"DICT_4X4_50\"\nlegacy = true\n"), "");
    assert_eq!(own, table);
    assert_eq!(own.aruco.map(|a| (a.side_m, a.legacy)), Some((0.02, true)));
    let refused = |keys: &str| refusal(&board(keys), "").code;
    assert_eq!(refused("marker_m = 0.02\n"), Code::SettingMissing);
    assert_eq!(refused("legacy = true\n"), Code::SettingMissing);
    assert_eq!(refused("marker_m = 0.04\ndictionary = \"DICT_4X4_50\"\n"), Code::SettingRange);
    let both = "marker_m = 0.02\ndictionary = \"DICT_4X4_50\"\n[aruco]\nside_m = 0.02\ndictionary = \"DICT_4X4_50\"\n";
    assert_eq!(refused(both), Code::SettingConflict);
    assert_eq!(refused("tag_m = 0.02\n"), Code::SettingConflict);
    let chessboard = "format = 1\nkind = \"chessboard\"\ncolumns = 8\nrows = 5\npitch_m = 0.03\nmarker_m = 0.02\n";
    assert_eq!(refusal(chessboard, "").code, Code::SettingConflict);
}

#[test]
fn a_scale_bar_must_be_possible() {
    let scaled = |from: u32, to: u32, distance: f64| {
        format!("{CODED}[scale]\nfrom = {from}\nto = {to}\ndistance_m = {distance}\nsigma_m = 0.00002\n")
    };
    let read = plate(&scaled(0, 1, 0.02001), &table("", ""));
    assert_eq!(read.scale, Some(ScaleBar { from: 0, to: 1, distance_m: 0.02001, sigma_m: 2e-5 }));
    assert_says(&refusal(&scaled(0, 9, 0.02), &table("", "")), Code::MarkerUnknown, &["[scale]", "marker 9"]);
    assert_says(&refusal(&scaled(0, 1, 20.0), &table("", "")), Code::PlateScaleUnlikely, &["distance_m = 20"]);
    assert_says(&refusal(&scaled(1, 1, 0.02), &table("", "")), Code::PlateScaleUnlikely, &[]);
    assert_says(&refusal(&scaled(0, 1, -0.02), &table("", "")), Code::SettingRange, &["distance_m = -0.02"]);
}

#[test]
fn points_and_corrected_plates() {
    let toml = "format = 1\nkind = \"points\"\nmarkers = \"plate.csv\"\ntolerance_m = 0.001\n";
    let csv = "id,x_m,y_m,z_m,sigma_x_m,sigma_y_m,sigma_z_m\n7,1,2,3,0.1,0.3,0.2\n5,0,0,0,,,\n";
    let read = plate(toml, csv);
    assert_eq!(read.index_of(7), Some(1));
    assert_eq!((read.markers[0].sigma_m, read.markers[1].sigma_m), (0.001, 0.3));
    assert_says(&refusal(toml, "id,x_m,y_m,z_m\n1,0,0,0\n2,0,0,0\n"), Code::MarkersOverlap, &["1 and 2"]);
}

#[test]
fn what_is_written_reads_back_the_same() {
    let marker = |id, x: f64, outer: f64, inner: f64, sigma: f64| Marker {
        id,
        position_m: Vector3::new(x, 1.0 / 3.0, -1e-17),
        outer_radius_m: outer,
        inner_radius_m: inner,
        sigma_m: sigma,
    };
    let points = Plate {
        name: Some("print 2".into()),
        kind: PlateKind::Points,
        columns: 0,
        rows: 0,
        pitch_m: 0.0,
        tolerance_m: 1e-4,
        aruco: None,
        tags: None,
        puzzle: None,
        large: vec![],
        scale: Some(ScaleBar { from: 3, to: 12, distance_m: 0.1 + 0.2, sigma_m: 1e-6 }),
        markers: vec![marker(3, 0.0, 0.01, 0.005, 1e-4), marker(12, 0.3, 0.0, 0.0, 3e-5)],
    };
    assert_eq!(plate(&plate_toml(&points, Some("plate.csv")).unwrap(), &plate_csv(&points)), points);
    let board = Plate::lattice(PlateKind::Chessboard, 5, 4, 0.012, 5e-5);
    let mut measured = board.clone();
    measured.markers[3].position_m.z = 1e-4;
    for (plate_of, has_table) in [(points, true), (measured, true), (board, false)] {
        let files = plate_files(&plate_of).unwrap();
        let names: Vec<&str> = files.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, &["plate.toml", "plate.csv"][..if has_table { 2 } else { 1 }]);
        assert_eq!(plate(&files[0].1, files.get(1).map_or("", |(_, text)| text)), plate_of);
    }
    let coded = plate(CODED, &table("", ""));
    assert_eq!(plate(&plate_toml(&coded, Some("plate.csv")).unwrap(), &plate_csv(&coded)), coded);
    let mut dots = Plate::lattice(PlateKind::CircleGrid, 5, 4, 0.012, 5e-5);
    dots.markers.iter_mut().for_each(|m| m.outer_radius_m = 0.004);
    assert_eq!(plate(&plate_toml(&dots, None).unwrap(), ""), dots);
    let shifted = "format = 1\nkind = \"circle-grid\"\ncolumns = 4\nrows = 11\npitch_m = 0.01\nasymmetric = true\n";
    let marked = plate(&format!("{shifted}large = [[1, 0], [2, 3]]\n"), "");
    assert_eq!(marked.large, [1, 14]);
    let right_of_first = |id: usize| (marked.markers[id].position_m - marked.markers[0].position_m).x;
    assert!((right_of_first(1) - 0.02).abs() < 1e-15 && (right_of_first(4) - 0.01).abs() < 1e-15);
    assert_eq!(plate(&plate_toml(&marked, None).unwrap(), ""), marked);
    for tags in [
        "kind = \"aprilgrid\"\ncolumns = 3\nrows = 2\ntag_m = 0.05\nspacing = 0.25\nfamily = \"t36h11\"\n",
        "kind = \"aruco-grid\"\ncolumns = 3\nrows = 2\nmarker_m = 0.05\ngap_m = 0.01\ndictionary = \"DICT_4X4_50\"\nfirst_id = 7\n",
        "kind = \"tag\"\ntag_m = 0.05\nid = 7\nfamily = \"25h9\"\n",
        "kind = \"tag\"\ntag_m = 0.05\nid = 7\ndictionary = \"DICT_6X6_50\"\n",
    ] {
        let tags = plate(&format!("format = 1\n{tags}"), "");
        assert_eq!(plate(&plate_toml(&tags, None).unwrap(), ""), tags);
        assert_eq!(plate(&plate_toml(&tags, Some("plate.csv")).unwrap(), &plate_csv(&tags)), tags);
    }
    assert_says(&refusal(&format!("{shifted}large = [[4, 0]]\n"), ""), Code::SettingRange, &["column 4"]);
}

/// The marker file of a grid may number its dots otherwise, and says where they lie; columns and rows belong to it.
#[test]
fn a_grid_is_as_large_as_its_marker_file() {
    for (columns, rows, asymmetric) in [(4, 3, false), (4, 11, true)] {
        let toml = |columns: u32, rows: u32, pitch_m: f64, more: &str| {
            format!(
                "format = 1\nkind = \"circle-grid\"\ncolumns = {columns}\nrows = {rows}\npitch_m = {pitch_m}\nasymmetric = \
                 {asymmetric}\n{more}"
            )
        };
        let nominal = plate(&toml(columns, rows, 0.01, "radius_m = 0.003\n"), "");
        let row = |(k, m): (usize, &Marker)| {
            format!("{},{},{},0,0.003,0\n", 500 - k, m.position_m.x + 2e-4, m.position_m.y - 1e-4)
        };
        let dots: String = nominal.markers.iter().enumerate().map(row).collect();
        let csv = format!("id,x_m,y_m,z_m,outer_radius_m,inner_radius_m\n{dots}");
        let named = |columns, rows, pitch_m| toml(columns, rows, pitch_m, "markers = \"plate.csv\"\n");
        assert_eq!(plate(&named(columns, rows, 0.01), &csv).markers.len(), (columns * rows) as usize);
        for (c, r, pitch_m) in
            [(columns + 1, rows, 0.01), (columns, rows - 1, 0.01), (rows, columns, 0.01), (columns, rows, 0.02)]
        {
            let refused = refusal(&named(c, r, pitch_m), &csv);
            assert_says(&refused, Code::MarkerMisplaced, &["columns", "plate.csv"]);
        }
    }
}
