//! `robotcal compensate` on KUKA KRL, written as the vendor's manuals give it.

use std::collections::BTreeMap;

use crate::programs_support::{Cell, assert_meets, shape, status_turn};
use crate::said::assert_says;
use robotcal::Code;
use robotcal::geom::{Pose, matrix_from_rpy};
use robotcal::model::inverse;

/// `name -> value` of an aggregate, by a reader of its own.
fn aggregate(text: &str, before: &str) -> BTreeMap<String, f64> {
    let at = text.find(before).unwrap_or_else(|| panic!("{before} in\n{text}")) + before.len();
    let body = text[at..].split_once('{').unwrap().1.split_once('}').unwrap().0;
    let body = body.rsplit(':').next().unwrap();
    let pair = |p: &str| {
        let (name, value) = p.trim().split_once(|c: char| c.is_whitespace())?;
        Some((name.to_uppercase(), value.trim().parse().ok()?))
    };
    body.split(',').filter_map(pair).collect()
}

fn axes(a: &BTreeMap<String, f64>) -> Vec<f64> {
    (1..7).map(|k| a[&format!("A{k}")].to_radians()).collect()
}

fn pose(a: &BTreeMap<String, f64>) -> Pose {
    let angle = |n: &str| a[n].to_radians();
    let mm = |n: &str| 1e-3 * a[n];
    Pose::new(matrix_from_rpy([angle("C"), angle("B"), angle("A")]), [mm("X"), mm("Y"), mm("Z")].into())
}

fn pose_text(p: &Pose) -> String {
    let [c, b, a] = p.rpy().map(f64::to_degrees);
    let [x, y, z] = p.xyz().map(|v| 1e3 * v);
    format!("X {x:.4},Y {y:.4},Z {z:.4},A {a:.6},B {b:.6},C {c:.6}")
}

fn axes_text(q: &[f64]) -> String {
    let one = |(k, v): (usize, &f64)| format!("A{} {:.6}", k + 1, v.to_degrees());
    q.iter().enumerate().map(one).collect::<Vec<_>>().join(",")
}

const TOOL: &str = "X 12.5,Y -3.0,Z 180.25,A 0.0,B 35.0,C 10.0";
const BASE: &str = "X 250.0,Y 100.0,Z 50.0,A 30.0,B 0.0,C 0.0";

const SRC: &str = "&ACCESS RVP\r\n&REL 12\r\n&PARAM TEMPLATE = C:\\KRC\\Roboter\\Template\\vorgabe\r\nDEF welding( )\r\n\
;FOLD INI;%{PE}\r\n  BAS (#INITMOV,0 )\r\n;ENDFOLD (INI)\r\n\r\n\
;FOLD PTP HOME  Vel= 100 % DEFAULT;%{PE}%MKUKATPBASIS {A1 5.5}\r\n\
$BWDSTART = FALSE\r\nPDAT_ACT=PDEFAULT\r\nFDAT_ACT=FHOME\r\nBAS (#PTP_PARAMS,100 )\r\n\t$H_POS=XHOME\r\nPTP  XHOME\r\n;ENDFOLD\r\n\
;FOLD PTP P1 CONT Vel=100 % PDAT1 Tool[1]:gun Base[2]:table;%{PE}\r\n$BWDSTART=FALSE\r\nPDAT_ACT=PPDAT1\r\nFDAT_ACT=FP1\r\nBAS(#PTP_PARAMS,100)\r\nPTP XP1 C_PTP\r\n;ENDFOLD\r\n\
lin xp2 c_dis ; slow {X 1.0}\r\n\
$TOOL={@TOOL@}\r\n$base = {@BASE@}\r\n\
PTP {@P3@,S 'B@S3@',T 'B@T3@'}\r\n\
LIN {Z @Z4@}\r\n\
CIRC {@P5@} , {@P6@},CA 90.0\r\n\
PTP {E6AXIS: @Q7@, E1 0.0, E2 0.0}\r\n\
LIN_REL {X 10.0}\r\n\
LIN XP2:{X 0.0,Y 0.0,Z 10.0,A 0.0,B 0.0,C 0.0}\r\n\
PTP $POS_ACT\r\nWAIT SEC 0.5\r\nIF $IN[1]==TRUE THEN\r\nHALT\r\nENDIF\r\nEND\r\n";

const DAT: &str = "&ACCESS RVP\nDEFDAT  WELDING\n;FOLD EXTERNAL;%{PE}\n;ENDFOLD\n; Sch\u{f6}ne Gr\u{fc}\u{df}e 1.0\n\
DECL E6POS XP1={@P1@,S @S1@,T @T1@,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}\n\
DECL FDAT FP1={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,POINT2[] \" \",TQ_STATE FALSE}\n\
DECL PDAT PPDAT1={VEL 100.0,ACC 100.0,APO_DIST 50.0}\n\
DECL\tPOS\tXP2 = { @P2@, S @S2@, T @T2@ }\n\
DECL E6AXIS XUNUSED={@Q8@,E1 0.0}\n\
DECL E6POS XLOST={X 100.0,Y 0.0,Z 500.0,A 0.0,B 90.0,C 0.0,S 2,T 35}\n\
ENDDAT\n";

const CONFIG: &str = "DEFDAT  $CONFIG\nBASE_DATA[2]={@BASE@}\nTOOL_DATA[1]={@TOOL@}\n\
DECL E6AXIS XHOME={@Q0@,E1 0.0}\nDECL FDAT FHOME={TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE}\nENDDAT\n";

/// Latin-1 as the controller writes it.
fn latin1(text: &str) -> Vec<u8> {
    text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect()
}

fn from_latin1(bytes: &[u8]) -> String {
    bytes.iter().map(|b| char::from(*b)).collect()
}

#[test]
fn krl_keeps_every_other_byte_and_meets_every_target() {
    for seed in [21, 22, 23] {
        check(seed);
    }
}

fn check(seed: u64) {
    let mut cell = Cell::kuka(seed);
    let mut tools = BTreeMap::new();
    tools.insert("tool", pose(&aggregate(&format!("{{{TOOL}}}"), "")));
    tools.insert("base", pose(&aggregate(&format!("{{{BASE}}}"), "")));
    let (tool, base) = (tools["tool"], tools["base"]);
    let mut q: Vec<Vec<f64>> = (0..9).map(|_| cell.readings()).collect();
    // P5 and P6 have no status: they mean the posture of the target before them, as does P4, 20 mm above P3. A line leads to P2.
    for (k, from) in [(2, 1), (5, 3), (6, 3)] {
        q[k] = q[from].iter().enumerate().map(|(i, v)| v + 0.05 * ((k + i) as f64).sin()).collect();
    }
    let work = |q: &[f64]| base.inverse() * cell.nominal.base_from_tip(q) * tool;
    let mut src = SRC.replace("@TOOL@", TOOL).replace("@BASE@", BASE).replace("@Q7@", &axes_text(&q[7]));
    let mut dat = DAT.replace("@Q8@", &axes_text(&q[8]));
    for k in [1, 2, 3, 5, 6] {
        let (s, t) = status_turn(&q[k]);
        let (key, text) = (format!("@P{k}@"), pose_text(&work(&q[k])));
        src = src
            .replace(&key, &text)
            .replace(&format!("@S{k}@"), &format!("{s:03b}"))
            .replace(&format!("@T{k}@"), &format!("{t:06b}"));
        dat = dat
            .replace(&key, &text)
            .replace(&format!("@S{k}@"), &s.to_string())
            .replace(&format!("@T{k}@"), &t.to_string());
    }
    let up = work(&q[3]).xyz()[2] * 1e3 + 20.0;
    src = src.replace("@Z4@", &format!("{up:.4}"));
    let config = CONFIG.replace("@TOOL@", TOOL).replace("@BASE@", BASE).replace("@Q0@", &axes_text(&q[0]));
    let files = [("welding.src", latin1(&src)), ("welding.dat", latin1(&dat)), ("$config.dat", latin1(&config))];
    let paths: Vec<_> = files.iter().map(|(name, bytes)| cell.write(name, bytes)).collect();
    let run = cell.compensate(&paths.iter().collect::<Vec<_>>(), &["--unordered"]);
    let run = run.expect(1);
    let told = run.told();
    let mut left: Vec<(&str, &str)> =
        told.left.iter().map(|(_, name, reason)| (name.as_str(), reason.as_str())).collect();
    left.sort_unstable();
    let wanted = [("CIRC", "path_end"), ("LIN", "computed"), ("LIN_REL", "relative"), ("XLOST", "unvisited")];
    assert_eq!(left, wanted, "seed {seed}");
    assert_eq!(told.corrected, 9, "seed {seed}");
    let new = |name: &str| from_latin1(&run.file(name));
    let (new_src, new_dat, new_config) = (new("welding.src"), new("welding.dat"), new("$config.dat"));
    // The partial aggregate gains its missing components; nothing else changes in shape.
    let lin = new_src.lines().find(|l| l.starts_with("LIN {Z")).unwrap().to_owned();
    let plain = new_src.replace(&lin, &format!("LIN {{Z {up:.4}}}"));
    assert_eq!(from_latin1(&shape(&latin1(&plain))), from_latin1(&shape(&latin1(&src))));
    assert_eq!(from_latin1(&shape(&latin1(&new_dat))), from_latin1(&shape(&latin1(&dat))));
    assert_eq!(from_latin1(&shape(&latin1(&new_config))), from_latin1(&shape(&latin1(&config))));
    for same in ["TOOL_DATA[1]", "BASE_DATA[2]"] {
        assert_eq!(aggregate(&config, same), aggregate(&new_config, same));
    }
    for same in ["LIN_REL", "LIN XP2:", "$TOOL=", "$base = ", "MKUKATPBASIS"] {
        assert_eq!(aggregate(&src, same), aggregate(&new_src, same), "{same}");
    }
    assert_eq!(aggregate(&dat, "XLOST="), aggregate(&new_dat, "XLOST="));
    // Joint targets.
    for (old, new, key) in [(&config, &new_config, "XHOME="), (&src, &new_src, "E6AXIS"), (&dat, &new_dat, "XUNUSED=")]
    {
        let (old, new) = match key {
            "E6AXIS" => (
                aggregate(&old.replace("PTP {E6AXIS", "E6AXIS {"), "E6AXIS"),
                aggregate(&new.replace("PTP {E6AXIS", "E6AXIS {"), "E6AXIS"),
            ),
            key => (aggregate(old, key), aggregate(new, key)),
        };
        assert_meets(&cell.real_at(&axes(&new), None), &cell.nominal.base_from_tip(&axes(&old)), key);
    }
    // Poses: what the controller makes of the new ones by its own model.
    let limits = inverse::reading_limits(&cell.nominal.chain);
    let meets = |old: &BTreeMap<String, f64>, new: &BTreeMap<String, f64>, q: &[f64], what: &str| {
        let flange = |a: &BTreeMap<String, f64>| base * pose(a) * tool.inverse();
        let commanded = inverse::solve_from(&cell.nominal, &limits, &flange(new), q).unwrap();
        assert_meets(&cell.real_at(&commanded, None), &flange(old), what);
        let change = commanded.iter().zip(q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(change < 0.2, "{what} left its posture: {change}");
    };
    meets(&aggregate(&dat, "XP1="), &aggregate(&new_dat, "XP1="), &q[1], "XP1");
    meets(&aggregate(&dat, "XP2 ="), &aggregate(&new_dat, "XP2 ="), &q[2], "XP2");
    let third = |text: &str| aggregate(text.lines().find(|l| l.starts_with("PTP {X")).unwrap(), "PTP");
    meets(&third(&src), &third(&new_src), &q[3], "P3");
    meets(&aggregate(&src, "CIRC"), &aggregate(&new_src, "CIRC"), &q[5], "P5");
    meets(&aggregate(&src, "} , "), &aggregate(&new_src, "} , "), &q[6], "P6");
    let mut fourth = third(&src);
    fourth.insert("Z".into(), format!("{up:.4}").parse().unwrap());
    let flange = base * pose(&fourth) * tool.inverse();
    let near = inverse::solve_from(&cell.nominal, &limits, &flange, &q[3]).unwrap();
    meets(&fourth, &aggregate(&lin, "LIN "), &near, "P4");
}

#[test]
fn malformed_lines_are_refused_with_their_line() {
    let cell = Cell::kuka(24);
    for (text, code, names) in [
        ("DEF a()\nPTP {A1 10,A2 20\nEND\n", Code::ProgramSyntax, ["a.src:2", "A2"]),
        ("DEF a()\n\nPTP {A1 10,5,A2 20}\nEND\n", Code::ProgramSyntax, ["a.src:3", "\"5\""]),
        ("LIN {X 10,Y ,Z 3}\n", Code::ProgramSyntax, ["a.src:1", " Y "]),
        ("LIN {X 10,Y 1,X 3}\n", Code::ProgramSyntax, ["a.src:1", " X "]),
        ("LIN\n", Code::ProgramTargets, ["a.src:1", "LIN"]),
        ("CIRC {X 10,Y 1}\n", Code::ProgramTargets, ["a.src:1", "CIRC"]),
    ] {
        let file = cell.write("a.src", text.as_bytes());
        let run = cell.compensate(&[&file], &[]).expect(2);
        assert_says(&run.said(), code, &names);
    }
}

#[test]
fn status_and_turn_choose_the_posture_and_follow_a_corrected_sign() {
    let mut cell = Cell::kuka(25);
    let limits = inverse::reading_limits(&cell.nominal.chain);
    let mut targets = String::from("DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n");
    let mut wanted = Vec::new();
    for k in 0..60 {
        let mut q = cell.readings();
        // Axis 4 next to zero: its correction changes a bit of T.
        if k % 2 == 0 {
            q[3] = if k % 4 == 0 { 1e-4 } else { -1e-4 };
        }
        let (s, t) = status_turn(&q);
        targets += &format!("PTP {{{},S {s},T {t}}}\n", pose_text(&cell.nominal.base_from_tip(&q)));
        wanted.push(q);
    }
    let file = cell.write("a.src", targets.as_bytes());
    let run = cell.compensate(&[&file], &["--unordered"]);
    let (told, new) = (run.told(), run.text("a.src"));
    assert!(told.corrected == 60 && told.left.is_empty(), "{told:?}");
    let mut turned = 0;
    for ((old, new), q) in targets.lines().zip(new.lines()).skip(3).zip(&wanted) {
        let (a, b) = (aggregate(old, "PTP"), aggregate(new, "PTP"));
        let commanded = inverse::solve_from(&cell.nominal, &limits, &pose(&b), q).unwrap();
        assert_meets(&cell.real_at(&commanded, None), &pose(&a), old);
        let (s, t) = status_turn(&commanded);
        assert_eq!((b["S"] as u32, b["T"] as u32), (s, t), "{old}\n{new}");
        turned += usize::from(a["T"] != b["T"]);
    }
    assert!(turned > 3, "{turned}");
}

/// A world of frames: `X .., Y .., ..` of the flange in the base.
fn coded(cell: &Cell, q: &[f64]) -> String {
    let (s, t) = status_turn(q);
    format!("{{{},S {s},T {t}}}", pose_text(&cell.nominal.base_from_tip(q)))
}

fn assert_pose_meets(cell: &Cell, old: &str, new: &str, key: &str, frames: (&Pose, &Pose), q: &[f64]) {
    let (a, b) = (aggregate(old, key), aggregate(new, key));
    let flange = |a: &BTreeMap<String, f64>| *frames.0 * pose(a) * frames.1.inverse();
    let limits = inverse::reading_limits(&cell.nominal.chain);
    let commanded = inverse::solve_from(&cell.nominal, &limits, &flange(&b), q).unwrap();
    let change = commanded.iter().zip(q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(change < 0.15, "{key} left its posture: {change}");
    assert_meets(&cell.real_at(&commanded, None), &flange(&a), key);
    assert_ne!(a, b, "{key} is corrected");
}

#[test]
fn frames_that_a_motion_states_for_itself_hold_for_it_alone() {
    let mut cell = Cell::kuka(26);
    let frame = |text: &str| pose(&aggregate(&format!("{{{text}}}"), ""));
    let (tool, base) = (frame(TOOL), frame(BASE));
    let (a, b) = (cell.readings(), cell.readings());
    let beside = |q: &[f64]| q.iter().map(|v| v + 0.03).collect::<Vec<_>>();
    let q = [a.clone(), beside(&a), b.clone(), beside(&b)];
    let at = |q: &[f64], base: &Pose, tool: &Pose| {
        let (s, t) = status_turn(q);
        format!("{{{},S {s},T {t}}}", pose_text(&(base.inverse() * cell.nominal.base_from_tip(q) * *tool)))
    };
    let none = Pose::identity();
    let src = format!(
        "DEF a()\nSPTP XP1 WITH $VEL_AXIS[1] = SVEL_JOINT(10.0), $TOOL = STOOL2(FP1), $BASE = SBASE(FP1.BASE_NO), $IPO_MODE = SIPO_MODE(FP1.IPO_FRAME), $LOAD = SLOAD(FP1.TOOL_NO), $APO = SAPO_PTP(PPDAT1)\n\
SLIN XP2 WITH $TOOL=TOOL_DATA[1], $BASE={{{BASE}}} C_SPL\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nPTP XP3\nSPLINE WITH $BASE = SBASE(FP1.BASE_NO), $TOOL = STOOL2(FP1)\nSPL XP4\nENDSPLINE\nEND\n"
    );
    let dat = format!(
        "DEFDAT a\nDECL E6POS XP1={}\nDECL FDAT FP1={{TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}}\nDECL E6POS XP2={}\nDECL E6POS XP3={}\nDECL E6POS XP4={}\nENDDAT\n",
        at(&q[0], &base, &tool),
        at(&q[1], &base, &tool),
        at(&q[2], &none, &none),
        at(&q[3], &base, &tool)
    );
    let config = format!("DEFDAT $CONFIG\nBASE_DATA[2]={{{BASE}}}\nTOOL_DATA[1]={{{TOOL}}}\nENDDAT\n");
    let files = [("a.src", src), ("a.dat", dat.clone()), ("$config.dat", config)];
    let paths: Vec<_> = files.iter().map(|(name, text)| cell.write(name, text.as_bytes())).collect();
    let run = cell.compensate(&paths.iter().collect::<Vec<_>>(), &["--unordered"]).expect(0);
    let new = run.text("a.dat");
    assert_eq!(run.text("corrections.csv").lines().count(), 5, "corrected, and nothing is listed twice");
    for (k, q) in q.iter().enumerate() {
        let frames = if k == 2 { (&none, &none) } else { (&base, &tool) };
        assert_pose_meets(&cell, &dat, &new, &format!("XP{}=", k + 1), frames, q);
    }
}

#[test]
fn an_element_that_is_chosen_while_the_program_runs_stands_for_all_that_are_declared() {
    let mut cell = Cell::kuka(27);
    let q: Vec<Vec<f64>> = (0..4).map(|_| cell.readings()).collect();
    let src =
        "DEF a()\nDECL INT I\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\nFOR I=1 TO 3\nPTP P[I]\nENDFOR\nPTP Q[2,I]\nEND\n";
    let dat = format!(
        "DEFDAT a\nDECL E6POS P[3]\nP[1]={}\nP[2]={}\nP[3]={}\nDECL E6AXIS Q[2,2]\nQ[2,1]={{{}}}\nQ[1,1]={{A1 1.0,A2 -90.0,A3 90.0,A4 0.0,A5 10.0,A6 0.0}}\nENDDAT\n",
        coded(&cell, &q[0]),
        coded(&cell, &q[1]),
        coded(&cell, &q[2]),
        axes_text(&q[3])
    );
    let paths = [cell.write("a.src", src.as_bytes()), cell.write("a.dat", dat.as_bytes())];
    let run = cell.compensate(&paths.iter().collect::<Vec<_>>(), &["--unordered"]).expect(0);
    let new = run.text("a.dat");
    let none = Pose::identity();
    for (k, q) in q.iter().enumerate().take(3) {
        assert_pose_meets(&cell, &dat, &new, &format!("P[{}]=", k + 1), (&none, &none), q);
    }
    let (old, new) = (aggregate(&dat, "Q[2,1]="), aggregate(&new, "Q[2,1]="));
    assert_meets(&cell.real_at(&axes(&new), None), &cell.nominal.base_from_tip(&axes(&old)), "Q[2,1]");
}

#[test]
fn a_declared_target_visited_again_gives_the_numbers_that_literals_give() {
    let mut checked = 0;
    for seed in 28..33 {
        let mut cell = Cell::kuka(seed);
        let (a, b) = (cell.readings(), cell.readings());
        let c: Vec<f64> = a.iter().enumerate().map(|(i, v)| v + 0.05 * (i as f64 + 1.0).sin()).collect();
        let last = format!("LIN {{{}}}", pose_text(&cell.nominal.base_from_tip(&c)));
        let head = "DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n";
        let (xa, xb) = (format!("{{{}}}", axes_text(&a)), format!("{{{}}}", axes_text(&b)));
        let declared = cell.write("a.src", format!("{head}PTP XA\nPTP XB\nPTP XA\n{last}\nEND\n").as_bytes());
        let data =
            cell.write("a.dat", format!("DEFDAT a\nDECL E6AXIS XA={xa}\nDECL E6AXIS XB={xb}\nENDDAT\n").as_bytes());
        let literal = cell.write("b.src", format!("{head}PTP {xa}\nPTP {xb}\nPTP {xa}\n{last}\nEND\n").as_bytes());
        // In the order of the text: backlash counts, and depends on where the robot comes from.
        let by_name = cell.compensate(&[&declared, &data], &[]).expect(0).text("a.src");
        let by_number = cell.compensate(&[&literal], &[]).expect(0).text("b.src");
        let of = |text: &str| aggregate(text.lines().find(|l| l.starts_with("LIN")).unwrap(), "LIN");
        let (x, y) = (of(&by_name), of(&by_number));
        for (name, value) in &x {
            // XA has one correction by name and two by number: their backlash differs.
            assert!((value - y[name]).abs() < 0.02, "seed {seed}, {name}: {value} {}", y[name]);
        }
        let none = Pose::identity();
        let file = cell.write("a.src", format!("{head}PTP XA\nPTP XB\nPTP XA\n{last}\nEND\n").as_bytes());
        let run = cell.compensate(&[&file, &data], &["--unordered"]).expect(0);
        assert_pose_meets(&cell, &last, &run.text("a.src"), "LIN", (&none, &none), &c);
        checked += 1;
    }
    assert_eq!(checked, 5);
}

#[test]
fn poses_without_status_go_on_in_every_posture_of_the_arm() {
    let mut cell = Cell::kuka(33);
    let limits = inverse::reading_limits(&cell.nominal.chain);
    let mut postures: Vec<Vec<f64>> = Vec::new();
    let mut seen = std::collections::BTreeSet::new();
    for _ in 0..4000 {
        let q = cell.readings();
        if q.iter().zip(&limits).all(|(v, (l, h))| *v > l + 0.3 && *v < h - 0.3) && seen.insert(status_turn(&q).0) {
            postures.push(q);
        }
    }
    assert!(postures.len() >= 6, "{seen:?}");
    let none = Pose::identity();
    for q in &postures {
        let up: Vec<f64> = q.iter().enumerate().map(|(i, v)| v + 0.06 * (i as f64 + 0.5).cos()).collect();
        let lin = format!("LIN {{{}}}", pose_text(&cell.nominal.base_from_tip(&up)));
        let head = "DEF a()\n$TOOL=$NULLFRAME\n$BASE=$NULLFRAME\n";
        let file = cell.write("a.src", format!("{head}PTP {{{}}}\n{lin}\nEND\n", axes_text(q)).as_bytes());
        let run = cell.compensate(&[&file], &["--unordered"]).expect(0);
        assert_pose_meets(&cell, &lin, &run.text("a.src"), "LIN", (&none, &none), &up);
        // Alone, nothing tells which of them it means.
        let file = cell.write("b.src", format!("{head}{lin}\nEND\n").as_bytes());
        let alone = cell.compensate(&[&file], &["--unordered"]).expect(1);
        assert_eq!(alone.text("b.src").lines().nth(3), Some(lin.as_str()));
    }
}
