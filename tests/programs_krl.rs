//! `robotcal compensate` on KUKA KRL, written as the vendor's manuals give it.

#![allow(clippy::unwrap_used)]

mod programs_support;

use std::collections::BTreeMap;

use programs_support::{Cell, assert_meets, shape, status_turn};
use robotcal::geom::{Pose, matrix_from_rpy};
use robotcal::plan::inverse;

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
    // P5 and P6 have no status: they mean the posture of the target before them, as does P4, 20 mm above P3.
    for k in [5, 6] {
        q[k] = q[3].iter().enumerate().map(|(i, v)| v + 0.05 * ((k + i) as f64).sin()).collect();
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
    let said = run.said();
    let run = run.expect(1);
    for left in ["LIN_REL: it is relative", "LIN: its target is computed", "XLOST: no motion of the files goes there"] {
        assert!(said.contains(left), "{left}: {said}");
    }
    assert!(said.contains("9 corrected, 3 left"), "seed {seed}: {said}");
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
    for (text, words) in [
        ("DEF a()\nPTP {A1 10,A2 20\nEND\n", ["a.src:2", "not closed behind the component A2"]),
        ("DEF a()\n\nPTP {A1 10,5,A2 20}\nEND\n", ["a.src:3", "\"5\" stands where the name of a component belongs"]),
        ("LIN {X 10,Y ,Z 3}\n", ["a.src:1", "the component Y has no value"]),
        ("LIN {X 10,Y 1,X 3}\n", ["a.src:1", "the component X stands twice"]),
        ("LIN\n", ["a.src:1", "LIN has no target"]),
        ("CIRC {X 10,Y 1}\n", ["a.src:1", "CIRC has 1 targets, not 2"]),
    ] {
        let file = cell.write("a.src", text.as_bytes());
        let run = cell.compensate(&[&file], &[]).expect(2);
        assert!(words.iter().all(|w| run.said().contains(w)), "{text}: {}", run.said());
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
    let (said, new) = (run.said(), run.text("a.src"));
    assert!(said.contains("60 corrected, 0 left"), "{said}");
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
