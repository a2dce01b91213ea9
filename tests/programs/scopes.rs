//! Data of one name in several modules and routines of RAPID.

use crate::programs_support::text::{NO_AXES as AXES, UNCHECKED, robtarget};
use crate::programs_support::{Cell, numbers};
use crate::said::assert_says;
use robotcal::Code;
use robotcal::programs::LeftReason;

fn literal(cell: &Cell, q: &[f64]) -> String {
    robtarget(&cell.nominal.base_from_tip(q), UNCHECKED)
}

fn tool(z: f64) -> String {
    format!("[TRUE,[[0,0,{z}],[1,0,0,0]],[1,[0,0,50],[1,0,0,0],0,0,0]]")
}

/// Moves that begin at a posture.
fn begin(q: &[f64]) -> String {
    let axes: Vec<f64> = q.iter().map(|v| v.to_degrees()).collect();
    format!("ConfJ\\Off;\nMoveAbsJ [{axes:?},{AXES}],v10,fine,tool0;\n")
}

/// Numbers of the first position of a text after correction of files, and of all names left with their reasons.
fn corrected(cell: &Cell, files: &[(&str, String)], which: usize, declared: &str) -> (Vec<f64>, Vec<String>) {
    let paths: Vec<_> = files.iter().map(|(name, text)| cell.write(name, text.as_bytes())).collect();
    let run = cell.compensate(&paths.iter().collect::<Vec<_>>(), &["--unordered"]);
    let text = run.file(files[which].0);
    let text = String::from_utf8_lossy(&text).into_owned();
    let line = text.lines().find(|line| line.contains(declared)).unwrap();
    let left = run.told().left.into_iter().map(|(_, name, reason)| format!("{name} {reason}")).collect();
    (numbers(line.split_once(":=").unwrap().1), left)
}

#[test]
fn local_data_hide_those_of_other_modules_and_routines() {
    let mut cell = Cell::kuka(131);
    let (a, b) = (cell.readings(), cell.readings());
    let module = |name: &str, local: &str, q: &[f64], z: f64| {
        format!(
            "MODULE {name}\n{local}PERS tooldata t:={};\n{local}CONST robtarget p:={};\nPROC r{name}()\n{}MoveJ p,v10,fine,t;\nENDPROC\nENDMODULE\n",
            tool(z),
            literal(&cell, q),
            begin(q)
        )
    };
    let alone = |text: String| corrected(&cell, &[("one.mod", text)], 0, "robtarget p");
    let (first, second) = (alone(module("A", "", &a, 50.0)), alone(module("B", "", &b, 90.0)));
    assert_eq!((&first.1, &second.1), (&vec![], &vec![]));
    let files = [("a.mod", module("A", "LOCAL ", &a, 50.0)), ("b.mod", module("B", "", &b, 90.0))];
    assert_eq!(corrected(&cell, &files, 0, "robtarget p"), first);
    assert_eq!(corrected(&cell, &files, 1, "robtarget p"), second);
    let within = format!(
        "MODULE A\nPERS tooldata t:={};\nPERS tooldata u:={};\nCONST robtarget p:={};\nPROC ra()\n{}MoveJ p,v10,fine,t;\nENDPROC\nPROC rb()\n CONST robtarget p:={};\n{}MoveJ p,v10,fine,u;\nENDPROC\nENDMODULE\n",
        tool(50.0),
        tool(90.0),
        literal(&cell, &a),
        begin(&a),
        literal(&cell, &b),
        begin(&b)
    );
    let files = [("a.mod", within)];
    assert_eq!(corrected(&cell, &files, 0, "CONST robtarget p"), first);
    assert_eq!(corrected(&cell, &files, 0, " CONST robtarget p"), second);
}

#[test]
fn two_global_data_of_one_name_are_named_by_their_places() {
    let mut cell = Cell::kuka(132);
    let q = cell.readings();
    let text = format!("MODULE m\nCONST robtarget p:={};\nENDMODULE\n", literal(&cell, &q));
    let files = ["a.mod", "b.mod"].map(|name| cell.write(name, text.as_bytes()));
    let said = cell.compensate(&files.iter().collect::<Vec<_>>(), &[]).expect(2).said();
    assert_says(&said, Code::ProgramTwin, &["a.mod:2", "b.mod:2"]);
}

#[test]
fn a_target_that_is_another_is_corrected_there() {
    let mut cell = Cell::kuka(133);
    let q = cell.readings();
    let text = |moves: &str| {
        format!(
            "MODULE m\nCONST robtarget c:=p;\nCONST robtarget p:={};\nPROC main()\n{}{moves}ENDPROC\nENDMODULE\n",
            literal(&cell, &q),
            begin(&q)
        )
    };
    let of = |moves: &str| corrected(&cell, &[("m.mod", text(moves))], 0, "robtarget p");
    let direct = of("MoveJ p,v10,fine,tool0;\n");
    assert_eq!(direct.1, Vec::<String>::new());
    assert_eq!(of("MoveJ c,v10,fine,tool0;\n"), direct);
    let differing = of("MoveJ p,v10,fine,tool0;\nMoveJ c,v10,fine,tool0\\WObj:=wobj1;\n").1;
    assert_eq!(differing, [format!("MoveJ {}", LeftReason::FrameUnknown.name())]);
}

#[test]
fn letters_of_latin_1_belong_to_names_of_rapid() {
    let mut cell = Cell::kuka(134);
    let q = cell.readings();
    let text = format!(
        "MODULE m\nPERS tooldata t:={};\nPERS tooldata tÄ:={};\nPERS tooldata tÖ:={};\nCONST robtarget pGrün:={};\nPROC main()\n{}MoveJ pGrün,v10,fine,tä;\nENDPROC\nENDMODULE\n",
        tool(50.0),
        tool(90.0),
        tool(70.0),
        literal(&cell, &q),
        begin(&q)
    );
    let plain = text.replace('Ä', "A").replace('ä', "a").replace('Ö', "O").replace('ü', "u");
    let (wanted, left) = corrected(&cell, &[("m.mod", plain)], 0, "robtarget pGrun");
    assert_eq!(left, Vec::<String>::new());
    let latin: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    for bytes in [text.as_bytes().to_vec(), latin] {
        let file = cell.write("m.mod", &bytes);
        let run = cell.compensate(&[&file], &["--unordered"]).expect(0);
        let new = run.file("m.mod");
        let new = String::from_utf8_lossy(&new).into_owned();
        let line = new.lines().find(|line| line.starts_with("CONST robtarget")).unwrap();
        assert_eq!(numbers(line.split_once(":=").unwrap().1), wanted);
    }
}

#[test]
fn a_data_list_of_krl_belongs_to_its_program() {
    let mut cell = Cell::kuka(135);
    let (a, b) = (cell.readings(), cell.readings());
    let files = |name: &str, q: &[f64], z: f64| {
        let pose = crate::programs_support::text::krl_pose(&cell, q);
        [
            (
                format!("{name}.src"),
                format!("DEF {name}()\n$BASE=$NULLFRAME\n$TOOL={{X 0,Y 0,Z {z},A 0,B 0,C 0}}\nPTP XP1\nEND\n"),
            ),
            (format!("{name}.dat"), format!("DEFDAT {name}\nDECL E6POS XP1={pose}\nENDDAT\n")),
        ]
    };
    let corrected = |files: &[(String, String)]| {
        let paths: Vec<_> = files.iter().map(|(name, text)| cell.write(name, text.as_bytes())).collect();
        let run = cell.compensate(&paths.iter().collect::<Vec<_>>(), &["--unordered"]).expect(0);
        let lists = files.iter().filter(|(name, _)| name.ends_with(".dat"));
        lists.map(|(name, _)| run.text(name)).collect::<Vec<_>>()
    };
    let (mut first, second) = (files("one", &a, 50.0), files("two", &b, 90.0));
    let both = |first: &[(String, String); 2]| corrected(&[first.clone(), second.clone()].concat());
    assert_eq!(both(&first), [corrected(&first), corrected(&second)].concat());
    // One that is there for all is hidden where a program has its own.
    first[1].1 = first[1].1.replace("DECL E6POS", "DECL GLOBAL E6POS");
    assert_eq!(both(&first), [corrected(&first), corrected(&second)].concat());
}
