//! Results on the disk: complete or not at all, and an earlier one only replaced by a new one.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use robotcal::output::write_all;

type Files = BTreeMap<String, Vec<u8>>;

/// A result of the given files, with a solution.json that lists them.
fn result(names: &[&str], content: &str) -> Files {
    let mut files: Files = names.iter().map(|n| (n.to_string(), content.as_bytes().to_vec())).collect();
    let mut listed: Vec<&str> = names.to_vec();
    listed.push("solution.json");
    files.insert("solution.json".into(), format!("{{\"files\": {listed:?}}}").into_bytes());
    files
}

fn found(folder: &Path) -> Files {
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap());
    entries.map(|e| (e.file_name().into_string().unwrap(), fs::read(e.path()).unwrap_or_default())).collect()
}

fn names(folder: &Path) -> Vec<String> {
    found(folder).into_keys().collect()
}

#[test]
fn a_result_is_written_below_folders_that_do_not_exist_yet() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("reports/run1");
    let files = result(&["camera.yaml"], "new");
    write_all(&out, &files).unwrap();
    assert_eq!(found(&out), files);
    assert_eq!(names(&root.path().join("reports")), ["run1"]);
}

#[test]
fn an_empty_folder_is_filled() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    fs::create_dir(&out).unwrap();
    write_all(&out, &result(&["camera.yaml"], "new")).unwrap();
    assert_eq!(names(&out), ["camera.yaml", "solution.json"]);
}

#[test]
fn an_earlier_result_is_replaced_as_a_whole_and_other_files_stay() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    write_all(&out, &result(&["camera.left.yaml", "camera.right.yaml"], "old")).unwrap();
    fs::write(out.join("notes.txt"), "mine").unwrap();
    fs::create_dir(out.join("pictures")).unwrap();
    fs::write(out.join("pictures/a.png"), "picture").unwrap();
    let new = result(&["camera.yaml"], "new");
    write_all(&out, &new).unwrap();
    assert_eq!(names(&out), ["camera.yaml", "notes.txt", "pictures", "solution.json"]);
    assert_eq!(fs::read(out.join("notes.txt")).unwrap(), b"mine");
    assert_eq!(fs::read(out.join("pictures/a.png")).unwrap(), b"picture");
    assert_eq!(found(&out)["solution.json"], new["solution.json"]);
    assert_eq!(names(root.path()), ["out"]);
}

#[test]
fn a_folder_with_other_things_is_left_alone() {
    let root = tempfile::tempdir().unwrap();
    let series = root.path().join("run1");
    fs::create_dir(&series).unwrap();
    fs::write(series.join("plate.toml"), "the plate of a series").unwrap();
    let before = found(&series);
    let error = write_all(&series, &result(&["plate.toml"], "new")).unwrap_err();
    assert!(error.what.contains("no earlier result"), "{error}");
    assert_eq!(error.exit_code(), 2);
    assert_eq!(found(&series), before);
    assert_eq!(names(root.path()), ["run1"]);
}

#[test]
fn a_file_of_the_user_in_an_earlier_result_is_not_overwritten() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    write_all(&out, &result(&["camera.yaml"], "old")).unwrap();
    fs::write(out.join("poses.csv"), "mine").unwrap();
    let before = found(&out);
    let error = write_all(&out, &result(&["camera.yaml", "poses.csv"], "new")).unwrap_err();
    assert!(error.place.ends_with("poses.csv"), "{error}");
    assert_eq!(found(&out), before);
}

#[test]
fn a_file_in_the_place_of_the_folder_is_named() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    fs::write(&out, "a file").unwrap();
    let error = write_all(&out, &result(&[], "")).unwrap_err();
    assert!(error.what.contains("is a file"), "{error}");
    assert_eq!(fs::read(&out).unwrap(), b"a file");
    let below = write_all(&out.join("deeper"), &result(&[], "")).unwrap_err();
    assert_eq!(below.exit_code(), 2);
}

#[test]
fn a_failure_half_way_leaves_the_earlier_result_and_no_rubbish() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    write_all(&out, &result(&["camera.yaml"], "old")).unwrap();
    let before = found(&out);
    // No file can have so long a name; it sorts behind the others.
    let mut broken = result(&["camera.yaml"], "new");
    broken.insert(format!("zz-cannot-{}", "x".repeat(300)), Vec::new());
    let error = write_all(&out, &broken).unwrap_err();
    assert!(error.place.contains("zz-cannot"), "{error}");
    assert_eq!(found(&out), before);
    assert_eq!(names(root.path()), ["out"]);
}

#[cfg(unix)]
#[test]
fn a_folder_without_permission_is_named() {
    use std::os::unix::fs::PermissionsExt;
    let root = tempfile::tempdir().unwrap();
    let locked = root.path().join("locked");
    fs::create_dir(&locked).unwrap();
    fs::set_permissions(&locked, fs::Permissions::from_mode(0o555)).unwrap();
    if fs::write(locked.join("probe"), "").is_ok() {
        println!("skipped: this user may write everywhere");
        return;
    }
    let error = write_all(&locked.join("out"), &result(&["camera.yaml"], "new")).unwrap_err();
    assert!(error.remedy.contains("permissions"), "{error}");
    fs::set_permissions(&locked, fs::Permissions::from_mode(0o755)).unwrap();
    assert_eq!(names(&locked), Vec::<String>::new());
}
