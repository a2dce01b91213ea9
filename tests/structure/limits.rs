//! Numbers that decide verdicts stand in `Limits`, where they are documented, overridable and recorded.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Constants that decide no verdict: sizes of computations, first guesses, how much is printed.
const NUMERICAL: [&str; 45] = [
    "assess/advice.rs BASES",
    "assess/advice.rs MOST_NEXT",
    "assess/advice.rs VALUES",
    "assess/clustered.rs SINGULAR",
    "assess/flange.rs MARGIN",
    "assess/flange.rs SAMPLES",
    "assess/hold_out.rs FOLDS",
    "assess/hold_out.rs NOMINAL_JOINT_ERROR",
    "assess/identifiability.rs AS_LONG",
    "assess/identifiability.rs MOST_PAIRS",
    "assess/projection.rs ACROSS",
    "assess/statistics.rs RESAMPLINGS",
    "assess/stops.rs FRAMES",
    "assess/stops.rs IDEAL_STOPS",
    "assess/stops.rs JOINT_SIGMA",
    "assess/stops.rs POSE_SIGMA_M",
    "assess/stops.rs POSE_SIGMA_RAD",
    "assess/stops.rs WIDEST_M",
    "assess/stops.rs WIDEST_RAD",
    "assess/worth.rs NORMAL_95",
    "diagnose/displaced.rs MOST_IMAGES",
    "diagnose/joint_noise.rs MOST_IMAGES",
    "diagnose/loose.rs MOST_IMAGES",
    "diagnose/plate_size.rs ASPECT",
    "diagnose/plate_size.rs UNKNOWN_SCALE",
    "identify/build.rs DEFAULT_SIGMA_PX",
    "identify/build.rs FIRST_JOINT_NOISE",
    "identify/build.rs FIRST_TILT",
    "identify/build.rs HUBER",
    "identify/free_poses.rs ROUNDS",
    "identify/joint.rs ROUNDS",
    "identify/lens_choice.rs KEPT_ASIDE",
    "identify/lens_choice.rs ROUNDS",
    "identify/second_pass.rs FEWEST_IMAGES",
    "identify/second_pass.rs REACH",
    "identify/start.rs COMPARED",
    "identify/two_stage.rs DECREMENT",
    "identify/two_stage.rs FIRST_FACTOR",
    "identify/two_stage.rs FIRST_ISOTROPIC",
    "identify/two_stage.rs FIRST_JOINT_NOISE",
    "identify/two_stage.rs ROUNDS",
    "identify/two_stage.rs STANDING",
    "identify/two_stage.rs STEPS",
    "identify/free_poses.rs GOOD_START_PX",
    "identify/lens_choice.rs OUTLIERS",
];

/// Constants that decide verdicts and are not in `Limits` yet. None may be added.
const STILL_OUTSIDE: [&str; 23] = [
    "assess/advice.rs LEAST_GAIN",
    "assess/advice.rs STANDS_STILL",
    "assess/clustered.rs FEWEST_IMAGES",
    "assess/clustered.rs MOST_TAKEN",
    "assess/hold_out.rs FEWEST_POSTURES",
    "assess/hold_out.rs FEWEST_REGIONS",
    "assess/identifiability.rs LEAST_PART",
    "assess/identifiability.rs OUTSIDE",
    "assess/identifiability.rs STRONG_CORRELATION",
    "assess/stops.rs LEAST_SHARE",
    "identify/build.rs FEWEST_OBSERVATIONS",
    "identify/compare.rs FEWEST_IMAGES",
    "identify/free_poses.rs LEAST_TILT",
    "identify/free_poses.rs LEAST_TURN",
    "identify/free_poses.rs WORST_FOCAL_SIGMA",
    "identify/lens_choice.rs AS_GOOD",
    "identify/lens_choice.rs FISHEYE_FROM",
    "identify/local_errors.rs LEAST_SHARE_TIED",
    "identify/suspects.rs EXPLAINS",
    "identify/suspects.rs SCALE_ERROR",
    "identify/suspects.rs SCALE_EXPLAINS",
    "identify/suspects.rs UNSUSPICIOUS",
    "identify/suspects.rs WRONG_LENGTHS_M",
];

/// `file NAME` of every constant whose type is a number or a tuple of numbers.
fn constants(room: &str) -> BTreeSet<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(room);
    let mut found = BTreeSet::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let file = format!("{room}/{}", path.file_name().unwrap().to_string_lossy());
        for line in fs::read_to_string(&path).unwrap_or_default().lines() {
            let Some((_, after)) = line.split_once("const ") else { continue };
            let Some((name, kind)) = after.split_once(": ") else { continue };
            let is_number =
                ["f64", "usize", "u8", "u32", "u64", "i32", "(f64", "[f64"].iter().any(|k| kind.starts_with(k));
            if is_number && name.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_') {
                found.insert(format!("{file} {name}"));
            }
        }
    }
    found
}

#[test]
fn numbers_that_decide_stand_in_limits() {
    let known: BTreeSet<String> = NUMERICAL.iter().chain(&STILL_OUTSIDE).map(|s| (*s).to_owned()).collect();
    let found: BTreeSet<String> = ["diagnose", "identify", "assess"].into_iter().flat_map(constants).collect();
    assert!(found.len() > 30, "only {} constants were found", found.len());
    let new: Vec<&String> = found.difference(&known).collect();
    assert!(new.is_empty(), "does it decide a verdict? then into `Limits`; else into NUMERICAL here: {new:#?}");
    let gone: Vec<&String> = known.difference(&found).collect();
    assert!(gone.is_empty(), "remove from the list: {gone:#?}");
}
