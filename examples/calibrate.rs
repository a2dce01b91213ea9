//! Calibrates the robot of a dataset that comes with the program, and says where its flange is.

use robotcal::{Options, Result, calibrate};

fn main() -> Result<()> {
    let calibration = calibrate("robots/ur10e/ur10e.urdf", ["datasets/ur10e_observations"], &Options::default())?;
    let accuracy = &calibration.solution().accuracy;
    println!("held out  {:.3} mm, nominal {:.3} mm", accuracy.calibrated.rms_mm, accuracy.nominal.rms_mm);
    calibration.findings().iter().for_each(|finding| println!("found     {finding}"));
    let flange = calibration.fk(&[0.0, -1.2, 1.0, -1.4, -1.5, 0.3]);
    println!("flange    {:?} m in the base frame", flange.xyz());
    calibration.save(std::env::temp_dir().join("robotcal-example"))
}

#[test]
fn runs() -> Result<()> {
    main()
}
