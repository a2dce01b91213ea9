//! Series that belong to another robot, or whose camera stands elsewhere than series.toml says, are refused by name.

#![allow(clippy::unwrap_used, clippy::panic)]

use robotcal::recipe::{MeasuredSeries, Options, identify, measured};
use robotcal::series::{CameraMount, Plate, PlateKind};
use robotcal::simulate::{WorldRequest, series};
use robotcal::urdf::Chain;
use std::path::Path;

fn chain() -> Chain {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/kuka_kr6_r900/kuka_kr6_r900.urdf");
    robotcal::urdf::read(&urdf).unwrap().chain(None, None).unwrap()
}

fn seen(chain: &Chain) -> MeasuredSeries {
    let mut plate = Plate::lattice(PlateKind::Points, 8, 6, 0.038, 0.1e-3);
    plate.markers.iter_mut().for_each(|m| m.outer_radius_m = 0.01);
    let request =
        WorldRequest { images: 16, least_markers: 12, seed: 5, ..WorldRequest::typical(chain.clone(), plate) };
    measured(&series(&request).unwrap(), chain)
}

fn diagnosis(chain: Chain, series: MeasuredSeries) -> String {
    let error = identify(chain, &[series], &Options::default()).map(|_| ()).unwrap_err();
    assert_eq!(error.exit_code(), 3, "{error}");
    error.to_string()
}

#[test]
fn a_larger_robot_of_the_same_build_is_named() {
    let right = chain();
    let series = seen(&right);
    let mut larger = right;
    // The forearm of the long version of the arm.
    let elbow = larger.joints.iter().position(|j| j.name == "joint_a5").unwrap();
    larger.joints[elbow].origin.translation *= 1.6;
    let said = diagnosis(larger, series);
    assert!(said.contains("link lengths") && said.contains("URDF is of this robot"), "{said}");
}

#[test]
fn an_exchanged_camera_mount_is_named() {
    let chain = chain();
    let mut series = seen(&chain);
    series.mount = CameraMount::Fixed;
    let said = diagnosis(chain, series);
    assert!(said.contains("camera_mount = \"hand\""), "{said}");
}
