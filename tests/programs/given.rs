//! What `compensate` says of files that are not what they should be: no targets, other line ends, other descriptions.

use std::path::Path;
use std::process::Command;

use crate::programs_support::{Cell, Run, findings};
use crate::robots::repo;
use robotcal::Code;
use robotcal::programs::LeftReason;

/// `compensate` with these descriptions, base and tool nominal.
fn compensate(cell: &Cell, file: &Path, nominal: &Path, urdf: &Path, flags: &[&str]) -> Run {
    let out = cell.folder.path().join("out");
    let mut command = Command::new(env!("CARGO_BIN_EXE_robotcal"));
    command.arg("compensate").arg(file).arg("--out").arg(&out).arg("--nominal").arg(nominal).arg("--urdf").arg(urdf);
    command.args(["--frames", "nominal", "--base", "base_link", "--tip", "tool0"]);
    Run { output: command.args(flags).output().unwrap(), out, programs: Vec::new() }
}

fn weight(run: &Run, code: Code) -> Option<String> {
    findings(run).get(code.name()).map(|(weight, _)| weight.clone())
}

#[test]
fn a_text_without_a_target_is_not_corrected() {
    let cell = Cell::kuka(121);
    let other = "/PROG MOVE\n/MN\n   1:J P[1] 100% FINE    ;\n   2:L P[2] 250mm/sec FINE    ;\n/END\n";
    for text in ["", other] {
        for language in ["krl", "rapid", "urscript"] {
            let file = cell.write("other.ls", text.as_bytes());
            let run = cell.compensate(&[&file], &["--language", language]).expect(1);
            assert_eq!(weight(&run, Code::TargetsMissing).as_deref(), Some("gate"), "{language}: {text}");
        }
    }
}

#[test]
fn line_ends_without_line_feed_are_line_ends() {
    let mut cell = Cell::kuka(122);
    let q: Vec<f64> = cell.readings().iter().map(|v| v.to_degrees()).collect();
    let axes: Vec<String> = q.iter().enumerate().map(|(k, v)| format!("A{} {v:.4}", k + 1)).collect();
    let header = cell.nominal.chain.readings.join(",");
    let row: Vec<String> = q.iter().map(|v| format!("{v:.4}")).collect();
    let krl = format!("DEF a()\n; PTP\nPTP {{{}}}\nLIN XQ\nEND\n", axes.join(","));
    let rapid = format!(
        "MODULE m\nPROC main()\n! Move\nMoveAbsJ [{q:?},[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,tool0;\nMoveJ p,v1,z1,tool0;\nENDPROC\nENDMODULE\n"
    );
    for (name, text, line) in
        [("a.src", krl, Some(4)), ("m.mod", rapid, Some(5)), ("t.csv", format!("{header}\n{}\n", row.join(",")), None)]
    {
        let run = |text: &str| {
            let file = cell.write(name, text.as_bytes());
            let run = cell.compensate(&[&file], &["--unordered", "--joint-unit", "deg"]);
            let told = run.told();
            assert_eq!(told.corrected, 1, "{name}");
            assert_eq!(told.left.first().map(|l| l.0), line, "{name}");
            run.text(name)
        };
        let old_style = run(&text.replace('\n', "\r"));
        assert_eq!(old_style.replace('\r', "\n"), run(&text));
        assert_ne!(run(&text), text);
    }
}

/// What the record beside a program says of it; one that was written by hand since is only named.
#[test]
fn a_program_that_is_corrected_already_is_not_corrected_twice() {
    let mut cell = Cell::kuka(124);
    let axes = |q: &[f64]| {
        q.iter().enumerate().map(|(k, v)| format!("A{} {:.4}", k + 1, v.to_degrees())).collect::<Vec<_>>().join(",")
    };
    let text = format!("DEF a()\nPTP {{{}}}\nEND\n", axes(&cell.readings()));
    let first = cell.write("a.src", text.as_bytes());
    let run = cell.compensate(&[&first], &["--unordered"]).expect(0);
    assert_eq!(weight(&run, Code::ProgramWritten).as_deref(), Some("note"));
    assert_eq!(weight(&run, Code::CorrectedAlready), None);
    let (corrected, out) = (run.out.join("a.src"), cell.folder.path().join("twice"));
    let again = |flags: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_robotcal"));
        command.arg("compensate").arg(&corrected).arg("--out").arg(&out).arg("--nominal").arg(&cell.nominal_urdf);
        command.arg("--urdf").arg(&cell.real_urdf).arg("--compensation").arg(&cell.compensation);
        command.args(["--frames", "nominal", "--base", "base_link", "--tip", "tool0", "--unordered"]);
        Run { output: command.args(flags).output().unwrap(), out: out.clone(), programs: Vec::new() }
    };
    let twice = again(&[]).expect(1);
    assert_eq!(weight(&twice, Code::CorrectedAlready).as_deref(), Some("gate"), "{}", twice.said());
    // Taught on a robot for which it was corrected.
    let taught = again(&["--from", cell.nominal_urdf.to_str().unwrap()]);
    assert_eq!(weight(&taught, Code::CorrectedAlready).as_deref(), Some("note"), "{}", taught.said());
    std::fs::write(&corrected, format!("{text}; by hand\n")).unwrap();
    let by_hand = again(&[]).expect(0);
    assert_eq!(weight(&by_hand, Code::CorrectedAlready).as_deref(), Some("note"), "{}", by_hand.said());
}

/// A program of one target.
fn one_target(cell: &mut Cell) -> String {
    let q = cell.readings();
    let axes = q.iter().enumerate().map(|(k, v)| format!("A{} {:.4}", k + 1, v.to_degrees())).collect::<Vec<_>>();
    format!("DEF a()\nPTP {{{}}}\nEND\n", axes.join(","))
}

#[test]
fn programs_that_are_corrected_one_after_the_other_into_one_folder_are_all_on_record() {
    let mut cell = Cell::kuka(126);
    let files = ["a.src", "b.src", "c.src"].map(|name| {
        let text = one_target(&mut cell);
        cell.write(name, text.as_bytes())
    });
    for file in files.iter().chain(&files[..1]) {
        cell.compensate(&[file], &["--unordered"]).expect(0);
    }
    let out = cell.folder.path().join("out");
    let rows = || {
        let table = std::fs::read_to_string(out.join("corrections.csv")).unwrap();
        let mut reader = csv::Reader::from_reader(table.as_bytes());
        let name = |row: csv::StringRecord| Path::new(&row[0]).file_name().unwrap().to_str().unwrap().to_owned();
        let mut names: Vec<String> = reader.records().map(|row| name(row.unwrap())).collect();
        names.sort();
        names
    };
    assert_eq!(rows(), ["a.src", "b.src", "c.src"]);
    let twice = |name: &str| {
        let run = compensate_into(&cell, &[&out.join(name)], &cell.folder.path().join("twice"));
        (run.output.status.code(), weight(&run, Code::CorrectedAlready))
    };
    for name in ["a.src", "b.src", "c.src"] {
        assert_eq!(twice(name), (Some(1), Some("gate".to_owned())), "{name}");
    }
    // What is no longer there is on no record.
    std::fs::remove_file(out.join("b.src")).unwrap();
    cell.compensate(&[&files[2]], &["--unordered"]).expect(0);
    assert_eq!(rows(), ["a.src", "c.src"]);
}

fn compensate_into(cell: &Cell, files: &[&Path], out: &Path) -> Run {
    let mut command = Command::new(env!("CARGO_BIN_EXE_robotcal"));
    command.arg("compensate").args(files).arg("--out").arg(out).arg("--nominal").arg(&cell.nominal_urdf);
    command.arg("--urdf").arg(&cell.real_urdf).arg("--compensation").arg(&cell.compensation);
    command.args(["--frames", "nominal", "--base", "base_link", "--tip", "tool0", "--unordered"]);
    Run { output: command.output().unwrap(), out: out.to_path_buf(), programs: Vec::new() }
}

/// Of a program that is not corrected again, its gate stays.
#[test]
fn findings_of_other_programs_in_the_folder_stay() {
    let mut cell = Cell::kuka(128);
    let [whole, other] = [0, 1].map(|_| one_target(&mut cell));
    let looped = "LOOP\nPTP P\nP={A1 1,A2 -80,A3 90,A4 20,A5 40,A6 10}\nENDLOOP\nEND";
    let part = other.replace("END", looped).replace("PTP {", "DECL E6AXIS P\nP={").replace("a()", "b()");
    let files = [("a.src", &whole), ("b.src", &part)].map(|(name, text)| cell.write(name, text.as_bytes()));
    cell.compensate(&[&files[1]], &["--unordered"]).expect(1);
    let out = cell.folder.path().join("out");
    let left = || {
        let text = std::fs::read(out.join("findings.json")).unwrap();
        let all: Vec<serde_json::Value> = serde_json::from_slice(&text).unwrap();
        let is_left = |f: &&serde_json::Value| f["code"] == Code::TargetsLeft.name();
        all.iter()
            .filter(is_left)
            .map(|f| (f["programs"].clone(), f["quantities"]["targets"].clone()))
            .collect::<Vec<_>>()
    };
    let of_b = vec![(serde_json::json!(["b.src"]), serde_json::json!(1.0))];
    assert_eq!(left(), of_b);
    for _ in 0..2 {
        cell.compensate(&[&files[0]], &["--unordered"]).expect(0);
        assert_eq!(left(), of_b);
    }
    cell.write("b.src", whole.replace("a()", "b()").as_bytes());
    cell.compensate(&[&files[1]], &["--unordered"]).expect(0);
    assert_eq!(left(), []);
}

#[test]
fn programs_and_records_of_the_user_are_not_replaced() {
    let mut cell = Cell::kuka(127);
    let [text, other] = [0, 1].map(|_| one_target(&mut cell));
    let without = "DEFDAT a\n;comment\nENDDAT\n";
    let folder = cell.folder.path().to_path_buf();
    for place in ["p1", "p2", "own"] {
        std::fs::create_dir(folder.join(place)).unwrap();
    }
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    let [src, dat] = ["p1/a.src", "p1/a.dat"].map(|name| folder.join(name));
    write("p1/a.src", &text);
    write("p1/a.dat", without);
    write("p2/a.src", &other);
    let refused = |files: &[&Path], out: &str, kept: &str| {
        let before = std::fs::read(folder.join(out).join(kept)).unwrap();
        let run = compensate_into(&cell, files, &folder.join(out)).expect(2);
        assert!(run.said().starts_with("error[output_exists]: "), "{}", run.said());
        assert!(std::fs::read(folder.join(out).join(kept)).unwrap() == before);
    };
    for (name, text) in [("a.src", "DEF a()\n; mine\nEND\n"), ("findings.json", "{}\n"), ("corrections.csv", "a,b\n")] {
        write(&format!("own/{name}"), text);
        refused(&[&src], "own", name);
        std::fs::remove_file(folder.join("own").join(name)).unwrap();
    }
    let good = || compensate_into(&cell, &[&src, &dat], &folder.join("out")).expect(0);
    good();
    good();
    // The program is taught anew; the other file of it is a copy.
    write("p1/a.src", &other);
    write("p1/a.dat", &without.replace("comment", "another"));
    good();
    // Of another cell.
    refused(&[&folder.join("p2/a.src")], "out", "a.src");
    // An earlier version said nothing of copies, and kept no record.
    let findings = std::fs::read_to_string(folder.join("out/findings.json")).unwrap();
    let rows: Vec<&str> = findings.lines().filter(|row| !row.contains(Code::ProgramCopied.name())).collect();
    write("out/findings.json", &rows.join("\n").replace("},\n]", "}\n]"));
    write("out/a.dat", without);
    std::fs::remove_file(folder.join("out/.robotcal-written.json")).unwrap();
    good();
    assert_eq!(std::fs::read_to_string(folder.join("out/a.dat.kept-1")).unwrap(), without);
    // Touched up by hand.
    let corrected = std::fs::read_to_string(folder.join("out/a.src")).unwrap();
    write("out/a.src", &format!("{corrected}; by hand\n"));
    refused(&[&src, &dat], "out", "a.src");
}

/// Columns of external axes beside poses; an empty cell, or one that says it is not used, leaves the axis where it is.
#[test]
fn rows_with_an_external_axis_that_the_description_lacks_are_left_unless_it_is_at_zero() {
    let cell = Cell::kuka(125);
    let pose = cell.nominal.base_from_tip(&[0.17, -1.4, 1.7, 0.35, 0.7, 0.5]);
    let flange: Vec<String> = pose.xyz().iter().chain(&pose.quaternion_xyzw()).map(|v| format!("{v:.9}")).collect();
    let external = LeftReason::ExternalAxis.name();
    for name in ["E1", "eax_a", "ext1", "ext_1", "extaxis1", "extaxis_1"] {
        let mut table = format!("name,x_m,y_m,z_m,qx,qy,qz,qw,{name},speed\n");
        ["0", "9E9", "500", "", "9E+09", "0.0", ""]
            .iter()
            .for_each(|at| table += &format!("P,{},{at},250\n", flange.join(",")));
        let file = cell.write("t.csv", table.as_bytes());
        let run = cell.compensate(&[&file], &["--joint-unit", "deg", "--unordered"]).expect(1);
        let left: Vec<(usize, String)> = run.told().left.into_iter().map(|(line, _, reason)| (line, reason)).collect();
        assert_eq!(left, [4, 5, 6].map(|line| (line, external.to_owned())), "{}", run.said());
        assert_eq!(run.told().corrected, 4);
        assert!(run.said().contains(Code::JointUnused.name()), "{}", run.said());
        let columns: Vec<usize> = run.text("t.csv").lines().map(|line| line.split(',').count()).collect();
        assert_eq!(columns, [16; 8], "every row has all cells");
        let apart = cell.compensate(&[&file], &["--joint-unit", "deg", "--unordered", "--axes-apart"]).expect(0);
        assert_eq!(apart.told().corrected, 7);
    }
    // The last run may have left the axis at 500.
    let rows: String = ["", "9E9", "0", "", "500"].map(|at| format!("{},{at}\n", flange.join(","))).concat();
    let file = cell.write("t.csv", format!("x_m,y_m,z_m,qx,qy,qz,qw,E1\n{rows}").as_bytes());
    let told = cell.compensate(&[&file], &["--joint-unit", "deg", "--unordered"]).expect(1).told();
    let left: Vec<(usize, String)> = told.left.into_iter().map(|(line, _, reason)| (line, reason)).collect();
    assert_eq!((told.corrected, left), (2, [2, 3, 6].map(|line| (line, external.to_owned())).to_vec()));
    // Columns of something else.
    for name in ["extra", "extruder_speed", "extension_mm", "ext_force"] {
        let table = format!("x_m,y_m,z_m,qx,qy,qz,qw,{name}\n{},500\n", flange.join(","));
        let file = cell.write("t.csv", table.as_bytes());
        let run = cell.compensate(&[&file], &["--joint-unit", "deg", "--unordered"]).expect(0);
        assert_eq!(run.told().corrected, 1, "{name}");
        assert!(run.said().contains(Code::JointUnused.name()), "{}", run.said());
    }
}

#[test]
fn what_fewer_than_six_joints_cannot_take_out_is_no_matter_of_reach() {
    let cell = Cell::kuka(126);
    let names = &cell.nominal.chain.readings;
    let file = cell.write("t.csv", format!("{}\n0.17,-1.4,1.7,0.35,0.7,0.5\n", names.join(",")).as_bytes());
    for (held, left) in [(&names[..0], vec![]), (&names[3..5], vec![LeftReason::TooFewAxes.name().to_owned()])] {
        let hold = format!("--hold={}", held.join(","));
        let flags = [&["--joint-unit", "rad", "--unordered"][..], &[hold.as_str()][..held.len().min(1)]].concat();
        let told = cell.compensate(&[&file], &flags).expect(i32::from(!held.is_empty())).told();
        let found: Vec<String> = told.left.into_iter().map(|(.., reason)| reason).collect();
        assert_eq!(found, left, "{hold}");
    }
}

#[test]
fn descriptions_that_correct_nothing_or_the_wrong_way_are_named() {
    let mut cell = Cell::kuka(123);
    let q: Vec<String> = cell.readings().iter().map(|v| format!("{v:.4}")).collect();
    let table = format!("{}\n{}\n", cell.nominal.chain.readings.join(","), q.join(","));
    let file = cell.write("t.csv", table.as_bytes());
    let rad = ["--joint-unit", "rad", "--unordered"];
    let (nominal, real) = (&cell.nominal_urdf, &cell.real_urdf);
    let (solved, toml) = (repo("reports/kr6_small/kuka_kr6_r900.calibrated.urdf"), cell.compensation.to_str().unwrap());
    for (nominal, urdf, flags, code) in [
        (nominal, nominal, vec![], Some(Code::ModelsEqual)),
        (real, real, vec![], Some(Code::ModelsEqual)),
        (nominal, real, vec![], None),
        (real, real, vec!["--compensation", toml], None),
        (&solved, nominal, vec![], Some(Code::ModelsExchanged)),
        (nominal, &solved, vec![], None),
        // From one calibrated robot to another.
        (&solved, real, vec![], None),
    ] {
        let run =
            compensate(&cell, &file, nominal, urdf, &[&rad[..], &flags].concat()).expect(i32::from(code.is_some()));
        for gate in [Code::ModelsEqual, Code::ModelsExchanged] {
            assert_eq!(weight(&run, gate).is_some(), code == Some(gate), "{}", run.said());
        }
        let is_left_out = flags.is_empty() && urdf == real;
        let note = is_left_out.then(|| "note".to_owned());
        assert_eq!(weight(&run, Code::CompensationNotGiven), note, "{}", run.said());
    }
}

/// ur_description has the frame of the controller beside `base_link`, turned by half a turn.
#[test]
fn poses_of_urscript_in_another_base_than_the_controllers_are_named() {
    let cell = Cell::ur(126);
    let frame = "<link name=\"base\"/><joint name=\"base_link-base\" type=\"fixed\"><parent link=\"base_link\"/><child link=\"base\"/>\
        <origin xyz=\"0 0 0\" rpy=\"0 0 3.141592653589793\"/></joint></robot>";
    let described = |name: &str, path: &Path| {
        let text = std::fs::read_to_string(path).unwrap().replace("</robot>", frame);
        cell.write(name, text.as_bytes())
    };
    let [nominal, real] = [described("n.urdf", &cell.nominal_urdf), described("r.urdf", &cell.real_urdf)];
    let pose = "def p():\n  set_tcp(p[0,0,0,0,0,0])\n  movej(p[0.6,0.2,0.4,0,3.1,0], a=1)\nend\n";
    let joints = "def p():\n  movej([0.1,-1.2,1.5,-1.8,-1.5,0.3], a=1)\nend\n";
    for (text, base, named) in
        [(pose, None, Some("gate")), (pose, Some("base"), None), (pose, Some("base_link"), None), (joints, None, None)]
    {
        let file = cell.write("p.script", text.as_bytes());
        let out = cell.folder.path().join("out");
        let mut command = Command::new(env!("CARGO_BIN_EXE_robotcal"));
        command.arg("compensate").arg(&file).arg("--out").arg(&out);
        command.arg("--nominal").arg(&nominal).arg("--urdf").arg(&real);
        command.args(["--frames", "nominal", "--tip", "tool0", "--start", "0.1,-1.2,1.5,-1.8,-1.5,0.3"]);
        command.args(base.map(|base| ["--base", base]).into_iter().flatten());
        let run = Run { output: command.output().unwrap(), out, programs: Vec::new() };
        assert_eq!(weight(&run, Code::ControllerBase).as_deref(), named, "{base:?} {}", run.said());
    }
}

/// The joint columns are corrected, and the pose columns are not.
#[test]
fn poses_beside_corrected_joints_are_said_to_be_kept() {
    let mut cell = Cell::kuka(127);
    let q = cell.readings();
    let pose = cell.nominal.base_from_tip(&q);
    let [x, y, z] = pose.xyz();
    let turn = nalgebra::UnitQuaternion::from_matrix(&pose.rotation);
    let header = format!("x_m,y_m,z_m,qx,qy,qz,qw,{}", cell.nominal.chain.readings.join(","));
    let cells = [x, y, z, turn.i, turn.j, turn.k, turn.w].into_iter().chain(q.iter().copied());
    let row: Vec<String> = cells.map(|v| format!("{v:.9}")).collect();
    let file = cell.write("t.csv", format!("{header}\n{}\n", row.join(",")).as_bytes());
    let run = cell.compensate(&[&file], &["--joint-unit", "rad"]);
    assert_eq!(weight(&run, Code::PosesKept).as_deref(), Some("note"), "{}", run.said());
    let joints = format!("{}\n{}\n", cell.nominal.chain.readings.join(","), row[7..].join(","));
    let file = cell.write("t.csv", joints.as_bytes());
    let run = cell.compensate(&[&file], &["--joint-unit", "rad"]);
    assert_eq!(weight(&run, Code::PosesKept), None);
}
