//! The study of joint against two-step calibration.

use crate::robots::kr6_urdf;
use robotcal::study::{StudyRequest, study};

#[test]
fn joint_noise_in_the_model_is_worth_most_where_the_robot_is_noisy() {
    let urdf = kr6_urdf();
    let chain = robotcal::urdf::read(&urdf).unwrap().chain(None, None).unwrap();
    let request = StudyRequest {
        seeds: 4,
        images: 15,
        ratios: vec![0.0, 3.0],
        markers: vec![(5, 4)],
        ..StudyRequest::full(chain)
    };
    let study = study(&request, |_, _| {}).unwrap();
    for cell in &study.cells {
        assert_eq!(cell.failed, [0; 6], "{cell:?}");
        println!("{} {:?} {:?}", cell.ratio, cell.flange_mm, cell.camera_mm);
    }
    let [exact, noisy] = [&study.cells[0], &study.cells[1]];
    // Exact readings: the hard fit has the right model, the joint fit may lose a little by not knowing that.
    assert!(exact.flange_mm[5] < 1.2 * exact.flange_mm[4], "{exact:?}");
    // Noise of three times a pose error: a fit that takes readings as exact is clearly worse.
    assert!(noisy.flange_mm[4] > 1.2 * noisy.flange_mm[5], "{noisy:?}");
    assert!(noisy.joint_noise_rad > 0.0 && exact.joint_noise_rad == 0.0);
}
