//! Numbers that decide verdicts stand in `Limits`, where they are documented, overridable and recorded.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::imports::files_below;

/// Where the limits are those that nobody changed, and why: everywhere else they are those of the options, or of the solution at hand.
const UNCHANGED: [(&str, &str); 9] = [
    ("cli/corrected_robot/compensate_frames.rs", "frames of a solution that is not at hand"),
    ("cli/images/detect.rs", "has no options"),
    ("cli/series/doctor.rs", "has no options"),
    ("cli/images/poses.rs", "has no options, and writes them into poses.json"),
    ("cli/corrected_robot/verify_model.rs", "no solution stands beside the description"),
    ("identify/options.rs", "default of the options"),
    ("plan/setting.rs", "a plan leaves nothing out"),
    ("simulate/placement.rs", "simulated, without options"),
    ("study/crossover.rs", "simulated, without options"),
];

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
    ("assess/hold_out.rs NOMINAL_NOISE_STOPS", "samples of an average"),
    ("assess/hold_out.rs NOMINAL_ROUNDS", "rounds of an estimate"),
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
    ("assess/patterns.rs HIGHEST", "degree of a polynomial"),
    ("assess/patterns.rs LEAST_SHARE", "rounding of an eigenvalue"),
    ("assess/patterns.rs PLATE_UNIT_M", "unit of a column"),
    ("assess/patterns.rs POWER_95", "quantile of the normal distribution"),
    ("assess/points.rs DETERMINED", "rounding of an eigenvalue"),
    ("assess/points.rs HELD", "what the points do not tell is held by so little that it decides nothing"),
    ("assess/points.rs FITTED", "unknowns of frame and reflector"),
    ("assess/points_apart.rs DRAWN_ALONG", "which are left out first"),
    ("assess/points_apart.rs MARKERS_DRAWN_ALONG", "which are let go first"),
    ("assess/points_apart.rs POINT", "coordinates of a point"),
    ("assess/points_size.rs STEP", "by which residuals are differentiated"),
    ("assess/points_size.rs STEPS", "rounds of a search"),
    ("assess/projection.rs ACROSS", "grid of a map"),
    ("assess/repeating.rs FEWEST", "samples of a variance"),
    ("assess/statistics.rs RESAMPLINGS", "samples of a bootstrap"),
    ("assess/stops.rs FRAMES", "size of a matrix"),
    ("assess/stops.rs IDEAL_STOPS", "samples of the ideal series"),
    ("assess/stops.rs JOINT_SIGMA", "noise of the ideal series"),
    ("assess/stops.rs POSE_SIGMA_M", "noise of the ideal series"),
    ("assess/stops.rs POSE_SIGMA_RAD", "noise of the ideal series"),
    ("assess/uncertainty.rs NORMAL_95", "quantile of the normal distribution"),
    ("diagnose/left_out/agreement.rs STEP", "step of a difference quotient"),
    ("diagnose/computed_postures.rs NAMED", "how many are named"),
    ("diagnose/tool_in_poses.rs NAMED", "how many are named"),
    ("diagnose/left_out/agreement.rs CANDIDATES", "how many are tried"),
    ("diagnose/left_out/exchanged_pictures.rs MOST_IMAGES", "how many are named"),
    ("diagnose/left_out/exchanged_readings.rs MOST_STOPS", "how many are named"),
    ("diagnose/left_out/exchanged_targets.rs MOST_STOPS", "how many are named"),
    ("diagnose/steps/place_misstated.rs MOST_STOPS", "how many are named"),
    ("diagnose/steps/displaced.rs MOST_IMAGES", "how many are named"),
    ("diagnose/held_parameters.rs MOST_NAMED", "how many are named"),
    ("diagnose/joint_noise.rs MOST_IMAGES", "how many are named"),
    ("diagnose/left_out/left_out_bodies.rs MOST_NAMED", "words"),
    ("diagnose/left_out/left_out_images.rs MOST_IMAGES", "how many are named"),
    ("diagnose/contradicted_distances.rs MOST_NAMED", "how many are named"),
    ("diagnose/length_standard.rs FOUND", "convergence"),
    ("diagnose/length_standard.rs ROUNDS", "most iterations"),
    ("diagnose/left_out/moved.rs MOST_NAMED", "how many are named"),
    ("diagnose/steps/loose_mounting.rs MOST_IMAGES", "how many are named"),
    ("diagnose/plate_size.rs MOST_STOPS", "samples of a fit"),
    ("diagnose/slopes.rs TOLD_APART", "rounding"),
    ("diagnose/steps/rows.rs LEFT", "rounding"),
    ("diagnose/steps/candidates.rs MOST_TRIED", "how many are tried at first"),
    ("diagnose/steps/orders.rs SAME_PLACE_M", "which places are one, or in a line"),
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
    ("frames/touch.rs AT_MARKER_M", "what a file rounds"),
    ("identify/two_stage/compare.rs MANY_STOPS", "where some stops do"),
    ("identify/two_stage/compare.rs MOST_TOGETHER", "saves time"),
    ("identify/two_stage/compare.rs SOME_STOPS", "samples of a ratio"),
    ("identify/model_choice/evidence.rs MANY_STOPS", "where some stops do"),
    ("identify/model_choice/evidence.rs SOME_STOPS", "samples of a fit"),
    ("identify/model_choice/lens_choice.rs MANY_STOPS", "where some stops do"),
    ("identify/model_choice/lens_choice.rs SOME_STOPS", "samples of a fit"),
    ("identify/observations/bodies.rs DEFAULT_SIGMA", "start of a variance component"),
    ("identify/bodies/moved_between.rs MOST_MISSED", "robustness of a division"),
    ("identify/bodies/misfit.rs FEWEST_POSES", "unknowns of a start"),
    ("identify/mistakes/divided.rs PARTS", "how many are tried"),
    ("identify/bodies/places_exchanged.rs MOST_PLACES", "how many are tried"),
    ("identify/bodies/points_start.rs DISAGREES", "robustness of a start"),
    ("identify/bodies/points_start.rs FEWEST_POINTS", "unknowns of a start"),
    ("identify/bodies/points_start.rs HOLD", "rounding"),
    ("identify/bodies/points_start.rs MANY_POINTS", "unknowns of a start"),
    ("identify/bodies/points_start.rs ONE_POSTURE", "rounding"),
    ("identify/bodies/points_start.rs ROUNDS", "iterations"),
    ("identify/bodies/points_start.rs STANDING_M", "iterations"),
    ("identify/bodies/points_start.rs TRIMMINGS", "iterations"),
    ("identify/bodies/rows_in_part.rs ROUNDS", "iterations"),
    ("identify/bodies/rows_in_part.rs TAKEN", "how many are tried"),
    ("identify/problem/build.rs DEFAULT_SIGMA_PX", "first guess; its size is estimated"),
    ("identify/problem/build.rs FIRST_JOINT_NOISE", "first guess"),
    ("identify/problem/build.rs FIRST_DISPLACEMENT", "first guess"),
    ("identify/controller/choice.rs DESCENDED", "starts of a search"),
    ("identify/controller/choice.rs HELD", "rounding"),
    ("identify/controller/choice.rs OF_BEAM", "starts of a search"),
    ("identify/controller/choice.rs STARTS", "starts of a search"),
    ("identify/controller/choice.rs TURNS", "most iterations"),
    ("identify/controller/choice.rs WIDTH", "width of a search"),
    ("identify/controller/choice.rs WIDTH_FITTED", "width of a search"),
    ("identify/controller/compared.rs JOINT_SIGMA", "noise of a comparison"),
    ("identify/controller/readings.rs MOST_POSTURES", "postures of an arm of six joints"),
    ("identify/controller/readings.rs POSE_COORDINATES", "coordinates of a pose"),
    ("identify/controller/readings.rs TRIED", "samples of a share"),
    ("identify/controller/tool.rs DIFFERENCE", "step of a difference quotient"),
    ("identify/controller/tool.rs FAMILY_ROUNDS", "most iterations"),
    ("identify/controller/tool.rs GAINED", "end of a search"),
    ("identify/controller/tool.rs MOST_DAMPING", "end of a search"),
    ("identify/controller/tool.rs MOST_STOPS", "where some stops do"),
    ("identify/controller/tool.rs RECHOICES", "most iterations"),
    ("identify/controller/tool.rs RECHOSEN", "starts of a search"),
    ("identify/controller/tool.rs STARTS_M", "starts of a search"),
    ("identify/controller/tool.rs STEPS", "most iterations"),
    ("diagnose/mistake.rs HALF_TURN_DEG", "half a turn"),
    ("identify/model_choice/evidence.rs DECREMENT", "convergence"),
    ("identify/run.rs RETELLINGS", "most iterations"),
    ("identify/model_choice/evidence.rs ROUNDS", "most iterations"),
    ("identify/photogrammetry/first_camera.rs ENOUGH", "observations of the quick problem"),
    ("identify/photogrammetry/free_poses.rs ENOUGH_IMAGES", "images of the quick problem"),
    ("identify/photogrammetry/first_camera.rs GOOD_START_PX", "saves starts; the best one counts"),
    ("identify/photogrammetry/free_poses.rs ROUNDS", "most iterations"),
    ("identify/photogrammetry/first_camera.rs START_DECREMENT", "convergence"),
    ("identify/joint_fit/fit.rs ROUNDS", "most iterations"),
    ("identify/model_choice/lens_choice.rs DECREMENT", "convergence"),
    ("identify/model_choice/lens_choice.rs FIELD_ROUNDS", "most iterations"),
    ("identify/model_choice/lens_choice.rs KEPT_ASIDE", "how the hold-out is divided"),
    ("identify/model_choice/lens_choice.rs OUTLIERS", "trimming of an estimator"),
    ("identify/model_choice/lens_choice.rs ROUNDS", "most iterations"),
    ("identify/poses/pose_comparison.rs FEWEST", "unknowns of a frame"),
    ("identify/poses/pose_comparison.rs FIRST_M_PER_RAD", "first guess"),
    ("identify/poses/pose_comparison.rs HELD", "rounding"),
    ("identify/poses/pose_comparison.rs ROUNDS", "iterations"),
    ("identify/problem/local_errors.rs BEYOND_CHANCE", "which columns are added to the fit"),
    ("identify/problem/local_errors.rs MOST_TERMS", "size of a matrix"),
    ("identify/observations/second_pass.rs FEWEST_IMAGES", "first guess of a detector"),
    ("identify/observations/second_pass.rs REACH", "reach of a detector"),
    ("identify/poses/stand_alone.rs MOST_TOGETHER", "how many are written"),
    ("identify/two_stage/staged.rs VARIED", "step of a derivative"),
    ("identify/start/robot.rs COMPARED", "how many starts are compared"),
    ("identify/start/robot.rs SQUARES_OF_POSE", "quantile of chi-squared"),
    ("identify/mistakes/suspects.rs ENOUGH", "samples of a median"),
    ("identify/bodies/touch_mistakes.rs FITTED", "starts of a search"),
    ("identify/bodies/touch_mistakes.rs NAMED", "how many are named"),
    ("identify/bodies/touch_size.rs FIRST_STEP", "by which a sum of squares is differentiated"),
    ("identify/bodies/touch_size.rs ROUNDS", "iterations"),
    ("identify/start/turns.rs MOST_MISFIT", "robust loss of a choice"),
    ("identify/start/turns.rs ROUNDS", "most iterations"),
    ("identify/start/turns.rs TOLD", "turns are a quarter apart"),
    ("identify/start/turns.rs FEWEST_KNOWN", "a choice by fewer is none"),
    ("identify/two_stage/fit.rs DECREMENT", "convergence"),
    ("identify/two_stage/fit.rs FIRST_FACTOR", "first guess"),
    ("identify/two_stage/fit.rs FIRST_ISOTROPIC", "first guess"),
    ("identify/two_stage/fit.rs MOST_TOGETHER", "bounds the work; what it leaves out is none of the result"),
    ("identify/two_stage/fit.rs PREDICTED", "convergence"),
    ("identify/two_stage/fit.rs ROUNDS", "most iterations"),
    ("identify/two_stage/fit.rs STANDING", "convergence"),
    ("identify/two_stage/fit.rs STEPS", "most iterations"),
    ("cli/flags/choices.rs MOST_HARMONICS", "range of an option"),
    ("cli/results/compare.rs MONTE_CARLO_IMAGES", "size of a study"),
    ("cli/results/compare.rs MONTE_CARLO_NOISE", "noise of a study"),
    ("cli/corrected_robot/compensate_frames.rs SAME_ORIGIN", "rounding of a file"),
    ("cli/series/convert_camera.rs UNKNOWN_DEPTHS_M", "where a lens is compared"),
    ("cli/corrected_robot/frames.rs FARTHEST_TOOL_M", "range of an option"),
    ("cli/images/image_study.rs PICTURES", "size of a study"),
    ("cli/images/image_study.rs DRAWN", "how many are drawn"),
    ("cli/memory.rs ABORT", "number of a signal"),
    ("cli/memory.rs BUS", "number of a signal"),
    ("cli/memory.rs LARGEST_FROM_HEAP", "size of a block of memory"),
    ("cli/memory.rs MOST_FOR_A_CORE", "threads"),
    ("cli/memory.rs SEGMENT", "number of a signal"),
    ("cli/series/plan.rs TRIAL_CANDIDATES", "samples of a trial"),
    ("cli/series/plan_targets.rs LEAST_SHARE", "what counts as taken up by the frames"),
    ("cli/series/plan_targets.rs LEAST_TARGETS", "unknowns of the frames"),
    ("cli/series/plan_touches.rs TRIES", "samples of a search"),
    ("cli/images/plate_board.rs LARGER", "what is drawn"),
    ("cli/flags/recording.rs LONGEST_DELAY_S", "range of an option"),
    ("cli/corrected_robot/verify_verdict.rs FITTED", "unknowns of frame and reflector, three a point"),
    ("init/between.rs HELD", "rounding"),
    ("init/between.rs REFINED", "starts of a search"),
    ("init/between.rs ROUNDS", "iterations"),
    ("init/between.rs STANDING_RAD", "convergence"),
    ("init/between.rs STEPS", "most iterations"),
    ("init/between.rs TRIED", "starts of a search"),
    ("init/between.rs TRIED_IMAGES", "samples of a search"),
    ("init/focal.rs LADDER", "starts of a search"),
    ("init/hand_eye.rs CONSENSUS_SHARE", "robustness of a start"),
    ("init/hand_eye.rs ENOUGH", "samples of a median"),
    ("init/hand_eye.rs LEAST_TOLD", "rounding of an eigenvalue"),
    ("init/hand_eye.rs MANY", "below it all starts are tried"),
    ("init/hand_eye.rs SAMPLES", "starts of a search"),
    ("init/hand_eye.rs SAMPLES_FOR_MISFIT", "starts of a search"),
    ("init/hand_eye.rs SAMPLE_SIZE", "unknowns of a start"),
    ("init/hand_eye.rs SQUARINGS", "most iterations"),
    ("init/resection.rs AT_END", "convergence"),
    ("init/resection.rs NEAR_STEPS", "most iterations"),
    ("init/zeros.rs COMMON", "usual error of a plate"),
    ("init/zeros.rs DAMPING", "factor of an iteration"),
    ("init/zeros.rs FAR", "robustness of a start"),
    ("init/zeros.rs MISFIT", "loss function of a start"),
    ("init/zeros.rs MOST_STOPS", "samples of a start"),
    ("init/zeros.rs OFFSET", "prior of a start"),
    ("init/zeros.rs ORIGIN", "prior of a start"),
    ("init/zeros.rs PART", "starts of a search"),
    ("init/zeros.rs ROUNDS", "iterations"),
    ("init/zeros.rs SETTLED", "convergence"),
    ("init/zeros.rs STEPS", "most iterations"),
    ("output/camera_formats/distortion.rs ACROSS", "grid of a fit"),
    ("output/camera_formats/mod.rs SAME_PX", "rounding of a lens"),
    ("output/drawing/dot_font.rs ADVANCE", "size of a letter"),
    ("output/drawing/plate_drawing.rs EDGE", "margin of printers"),
    ("output/robot/compensation.rs GRAVITY", "constant of nature"),
    ("output/robot/compensation_read.rs ROUNDED", "rounding of a file"),
    ("output/robot/controller_files.rs POSTURES", "samples of a check"),
    ("output/robot/controller_files.rs SEED", "start of random numbers"),
    ("output/judgement/difference.rs FEWEST_PLACES", "unknowns of frames"),
    ("output/frames/frames_record.rs CHECKED", "samples of a check"),
    ("output/frames/frames_record.rs FORMAT", "number of a format"),
    ("output/frames/frames_record.rs SAME_ROBOT", "rounding of a file"),
    ("output/robot/kinematics_file.rs LOSS_M", "rounding of a file"),
    ("output/robot/kinematics_file.rs SAME_M", "rounding of a file"),
    ("output/robot/kinematics_file.rs SAME_RAD", "rounding of a file"),
    ("output/robot/mastering.rs STEPS", "digits of a number"),
    ("output/names.rs LONGEST", "length of a name"),
    ("output/npy.rs ALIGNED", "layout of a format"),
    ("output/drawing/overlay.rs CURVE_POINTS", "what is drawn"),
    ("output/drawing/overlay.rs MOST_PIXELS", "size of a picture"),
    ("output/drawing/overlay.rs NEIGHBOURS", "samples of a map"),
    ("output/drawing/overlay.rs READABLE_PITCH_PX", "what is drawn"),
    ("output/judgement/parameter_words.rs MOST_NAMED", "how many are named"),
    ("output/judgement/parameter_words.rs MOST_NEXT", "how many are named"),
    ("output/frames/frame_findings.rs NAMED", "how many are named"),
    ("output/frames/frame_files/written.rs LONGEST", "length of a name"),
    ("output/plan/plan_files.rs DEGREE_DIGITS", "digits of a number"),
    ("output/plan/plan_files.rs FORMAT", "number of a format"),
    ("output/plan/plan_programs/krl.rs EXTERNAL", "axes of a language"),
    ("output/plan/plan_programs/rapid.rs EXTERNAL", "axes of a language"),
    ("output/plan/plan_programs/route.rs ARM_AXES", "axes of an arm"),
    ("output/plan/plan_programs/route.rs EXPOSE_S", "times of a program"),
    ("output/plan/plan_programs/route.rs LEAST_TIME_S", "times of a program"),
    ("output/plan/plan_programs/route.rs LONGEST_NAME", "length of a name"),
    ("output/plan/plan_programs/route.rs MOST_SLIDES", "axes of a language"),
    ("output/plan/plan_programs/route.rs PULSE_S", "times of a program"),
    ("output/plan/plan_programs/route.rs SETTLE_S", "times of a program"),
    ("output/plan/plan_programs/route.rs SPEED", "speed of a program"),
    ("output/plan/plan_programs/urscript.rs AXES", "axes of an arm"),
    ("output/drawing/plate_drawing.rs HALF_LETTER", "what is drawn"),
    ("output/drawing/plate_drawing.rs LINE", "what is drawn"),
    ("output/drawing/plate_drawing.rs RULE", "what is drawn"),
    ("output/drawing/plate_drawing.rs TEXT", "what is drawn"),
    ("output/drawing/plate_pdf.rs ARCS", "what is drawn"),
    ("output/drawing/plate_pdf.rs CAP_HEIGHT", "what is drawn"),
    ("output/drawing/plate_pdf.rs POINTS_PER_METRE", "unit of a format"),
    ("output/drawing/plate_png.rs HEADER", "layout of a format"),
    ("output/drawing/plate_png.rs METRES_PER_INCH", "unit of a format"),
    ("output/drawing/plate_png.rs SAMPLES", "what is drawn"),
    ("output/vision/recording.rs LEFT_OUT", "a colour"),
    ("output/vision/recording.rs MAGNIFIED", "what is drawn"),
    ("output/vision/recording.rs RESIDUAL", "a colour"),
    ("output/vision/recording.rs USED", "a colour"),
    ("output/solution/check.rs MOST_ACROSS", "range of a format"),
    ("output/solution/check.rs POSE_COVARIANCE", "size of a matrix"),
    ("output/solution/check.rs ROUNDING", "rounding of a file"),
    ("output/solution/solution_json.rs FORMAT", "number of a format"),
    ("output/write/own.rs HEAD", "how much of a file is looked at"),
    ("output/robot/ur_frames.rs NEAR_M", "which frames of ur_description are meant"),
    ("output/robot/ur_frames.rs PARALLEL", "rounding of directions"),
    ("output/robot/ur_frames.rs TURNED_RAD", "which frames of ur_description are meant"),
    ("output/robot/ur_frames.rs TURNS_RAD", "frames of ur_description"),
    ("problem/body.rs HUBER", "loss function of the solver"),
    ("problem/equations.rs E", "layout of a matrix"),
    ("problem/equations.rs FORMULA", "layout of a matrix"),
    ("problem/equations.rs MODE", "layout of a matrix"),
    ("problem/equations.rs P", "layout of a matrix"),
    ("problem/equations.rs POSE", "layout of a matrix"),
    ("problem/equations.rs RESIDUAL", "layout of a matrix"),
    ("problem/family.rs GRAVITY_DRAWN", "prior of a variance component"),
    ("problem/family.rs HELD", "rounding"),
    ("problem/family.rs SMALLEST_FACTOR", "bound of a variance component"),
    ("problem/family.rs TWISTS_DRAWN", "prior of a variance component"),
    ("problem/given.rs FIXED_MARKER_SIGMA_M", "rounding of a prior"),
    ("problem/given.rs MOVED_MARKER_SIGMA_M", "a prior that says nothing"),
    ("problem/given.rs HUBER", "loss function of the solver"),
    ("problem/given.rs LEAST_SHARED_STOPS", "samples of a variance"),
    ("problem/plate_distance.rs UNKNOWN_SCALE", "prior that says nothing"),
    ("problem/postures.rs JOINTS_IN_COMMON", "chance of a coincidence"),
    ("problem/postures.rs SAME_READING", "which postures belong together"),
    ("problem/rounding.rs DEGREE", "a unit"),
    ("problem/rounding.rs EXACT", "rounding of a unit"),
    ("problem/select.rs MOST_PROPOSED", "how many are named"),
    ("problem/some_stops.rs FEWEST", "samples of a fit"),
    ("problem/stop.rs DISPLACEMENTS", "layout of a matrix"),
    ("problem/stop.rs DISPLACEMENT_SIZES", "layout of a matrix"),
    ("problem/stop.rs TILT", "layout of a matrix"),
    ("solve/noise/acceleration.rs ACCELERATED", "convergence"),
    ("solve/noise/acceleration.rs DEPTH", "convergence"),
    ("solve/noise/acceleration.rs LARGEST_STEP", "convergence"),
    ("solve/noise/acceleration.rs MISLED", "convergence"),
    ("solve/noise/acceleration.rs RIDGE", "rounding"),
    ("solve/elimination/alike.rs APART_M", "order of rows"),
    ("solve/elimination/alike.rs MOST", "size of a product"),
    ("solve/elimination/blocks.rs STOPS_A_PRODUCT", "size of a product"),
    ("solve/noise/body_components.rs STATED", "prior of a variance component"),
    ("solve/elimination/body_stops.rs ROUNDING", "rounding of a pivot"),
    ("solve/elimination/body_stops.rs TOGETHER", "size of a product"),
    ("solve/noise/components.rs CONVERGED", "convergence"),
    ("solve/noise/components.rs FEWEST_DETERMINED", "rounding of a variance component"),
    ("solve/noise/components.rs FEWEST_MARKER_COORDINATES", "samples of a variance"),
    ("solve/noise/components.rs LEAST_FIRST_GUESS", "first guess"),
    ("solve/noise/components.rs MANY_STOPS", "where some stops do"),
    ("solve/noise/components.rs ONE_IN", "samples of a fit"),
    ("solve/noise/components.rs POLISHING_STEPS", "most iterations"),
    ("solve/noise/components.rs ROUGH_DECREMENT", "convergence"),
    ("solve/noise/components.rs SOME_STOPS", "samples of a fit"),
    ("solve/noise/components.rs STAYS", "convergence"),
    ("solve/optimum/frame.rs CORRECTIONS", "iterations"),
    ("solve/optimum/frame.rs LEAST_PIVOT", "rounding of a pivot"),
    ("solve/optimum/frame.rs RIGID", "size of a matrix"),
    ("solve/noise/latent_data.rs FAR_OFF", "convergence"),
    ("solve/noise/latent_data.rs MOST_GROWTH", "convergence"),
    ("solve/noise/latent_data.rs MOST_ROUNDS", "most iterations"),
    ("solve/noise/latent_data.rs STANDS", "convergence"),
    ("solve/optimum/length_misfit.rs LEFT", "rounding of a variance"),
    ("solve/levenberg.rs COMING_DOWN", "convergence"),
    ("solve/levenberg.rs CONTRACTION", "convergence"),
    ("solve/levenberg.rs ENOUGH", "samples of an approach"),
    ("solve/levenberg.rs FIRST_LAMBDA", "damping"),
    ("solve/levenberg.rs LAMBDA_IF_REFUSED", "damping"),
    ("solve/levenberg.rs LAMBDA_IF_SINGULAR", "damping"),
    ("solve/levenberg.rs LARGEST_LAMBDA", "damping"),
    ("solve/levenberg.rs LONGEST_DETOUR", "most iterations"),
    ("solve/levenberg.rs NEAR", "convergence"),
    ("solve/levenberg.rs NEARLY_THERE", "convergence"),
    ("solve/levenberg.rs REFUSED_NEARER", "convergence"),
    ("solve/levenberg.rs ROUNDING", "rounding of a cost"),
    ("solve/levenberg.rs SMALLEST_LAMBDA", "damping"),
    ("solve/levenberg.rs SQUARE_A_STOP", "convergence"),
    ("solve/levenberg.rs WORTH_A_STEP", "convergence"),
    ("solve/linear.rs MOST_KEPT", "memory"),
    ("solve/noise/information.rs MOST_COUPLED", "size of a matrix"),
    ("solve/noise/uncertainty.rs MOST_SPREAD", "bound of a linearisation"),
    ("solve/side_by_side.rs MANY", "memory"),
    ("solve/snoop.rs ONE_IN", "a minority"),
    ("solve/noise/tally.rs JOINT_NOISE_FLOOR", "rounding of a variance component"),
    ("solve/noise/tally.rs NOT_TOLD_SIGMAS", "convergence"),
    ("solve/noise/tally.rs SHRINKAGE", "prior of a variance component"),
];

/// Constants that decide, and stand where nothing has limits: what each of them decides, or why it is none of the user's.
const ELSEWHERE: &[(&str, &str)] = &[
    ("output/robot/mastering.rs LEAST_SIGMAS", "which offsets are proposed for entry"),
    ("output/robot/mastering.rs USEFUL_SIGMA_M", "which offsets are proposed for entry"),
    ("output/robot/mastering.rs USEFUL_SIGMA_RAD", "which offsets are proposed for entry"),
    ("output/judgement/corrections.rs SAME_FRAMES", "of a program, which has no options"),
    ("output/judgement/corrections.rs SAME_MODEL", "of a program, which has no options"),
    ("output/judgement/difference.rs DISAGREE", "of two solutions, each with its own limits"),
    ("problem/rounding.rs AS_LARGE", "of the step of readings: problem cannot import Limits"),
    ("problem/rounding.rs FEWEST", "of the step of readings: problem cannot import Limits"),
    ("solve/noise/unidentified.rs IDENTIFIED", "a quantile"),
    ("solve/noise/unidentified.rs PLAIN", "saves time"),
];

/// Files whose constants are sizes of drawings, tables and lines of the terminal.
const SHOWN: [&str; 11] = [
    "output/report/",
    "cli/results/at.rs",
    "cli/corrected_robot/compensate.rs",
    "cli/series/doctor.rs",
    "cli/results/long_table.rs",
    "cli/terminal/paragraph.rs",
    "cli/images/poses.rs",
    "cli/results/summary.rs",
    "cli/corrected_robot/frames_text.rs MOST_ROWS",
    "cli/corrected_robot/frames.rs MOST_STOPS",
    "cli/series/plan.rs GAINS_SHOWN",
];

/// Comparisons with a bare number that decide no verdict: where, what follows the operator or stands before it, and why.
const COMPARED: &[(&str, &str, &str)] = &[
    ("assess/points.rs", "step.norm() < 1e-12", "convergence"),
    ("identify/two_stage/fit.rs", "**r > 1e-9", "rounding of a redundancy"),
    ("diagnose/joint_noise.rs", "1e-3 * accuracy.calibrated.rms_mm", "a unit"),
    ("cli/series/plan.rs", "args.tilt_deg >= 85.0", "range of an option"),
    ("cli/series/plan.rs", "args.camera_fov_deg >= 170.0", "range of an option"),
    ("cli/series/simulate.rs", "5.0..140.0", "range of an option"),
    ("cli/corrected_robot/verify_series.rs", "rms_m > 1e-3 * limits.flange_sigma_mm", "a unit"),
    ("init/focal.rs", "focal < 20.0 * width", "range of a start"),
    ("init/focal.rs", "focal > 0.2 * width", "range of a start"),
    ("init/hand_eye.rs", "flange.norm() < 3.0", "a rotation near half a turn has no logarithm"),
    ("init/hand_eye.rs", "camera.norm() < 3.0", "a rotation near half a turn has no logarithm"),
    ("init/hand_eye.rs", "scale.abs() < 1e-12", "rounding"),
    ("init/hand_eye.rs", "1.0 - trace < 1e-9", "convergence"),
    ("init/homography.rs", "axis.norm() < 1e-9", "rounding"),
    ("init/resection.rs", "lambda > 1e12", "damping"),
    ("init/zeros.rs", "damping < 1e8", "damping"),
    ("output/frames/frames_record.rs", "(norm - 1.0).abs() < 1e-6", "rounding of a file"),
    ("output/drawing/plate_drawing.rs", "half_width > 0.075", "what is drawn"),
    ("output/report/chapters/knowledge.rs", "1e3 * w.sigma_m > **b", "a unit"),
    ("output/report/chapters/parameters.rs", "value.abs() > 3.0 * sigma", "which corrections are named first"),
    ("output/report/wording/words.rs", "(v - value).abs() < 1e-6 * value.abs()", "rounding of words"),
    ("output/report/wording/words.rs", "s < 1e-3", "words"),
    ("solve/levenberg.rs", "decrement < 0.1 * b", "convergence"),
    ("solve/levenberg.rs", "decrement * decrement < 10.0 * ROUNDING * cost", "rounding of a cost"),
    ("solve/noise/tally.rs", "free > 1e-9", "rounding of a redundancy"),
];

/// Numbers that a comparison may hold: signs, halves and majorities, probabilities of certainty.
const PLAIN: [f64; 4] = [0.0, 0.5, 1.0, 2.0];

const ROOMS: [&str; 9] = ["diagnose", "identify", "assess", "frames", "solve", "problem", "init", "output", "cli"];

/// Name and text of every file of the rooms.
fn files() -> Vec<(String, String)> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut paths = Vec::new();
    ROOMS.iter().for_each(|room| files_below(&src.join(room), &mut paths));
    let named = |path: &PathBuf| {
        (path.strip_prefix(&src).unwrap().to_string_lossy().into_owned(), fs::read_to_string(path).unwrap())
    };
    paths.iter().map(named).collect()
}

/// `file NAME` of every constant whose type is a number or a tuple of numbers.
fn constants(file: &str, text: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for line in text.lines() {
        let Some((before, after)) = line.split_once("const ") else { continue };
        // Parameters of a type are no numbers of the program.
        if before.ends_with('<') {
            continue;
        }
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
    let known: BTreeSet<String> = NUMERICAL.iter().chain(ELSEWHERE).map(|(name, _)| (*name).to_owned()).collect();
    let is_shown = |name: &String| SHOWN.iter().any(|shown| name.starts_with(shown));
    let found: BTreeSet<String> = files().iter().flat_map(|(file, text)| constants(file, text)).collect();
    let found: BTreeSet<String> = found.into_iter().filter(|name| !is_shown(name)).collect();
    assert!(found.len() > 200, "only {} constants were found", found.len());
    let new: Vec<&String> = found.difference(&known).collect();
    assert!(new.is_empty(), "does it decide a verdict? then into `Limits`; else into NUMERICAL here: {new:#?}");
    let gone: Vec<&String> = known.difference(&found).collect();
    assert!(gone.is_empty(), "remove from the list: {gone:#?}");
}

#[test]
fn numbers_in_comparisons_stand_in_limits() {
    let all = files();
    assert!(all.len() > 200, "only {} files were read", all.len());
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
fn limits_are_those_of_the_options() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut paths = Vec::new();
    files_below(&src, &mut paths);
    let of_verdicts = |path: &Path| {
        let code = code_of(&fs::read_to_string(path).unwrap());
        let imports = code.split(';').any(|part| part.contains("assess::") && part.contains("Limits"));
        code.match_indices("Limits::default").any(|(at, _)| {
            let before = code[..at].chars().next_back();
            // Other limits have a longer name, or come from another crate.
            !before.is_some_and(char::is_alphanumeric) && (imports || code[..at].ends_with("assess::"))
        })
    };
    let name = |path: &Path| path.strip_prefix(&src).unwrap().to_string_lossy().into_owned();
    let found: BTreeSet<String> = paths.iter().filter(|path| of_verdicts(path)).map(|path| name(path)).collect();
    let known: BTreeSet<String> = UNCHANGED.iter().map(|(file, _)| (*file).to_owned()).collect();
    assert_eq!(found, known, "pass the limits of the options or of the solution; else name the file and why");
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
