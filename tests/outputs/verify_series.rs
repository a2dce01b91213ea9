//! `robotcal verify --series`: the same stops by joint readings and by the poses that the controller computes of them.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;

use crate::support::by_poses::with_poses;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The series of the shipped report with what it observed in the place of images.
fn observed(into: &Path) -> PathBuf {
    let (of, folder) = (root().join("datasets/kr6_small"), into.join("joints"));
    std::fs::create_dir(&folder).unwrap();
    for name in ["joints.csv", "plate.csv", "plate.toml"] {
        std::fs::copy(of.join(name), folder.join(name)).unwrap();
    }
    let settings = std::fs::read_to_string(of.join("series.toml")).unwrap();
    let size = image::image_dimensions(of.join("images/img_000.png")).unwrap();
    let camera = format!("{settings}[camera]\nwidth_px = {}\nheight_px = {}\n", size.0, size.1);
    std::fs::write(folder.join("series.toml"), camera).unwrap();
    let all = std::fs::read_to_string(root().join("reports/kr6_small/observations.csv")).unwrap();
    let mut table = String::from("image,marker,u,v,edge,cov_uu,cov_uv,cov_vv\n");
    for line in all.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        writeln!(table, "{}", cells[..8].join(",")).unwrap();
    }
    std::fs::write(folder.join("observations.csv"), table).unwrap();
    folder
}

#[test]
fn poses_of_a_controller_judge_a_model_as_the_readings_do() {
    let urdf = root().join("robots/kuka_kr6_r900/kuka_kr6_r900.urdf");
    let report = root().join("reports/kr6_small");
    let folder = tempfile::tempdir().unwrap();
    let joints = observed(folder.path());
    let poses = folder.path().join("poses");
    std::fs::create_dir(&poses).unwrap();
    for entry in std::fs::read_dir(&joints).unwrap().map(Result::unwrap) {
        std::fs::copy(entry.path(), poses.join(entry.file_name())).unwrap();
    }
    with_poses(&poses, &urdf, true);
    let judged = |series: &Path, nominal: Option<&Path>| -> Output {
        let mut command = Command::cargo_bin("robotcal").unwrap();
        command.arg("verify").arg("--urdf").arg(report.join("kuka_kr6_r900.calibrated.urdf"));
        command.arg("--compensation").arg(report.join("compensation.toml")).arg("--series").arg(series);
        if let Some(file) = nominal {
            command.arg("--nominal").arg(file);
        }
        command.output().unwrap()
    };
    let of_readings = judged(&joints, Some(&urdf));
    let text = String::from_utf8_lossy(&of_readings.stdout);
    println!("{text}");
    assert!(of_readings.status.success(), "{}", String::from_utf8_lossy(&of_readings.stderr));
    assert_eq!(String::from_utf8_lossy(&judged(&poses, Some(&urdf)).stdout), text);
    // The model in the controller is needed then, and a robot of other joints is not it.
    assert_eq!(judged(&joints, None).status.code(), Some(0));
    let codes = [None, Some(root().join("robots/ur10e/ur10e.urdf"))].map(|nominal| {
        let found = judged(&poses, nominal.as_deref());
        println!("{}", String::from_utf8_lossy(&found.stderr));
        found.status.code()
    });
    assert_eq!(codes, [Some(2); 2]);
}
