//! Results on the disk: complete or not at all, and an earlier one only replaced by a new one.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use crate::robots::kr6_urdf;
use robotcal::Code;
use robotcal::output::{NewFolder, ResultFolder, recover, write_all, write_beside};
use robotcal::series::InputFile;

type Files = BTreeMap<String, Vec<u8>>;

/// A result of the given files, with a solution.json that lists them.
fn result(names: &[&str], content: &str) -> Files {
    let mut files: Files = names.iter().map(|n| (n.to_string(), content.as_bytes().to_vec())).collect();
    let mut listed: Vec<&str> = names.to_vec();
    listed.push("solution.json");
    files.insert("solution.json".into(), format!("{{\"files\": {listed:?}}}").into_bytes());
    files
}

/// What was written to a folder, by hash.
const WRITTEN: &str = ".robotcal-written.json";

fn found(folder: &Path) -> Files {
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap()).filter(|e| e.file_name() != WRITTEN);
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
fn a_result_that_was_changed_is_left_alone() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    write_all(&out, &result(&["camera.yaml"], "old")).unwrap();
    write_all(&out, &result(&["camera.yaml"], "new")).unwrap();
    fs::write(out.join("camera.yaml"), "new, and by hand").unwrap();
    let before = found(&out);
    assert_eq!(write_all(&out, &result(&["camera.yaml"], "newer")).unwrap_err().code, Code::OutputForeign);
    assert_eq!(found(&out), before);
    // The record of a folder that was emptied is nobody's.
    for name in before.keys() {
        fs::remove_file(out.join(name)).unwrap();
    }
    write_all(&out, &plan("planned")).unwrap();
    assert_eq!(all_below(&out), plan("planned"));
}

#[test]
fn a_folder_with_other_things_is_left_alone() {
    let root = tempfile::tempdir().unwrap();
    let series = root.path().join("run1");
    fs::create_dir(&series).unwrap();
    fs::write(series.join("plate.toml"), "the plate of a series").unwrap();
    let before = found(&series);
    let error = write_all(&series, &result(&["plate.toml"], "new")).unwrap_err();
    assert_eq!(error.code, Code::OutputForeign, "{error}");
    assert_eq!(found(&series), before);
    assert_eq!(names(root.path()), ["run1"]);
}

/// A plan, as `plan` lists it.
fn plan(joints: &str) -> Files {
    let sha256 = InputFile::of_bytes(Path::new("joints.csv"), joints.as_bytes()).sha256;
    let record =
        format!("{{\"files\": [\"joints.csv\", \"plan.json\"], \"as_written\": {{\"joints.csv\": \"{sha256}\"}}}}");
    [("joints.csv", joints.to_owned()), ("plan.json", record)].map(|(n, t)| (n.to_owned(), t.into_bytes())).into()
}

#[test]
fn the_result_of_another_command_is_left_alone() {
    let root = tempfile::tempdir().unwrap();
    for (there, new) in [(plan("a"), result(&["camera.yaml"], "new")), (result(&["camera.yaml"], "old"), plan("b"))] {
        let out = root.path().join(if there.contains_key("plan.json") { "run1" } else { "solved" });
        write_all(&out, &there).unwrap();
        assert_eq!(write_all(&out, &new).unwrap_err().code, Code::OutputForeign);
        assert_eq!(found(&out), there);
    }
}

#[test]
fn a_plan_that_became_a_series_is_left_alone() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("run1");
    write_all(&out, &plan("planned")).unwrap();
    write_all(&out, &plan("planned anew")).unwrap();
    fs::write(out.join("joints.csv"), "measured").unwrap();
    let before = found(&out);
    assert_eq!(write_all(&out, &plan("planned again")).unwrap_err().code, Code::OutputForeign);
    assert_eq!(found(&out), before);
    fs::write(out.join("joints.csv"), "planned anew").unwrap();
    fs::create_dir(out.join("images")).unwrap();
    assert_eq!(write_all(&out, &plan("planned again")).unwrap_err().code, Code::OutputForeign);
    assert_eq!(fs::read(out.join("joints.csv")).unwrap(), b"planned anew");
}

#[test]
fn a_plate_that_was_measured_is_not_drawn_over() {
    let root = tempfile::tempdir().unwrap();
    let draw = |kind: &str| robotcal(root.path(), &["plate", "--sheet", "A4", "--kind", kind, "--out", "plate"]).0;
    assert_eq!([draw("coded-circles"), draw("coded-circles")], [Some(0), Some(0)], "the same plate again");
    let file = root.path().join("plate/plate.toml");
    let measured =
        fs::read_to_string(&file).unwrap() + "\n[scale]\nfrom = 0\nto = 1\ndistance_m = 0.0083\nsigma_m = 1e-5\n";
    fs::write(&file, &measured).unwrap();
    assert_eq!([draw("coded-circles"), draw("chessboard")], [Some(2), Some(2)]);
    assert_eq!(fs::read_to_string(&file).unwrap(), measured);
}

#[test]
fn a_plate_is_drawn_again_at_another_resolution() {
    let root = tempfile::tempdir().unwrap();
    for kind in [&["coded-circles"][..], &["chessboard", "--shape", "8x6", "--pitch-mm", "25"]] {
        let draw =
            |dpi: &str| robotcal(root.path(), &[&["plate", "--out", kind[0], "--dpi", dpi, "--kind"], kind].concat());
        for dpi in ["50", "60"] {
            let (code, said) = draw(dpi);
            assert_eq!(code, Some(0), "{kind:?}: {said}");
        }
        let png = root.path().join(kind[0]).join("plate.png");
        fs::write(&png, "of the user").unwrap();
        let (code, said) = draw("70");
        assert!(code == Some(2) && said.starts_with("error[output_exists]: "), "{said}");
        assert_eq!(fs::read(&png).unwrap(), b"of the user");
    }
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
    assert_eq!(error.exit_code(), 2);
    assert_eq!(found(&out), before);
    // The work is not lost either.
    assert_eq!(found(&root.path().join("out-2")), result(&["camera.yaml", "poses.csv"], "new"));
    assert_eq!(names(root.path()), ["out", "out-2"]);
}

#[test]
fn a_file_in_the_place_of_the_folder_is_named() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    fs::write(&out, "a file").unwrap();
    let error = write_all(&out, &result(&[], "")).unwrap_err();
    assert_eq!(error.code, Code::OutputName, "{error}");
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
    assert_eq!(error.code, Code::FileForbidden, "{error}");
    fs::set_permissions(&locked, fs::Permissions::from_mode(0o755)).unwrap();
    assert_eq!(names(&locked), Vec::<String>::new());
}

/// Files and folders below, with a mark where the user's are.
fn all_below(folder: &Path) -> Files {
    let mut all = Files::new();
    for (name, bytes) in found(folder) {
        let path = folder.join(&name);
        match path.symlink_metadata().unwrap().is_dir() {
            true => all.extend(all_below(&path).into_iter().map(|(n, b)| (format!("{name}/{n}"), b))),
            false => drop(all.insert(name, bytes)),
        }
    }
    all
}

/// Two results that share some names, with a folder.
fn two_results() -> [Files; 2] {
    let with_folder = |names: &[&str], content: &str| result(names, &content.repeat(5000));
    [
        with_folder(&["camera.yaml", "only_a.csv", "robot.urdf", "overlay/1.png", "overlay/2.png"], "a"),
        with_folder(&["camera.yaml", "only_b.csv", "robot.urdf", "overlay/2.png", "overlay/3.png"], "b"),
    ]
}

/// Not a test by itself: another process that writes results, one after the other, until it is killed.
#[test]
#[ignore = "run by other tests"]
fn child() {
    let Ok(out) = std::env::var("RESULTS_GO_TO") else { return };
    let rounds = std::env::var("ROUNDS").map_or(u32::MAX, |r| r.parse().unwrap());
    let [a, b] = two_results();
    for k in 0..rounds {
        println!("round {k}");
        write_all(Path::new(&out), if k % 2 == 0 { &a } else { &b }).unwrap();
    }
}

fn child_command(out: &Path) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--ignored", "--exact", "write::child", "--nocapture", "--test-threads=1"]).env("RESULTS_GO_TO", out);
    command
}

fn writing(out: &Path) -> Child {
    let mut child = child_command(out).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut said = Vec::new();
    let mut stdout = child.stdout.take().unwrap();
    while !said.ends_with(b"round 1") {
        let mut byte = [0];
        assert_eq!(stdout.read(&mut byte).unwrap(), 1, "the child ended: {}", String::from_utf8_lossy(&said));
        said.push(byte[0]);
    }
    // Nobody reads on, and nobody blocks: the rounds are few before the kill.
    std::mem::forget(stdout);
    child
}

const KILLS: u64 = 50;

/// Kills a writing process at moments that differ, and looks what is there.
fn kill_again_and_again(out: &Path, users: &Files, look: impl Fn(u64)) {
    for kill in 0..KILLS {
        let mut child = writing(out);
        std::thread::sleep(Duration::from_micros(1 + kill * 7919 % 20_011));
        child.kill().unwrap();
        child.wait().unwrap();
        look(kill);
        let mut there = all_below(out);
        for (name, bytes) in users {
            assert_eq!(there.remove(name).as_ref(), Some(bytes), "kill {kill}: {name}");
        }
        there.retain(|name, _| !name.starts_with(".robotcal-unfinished"));
        assert!(two_results().contains(&there), "kill {kill}: {:?}", there.keys());
    }
}

#[test]
fn killed_at_any_moment_the_earlier_or_the_new_result_is_whole() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    write_all(&out, &two_results()[0]).unwrap();
    // Nothing is brought in order before the look: the folder itself is whole at every moment.
    kill_again_and_again(&out, &Files::new(), |_| {});
    write_all(&out, &two_results()[1]).unwrap();
    assert_eq!(all_below(&out), two_results()[1]);
    assert_eq!(names(root.path()), ["out"], "what the killed runs left is swept up");
}

#[test]
fn killed_while_replacing_file_by_file_the_next_look_finds_a_whole_result() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    write_all(&out, &two_results()[0]).unwrap();
    // A folder of the user cannot change places with the result.
    fs::create_dir(out.join("pictures")).unwrap();
    fs::write(out.join("pictures/mine.png"), "picture").unwrap();
    let users = Files::from([("pictures/mine.png".to_owned(), b"picture".to_vec())]);
    kill_again_and_again(&out, &users, |_| recover(&out.join("solution.json")).unwrap());
    write_all(&out, &two_results()[1]).unwrap();
    assert_eq!(names(root.path()), ["out"]);
    assert_eq!(names(&out), ["camera.yaml", "only_b.csv", "overlay", "pictures", "robot.urdf", "solution.json"]);
}

#[test]
fn an_earlier_result_that_a_killed_run_moved_away_comes_back() {
    let root = tempfile::tempdir().unwrap();
    let (out, old) = (root.path().join("out"), root.path().join(".out.old-4711-0"));
    let earlier = result(&["camera.yaml"], "earlier");
    let killed = || {
        write_all(&out, &earlier).unwrap();
        fs::write(out.join("notes.txt"), "mine").unwrap();
        fs::rename(&out, &old).unwrap();
    };
    killed();
    recover(&out.join("solution.json")).unwrap();
    assert_eq!(fs::read(out.join("solution.json")).unwrap(), earlier["solution.json"]);
    fs::remove_dir_all(&out).unwrap();
    killed();
    // The next run fails: the earlier result is there again.
    let broken = Files::from([("x".repeat(300), Vec::new())]);
    assert_eq!(write_all(&out, &broken).unwrap_err().exit_code(), 2);
    assert_eq!(fs::read(out.join("camera.yaml")).unwrap(), b"earlier");
    assert_eq!(fs::read(out.join("notes.txt")).unwrap(), b"mine");
    assert_eq!(names(root.path()), ["out"]);
}

#[cfg(unix)]
#[test]
fn a_folder_is_free_at_once_though_programs_are_being_started() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    let done = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|threads| {
        threads.spawn(|| {
            while !done.load(std::sync::atomic::Ordering::Relaxed) {
                std::process::Command::new("true").status().unwrap();
            }
        });
        // Where a folder is free only when its file is closed everywhere, about one try in four comes too early.
        let all_written = (0..80).all(|k| write_all(&out, &two_results()[k % 2]).is_ok());
        done.store(true, std::sync::atomic::Ordering::Relaxed);
        assert!(all_written);
    });
}

#[test]
fn what_the_user_puts_there_meanwhile_stays() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    write_all(&out, &two_results()[0]).unwrap();
    let place = ResultFolder::claim(&out, "solution.json").unwrap();
    let new = place.begin().unwrap();
    two_results()[1].iter().for_each(|(name, bytes)| new.put(name, bytes).unwrap());
    fs::write(out.join("overlay/mine.txt"), "mine").unwrap();
    fs::write(out.join("notes.txt"), "mine").unwrap();
    new.finish().unwrap();
    let mut expected = two_results()[1].clone();
    expected.insert("overlay/mine.txt".into(), b"mine".to_vec());
    expected.insert("notes.txt".into(), b"mine".to_vec());
    assert_eq!(all_below(&out), expected);
    assert_eq!(names(root.path()), ["out"]);
}

#[test]
fn what_is_changed_during_the_run_is_left_alone() {
    let solutions = two_results();
    let plans = ["planned", "planned again"].map(plan);
    for (record, [old, new], changed) in [
        ("solution.json", &solutions, "robot.urdf"),
        ("plan.json", &plans, "joints.csv"),
        ("plan.json", &plans, "images"),
    ] {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("out");
        write_all(&out, old).unwrap();
        let result = ResultFolder::claim(&out, record).unwrap().begin().unwrap();
        new.iter().for_each(|(name, bytes)| result.put(name, bytes).unwrap());
        match changed {
            "images" => fs::create_dir(out.join(changed)).unwrap(),
            _ => fs::write(out.join(changed), "by hand").unwrap(),
        }
        let before = all_below(&out);
        assert_eq!(result.finish().unwrap_err().code, Code::OutputForeign, "{changed}");
        assert_eq!(all_below(&out), before, "{changed}");
        assert_eq!(&all_below(&root.path().join("out-2")), new, "{changed}");
        assert_eq!(names(root.path()), ["out", "out-2"]);
    }
}

/// Of an earlier version, or copied without the hashes.
#[test]
fn files_of_a_result_without_hashes_are_kept_in_one_folder_beside_it() {
    let [old, new] = two_results();
    for by_exchange in [true, false] {
        let root = tempfile::tempdir().unwrap();
        let [out, first, second] = ["out", "out.kept-1", "out.kept-2"].map(|name| root.path().join(name));
        write_all(&out, &old).unwrap();
        if !by_exchange {
            fs::create_dir(out.join("pictures")).unwrap();
        }
        let without_hashes = |files: &Files| {
            fs::remove_file(out.join(WRITTEN)).unwrap();
            write_all(&out, files).unwrap();
            assert_eq!(&all_below(&out), files);
            names(root.path())
        };
        assert_eq!(without_hashes(&old), ["out"], "nothing is another file");
        fs::write(out.join("robot.urdf"), "by hand").unwrap();
        assert_eq!(without_hashes(&old), ["out", "out.kept-1"]);
        assert_eq!(all_below(&first), Files::from([("robot.urdf".to_owned(), b"by hand".to_vec())]));
        // Everything is another file: pictures and records are not what people edit.
        assert_eq!(without_hashes(&new), ["out", "out.kept-1", "out.kept-2"]);
        let edited = old.iter().filter(|(name, _)| ["yaml", "csv", "urdf"].iter().any(|e| name.ends_with(e)));
        assert_eq!(all_below(&second), edited.map(|(n, b)| (n.clone(), b.clone())).collect());
        write_all(&out, &old).unwrap();
        assert_eq!(names(root.path()), ["out", "out.kept-1", "out.kept-2"], "it has hashes now");
    }
}

#[test]
fn hashes_in_the_record_of_a_plan_are_enough() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("run1");
    write_all(&out, &plan("planned")).unwrap();
    fs::remove_file(out.join(WRITTEN)).unwrap();
    write_all(&out, &plan("planned again")).unwrap();
    assert_eq!(names(root.path()), ["run1"]);
}

#[cfg(target_os = "linux")]
#[test]
fn names_that_are_no_text_stay() {
    use std::os::unix::ffi::OsStrExt;
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    write_all(&out, &two_results()[0]).unwrap();
    let strange = out.join(std::ffi::OsStr::from_bytes(b"notes-\xff.txt"));
    fs::write(&strange, "mine").unwrap();
    write_all(&out, &two_results()[1]).unwrap();
    assert_eq!(fs::read(&strange).unwrap(), b"mine");
    fs::remove_file(&strange).unwrap();
    assert_eq!(all_below(&out), two_results()[1]);
}

#[cfg(unix)]
#[test]
fn the_current_folder_stays_the_current_folder() {
    use std::os::unix::fs::MetadataExt;
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    write_all(&out, &two_results()[0]).unwrap();
    let id = fs::metadata(&out).unwrap().ino();
    for here in [".", "overlay/..", "../out"] {
        let ended = child_command(Path::new(here)).env("ROUNDS", "2").current_dir(&out).output().unwrap();
        assert!(ended.status.success(), "{here}: {}", String::from_utf8_lossy(&ended.stderr));
        assert_eq!(
            fs::metadata(&out).unwrap().ino(),
            id,
            "{here}: whoever stands in it would stand in a removed folder"
        );
        assert_eq!(all_below(&out), two_results()[1]);
    }
    assert_eq!(names(root.path()), ["out"]);
}

#[cfg(unix)]
#[test]
fn a_link_to_a_folder_is_followed_and_stays_a_link() {
    let root = tempfile::tempdir().unwrap();
    let (real, link) = (root.path().join("real"), root.path().join("link"));
    fs::create_dir(&real).unwrap();
    std::os::unix::fs::symlink(&real, &link).unwrap();
    two_results().iter().for_each(|files| write_all(&link, files).unwrap());
    assert!(link.symlink_metadata().unwrap().is_symlink());
    assert_eq!(all_below(&real), two_results()[1]);
    for (name, target) in [("round", "round"), ("nowhere", "missing")] {
        std::os::unix::fs::symlink(target, root.path().join(name)).unwrap();
        let error = write_all(&root.path().join(name), &two_results()[0]).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.place.ends_with(name), "{error}");
    }
    assert_eq!(names(root.path()), ["link", "nowhere", "real", "round"]);
}

#[test]
fn of_two_runs_into_one_folder_the_second_is_refused_at_once() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    let first = ResultFolder::claim(&out, "solution.json").unwrap();
    let second = ResultFolder::claim(&out, "solution.json").unwrap_err();
    assert_eq!(second.exit_code(), 2);
    assert_eq!(NewFolder::begin(&out).unwrap_err().exit_code(), 2);
    first.write_all(&two_results()[0]).unwrap();
    assert_eq!(all_below(&out), two_results()[0]);
    ResultFolder::claim(&out, "solution.json").unwrap().write_all(&two_results()[1]).unwrap();
    assert_eq!(all_below(&out), two_results()[1]);
}

#[test]
fn many_processes_in_one_folder_leave_one_whole_result() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    write_all(&out, &two_results()[0]).unwrap();
    let start = |_| child_command(&out).env("ROUNDS", "6").stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let children: Vec<Child> = (0..4).map(start).collect();
    for mut child in children {
        child.wait().unwrap();
    }
    assert!(two_results().contains(&all_below(&out)), "{:?}", all_below(&out).keys());
    assert_eq!(names(root.path()), ["out"]);
}

#[test]
fn a_folder_made_for_nothing_goes_again() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("reports/2026/run1");
    drop(ResultFolder::claim(&out, "solution.json").unwrap());
    drop(NewFolder::begin(&out).unwrap());
    assert_eq!(names(root.path()), Vec::<String>::new());
    let folder = NewFolder::begin(&out).unwrap();
    fs::create_dir(folder.path().join("images")).unwrap();
    fs::write(folder.path().join("images/1.png"), "1").unwrap();
    assert_eq!(names(&out), Vec::<String>::new(), "it appears when it is complete");
    folder.finish().unwrap();
    assert_eq!(all_below(&out), Files::from([("images/1.png".to_owned(), b"1".to_vec())]));
    assert_eq!(NewFolder::begin(&out).unwrap_err().exit_code(), 2);
}

#[test]
fn files_among_others_come_together() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("reports");
    let table = |content: &str| format!("j1,x_m,y_m,z_m,qx,qy,qz,qw,sigma_mm,sigma_mrad,outside\n{content}\n");
    let [old, new] = ["old", "new"].map(table);
    fn files(content: &str) -> [(String, &[u8]); 2] {
        ["a.csv", "b.csv"].map(|n| (n.to_owned(), content.as_bytes()))
    }
    write_beside(&out, &files(&old), &[]).unwrap();
    fs::write(out.join("mine.md"), "mine").unwrap();
    // The second cannot be a file: neither of them is changed.
    let error = write_beside(&out, &[("a.csv".into(), &b"new"[..]), ("x".repeat(300), &b"new"[..])], &[]).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert_eq!(fs::read_to_string(out.join("a.csv")).unwrap(), old);
    write_beside(&out, &files(&new), &[]).unwrap();
    // One of them is the user's: neither is changed.
    fs::write(out.join("b.csv"), "x,y\n1,2\n").unwrap();
    assert_eq!(write_beside(&out, &files(&old), &[]).unwrap_err().code, Code::OutputExists);
    let expected = [("a.csv", new.as_str()), ("b.csv", "x,y\n1,2\n"), ("mine.md", "mine")];
    assert_eq!(all_below(&out), expected.map(|(n, c)| (n.to_owned(), c.into())).into());
}

/// Whatever their names and endings are.
#[test]
fn files_among_others_are_known_by_what_was_written() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("reports");
    let write = |content: &str| {
        let files = ["rep", "r.htm", "R.HTML", "p.png", "a.csv"].map(|name| (name.to_owned(), content.as_bytes()));
        write_beside(&out, &files, &[])
    };
    ["first", "second"].iter().for_each(|content| write(content).unwrap());
    fs::write(out.join("p.png"), "second, and by hand").unwrap();
    let before = all_below(&out);
    assert_eq!(write("third").unwrap_err().code, Code::OutputExists);
    assert_eq!(all_below(&out), before);
    fs::remove_file(out.join("p.png")).unwrap();
    write("third").unwrap();
    assert!(all_below(&out).values().all(|bytes| bytes == b"third"));
    // It may be of an earlier version, which kept no hashes.
    fs::write(out.join("old.png"), "of an earlier version").unwrap();
    let error = write_beside(&out, &[("old.png".to_owned(), &b"fourth"[..])], &[]).unwrap_err();
    assert_eq!(error.code, Code::OutputExists, "{error}");
}

/// Of earlier versions, or moved there.
#[test]
fn files_that_no_record_names_are_kept_under_another_name() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("reports");
    let table = |content: &str| format!("j1,x_m,y_m,z_m,qx,qy,qz,qw,sigma_mm,sigma_mrad,outside\n{content}\n");
    let write = |content: &str| write_beside(&out, &[("at.csv".to_owned(), table(content).as_bytes())], &[]);
    write("first").unwrap();
    fs::remove_file(out.join(WRITTEN)).unwrap();
    fs::write(out.join("at.csv"), table("by hand")).unwrap();
    ["second", "third"].iter().for_each(|content| write(content).unwrap());
    let expected = [("at.csv", "third"), ("at.csv.kept-1", "by hand")];
    assert_eq!(all_below(&out), expected.map(|(n, c)| (n.to_owned(), table(c).into_bytes())).into());
    // No name is left to keep it.
    fs::remove_file(out.join(WRITTEN)).unwrap();
    (2..1000).for_each(|k| fs::write(out.join(format!("at.csv.kept-{k}")), "").unwrap());
    let before = all_below(&out);
    assert_eq!(write("fourth").unwrap_err().code, Code::OutputExists);
    assert!(all_below(&out) == before);
}

#[test]
fn files_among_others_that_came_in_part_are_completed_before_the_next() {
    let root = tempfile::tempdir().unwrap();
    let [out, other] = ["out", "other"].map(|name| root.path().join(name));
    fn files(content: &str) -> [(String, &[u8]); 2] {
        ["a", "b"].map(|n| (n.to_owned(), content.as_bytes()))
    }
    write_beside(&out, &files("first"), &[]).unwrap();
    write_beside(&other, &files("second"), &[]).unwrap();
    // One of them has come, the other and the record have not.
    fs::copy(other.join("a"), out.join("a")).unwrap();
    let unfinished = out.join(".robotcal-unfinished");
    fs::create_dir_all(unfinished.join("files")).unwrap();
    for name in ["b", WRITTEN] {
        fs::copy(other.join(name), unfinished.join("files").join(name)).unwrap();
    }
    let list = format!("{{\"move_in\": [\"a\", \"b\", \"{WRITTEN}\"], \"remove\": []}}");
    fs::write(unfinished.join("commit.json"), list).unwrap();
    assert!(ResultFolder::among(&out).unwrap().for_files(&["a", "b"]).is_ok());
    write_beside(&out, &files("third"), &[]).unwrap();
    assert_eq!(all_below(&out), files("third").map(|(n, bytes)| (n, bytes.to_vec())).into());
}

/// An earlier result of the command is replaced, whatever is not of the program stays.
#[test]
fn files_of_the_user_are_not_replaced() {
    let root = tempfile::tempdir().unwrap();
    let solution = Path::new(env!("CARGO_MANIFEST_DIR")).join("reports/kr6_small/solution.json").display().to_string();
    let joints = "joint_a1,joint_a2,joint_a3,joint_a4,joint_a5,joint_a6\n10,-80,90,20,40,10\n";
    fs::write(root.path().join("at_joints.csv"), joints).unwrap();
    let at = ["show", &solution, "--at", "at_joints.csv", "--at-unit", "deg", "--out", "at"];
    let frames = ["frames", "--from", &solution, "--plate", "--out", "frames"];
    for (args, made, option) in [
        (&["show", &solution, "--report", "own/r.html"][..], "own/r.html", "--report"),
        (&["show", &solution, "--figures", "figures"], "figures", "--figures"),
        (&at, "at/at.csv", "--out"),
        (&frames, "frames/frames.json", "--out"),
        (&frames, "frames/robotcal_frames.src", "--out"),
    ] {
        for _ in 0..2 {
            let (code, said) = robotcal(root.path(), args);
            assert_ne!(code, Some(2), "{args:?}: {said}");
        }
        let mut made = root.path().join(made);
        if made.is_dir() {
            made = made.join(&names(&made)[0]);
        }
        let written = fs::read(&made).unwrap();
        let of_user = [b"of the user, by hand\n", &written[written.len() / 2..]].concat();
        let edited = [&written, &b" "[..]].concat();
        for users in [of_user, edited] {
            fs::write(&made, &users).unwrap();
            let (code, said) = robotcal(root.path(), args);
            assert_eq!(code, Some(2), "{args:?}: {said}");
            // words: the name of the option.
            assert!(said.starts_with("error[output_exists]: ") && said.contains(option), "{args:?}: {said}");
            assert!(fs::read(&made).unwrap() == users, "{args:?}");
        }
        fs::write(&made, &written).unwrap();
        assert_ne!(robotcal(root.path(), args).0, Some(2), "{args:?}");
    }
    // Known before the work.
    fs::write(root.path().join("monte-carlo.md"), "# Monte Carlo, by hand\n").unwrap();
    let urdf = kr6_urdf().display().to_string();
    let (code, said) = robotcal(root.path(), &["compare", "--monte-carlo", "--urdf", &urdf, "--out", "."]);
    assert!(code == Some(2) && said.starts_with("error[output_exists]: "), "{said}");
    // Joints of a series are no report.
    let readings = root.path().join("at_joints.csv");
    let (code, said) = robotcal(root.path(), &["show", &solution, "--report", "at_joints.csv"]);
    assert!(code == Some(2) && said.starts_with("error[output_exists]: "), "{said}");
    assert_eq!(fs::read_to_string(readings).unwrap(), joints);
}

#[test]
fn a_report_that_is_written_again_is_named() {
    let root = tempfile::tempdir().unwrap();
    let solution = Path::new(env!("CARGO_MANIFEST_DIR")).join("reports/kr6_small/solution.json");
    let mut command = Command::new(env!("CARGO_BIN_EXE_robotcal"));
    let shown = command.arg("show").arg(solution).args(["--report", "mine.html"]).current_dir(root.path()).output();
    let said = String::from_utf8(shown.unwrap().stdout).unwrap();
    let named = said.lines().find_map(|line| line.strip_prefix("report")).unwrap().trim_start();
    assert!(named.starts_with("mine.html"), "{said}");
}

/// Nobody named the folder in which two series of one name meet.
#[test]
fn a_result_of_another_robot_or_series_is_not_replaced_unasked() {
    let root = tempfile::tempdir().unwrap();
    let ur = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/ur10e/ur10e.urdf").display().to_string();
    let kr = kr6_urdf().display().to_string();
    let series = [(&kr, "z1/run1"), (&ur, "z2/run1"), (&kr, "z3/run1")];
    for ((urdf, folder), seed) in series.into_iter().zip(["1", "2", "3"]) {
        let flags = ["--observations", "--images", "24", "--errors", "rigid", "--seed", seed];
        let (code, said) =
            robotcal(root.path(), &[&["simulate", "--urdf", urdf, "--out", folder], &flags[..]].concat());
        assert_eq!(code, Some(0), "{said}");
    }
    let identify = |(urdf, folder): (&String, &str)| {
        robotcal(root.path(), &["identify", "--urdf", urdf, "--series", folder, "--robot-model", "rigid"])
    };
    let result = || fs::read(root.path().join("reports/run1/solution.json")).unwrap();
    let (code, said) = identify(series[0]);
    assert_ne!(code, Some(2), "{said}");
    let first = result();
    for other in &series[1..] {
        let (code, said) = identify(*other);
        assert!(code == Some(2) && said.starts_with("error[output_exists]: "), "{said}");
        assert!(result() == first);
    }
    fs::rename(root.path().join("z1"), root.path().join("moved")).unwrap();
    for same in ["moved/run1", "./moved/run1"] {
        let (code, said) = identify((&kr, same));
        assert_ne!(code, Some(2), "{said}");
    }
}

#[test]
fn a_folder_that_vanishes_is_made_again() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("reports/out");
    let place = ResultFolder::claim(&out, "solution.json").unwrap();
    fs::remove_dir_all(root.path().join("reports")).unwrap();
    place.write_all(&two_results()[0]).unwrap();
    assert_eq!(all_below(&out), two_results()[0]);
    let new = ResultFolder::claim(&out, "solution.json").unwrap().begin().unwrap();
    two_results()[1].iter().for_each(|(name, bytes)| new.put(name, bytes).unwrap());
    fs::remove_dir_all(&out).unwrap();
    new.finish().unwrap();
    assert_eq!(all_below(&out), two_results()[1]);
    assert_eq!(names(&root.path().join("reports")), ["out"]);
}

#[test]
fn a_record_that_names_files_elsewhere_does_no_harm() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    fs::create_dir(&out).unwrap();
    fs::write(root.path().join("mine.txt"), "mine").unwrap();
    fs::write(out.join("solution.json"), r#"{"files": ["../mine.txt", "solution.json"]}"#).unwrap();
    write_all(&out, &two_results()[0]).unwrap();
    let unfinished = out.join(".robotcal-unfinished");
    fs::create_dir(&unfinished).unwrap();
    fs::write(unfinished.join("commit.json"), r#"{"move_in": [], "remove": ["../mine.txt"]}"#).unwrap();
    assert_eq!(recover(&out.join("solution.json")).unwrap_err().exit_code(), 2);
    assert_eq!(fs::read(root.path().join("mine.txt")).unwrap(), b"mine");
}

/// Runs a shell script in a mount namespace of its own; `None` where the system does not allow that.
#[cfg(target_os = "linux")]
fn with_mounts(script: &str, folder: &Path) -> Option<std::process::Output> {
    let allowed = Command::new("unshare").args(["-rm", "true"]).output().is_ok_and(|o| o.status.success());
    let exe = std::env::current_exe().unwrap();
    let run = || {
        let mut command = Command::new("unshare");
        command.args(["-rm", "sh", "-ec", script]).current_dir(folder).env("ROUNDS", "2");
        command.env("CHILD", format!("{} --ignored --exact write::child --test-threads=1", exe.display()));
        command.output().unwrap()
    };
    if !allowed {
        println!("skipped: no mount namespaces here");
    }
    allowed.then(run)
}

#[cfg(target_os = "linux")]
#[test]
fn a_mount_point_gets_the_result_file_by_file() {
    let root = tempfile::tempdir().unwrap();
    fs::create_dir(root.path().join("out")).unwrap();
    let script = "mount -t tmpfs none out; RESULTS_GO_TO=out $CHILD >&2; cp -a out copy; umount out; \
                  mkdir kept; mount --bind kept out; RESULTS_GO_TO=out $CHILD >&2";
    let Some(ended) = with_mounts(script, root.path()) else { return };
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    assert_eq!(all_below(&root.path().join("copy")), two_results()[1]);
    assert_eq!(all_below(&root.path().join("kept")), two_results()[1]);
    assert_eq!(names(root.path()), ["copy", "kept", "out"]);
}

#[cfg(target_os = "linux")]
#[test]
fn where_no_folder_can_be_made_beside_files_are_kept_within() {
    let root = tempfile::tempdir().unwrap();
    fs::create_dir(root.path().join("disk")).unwrap();
    let script = "mount -t tmpfs none disk; mkdir disk/out; mount -t tmpfs none disk/out; mount -o remount,ro disk; \
                  export ROUNDS=1 RESULTS_GO_TO=disk/out; $CHILD >&2; rm disk/out/.robotcal-written.json; \
                  printf 'by hand' > disk/out/robot.urdf; $CHILD >&2; cp -a disk/out copy";
    let Some(ended) = with_mounts(script, root.path()) else { return };
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let mut expected = two_results()[0].clone();
    expected.insert("earlier/robot.urdf".into(), b"by hand".to_vec());
    assert_eq!(all_below(&root.path().join("copy")), expected);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_keeps_the_earlier_result() {
    let root = tempfile::tempdir().unwrap();
    fs::create_dir(root.path().join("disk")).unwrap();
    // Room for one result and a half; once on a disk with the folder, once as the folder.
    for out in ["disk/out", "disk"] {
        let script = format!(
            "mount -t tmpfs -o size=64k none disk; ROUNDS=1 RESULTS_GO_TO={out} $CHILD >&2; \
             if RESULTS_GO_TO={out} $CHILD >&2; then exit 7; fi; cp -a {out} copy; ls -a disk > listed"
        );
        let Some(ended) = with_mounts(&script, root.path()) else { return };
        assert!(ended.status.success(), "{out}: {}", String::from_utf8_lossy(&ended.stderr));
        assert_eq!(all_below(&root.path().join("copy")), two_results()[0]);
        fs::remove_dir_all(root.path().join("copy")).unwrap();
        let listed = fs::read_to_string(root.path().join("listed")).unwrap();
        assert!(!listed.contains(".out") && !listed.contains("robotcal-unfinished"), "{listed}");
    }
}

fn robotcal(folder: &Path, args: &[&str]) -> (Option<i32>, String) {
    let ended = Command::new(env!("CARGO_BIN_EXE_robotcal")).args(args).current_dir(folder).output().unwrap();
    (ended.status.code(), String::from_utf8_lossy(&ended.stderr).into_owned())
}

/// Wrong readings put markers of left-out images beside the camera, where nothing can be predicted.
#[test]
fn a_result_of_which_many_images_are_left_out_is_read_back() {
    let root = tempfile::tempdir().unwrap();
    let urdf = kr6_urdf();
    let urdf = urdf.to_str().unwrap();
    let run = |args: &str| {
        robotcal(root.path(), &args.split(' ').map(|a| if a == "URDF" { urdf } else { a }).collect::<Vec<_>>())
    };
    let (code, said) = run("simulate --urdf URDF --observations --images 100 --seed 3 --out run");
    assert_eq!(code, Some(0), "{said}");
    // From image 60 on the third joint is not read any more.
    let joints = root.path().join("run/joints.csv");
    let mut rows: Vec<Vec<String>> =
        fs::read_to_string(&joints).unwrap().lines().map(|l| l.split(',').map(str::to_owned).collect()).collect();
    let last = rows[59][3].clone();
    rows[60..].iter_mut().for_each(|row| row[3].clone_from(&last));
    let text: String = rows.iter().map(|row| row.join(",") + "\n").collect();
    fs::write(&joints, text).unwrap();
    let (code, said) = run("identify --urdf URDF --series run --out result");
    assert_eq!(code, Some(1), "{said}");
    let (code, said) = run("show result/solution.json");
    assert_eq!(code, Some(1), "{said}");
}

#[test]
fn every_command_tries_its_folder_before_it_reads_anything() {
    let root = tempfile::tempdir().unwrap();
    fs::write(root.path().join("file"), "a file").unwrap();
    let before = all_below(root.path());
    // All inputs are missing, too: the folder is complained of first.
    for args in [
        "identify --urdf missing --series missing",
        "identify --from missing",
        "detect --series missing",
        "detect --plate missing missing.png",
        "detect --study --part identity --views 1",
        "compare --urdf missing --series missing",
        "compare --urdf missing --study",
        "compare --urdf missing --monte-carlo",
        "plan --urdf missing --plate missing",
        "plan --urdf missing --study 1",
        "simulate --urdf missing",
        "compensate missing.src --nominal missing --urdf missing",
        "plate",
    ] {
        for (out, why) in [("file", "output_name"), ("file/below", "file_not_regular")] {
            let args: Vec<&str> = args.split(' ').chain(["--out", out]).collect();
            let (code, said) = robotcal(root.path(), &args);
            assert_eq!(code, Some(2), "{args:?}: {said}");
            assert!(said.starts_with(&format!("error[{why}]: {out}")), "{args:?}: {said}");
        }
    }
    let file = "file";
    let (code, said) = robotcal(root.path(), &["convert", "missing.mcap", file]);
    assert!(code == Some(2) && said.starts_with(&format!("error[output_name]: {file}")), "{said}");
    assert_eq!(all_below(root.path()), before);
}

#[test]
fn the_table_of_predictions_is_tried_before_anything_is_read() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    write_all(&out, &result(&["camera.yaml"], "old")).unwrap();
    fs::write(out.join("at.csv"), "mine").unwrap();
    let args = "identify --urdf missing --series missing --at missing.csv --at-unit deg --out out";
    let (code, said) = robotcal(root.path(), &args.split(' ').collect::<Vec<_>>());
    assert!(code == Some(2) && said.starts_with("error[output_exists]: "), "{said}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_read_only_disk_is_named_before_the_work() {
    let root = tempfile::tempdir().unwrap();
    fs::create_dir(root.path().join("disk")).unwrap();
    let exe = PathBuf::from(env!("CARGO_BIN_EXE_robotcal"));
    let script = format!(
        "mount -t tmpfs -o ro none disk; {} plan --urdf missing --plate missing --out $PLACE || echo $? > code",
        exe.display()
    );
    for out in ["disk", "disk/below"] {
        let Some(ended) = with_mounts(&script.replace("$PLACE", out), root.path()) else { return };
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(ended.status.success() && said.contains(out) && !said.contains("[file_missing]"), "{said}");
        assert_eq!(fs::read_to_string(root.path().join("code")).unwrap().trim(), "2");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn with_little_memory_the_answer_is_the_same_or_the_error_is_clear() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let run = |limit: &str| {
        let script = format!("ulimit -v {limit} && exec \"$@\"");
        let args = ["--urdf", "robots/ur10e/ur10e.urdf", "--series", "datasets/ur10e_observations"];
        let mut command = Command::new("sh");
        command.args(["-c", &script, "sh", env!("CARGO_BIN_EXE_robotcal"), "identify", "--dry-run"]).args(args);
        command.current_dir(root).output().unwrap()
    };
    let free = run("unlimited");
    assert_eq!(free.status.code(), Some(0));
    let mut short = 0;
    // With less than the program itself takes, the system does not start it.
    for limit_kb in [1_048_576, 300_000, 150_000, 100_000, 70_000, 50_000, 40_000] {
        let limited = run(&limit_kb.to_string());
        let said = String::from_utf8_lossy(&limited.stderr);
        match limited.status.code() {
            Some(0) => assert_eq!(limited.stdout, free.stdout, "{limit_kb} kB"),
            code => {
                assert_eq!(code, Some(2), "{limit_kb} kB: {said}");
                short += 1;
            }
        }
    }
    assert!(short > 0, "no limit was a limit");
}
