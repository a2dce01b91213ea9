//! What the program writes, as other libraries read it: `tests/independent/make.py` made the tables.

use std::path::Path;

use nalgebra::{Vector2, Vector3};
use robotcal::model::camera::{Camera, Lens};
use robotcal::model::robot::Robot;
use robotcal::urdf::read;

fn rows(name: &str) -> Vec<csv::StringRecord> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/independent").join(name);
    csv::Reader::from_path(path).unwrap().records().map(Result::unwrap).collect()
}

fn number(row: &csv::StringRecord, column: usize) -> f64 {
    row[column].parse().unwrap()
}

/// Forward kinematics of pytransform3d.
#[test]
fn another_library_finds_the_tip_of_a_written_urdf_at_the_same_place() {
    let all = rows("kinematics.csv");
    assert_eq!(all.len(), 24);
    for row in all {
        let urdf = read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(&row[0])).unwrap();
        let chain = urdf.chain(Some(&row[1]), Some(&row[2])).unwrap();
        let value = |name: &String| {
            let of = row[3].split(';').find_map(|j| j.strip_prefix(name.as_str())?.strip_prefix('='));
            of.unwrap_or_else(|| panic!("{name} is missing")).parse::<f64>().unwrap()
        };
        let readings: Vec<f64> = chain.readings.iter().map(value).collect();
        let tip = Robot::nominal(chain).base_from_tip(&readings).matrix();
        let worst = (0..12).map(|k| (tip[(k / 4, k % 4)] - number(&row, 4 + k)).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-12, "{}: {worst:e}", &row[0]);
    }
}

/// `cv2.projectPoints` and `cv2.fisheye.projectPoints`, with the values and in the order of camera.yaml.
#[test]
fn another_library_projects_with_the_coefficients_of_camera_yaml_to_the_same_place() {
    let all = rows("projections.csv");
    assert_eq!(all.len(), 60);
    for row in all {
        let lens = match &row[0] {
            "plumb_bob" => Lens::Brown,
            "rational_polynomial" => Lens::Rational,
            _ => Lens::Fisheye,
        };
        let mut camera = Camera::pinhole(lens, 1280, 1024, 1.0);
        let coefficients = row[10].split(';').map(|d| d.parse::<f64>().unwrap());
        let values = (1..5).map(|k| number(&row, k)).chain(coefficients);
        camera.parameters.iter_mut().zip(values).for_each(|(p, v)| *p = v);
        let x = Vector3::new(number(&row, 5), number(&row, 6), number(&row, 7));
        let off = (camera.project(&x).unwrap() - Vector2::new(number(&row, 8), number(&row, 9))).norm();
        assert!(off < 1e-9, "{}: {off:e} px", &row[0]);
    }
}
