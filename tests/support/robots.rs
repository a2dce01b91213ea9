//! Robots that come with the repository, and the real series beside it.

#![allow(dead_code)]

use std::path::{Path, PathBuf};

use robotcal::urdf::{Chain, read};

/// The KUKA KR 6 in the repository.
pub const KR6: &str = "robots/kuka_kr6_r900/kuka_kr6_r900.urdf";

/// A file of the repository.
pub fn repo(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

pub fn kr6_urdf() -> PathBuf {
    repo(KR6)
}

/// The KR 6 from its root to its tip.
pub fn kr6() -> Chain {
    read(&kr6_urdf()).unwrap().chain(None, None).unwrap()
}

pub fn kr6_to_link_6() -> Chain {
    read(&kr6_urdf()).unwrap().chain(Some("base_link"), Some("link_6")).unwrap()
}

pub fn ur10e() -> Chain {
    read(&repo("robots/ur10e/ur10e.urdf")).unwrap().chain(Some("base_link"), Some("tool0")).unwrap()
}

/// A folder of measured data or descriptions, which lie beside the repository: tests that need them are ignored.
pub fn shared(folder: &str) -> PathBuf {
    let path = repo("../shared").join(folder);
    assert!(path.is_dir(), "{} is not there", path.display());
    path
}

/// What a study is made with, for the head of its table.
pub fn made_with() -> String {
    let git = |args: &[&str]| std::process::Command::new("git").current_dir(repo("")).args(args).output().ok();
    let commit = git(&["describe", "--always", "--dirty", "--exclude=*"]).map(|o| String::from_utf8(o.stdout).unwrap());
    format!("Made with robotcal {}, commit {}.\n", env!("CARGO_PKG_VERSION"), commit.unwrap_or_default().trim())
}

/// The KR 6 with a [`positioner`] before it, as a file in a folder.
pub fn kr6_and_positioner(folder: &Path) -> PathBuf {
    let text = std::fs::read_to_string(kr6_urdf()).unwrap();
    let end = text.rfind("</robot>").unwrap();
    let path = folder.join("cell.urdf");
    std::fs::write(&path, format!("{}{}{}", &text[..end], positioner(0.55, 0.5), &text[end..])).unwrap();
    path
}

/// Links and joints of a positioner of two axes, so far before `base_link` (m) and tilted by so much at most (rad); its last link is `table`.
pub fn positioner(before_m: f64, tilt_rad: f64) -> String {
    format!(
        r#"
  <link name="trunnion"/><link name="table"/>
  <joint name="tilt" type="revolute"><parent link="base_link"/><child link="trunnion"/><origin xyz="{before_m} 0 0.3" rpy="0 0 0.3"/>
    <axis xyz="0 1 0"/><limit lower="-{tilt_rad}" upper="{tilt_rad}" effort="0" velocity="1"/></joint>
  <joint name="turn" type="revolute"><parent link="trunnion"/><child link="table"/><origin xyz="0.02 0.01 0.08" rpy="0 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="0" velocity="1"/></joint>
"#
    )
}
