//! Files that are given together, in whatever order: data and routines of one name in several of them.

use crate::programs_support::text::{
    NO_AXES, START, UNCHECKED, beside, pose_text, robtarget as written, script_pose, told,
};
use crate::programs_support::{Cell, status_turn};
use robotcal::programs::LeftReason;

fn degrees(q: &[f64]) -> Vec<f64> {
    q.iter().map(|v| v.to_degrees()).collect()
}

/// A robtarget of the flange whose confdata count for nothing.
fn robtarget(cell: &Cell, q: &[f64]) -> String {
    written(&cell.nominal.base_from_tip(q), UNCHECKED)
}

/// The texts of files after correction, and what became of their targets.
fn corrected(cell: &Cell, files: &[(&str, String)]) -> Vec<String> {
    let paths: Vec<_> = files.iter().map(|(name, text)| cell.write(name, text.as_bytes())).collect();
    let run = cell.compensate(&paths.iter().collect::<Vec<_>>(), &["--unordered"]).expect(0);
    files.iter().map(|(name, _)| run.text(name)).collect()
}

/// Asserts that two files are corrected together, in both orders, as each of them alone, and differently.
fn assert_each_as_alone(cell: &Cell, one: (&str, String), other: (&str, String)) {
    let alone = [&one, &other].map(|file| corrected(cell, std::slice::from_ref(file)).remove(0));
    assert_ne!(alone[0], one.1);
    assert_eq!(corrected(cell, &[one.clone(), other.clone()]), alone);
    assert_eq!(corrected(cell, &[other, one]), [alone[1].clone(), alone[0].clone()]);
}

#[test]
fn data_of_rapid_that_another_module_sets_are_computed_in_whatever_order_they_are_given() {
    let cell = Cell::kuka(201);
    let point = robtarget(&cell, &beside(1));
    let data = |point: &str| {
        format!(
            "MODULE d\nPERS tooldata t:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nPERS wobjdata w:=[FALSE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\nPERS robtarget {point};\nENDMODULE\n"
        )
    };
    let (alone, of_array) = (data(&format!("p:={point}")), data(&format!("ps{{1}}:=[{point}]")));
    let [computed, tool, work] = [LeftReason::Computed, LeftReason::ToolUnknown, LeftReason::FrameUnknown];
    for (set, used, reason) in [
        ("p.trans.z:=600;", "p,v10,fine,t", Some(computed)),
        ("p:=Offs(p,0,0,9);", "p,v10,fine,t", Some(computed)),
        ("ps{1}.trans.z:=600;", "ps{1},v10,fine,t", Some(computed)),
        ("t.tframe.trans.z:=250;", "p,v10,fine,t", Some(tool)),
        ("w.uframe.trans.x:=300;", "p,v10,fine,t\\WObj:=w", Some(work)),
        // What is read only is where its numbers say.
        ("height:=p.trans.z;", "p,v10,fine,t", None),
        ("IF t.tframe.trans.z>90 Stop;", "p,v10,fine,t\\WObj:=w", None),
    ] {
        let main = format!(
            "MODULE m\nPROC main()\nConfJ\\Off;\n{set}\nMoveAbsJ [{:?},{NO_AXES}],v10,fine,t;\nMoveJ {used};\nENDPROC\nENDMODULE\n",
            degrees(&START)
        );
        let data = if used.contains("ps") { &of_array } else { &alone };
        let mut files = [("m.mod", main), ("d.mod", data.clone())];
        let left: Vec<String> = reason.iter().map(|reason| reason.name().to_owned()).collect();
        let wanted = (2 - left.len(), left);
        assert_eq!(told(&cell, &files, &[]), wanted, "{set}");
        files.reverse();
        assert_eq!(told(&cell, &files, &[]), wanted, "{set}");
    }
}

#[test]
fn a_routine_of_krl_is_that_of_its_file() {
    let cell = Cell::kuka(202);
    let axes: Vec<_> = degrees(&START).iter().enumerate().map(|(k, q)| format!("A{} {q:.6}", k + 1)).collect();
    let module = |name: &str, z: f64, ends: &str| {
        format!(
            "DEF {name}()\nSETUP()\nPTP {{{}}}\nLIN {{{}}}\n{ends}END\nDEF SETUP()\n$BASE=$NULLFRAME\n$TOOL={{X 0,Y 0,Z {z},A 0,B 0,C 0}}\nEND\n",
            axes.join(","),
            pose_text(&cell, &beside(1))
        )
    };
    assert_each_as_alone(&cell, ("a.src", module("a", 50.0, "")), ("b.src", module("b", 90.0, "")));
    // So is a handler.
    let interrupt = |name: &str, z: f64| {
        let text = module(name, z, "INTERRUPT DECL 4 WHEN $IN[1] DO HANDLER()\n");
        text + "DEF HANDLER()\n" + if z > 60.0 { "SETUP()\n" } else { "HALT\n" } + "END\n"
    };
    assert_each_as_alone(&cell, ("a.src", interrupt("a", 50.0)), ("b.src", interrupt("b", 90.0)));
}

#[test]
fn a_routine_of_krl_that_several_files_offer_may_be_any_of_them() {
    let cell = Cell::kuka(203);
    let (s, t) = status_turn(&beside(1));
    let main =
        format!("DEF a()\n$BASE=$NULLFRAME\nSETUP()\nPTP {{{},S {s},T {t}}}\nEND\n", pose_text(&cell, &beside(1)));
    let offers = |name: &str, first: &str, z: f64| {
        let setup = format!("SETUP()\n$TOOL={{X 0,Y 0,Z {z},A 0,B 0,C 0}}\nEND\n");
        format!("DEF {name}()\nEND\n{first} {setup}")
    };
    let unknown = vec![LeftReason::ToolUnknown.name().to_owned()];
    for (one, other, wanted) in [
        (offers("b", "GLOBAL DEF", 50.0), offers("c", "GLOBAL DEF", 50.0), (1, vec![])),
        (offers("b", "GLOBAL DEF", 50.0), offers("c", "GLOBAL DEF", 90.0), (0, unknown.clone())),
        (offers("b", "GLOBAL DEF", 50.0), offers("c", "DEF", 90.0), (1, vec![])),
        (offers("b", "DEF", 50.0), offers("c", "DEF", 50.0), (0, unknown.clone())),
    ] {
        let mut files = [("a.src", main.clone()), ("b.src", one), ("c.src", other)];
        assert_eq!(told(&cell, &files, &[]), wanted, "{files:?}");
        files.reverse();
        assert_eq!(told(&cell, &files, &[]), wanted, "{files:?}");
    }
}

#[test]
fn a_routine_of_a_script_is_that_of_its_file() {
    let cell = Cell::ur(204);
    let script = |name: &str, z: f64| {
        format!(
            "def setup():\n  set_tcp(p[0,0,{z},0,0,0])\nend\ndef {name}():\n  setup()\n  movej({START:?})\n  movel({})\nend\n{name}()\n",
            script_pose(&cell.nominal.base_from_tip(&beside(1)))
        )
    };
    assert_each_as_alone(&cell, ("a.script", script("a", 0.05)), ("b.script", script("b", 0.09)));
}

#[test]
fn a_local_routine_of_rapid_is_that_of_its_module() {
    let cell = Cell::kuka(205);
    let module = |name: &str, local: &str, body: &str| {
        format!(
            "MODULE {name}\nPROC r{name}()\nConfJ\\Off;\nrInit;\nMoveAbsJ [{:?},{NO_AXES}],v10,fine,tool0;\nMoveJ {},v10,fine,tool0;\nENDPROC\n{local}PROC rInit()\n{body}\nENDPROC\nENDMODULE\n",
            degrees(&START),
            robtarget(&cell, &beside(1))
        )
    };
    let shift = "PDispSet [[0,0,100],[1,0,0,0],[0,0,0],[0,0,0]];";
    let frame = vec![LeftReason::FrameUnknown.name().to_owned()];
    for local in ["LOCAL ", ""] {
        let mut files = [("a.mod", module("a", "LOCAL ", shift)), ("b.mod", module("b", local, "PDispOff;"))];
        assert_eq!(told(&cell, &files, &[]), (3, frame.clone()));
        files.reverse();
        assert_eq!(told(&cell, &files, &[]), (3, frame.clone()));
    }
    // One that other modules do not see hides no instruction of theirs.
    let main = module("a", "LOCAL ", "PDispOff;").replace("MoveJ", "ArcL");
    let hidden = "MODULE b\nLOCAL PROC ArcL(robtarget p)\nENDPROC\nENDMODULE\n".to_owned();
    assert_eq!(told(&cell, &[("a.mod", main), ("b.mod", hidden)], &[]), (2, vec![]));
}
