//! The report: complete, self-contained, and safe against whatever stands in names.

use std::process::Command;
use std::sync::OnceLock;

use crate::outputs_support::{context, robot, solved};
use robotcal::assess::{Bearer, Pattern, PatternTest};
use robotcal::diagnose::{
    DoubtedSize, ExchangedReadings, Finding, GivenCamera, InOrder, LensNotInRos, MarkerOff, OddImage, ResidualPattern,
    SmallGain, ToldBy, Weight,
};
use robotcal::error::{Code, Notice};
use robotcal::identify::{Estimator, RobotModel, beside_two_stages};
use robotcal::output::verdict::{Trust, Verdict, VerdictReason};
use robotcal::output::{Thumbnails, files, report_html, solution_json};
use robotcal::series::{CameraMount, InputFile};
use serde_json::json;

fn record() -> solution_json::SolutionRecord {
    static WRITTEN: OnceLock<Vec<u8>> = OnceLock::new();
    let written = WRITTEN.get_or_init(|| {
        let description = robot();
        let mut solution = solved(CameraMount::Hand, RobotModel::Full);
        solution.two_stage = beside_two_stages(&solution);
        let mut files = files(&solution, &context(&description)).unwrap();
        let written = files.remove("solution.json").unwrap();
        // The page is made from the record alone: what it says is in solution.json.
        let record = solution_json::read(&written).unwrap();
        assert_eq!(report_html(&record, &Thumbnails::default()).as_bytes(), files["report.html"]);
        written
    });
    solution_json::read(written).unwrap()
}

/// The outermost `<svg>` elements of a page.
fn drawings(page: &str) -> Vec<&str> {
    let (mut found, mut depth, mut start, mut at) = (Vec::new(), 0, 0, 0);
    while let Some(next) = page[at..].find("svg") {
        let here = at + next;
        at = here + 3;
        if page[..here].ends_with('<') {
            depth += 1;
            if depth == 1 {
                start = here - 1;
            }
        } else if page[..here].ends_with("</") {
            depth -= 1;
            if depth == 0 {
                found.push(&page[start..here + 4]);
            }
        }
    }
    found
}

#[test]
fn the_page_is_complete_and_self_contained() {
    let record = record();
    let page = report_html(&record, &Thumbnails::default());
    for text in [
        "Accuracy before and after",
        "What was read, and what was left out",
        "How well the flange is known where",
        "Two-step calibration",
        "Joint noise",
        "Residuals",
        "What was corrected on the robot",
        "What the data could not determine",
        "Plate",
        "Starting values",
        "For the record",
    ] {
        assert!(page.contains(&format!(">{text}</h2>")), "no section \"{text}\"");
    }
    for image in &record.images {
        assert!(page.contains(&image.name), "{} is missing", image.name);
    }
    assert!(page.contains(&record.inputs[0].sha256));
    for foreign in ["<link", "<img", "src=", "@import", "url("] {
        assert!(!page.contains(foreign), "the page contains {foreign}");
    }
    let links: Vec<&str> = page.split("href=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    for link in &links {
        let id = link.strip_prefix('#').unwrap_or_else(|| panic!("{link} leads out of the page"));
        assert!(page.contains(&format!("id=\"{id}\"")), "{link} leads nowhere");
    }
    assert!(links.len() > 15);
    assert_eq!(page.matches("<script").count(), 1, "the page has one script of its own");
    for broken in ["NaN", ">inf", "-inf", "Infinity"] {
        assert!(!page.contains(broken), "the page says {broken}");
    }
    // Histogram, workspace from above and from the side, two stages against one, joint noise, residuals over image and plate, distortion and uncertainty of the
    // camera, plate corrections; residuals by image, pose residuals in the axes of camera and plate, joints and image that were covered, the scene.
    let drawings = drawings(&page);
    assert_eq!(drawings.len(), 16);
    for drawing in drawings {
        let document = roxmltree::Document::parse(drawing).unwrap();
        assert!(document.descendants().filter(|n| n.is_element()).count() > 5);
    }
}

#[test]
fn what_may_be_promised_stands_first() {
    let record = record();
    let e = record.flange.unwrap();
    let page = report_html(&record, &Thumbnails::default());
    let at = |mm: f64| {
        let decimals = (2.0 - mm.log10().floor()) as usize;
        let shown = format!("{mm:.decimals$} mm");
        page.find(&shown).unwrap_or_else(|| panic!("{shown} is not in the page"))
    };
    let held_out = page.find("had not seen").unwrap();
    assert!(at(1e3 * e.best_urdf_m().0) < held_out && at(1e3 * e.model_m) < held_out);
    let [weak, all] = [record.undetermined().len(), record.robot_parameters().count()];
    assert!(all == record.identifiability.as_ref().unwrap().parameters, "{all}");
    assert!(weak > 0 && page.contains(&format!("{weak} of {all} ")));
}

#[test]
fn the_fits_in_two_stages_stand_beside_the_joint_one() {
    let record = record();
    let comparison = record.two_stage.as_ref().unwrap();
    let estimators: Vec<Estimator> = comparison.rows.iter().map(|r| r.estimator).collect();
    let two_stage =
        [Estimator::Isotropic, Estimator::Blocks, Estimator::BlocksAndRepeatability, Estimator::FullAndRepeatability];
    assert_eq!(estimators, [&two_stage[..], &[Estimator::Joint]].concat());
    let held = |k: usize| comparison.rows[k].by_image.unwrap();
    // The joint fit of the folds is the one that the accuracy is judged by.
    assert!((held(4).rms_mm / record.accuracy.calibrated.rms_mm - 1.0).abs() < 1e-9);
    // Full covariance with joint noise is one linearisation away from the joint fit; the worst weights cannot be better than it beyond doubt.
    assert!((held(3).rms_mm / held(4).rms_mm - 1.0).abs() < 0.05, "{} against {}", held(3).rms_mm, held(4).rms_mm);
    for k in 0..4 {
        let ratio = held(k).to_joint.unwrap();
        assert!(ratio.low <= ratio.value && ratio.value <= ratio.high && ratio.high > 0.95, "{ratio:?}");
        assert!((ratio.value - held(k).rms_mm / held(4).rms_mm).abs() < 1e-9);
    }
}

#[test]
fn the_verdict_follows_the_gates_and_then_the_doubts() {
    let mut record = record();
    assert!(report_html(&record, &Thumbnails::default()).contains("class=\"verdict good\""));
    let good = record.clone();
    // A camera goes on recording between the stops; a stop without an image is worth a look.
    record.notices.push(Notice::new(Code::ImagesInMotion, "run1", "", ""));
    assert_eq!(Verdict::of(&record).trust, Trust::Good);
    record.notices.push(Notice::new(Code::StandstillWithoutImage, "run1", "", ""));
    assert_eq!(Verdict::of(&record).trust, Trust::Doubts);
    record = good.clone();
    let odd = OddImage { image: good.images[0].name.clone(), error_mm: 1.25, rms_mm: 0.125, expected_mm: Some(0.25) };
    let gain = SmallGain { calibrated_mm: 0.25, nominal_mm: 0.3125 };
    for doubt in [Finding::from(odd), Finding::from(gain)] {
        record.notices = vec![doubt.notice()];
        let page = report_html(&record, &Thumbnails::default());
        assert!(page.contains("class=\"verdict care\""));
        // The first page and the chapter on findings both say why.
        assert!(page.matches(&doubt.notice().what).count() >= 2, "{doubt}");
    }
    let gate = "joint noise: 12.0 mrad";
    record.failed_gates.push(gate.into());
    let page = report_html(&record, &Thumbnails::default());
    assert!(page.contains("class=\"verdict failed\"") && page.contains(gate));
}

#[test]
fn of_several_plates_that_of_a_marker_is_named() {
    let place = |plate: Option<String>| Finding::from(MarkerOff { marker: 3, plate, distance_m: 1e-3 }).notice().place;
    assert_eq!([place(None), place(Some("plate 2".into()))], ["marker 3", "marker 3 of plate 2"]);
}

/// A plate of another size than its file says, which fails the result.
fn contradicted_size() -> DoubtedSize {
    DoubtedSize::Contradicted {
        plate: "plate".into(),
        measured: false,
        off: 0.02,
        sigma: 0.001,
        weight: Weight::Gate,
        told_by: ToldBy::Links,
        shown_in: Vec::new(),
        in_order: InOrder::default(),
    }
}

#[test]
fn what_was_seen_and_what_to_do_stay_apart() {
    let found = Finding::from(contradicted_size());
    assert!(found.fails() && found.remedy().contains("; "), "a remedy of two parts: {found}");
    let mut record = record();
    record.failed_gates = vec![found.to_string()];
    record.findings = vec![(&found).into()];
    let reason = |record: &solution_json::SolutionRecord| {
        let read = solution_json::read(&serde_json::to_vec(record).unwrap()).unwrap();
        let [one] = Verdict::of(&read).reasons.try_into().unwrap();
        one
    };
    let said = |what: &str, remedy: &str| VerdictReason {
        what: what.to_owned(),
        remedy: remedy.to_owned(),
        is_always_shown: false,
    };
    assert_eq!(reason(&record), said(&found.seen(), &found.remedy()));
    // Files of earlier versions have the sentence alone, or no findings at all.
    let alone = found.to_string();
    let mut earlier = serde_json::to_value(&record).unwrap();
    for field in ["seen", "remedy"] {
        earlier["findings"][0].as_object_mut().unwrap().remove(field).unwrap();
    }
    let earlier: solution_json::SolutionRecord = serde_json::from_value(earlier).unwrap();
    assert_eq!(reason(&earlier), said(&alone, ""));
    record.findings.clear();
    assert_eq!(reason(&record), said(&alone, ""));
}

#[test]
fn what_camera_yaml_is_off_by_stands_in_the_summary_among_any_number_of_doubts() {
    let mut record = record();
    record.failed_gates.clear();
    let lens = Finding::from(LensNotInRos {
        camera: "camera_of_the_left_hand_with_a_long_name".into(),
        lens: "brown+field",
        loss_px: Some([0.256, 1.29]),
        given: GivenCamera::Not,
    });
    let doubt = |k: usize| Notice {
        code: Code::ImagesLeftOut,
        place: format!("place {k}"),
        what: "what was seen there ".repeat(k + 1),
        remedy: "what to do about it, in so many words that no line holds them".into(),
    };
    for others in 0..7 {
        record.notices = (0..others).map(doubt).chain([lens.notice()]).collect();
        let said = robotcal::cli::summary_of(&record);
        let summary: Vec<&str> = said.lines().take_while(|line| !line.starts_with("report")).collect();
        assert!(summary.len() < 12 && summary.iter().all(|line| line.chars().count() <= 80), "{summary:#?}");
        let lines: Vec<_> = summary.iter().filter(|l| l.contains("0.256 px") && l.contains("1.290 px")).collect();
        assert_eq!(lines.len(), 1, "{others} others: {summary:#?}");
    }
}

/// A pattern may be found that is smaller than what is found nearly always.
#[test]
fn a_pattern_that_was_found_is_said_beside_how_often_larger_ones_are() {
    let found = PatternTest {
        pattern: Pattern::Radial,
        bearer: Bearer::Camera(0),
        statistic: 60.0,
        degrees: 4,
        deviate: 6.0,
        share: 0.02,
        rms_px: 0.0025,
        least_px: 0.0029,
        gain: 20.0,
        moved: None,
    };
    let finding = Finding::from(ResidualPattern {
        found,
        bearer: "hand".into(),
        matters: false,
        is_fitted: false,
        has_field: false,
        tried: vec![],
        given: GivenCamera::Not,
    });
    let said = finding.seen();
    let from = finding.quantities().into_iter().find(|q| q.name == "found_from").unwrap();
    assert_eq!((from.value, from.unit.as_str()), (0.0029, "px"));
    assert!(["0.0025 px", "0.0029 px 19 in 20"].iter().all(|name| said.contains(name)), "{said}");
}

#[test]
fn rows_that_were_exchanged_are_put_right_before_a_failed_result_is_tried_again() {
    let pair = vec!["img_003.png".to_owned(), "img_008.png".to_owned()];
    let exchanged = Finding::from(ExchangedReadings {
        circle: pair.clone(),
        images: pair,
        misfit: 1e-4,
        others_fit: false,
        table: "joints.csv",
    });
    let (gate, mut record) = (Finding::from(contradicted_size()), record());
    record.findings = vec![(&gate).into(), (&exchanged).into()];
    assert_eq!(Verdict::of(&record).remedies, Vec::<String>::new());
    record.failed_gates = vec![gate.to_string()];
    let verdict = Verdict::of(&record);
    let [of_gate, of_rows] = verdict.remedies.try_into().unwrap();
    assert_eq!((verdict.reasons.len(), of_gate), (1, gate.remedy()));
    assert!(of_rows.contains(&exchanged.seen()) && of_rows.contains(&exchanged.remedy()), "{of_rows}");
    assert!(report_html(&record, &Thumbnails::default()).contains(&of_rows));
}

#[test]
fn names_and_reasons_cannot_break_the_page() {
    let mut record = record();
    let hostile = "</td><script>alert(1)</script> & \"x\"";
    record.images[0].name = hostile.into();
    record.images[0].reason = Some(hostile.into());
    record.images[1].series = hostile.into();
    record.robot.name = hostile.into();
    record.robot.readings[0] = hostile.into();
    record.cameras[0].name = hostile.into();
    record.plates[0].name = hostile.into();
    record.program.command = hostile.into();
    let page = report_html(&record, &Thumbnails::default());
    assert!(!page.contains("<script>alert"), "a name reached the page as markup");
    for drawing in drawings(&page) {
        roxmltree::Document::parse(drawing).unwrap();
    }
}

#[test]
fn pictures_are_shown_of_images_whose_files_are_those_that_were_looked_at() {
    let mut record = record();
    let folder = tempfile::tempdir().unwrap();
    let image = |grey: u8| image::GrayImage::from_fn(640, 480, |x, _| image::Luma([grey.wrapping_add(x as u8)]));
    for k in 0..record.images.len() {
        let path = folder.path().join(&record.images[k].name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        image(k as u8).save_with_format(&path, image::ImageFormat::Png).unwrap();
        record.inputs.push(InputFile::of_file(&path).unwrap());
    }
    record.images[0].reason = Some("in motion".into());
    record.images[0].rms_px = None;
    let pictures = Thumbnails::of_files(record.photogrammetry());
    let page = report_html(&record, &pictures);
    // Two with the smallest residuals, three with the largest, one left out.
    assert_eq!(page.matches("data:image/jpeg;base64,").count(), 6);
    assert!(page.len() < 2_000_000);
    record.inputs.iter_mut().for_each(|f| f.sha256 = "0".into());
    assert_eq!(
        Thumbnails::of_files(record.photogrammetry()),
        Thumbnails::default(),
        "another image is not shown for it"
    );
}

#[test]
fn noise_is_per_series_and_per_camera_in_older_files() {
    let mut record = record();
    let own = record.series[0].noise.clone().unwrap();
    assert_eq!(record.stop_noise(), [(record.series[0].name.as_str(), own.clone())]);
    // One series: both are the same.
    record.series[0].noise = None;
    let bytes = solution_json::to_bytes(&record).unwrap();
    assert!(!String::from_utf8_lossy(&bytes).contains("joint_interval"));
    let older = solution_json::read(&bytes).unwrap();
    assert_eq!(older.stop_noise(), [(older.cameras[0].name.as_str(), own)]);
    assert_eq!(older.estimator, Estimator::Joint);
}

#[test]
fn a_result_without_robot_terms_plots_or_covariances_still_has_a_page() {
    let mut record = record();
    record.robot.terms.clear();
    record.estimates.clear();
    record.covariance_lower.clear();
    let noises = record.series.iter_mut().filter_map(|s| s.noise.as_mut());
    noises.for_each(|n| n.joint.iter_mut().for_each(|s| *s = 0.0));
    for image in &mut record.images {
        image.held_out_mm = None;
        image.observations = solution_json::ObservationColumns::default();
    }
    let page = report_html(&record, &Thumbnails::default());
    // words: the page is for people, and no number stands where nothing was estimated.
    assert!(page.contains("The readings were taken as exact."));
    assert!(!page.contains("NaN"));
}

/// Two megabytes: what a mail takes.
const LARGEST: usize = 2_000_000;

#[test]
fn a_series_of_many_stops_without_images_has_a_small_page_without_chapters_of_images() {
    let mut record = record();
    let readings = |k: usize| (0..6).map(|j| ((k * (j + 3)) as f64 * 0.37).sin()).collect::<Vec<f64>>();
    let stop = |k: usize| json!({ "series": "run", "name": format!("stop {k}"), "readings": readings(k) });
    record.bodies.stops = serde_json::from_value((0..12_000).map(stop).collect()).unwrap();
    record.images.clear();
    record.plates.clear();
    record.cameras.clear();
    record.mountings.clear();
    record.placements.clear();
    let page = report_html(&record, &Thumbnails::default());
    assert!(page.len() < LARGEST, "{}", page.len());
    let has = |id: &str| page.contains(&format!("<section id=\"{id}\""));
    for of_images in ["images", "residuals", "plate", "poses", "scene", "pictures"] {
        assert!(!has(of_images), "{of_images}");
    }
    assert!(["coverage", "known", "corrections", "record"].into_iter().all(has));
    // Of few stops each has a dot of its own, also where two have the same reading.
    record.bodies.stops.truncate(30);
    record.bodies.stops.iter_mut().for_each(|s| s.readings = Some(vec![0.1; 6]));
    let page = report_html(&record, &Thumbnails::default());
    assert_eq!(page.matches("class=\"stop\"").count(), 30 * 6);
}

#[test]
fn of_very_many_images_some_are_drawn_and_the_worst_are_listed() {
    let mut record = record();
    let (first, of_files) = (record.images.clone(), record.inputs.clone());
    record.images = (0..10_000)
        .map(|k| {
            let image = &first[k % first.len()];
            let rms_px = image.rms_px.map(|px| if k % 1000 == 7 { px + 1.0 } else { px });
            let reason = (k % 500 == 3).then(|| "in motion".to_owned());
            solution_json::ImageRecord { name: format!("images/{k:05}.png"), rms_px, reason, ..image.clone() }
        })
        .collect();
    record.inputs.extend(
        (0..10_000).map(|k| InputFile { path: format!("run/images/{k:05}.png").into(), ..of_files[0].clone() }),
    );
    let page = report_html(&record, &Thumbnails::default());
    assert!(page.len() < LARGEST, "{}", page.len());
    let listed = |k: usize| page.contains(&format!("<td class=\"name\">images/{k:05}.png</td>"));
    assert!((0..10_000).filter(|k| k % 1000 == 7 || k % 500 == 3).all(listed));
    assert!((200..=400).contains(&page.matches("class=\"camera").count()));
    assert!(of_files.iter().all(|f| page.contains(&*f.path.to_string_lossy())));
    assert!(!page.contains("run/images/00000.png"));
}

#[test]
fn local_errors_are_summed_up_and_make_no_columns() {
    let mut record = record();
    let heads = |page: &str| page.matches("<th class=\"n\">").count();
    let before = heads(&report_html(&record, &Thumbnails::default()));
    let joint = record.robot.readings[0].clone();
    let known = record.estimates.len();
    record.covariance_lower.resize((known + 3) * (known + 4) / 2, 0.0);
    for (at, value) in [("0.3298", 3e-4), ("-0.2237", -4e-4), ("1.5000", 0.0)] {
        let like = record.estimates.iter().find(|e| e.name.ends_with(".offset")).unwrap().clone();
        let name = format!("robot/{joint}.local_{at}");
        record.estimates.push(solution_json::EstimateRecord { name, value: Some(value), sigma: Some(1e-5), ..like });
        let term = format!("local_{at}");
        record.robot.local_errors.push(solution_json::TermRecord {
            reading: joint.clone(),
            term,
            value,
            unit: "rad".into(),
        });
    }
    let page = report_html(&record, &Thumbnails::default());
    assert_eq!(heads(&page), before + 3, "one small table: readings, RMS, largest");
    assert!(!page.contains("local_"));
    assert!(page.contains(">0.400<"), "largest, mrad");
    let text = serde_json::to_vec(&record).unwrap();
    assert_eq!(solution_json::read(&text).unwrap().robot, record.robot);
}

/// What agrees is said with the limit that was used, not with the usual one.
#[test]
fn the_scatter_is_judged_by_the_limit_that_was_used() {
    let mut record = record();
    record.scatter = Some(solution_json::ScatterRecord { flange_ratio: Some(2.0), larger_stated: false });
    let agrees = |limit: f64| {
        let mut record = record.clone();
        record.options.as_mut().unwrap().limits.scatter_ratio = limit;
        report_html(&record, &Thumbnails::default()).contains(&format!(" {limit}; "))
    };
    assert!(agrees(2.875) && !agrees(1.875));
}

#[test]
fn the_page_names_the_files_that_are_there() {
    let mut record = record();
    assert!(record.files.iter().any(|f| f == "plate.csv"));
    record.files.retain(|f| f != "plate.csv");
    record.files.extend(["plate.run1.csv".into(), "plate.run2.csv".into()]);
    let page = report_html(&record, &Thumbnails::default());
    assert!(!page.contains("plate.csv") && page.contains("plate.run1.csv") && page.contains("plate.run2.csv"));
}

/// Where the readings are poses of a controller, there is no arm, no joint and no correction to show.
#[test]
fn poses_of_a_controller_alone_show_no_robot() {
    let mut record = record();
    let chapter = |page: &str, id: &str| page.contains(&format!("<section id=\"{id}\""));
    let page = report_html(&record, &Thumbnails::default());
    assert!(chapter(&page, "corrections") && page.contains("class=\"arm\"") && page.contains("data-arms"));
    record.files.retain(|f| !f.ends_with(".urdf"));
    let page = report_html(&record, &Thumbnails::default());
    assert!(!chapter(&page, "corrections") && chapter(&page, "scene") && chapter(&page, "coverage"));
    for of_a_robot in ["class=\"arm\"", "data-arms"] {
        assert!(!page.contains(of_a_robot), "{of_a_robot}");
    }
    let folder = tempfile::tempdir().unwrap();
    let said = |record: &solution_json::SolutionRecord| {
        let file = folder.path().join("solution.json");
        std::fs::write(&file, solution_json::to_bytes(record).unwrap()).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_robotcal")).arg("show").arg(file).output().unwrap();
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let accuracy = |record: &solution_json::SolutionRecord| {
        let text = said(record);
        let rows = text.lines().skip_while(|l| !l.starts_with("accuracy")).take(3);
        rows.collect::<Vec<_>>().join("\n")
    };
    for failed in [vec![], vec!["a check".to_owned()]] {
        record.failed_gates = failed;
        let alone = accuracy(&record);
        record.files.push("robot.calibrated.urdf".to_owned());
        assert_ne!(accuracy(&record), alone);
        record.files.pop();
    }
}

/// Images that are planned beside those of a result are for the robot model that it chose.
#[test]
fn the_robot_model_of_a_result_is_read_from_its_terms() {
    let full = record();
    let chain = robotcal::output::restore::exported_model(&full).unwrap().robot.chain;
    assert_eq!(robotcal::output::plan_start::model_of(&full, &chain), RobotModel::Full);
    for (model, left) in
        [(RobotModel::Gear, ["gear", "cos_", "sin_", "offset"].as_slice()), (RobotModel::Rigid, &["offset"])]
    {
        let mut record = full.clone();
        record.robot.terms.retain(|t| left.iter().any(|name| t.term.starts_with(name)));
        assert_eq!(robotcal::output::plan_start::model_of(&record, &chain), model);
    }
}
