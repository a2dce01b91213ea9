//! Numbers that decide verdicts stand in `Limits`, where they are documented, overridable and recorded.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Constants that decide no verdict, with what they are instead.
const NUMERICAL: &[(&str, &str)] = &[
    ("assess/advice.rs BASES", "stops that are varied"),
    ("assess/advice.rs MOST_NEXT", "how many proposals are kept"),
    ("assess/advice.rs VALUES", "grid of the search"),
    ("assess/alone.rs HELD_M", "repeatability of the best robots"),
    ("assess/alone.rs STEPS", "iterations"),
    ("assess/alone.rs TOOL_M", "unit of a column"),
    ("assess/clustered.rs SINGULAR", "rounding of an eigenvalue"),
    ("assess/flange.rs HELD", "rounding"),
    ("assess/flange.rs SAMPLES", "samples of an average"),
    ("assess/hold_out.rs FOLDS", "how the hold-out is divided"),
    ("assess/hold_out.rs MOST_STOPS", "samples of an average"),
    ("assess/hold_out.rs NOMINAL_JOINT_ERROR", "prior of the nominal fit"),
    ("assess/hold_out.rs NOMINAL_POSE_ERROR", "prior of the nominal fit"),
    ("assess/hold_out.rs NOMINAL_STOPS", "samples of a fit"),
    ("assess/identifiability.rs AS_LONG", "rounding of a length"),
    ("assess/identifiability.rs MOST_PAIRS", "how many pairs are kept"),
    ("assess/mean_square.rs NEGLIGIBLE", "rounding of a sum"),
    ("assess/mean_square.rs SAMPLES", "samples of a quantile"),
    ("assess/mean_square.rs SEED", "start of random numbers"),
    ("assess/near_nominal.rs HALVINGS", "iterations"),
    ("assess/pattern_effect.rs HELD", "rounding"),
    ("assess/patterns.rs ABSORBED", "rounding of an eigenvalue"),
    ("assess/patterns.rs LEAST_SHARE", "rounding of an eigenvalue"),
    ("assess/patterns.rs PLATE_UNIT_M", "unit of a column"),
    ("assess/patterns.rs POWER_95", "quantile of the normal distribution"),
    ("assess/points.rs HELD", "what the points do not tell is held by so little that it decides nothing"),
    ("assess/projection.rs ACROSS", "grid of a map"),
    ("assess/repeating.rs FEWEST", "samples of a variance"),
    ("assess/statistics.rs RESAMPLINGS", "samples of a bootstrap"),
    ("assess/stops.rs FRAMES", "size of a matrix"),
    ("assess/stops.rs IDEAL_STOPS", "samples of the ideal series"),
    ("assess/stops.rs JOINT_SIGMA", "noise of the ideal series"),
    ("assess/stops.rs POSE_SIGMA_M", "noise of the ideal series"),
    ("assess/stops.rs POSE_SIGMA_RAD", "noise of the ideal series"),
    ("assess/stops.rs WIDEST_M", "range of the ideal series"),
    ("assess/stops.rs WIDEST_RAD", "range of the ideal series"),
    ("assess/uncertainty.rs NORMAL_95", "quantile of the normal distribution"),
    ("diagnose/agreement.rs STEP", "step of a difference quotient"),
    ("diagnose/computed_postures.rs NAMED", "how many are named"),
    ("diagnose/tool_in_poses.rs NAMED", "how many are named"),
    ("diagnose/agreement.rs CANDIDATES", "how many are tried"),
    ("diagnose/moved.rs TURNS", "which of two causes is told of what fails either way"),
    ("diagnose/exchanged_readings.rs MOST_STOPS", "how many are named"),
    ("diagnose/displaced.rs MOST_IMAGES", "how many are named"),
    ("diagnose/joint_noise.rs MOST_IMAGES", "how many are named"),
    ("diagnose/left_out_bodies.rs MOST_NAMED", "words"),
    ("diagnose/left_out_images.rs MOST_IMAGES", "how many are named"),
    ("diagnose/contradicted_distances.rs MOST_NAMED", "how many are named"),
    ("diagnose/length_standard.rs FOUND", "convergence"),
    ("diagnose/length_standard.rs ROUNDS", "most iterations"),
    ("diagnose/loose.rs MOST_IMAGES", "how many are named"),
    ("diagnose/plate_size.rs ASPECT", "index of a mode"),
    ("diagnose/plate_size.rs MOST_STOPS", "samples of a fit"),
    ("diagnose/step_rows.rs LEFT", "rounding"),
    ("diagnose/step_candidates.rs MOST_TRIED", "how many are tried at first"),
    ("frames/absorbed.rs HELD", "rounding"),
    ("frames/absorbed.rs MOST", "samples of an average"),
    ("frames/fit.rs ROUNDS", "most iterations"),
    ("frames/fit.rs SIZE", "convergence"),
    ("frames/fit.rs STATED", "prior of a variance component"),
    ("frames/fit.rs STEP", "convergence"),
    ("frames/fit.rs UNCONTROLLED", "rounding"),
    ("frames/plan.rs BEFORE", "prior that says nothing"),
    ("frames/plan.rs EXCHANGES", "most iterations"),
    ("frames/plan.rs GAIN", "convergence"),
    ("frames/plan.rs SEED", "start of random numbers"),
    ("frames/robot.rs ROUNDING", "rounding of an eigenvalue"),
    ("identify/compare.rs MANY_STOPS", "where some stops do"),
    ("identify/compare.rs MOST_TOGETHER", "saves time"),
    ("identify/compare.rs SOME_STOPS", "samples of a ratio"),
    ("identify/evidence.rs MANY_STOPS", "where some stops do"),
    ("identify/evidence.rs SOME_STOPS", "samples of a fit"),
    ("identify/lens_choice.rs MANY_STOPS", "where some stops do"),
    ("identify/lens_choice.rs SOME_STOPS", "samples of a fit"),
    ("identify/bodies_measured.rs DEFAULT_SIGMA", "start of a variance component"),
    ("identify/body_breaks.rs MOST_MISSED", "robustness of a division"),
    ("identify/body_misfit.rs FEWEST_POSES", "unknowns of a start"),
    ("identify/parts.rs PARTS", "how many are tried"),
    ("identify/places_exchanged.rs MOST_PLACES", "how many are tried"),
    ("identify/points_start.rs DISAGREES", "robustness of a start"),
    ("identify/points_start.rs FEWEST_POINTS", "unknowns of a start"),
    ("identify/points_start.rs HOLD", "rounding"),
    ("identify/points_start.rs MANY_POINTS", "unknowns of a start"),
    ("identify/points_start.rs ONE_POSTURE", "rounding"),
    ("identify/points_start.rs ROUNDS", "iterations"),
    ("identify/points_start.rs STANDING_M", "iterations"),
    ("identify/points_start.rs TRIMMINGS", "iterations"),
    ("identify/rows_in_part.rs ROUNDS", "iterations"),
    ("identify/rows_in_part.rs TAKEN", "how many are tried"),
    ("identify/build.rs DEFAULT_SIGMA_PX", "first guess; its size is estimated"),
    ("identify/build.rs FIRST_JOINT_NOISE", "first guess"),
    ("identify/build.rs FIRST_DISPLACEMENT", "first guess"),
    ("identify/computed_postures.rs DESCENDED", "starts of a search"),
    ("identify/computed_postures.rs HELD", "rounding"),
    ("identify/computed_postures.rs JOINT_SIGMA", "noise of a comparison"),
    ("identify/computed_postures.rs STARTS", "starts of a search"),
    ("identify/computed_postures.rs TURNS", "most iterations"),
    ("identify/controller_tool.rs DIFFERENCE", "step of a difference quotient"),
    ("identify/controller_tool.rs GAINED", "end of a search"),
    ("identify/controller_tool.rs MOST_DAMPING", "end of a search"),
    ("identify/controller_tool.rs MOST_STOPS", "where some stops do"),
    ("identify/controller_tool.rs STARTS_M", "starts of a search"),
    ("identify/controller_tool.rs STEPS", "most iterations"),
    ("identify/controller_readings.rs MOST_POSTURES", "postures of an arm of six joints"),
    ("identify/controller_readings.rs POSE_COORDINATES", "coordinates of a pose"),
    ("identify/controller_readings.rs TRIED", "samples of a share"),
    ("identify/evidence.rs DECREMENT", "convergence"),
    ("identify/evidence.rs RETELLINGS", "most iterations"),
    ("identify/evidence.rs ROUNDS", "most iterations"),
    ("identify/free_poses.rs ENOUGH", "observations of the quick problem"),
    ("identify/free_poses.rs GOOD_START_PX", "saves starts; the best one counts"),
    ("identify/free_poses.rs ROUNDS", "most iterations"),
    ("identify/free_poses.rs START_DECREMENT", "convergence"),
    ("identify/joint.rs ROUNDS", "most iterations"),
    ("identify/lens_choice.rs DECREMENT", "convergence"),
    ("identify/lens_choice.rs FIELD_ROUNDS", "most iterations"),
    ("identify/lens_choice.rs KEPT_ASIDE", "how the hold-out is divided"),
    ("identify/lens_choice.rs OUTLIERS", "trimming of an estimator"),
    ("identify/lens_choice.rs ROUNDS", "most iterations"),
    ("identify/pose_comparison.rs FEWEST", "unknowns of a frame"),
    ("identify/pose_comparison.rs FIRST_M_PER_RAD", "first guess"),
    ("identify/pose_comparison.rs HELD", "rounding"),
    ("identify/pose_comparison.rs ROUNDS", "iterations"),
    ("identify/local_errors.rs BEYOND_CHANCE", "which columns are added to the fit"),
    ("identify/local_errors.rs MOST_TERMS", "size of a matrix"),
    ("identify/second_pass.rs FEWEST_IMAGES", "first guess of a detector"),
    ("identify/second_pass.rs REACH", "reach of a detector"),
    ("identify/stand_alone.rs MOST_TOGETHER", "how many are written"),
    ("identify/staged.rs VARIED", "step of a derivative"),
    ("identify/start.rs COMPARED", "how many starts are compared"),
    ("identify/suspects.rs ENOUGH", "samples of a median"),
    ("identify/touch_mistakes.rs FITTED", "starts of a search"),
    ("identify/touch_mistakes.rs NAMED", "how many are named"),
    ("identify/turns.rs MOST_MISFIT", "robust loss of a choice"),
    ("identify/turns.rs ROUNDS", "most iterations"),
    ("identify/two_stage.rs DECREMENT", "convergence"),
    ("identify/two_stage.rs FIRST_FACTOR", "first guess"),
    ("identify/two_stage.rs FIRST_ISOTROPIC", "first guess"),
    ("identify/two_stage.rs MOST_TOGETHER", "bounds the work; what it leaves out is none of the result"),
    ("identify/two_stage.rs PREDICTED", "convergence"),
    ("identify/two_stage.rs ROUNDS", "most iterations"),
    ("identify/two_stage.rs STANDING", "convergence"),
    ("identify/two_stage.rs STEPS", "most iterations"),
];

/// Comparisons with a bare number that decide no verdict: where, what follows the operator or stands before it, and why.
const COMPARED: [(&str, &str, &str); 2] = [
    ("assess/points.rs", "step.norm() < 1e-12", "convergence"),
    ("identify/two_stage.rs", "**r > 1e-9", "rounding of a redundancy"),
];

/// Numbers that a comparison may hold: signs, halves and majorities, probabilities of certainty.
const PLAIN: [f64; 4] = [0.0, 0.5, 1.0, 2.0];

const ROOMS: [&str; 4] = ["diagnose", "identify", "assess", "frames"];

/// Name in its room and text of every file of the rooms.
fn files() -> Vec<(String, String)> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let of_room = |room: &&str| {
        let mut paths: Vec<_> = fs::read_dir(src.join(room)).unwrap().map(|e| e.unwrap().path()).collect();
        paths.sort();
        paths
            .into_iter()
            .map(|p| {
                let name = format!("{room}/{}", p.file_name().unwrap().to_string_lossy());
                (name, fs::read_to_string(&p).unwrap())
            })
            .collect::<Vec<_>>()
    };
    ROOMS.iter().flat_map(of_room).collect()
}

/// `file NAME` of every constant whose type is a number or a tuple of numbers.
fn constants(file: &str, text: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for line in text.lines() {
        let Some((_, after)) = line.split_once("const ") else { continue };
        let Some((name, kind)) = after.split_once(": ") else { continue };
        let is_number = ["f64", "usize", "u8", "u32", "u64", "i32", "(f64", "[f64"].iter().any(|k| kind.starts_with(k));
        if is_number && name.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_') {
            found.insert(format!("{file} {name}"));
        }
    }
    found
}

/// The text of the product: without comments, the insides of strings, and tests.
fn code_of(text: &str) -> String {
    let product = text.split("#[cfg(test)]").next().unwrap();
    let lines = product.lines().map(|line| line.split_once("//").map_or(line, |(code, _)| code));
    let joined = lines.collect::<Vec<_>>().join(" ");
    let outside = joined.replace("\\\"", "").split('"').step_by(2).map(str::to_owned).collect::<Vec<_>>();
    outside.join("\"\"").replace("..=", "..").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// An operand of a comparison, read away from the operator: it ends at a bracket that it did not begin, and at what binds less.
fn operand(text: impl Iterator<Item = char>, [begin, end]: [&str; 2]) -> String {
    let (mut found, mut depth) = (String::new(), 0);
    for c in text {
        depth += i32::from(begin.contains(c)) - i32::from(end.contains(c));
        if depth < 0 || (depth == 0 && ";{},|&=<>?".contains(c)) {
            break;
        }
        found.push(c);
    }
    found
}

/// Every number with a point or an exponent in a piece of code.
fn floats(code: &str) -> Vec<f64> {
    let mut found = Vec::new();
    let mut rest = code;
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let (before, number) = rest.split_at(start);
        let is_name = before.ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == '.');
        let mut end = 0;
        for (at, c) in number.char_indices() {
            let next = number[at + 1..].chars().next().unwrap_or(' ');
            let belongs = match c {
                '0'..='9' | '_' => true,
                '.' => next.is_ascii_digit() && !number[..at].contains('.'),
                'e' => next.is_ascii_digit() || next == '-',
                '-' => number[..at].ends_with('e'),
                _ => false,
            };
            if !belongs {
                break;
            }
            end = at + 1;
        }
        let own = number[..end].replace('_', "");
        let is_float = own.contains(['.', 'e']) || number[end..].starts_with("f64");
        if !is_name && is_float {
            found.push(own.parse().unwrap());
        }
        rest = &number[end..];
    }
    found
}

/// Comparisons with a number that is not plain, and ranges of such numbers.
fn bare_comparisons(text: &str) -> Vec<String> {
    let code = code_of(text);
    let is_bare = |piece: &String| floats(piece).iter().any(|x| !PLAIN.contains(x));
    let before = |at: usize| operand(code[..at].chars().rev(), [")]", "(["]).chars().rev().collect::<String>();
    let mut found = Vec::new();
    for operator in [" < ", " > ", " <= ", " >= ", " == ", " != "] {
        for (at, _) in code.match_indices(operator) {
            let right = operand(code[at + operator.len()..].chars(), ["([", ")]"]);
            found.extend(Some(format!("{}{operator}{}", before(at).trim(), right.trim())).filter(is_bare));
        }
    }
    for (at, _) in code.match_indices(").contains(") {
        found.extend(Some(before(at)).filter(|r| r.contains("..")).filter(is_bare));
    }
    found
}

#[test]
fn constants_that_decide_stand_in_limits() {
    let known: BTreeSet<String> = NUMERICAL.iter().map(|(name, _)| (*name).to_owned()).collect();
    let found: BTreeSet<String> = files().iter().flat_map(|(file, text)| constants(file, text)).collect();
    assert!(found.len() > 30, "only {} constants were found", found.len());
    let new: Vec<&String> = found.difference(&known).collect();
    assert!(new.is_empty(), "does it decide a verdict? then into `Limits`; else into NUMERICAL here: {new:#?}");
    let gone: Vec<&String> = known.difference(&found).collect();
    assert!(gone.is_empty(), "remove from the list: {gone:#?}");
}

#[test]
fn numbers_in_comparisons_stand_in_limits() {
    let all = files();
    assert!(all.len() > 40, "only {} files were read", all.len());
    let found: Vec<(&str, String)> = (all.iter())
        .flat_map(|(file, text)| bare_comparisons(text).into_iter().map(move |c| (file.as_str(), c)))
        .collect();
    let allowed = |(file, what): &&(&str, String)| COMPARED.iter().any(|(f, c, _)| f == file && what.contains(c));
    let new: Vec<_> = found.iter().filter(|f| !allowed(f)).collect();
    assert!(new.is_empty(), "does it decide a verdict? then into `Limits`; else into COMPARED here: {new:#?}");
    let gone: Vec<_> =
        COMPARED.iter().filter(|(f, c, _)| !found.iter().any(|(file, w)| file == f && w.contains(c))).collect();
    assert!(gone.is_empty(), "remove from the list: {gone:#?}");
}

#[test]
fn a_bare_number_in_a_comparison_is_seen() {
    for (text, seen) in [
        ("if size < 0.1 * (a + b) { x }", Some("if size < 0.1 * (a + b)")),
        ("all.filter(|(s, _)| *s >= 1e-3)", Some("*s >= 1e-3")),
        ("let far = distance(a, b) > limit && turn > 3_000.5;", Some("turn > 3_000.5")),
        ("if 25f64 < x.powi(2) {", Some("if 25f64 < x.powi(2)")),
        ("match () { _ if (0.2..=0.8).contains(&share) => 1 }", Some("0.2..0.8")),
        ("x\n    > 0.3", Some("x > 0.3")),
        ("if size < limits.size * 0.5 && x > 0.0 && -1.0 <= y && 2.0 * a > b {", None),
        ("let x: Vec<f64> = a.max(1e-12); f(a > b, 0.3)", None),
        ("(a < b).then(|| 0.3)", None),
        ("let low = 0.3; // x < 0.3\n\"x < 0.3\"", None),
        ("p.0 < q.10 && count > 12 && x1 == y2", None),
        ("x\n#[cfg(test)]\nmod tests { fn f() { assert!(a < 1e-9) } }", None),
    ] {
        let found = bare_comparisons(text);
        assert_eq!(found, seen.map(str::to_owned).into_iter().collect::<Vec<_>>(), "{text}");
    }
}
