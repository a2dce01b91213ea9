//! Measured frames beside programs with several tools and work objects, and poses that contradict the joints beside them.

use nalgebra::{Matrix3, Vector3};
use robotcal::Code;
use robotcal::assess::Limits;
use robotcal::geom::Pose;
use robotcal::model::robot::Robot;
use robotcal::programs::compensate::Compensated;
use robotcal::programs::{
    self, Language, LeftReason, MeasuredFrames, MeasuredTool, Models, Postures, Program, ProgramSetting, RobotFrames,
    SameFrames, TargetOutcome, TextFile,
};

use crate::programs_support::{Cell, assert_meets};

const READINGS: [f64; 6] = [0.2, -1.2, 1.5, 0.3, 0.8, 0.1];

/// What a user says beside the text.
#[derive(Default)]
struct Stated {
    tool: Option<Pose>,
    work: Option<Pose>,
    rad_per_unit: Option<f64>,
}

fn read(cell: &Cell, name: &str, text: &str, stated: &Stated) -> robotcal::Result<Program> {
    let setting = ProgramSetting {
        chain: &cell.nominal.chain,
        axes: &[0, 1, 2, 3, 4, 5],
        rad_per_unit: stated.rad_per_unit,
        base: Pose::identity(),
        tool: stated.tool,
        work: stated.work,
        axes_apart: false,
    };
    let file = TextFile { name: name.into(), bytes: text.into() };
    programs::read(Language::of_file(name.as_ref()).unwrap(), vec![file], &setting)
}

fn corrected(cell: &Cell, name: &str, text: &str, to: RobotFrames, stated: &Stated) -> Compensated {
    let limits = Limits::default();
    let frames = MeasuredFrames {
        to,
        from: None,
        base_within: None,
        tool: stated.tool,
        work: stated.work,
        unsaid: name.ends_with(".script").then(Pose::identity),
        same: SameFrames {
            work: (limits.same_work_m, limits.same_work_rad),
            tool: (limits.same_tool_m, limits.same_tool_rad),
            clearly_nearer: limits.frame_clearly_nearer,
        },
    };
    let program = read(cell, name, text, stated).unwrap();
    let models = Models {
        controller: &cell.nominal,
        from: &cell.nominal,
        to: &cell.real,
        frames: Some(&frames),
        beyond: [None; 2],
    };
    let postures = Postures { held: vec![false; 6], start: Some(READINGS.to_vec()) };
    programs::compensate(&program, models, &postures)
}

/// The reasons of what is left, by target.
fn left(done: &Compensated) -> Vec<Option<LeftReason>> {
    let reason = |outcome: &TargetOutcome| match outcome {
        TargetOutcome::Done(_) => None,
        TargetOutcome::Left(why) => Some(why.reason),
    };
    done.outcomes.iter().map(reason).collect()
}

fn krl(pose: &Pose) -> String {
    let ([x, y, z], [c, b, a]) = (pose.xyz().map(|v| 1e3 * v), pose.rpy().map(f64::to_degrees));
    format!("{{X {x:.6},Y {y:.6},Z {z:.6},A {a:.7},B {b:.7},C {c:.7}}}")
}

/// `READINGS` as numbers of degrees.
fn degrees() -> [String; 6] {
    READINGS.map(|q| format!("{:.6}", q.to_degrees()))
}

fn krl_axes() -> String {
    let axes: Vec<String> = (1..=6).zip(degrees()).map(|(k, q)| format!("A{k} {q}")).collect();
    format!("{{{}}}", axes.join(","))
}

fn jointtarget() -> String {
    format!("[[{}],[9E9,9E9,9E9,9E9,9E9,9E9]]", degrees().join(","))
}

fn rapid(pose: &Pose) -> String {
    let ([x, y, z], [qx, qy, qz, qw]) = (pose.xyz().map(|v| 1e3 * v), pose.quaternion_xyzw());
    format!("[[{x},{y},{z}],[{qw},{qx},{qy},{qz}]]")
}

/// Held by the robot or not.
fn tooldata(name: &str, held: &str, pose: &Pose) -> String {
    format!("PERS tooldata {name}:=[{held},{},[1,[0,0,0],[1,0,0,0],0,0,0]];\n", rapid(pose))
}

/// Standing still or moved by a unit.
fn wobjdata(name: &str, stands: &str, pose: &Pose) -> String {
    format!("PERS wobjdata {name}:=[FALSE,{stands},\"\",{},[[0,0,0],[1,0,0,0]]];\n", rapid(pose))
}

fn module(data: &str, body: &str) -> String {
    format!("MODULE m\n{data}PROC main()\n{body}\nENDPROC\nENDMODULE\n")
}

fn moved(pose: &Pose, x: f64) -> Pose {
    Pose::new(Matrix3::identity(), Vector3::new(x, 0.0, 0.0)) * *pose
}

/// One motion in each frame, to where the arm stands at `READINGS`; the frames are set by `$BASE` or `$TOOL`.
fn program(robot: &Robot, works: &[Pose], tools: &[Pose]) -> String {
    let flange = robot.base_from_tip(&READINGS);
    let mut text = "DEF a()\n".to_owned();
    for work in works {
        for tool in tools {
            let target = work.inverse() * flange * *tool;
            text += &format!("$BASE={}\n$TOOL={}\nPTP {}\n", krl(work), krl(tool), krl(&target));
        }
    }
    text + "END\n"
}

#[test]
fn one_of_several_work_objects_is_the_measured_one() {
    let cell = Cell::kuka(311);
    let measured = Pose::from_xyz_rpy([0.4, 0.1, 0.2], [0.0, 0.0, 0.3]);
    let tool = Pose::from_xyz_rpy([0.01, -0.02, 0.15], [0.0, 0.4, 0.0]);
    let of = |off: [f64; 2], stated: Option<Pose>| {
        let works = off.map(|x| moved(&measured, x));
        let to = RobotFrames { tool: None, work: Some(measured) };
        let stated = Stated { work: stated, ..Stated::default() };
        let done = corrected(&cell, "a.src", &program(&cell.nominal, &works, &[tool]), to, &stated);
        if let TargetOutcome::Done(correction) = &done.outcomes[0] {
            let wanted = measured * works[0].inverse() * cell.nominal.base_from_tip(&READINGS);
            assert_meets(&cell.real.base_from_tip(&correction.corrected), &wanted, "the place on the work object");
        }
        left(&done)
    };
    let other = Some(LeftReason::FrameUnknown);
    assert_eq!(of([0.002, 0.08], None), [None, other], "the second is another one");
    assert_eq!(of([0.06, 0.08], None), [other, other], "either may be the measured one");
    assert_eq!(of([0.06, 0.08], Some(moved(&measured, 0.06))), [None, other], "it is stated which");
    let stated = Some(measured);
    assert_eq!(of([0.06, 0.06], stated), [other, other], "it is stated that neither is");
    assert_eq!(of([0.002, 0.00201], None), [None, None], "one frame, written with few digits");
}

#[test]
fn one_of_several_tools_is_the_measured_one_and_a_point_has_no_turn() {
    let cell = Cell::kuka(312);
    let pose = Pose::from_xyz_rpy([0.01, -0.02, 0.15], [0.0, 0.4, 1.2]);
    let point = MeasuredTool::Point(pose.translation);
    let of = |tools: &[Pose], measured: MeasuredTool| {
        let to = RobotFrames { tool: Some(measured), work: None };
        let text = program(&cell.nominal, &[Pose::identity()], tools);
        corrected(&cell, "a.src", &text, to, &Stated::default())
    };
    let turned = Pose::new(pose.rotation * Pose::from_xyz_rpy([0.0; 3], [0.0, 0.0, 1.5]).rotation, pose.translation);
    let other = Some(LeftReason::ToolUnknown);
    let near = moved(&pose, 0.002);
    assert_eq!(left(&of(&[near, moved(&pose, 0.04)], point)), [None, other]);
    assert_eq!(left(&of(&[pose, turned], MeasuredTool::Pose(pose))), [None, other], "turned by 1.5 rad: another tool");
    let both = of(&[near, Pose::new(turned.rotation, near.translation)], point);
    assert_eq!(left(&both), [None, None], "one point, however its frames are turned");
    for outcome in &both.outcomes {
        let TargetOutcome::Done(correction) = outcome else { panic!("left") };
        assert!(correction.turn_rad < 0.02, "a point turns no tool: {} rad", correction.turn_rad);
    }
}

/// A pose of URScript is in the base of the controller; which work object it belongs to, only the user can say.
#[test]
fn the_stated_work_object_moves_no_pose_of_urscript() {
    let cell = Cell::kuka(313);
    let own = Pose::from_xyz_rpy([0.4, 0.1, 0.2], [0.0, 0.0, 0.3]);
    let measured = moved(&own, 0.004);
    let flange = cell.nominal.base_from_tip(&READINGS);
    let axis = nalgebra::Rotation3::from_matrix(&flange.rotation).scaled_axis();
    let [x, y, z] = flange.xyz();
    let text =
        format!("def a():\n  set_tcp(p[0,0,0,0,0,0])\n  movej(p[{x},{y},{z},{},{},{}])\nend\n", axis.x, axis.y, axis.z);
    let to = RobotFrames { tool: None, work: Some(measured) };
    let untold = corrected(&cell, "a.script", &text, to, &Stated::default());
    assert_eq!(left(&untold), [Some(LeftReason::FrameUnknown)]);
    let done = corrected(&cell, "a.script", &text, to, &Stated { work: Some(own), ..Stated::default() });
    let TargetOutcome::Done(correction) = &done.outcomes[0] else { panic!("{:?}", done.outcomes) };
    assert_meets(&cell.nominal.base_from_tip(&correction.programmed), &flange, "what the pose means");
    let wanted = measured * own.inverse() * flange;
    assert_meets(&cell.real.base_from_tip(&correction.corrected), &wanted, "the place on the work object");
}

#[test]
fn radians_said_to_be_degrees_are_refused_in_a_table() {
    let cell = Cell::kuka(314);
    let row = READINGS.map(|q| q.to_string()).join(",");
    let text = format!("{}\n{row}\n{row}\n{row}\n", cell.nominal.chain.readings.join(","));
    let code = |unit: f64| {
        let stated = Stated { rad_per_unit: Some(unit), ..Stated::default() };
        read(&cell, "t.csv", &text, &stated).err().map(|error| error.code)
    };
    assert_eq!([code(1.0), code(1f64.to_radians())], [None, Some(Code::RadiansAsDegrees)]);
}

#[test]
fn joint_columns_that_contradict_the_pose_of_their_row_leave_it() {
    let cell = Cell::kuka(315);
    let flange = cell.nominal.base_from_tip(&READINGS);
    let of = |off: f64| {
        let [x, y, z] = flange.xyz();
        let [qx, qy, qz, qw] = flange.quaternion_xyzw();
        let joints = READINGS.map(|q| format!("{:.3}", q + off)).join(",");
        let names = cell.nominal.chain.readings.join(",");
        let text = format!("x_m,y_m,z_m,qx,qy,qz,qw,{names}\n{x},{y},{z},{qx},{qy},{qz},{qw},{joints}\n");
        let stated = Stated { rad_per_unit: Some(1.0), ..Stated::default() };
        left(&corrected(&cell, "t.csv", &text, RobotFrames::default(), &stated))
    };
    assert_eq!([of(0.0), of(0.05)], [[None], [None]], "joints say the posture, roughly");
    assert_eq!(of(0.6), [Some(LeftReason::PostureUnknown)]);
}

/// Joint values belong to the tool that their text has, whatever tool is stated for those whose text has none.
#[test]
fn joints_take_the_tool_of_their_text() {
    let cell = Cell::kuka(316);
    let tool = Pose::from_xyz_rpy([0.01, -0.02, 0.15], [0.0, 0.4, 1.2]);
    let near = moved(&tool, 0.002);
    let other = Pose::from_xyz_rpy([0.2, 0.0, 0.05], [0.0, 1.0, 0.0]);
    let to = RobotFrames { tool: Some(MeasuredTool::Pose(tool)), work: None };
    let done =
        |name: &str, text: &str| corrected(&cell, name, text, to, &Stated { tool: Some(near), ..Stated::default() });
    let go = |tool: &Pose| format!("$TOOL={}\nPTP {}\n", krl(tool), krl_axes());
    let of_krl = |body: String| done("a.src", &format!("DEF a()\n{body}END\n"));
    let left_with_another: Option<LeftReason> = Some(LeftReason::ToolUnknown);
    assert_eq!(left(&of_krl(go(&near) + &go(&other))), [None, left_with_another]);
    assert_eq!(left(&of_krl(go(&Pose::identity()))), [None], "no tool was chosen");
    let text = format!("DEF a()\n{}END\n", go(&near));
    let untold = corrected(&cell, "a.src", &text, to, &Stated::default());
    let TargetOutcome::Done(correction) = &untold.outcomes[0] else { panic!("{:?}", untold.outcomes) };
    let wanted = cell.nominal.base_from_tip(&READINGS) * near * tool.inverse();
    assert_meets(&cell.real.base_from_tip(&correction.corrected), &wanted, "its own tool");

    let data = format!("{}CONST jointtarget j1:={};\n", tooldata("t2", "TRUE", &other), jointtarget());
    assert_eq!(left(&done("m.mod", &module(&data, "MoveAbsJ j1,v100,fine,t2;"))), [left_with_another]);
    let script = |tool: &Pose| {
        let axis = nalgebra::Rotation3::from_matrix(&tool.rotation).scaled_axis();
        let [x, y, z] = tool.xyz();
        let q = READINGS.map(|q| q.to_string()).join(",");
        format!("def a():\n  set_tcp(p[{x},{y},{z},{},{},{}])\n  movej([{q}])\nend\n", axis.x, axis.y, axis.z)
    };
    assert_eq!(
        [left(&done("a.script", &script(&near))), left(&done("a.script", &script(&other)))],
        [vec![None], vec![left_with_another]]
    );
}

/// A declared joint target to which the robot goes with two tools has none of them.
#[test]
fn joints_used_with_two_tools_are_left() {
    let cell = Cell::kuka(317);
    let tool = Pose::from_xyz_rpy([0.01, -0.02, 0.15], [0.0, 0.4, 1.2]);
    let to = RobotFrames { tool: Some(MeasuredTool::Pose(tool)), work: None };
    let of = |tools: [&Pose; 2]| {
        let goes: String = tools.iter().map(|t| format!("$TOOL={}\nPTP XP1\n", krl(t))).collect();
        let text = format!("DEF a()\nDECL E6AXIS XP1={}\n{goes}END\n", krl_axes());
        left(&corrected(&cell, "a.src", &text, to, &Stated::default()))
    };
    let other = moved(&tool, 0.1);
    assert_eq!(of([&tool, &Pose::identity()]), [None]);
    assert_eq!(of([&tool, &other]), [Some(LeftReason::ToolUnknown)]);
}

/// A tool in the room and one of several that a branch leaves are none that another one stands for, at joints as at poses.
#[test]
fn joints_of_a_tool_in_the_room_or_of_one_of_several_are_left() {
    let cell = Cell::kuka(318);
    let tool = Pose::from_xyz_rpy([0.01, -0.02, 0.15], [0.0, 0.4, 1.2]);
    let to = RobotFrames { tool: Some(MeasuredTool::Pose(tool)), work: None };
    let of = |name: &str, text: &str, stated: &Pose| {
        left(&corrected(&cell, name, text, to, &Stated { tool: Some(*stated), ..Stated::default() }))
    };
    let (unknown, other) = (Some(LeftReason::ToolUnknown), moved(&tool, 0.1));
    for (held, wanted) in [("TRUE", None), ("FALSE", unknown)] {
        let go = format!("MoveAbsJ {},v1,z1,t;", jointtarget());
        assert_eq!(of("m.mod", &module(&tooldata("t", held, &tool), &go), &tool), [wanted], "{held}");
    }
    let go = format!("PTP {}", krl_axes());
    let set = |tool: &Pose| format!("$TOOL={}\n", krl(tool));
    let maybe = |first: &Pose, second: &Pose| format!("{}IF $IN[1] THEN\n{}ENDIF\n{go}", set(first), set(second));
    for (body, wanted) in [
        (format!("{}{go}", set(&tool)), None),
        (format!("{}$IPO_MODE=#TCP\n{go}", set(&tool)), unknown),
        (maybe(&tool, &tool), None),
        (maybe(&tool, &other), unknown),
        (format!("$TOOL=GET()\n{go}"), None),
    ] {
        assert_eq!(of("a.src", &format!("DEF a()\n{body}\nEND\n"), &tool), [wanted], "{body}");
    }
    let q = READINGS.map(|q| q.to_string()).join(",");
    let script = |body: &str| format!("def a():\n{body}  movej([{q}])\nend\n");
    for (body, wanted) in
        [("", None), ("  set_tcp(f())\n", None), ("  if x:\n    set_tcp(p[0.3,0,0,0,0,0])\n  end\n", unknown)]
    {
        assert_eq!(of("a.script", &script(body), &tool), [wanted], "{body}");
    }
}

/// Work that a unit moves is none that another one stands for; the measured one is.
#[test]
fn joints_on_work_that_a_unit_moves_are_left() {
    let cell = Cell::kuka(319);
    let work = Pose::from_xyz_rpy([0.4, 0.1, 0.2], [0.0, 0.0, 0.3]);
    let to = RobotFrames { tool: None, work: Some(work) };
    let go = format!("MoveAbsJ {},v1,z1,tool0\\WObj:=w;", jointtarget());
    for (stands, wanted) in [("TRUE", None), ("FALSE", Some(LeftReason::FrameUnknown))] {
        let text = module(&wobjdata("w", stands, &work), &go);
        let stated = Stated { work: Some(work), ..Stated::default() };
        assert_eq!(left(&corrected(&cell, "m.mod", &text, to, &stated)), [wanted], "{stands}");
    }
}

/// Joints to which only an instruction goes that is no known move have the tool and the work object that it names.
#[test]
fn joints_of_an_unknown_instruction_have_the_frames_that_it_names() {
    let cell = Cell::kuka(320);
    let tool = Pose::from_xyz_rpy([0.01, -0.02, 0.15], [0.0, 0.4, 1.2]);
    let work = Pose::from_xyz_rpy([0.4, 0.1, 0.2], [0.0, 0.0, 0.3]);
    let other = |pose: &Pose| moved(pose, 0.2);
    let to = RobotFrames { tool: Some(MeasuredTool::Pose(tool)), work: Some(work) };
    let [t, w] = [tooldata("t1", "TRUE", &tool), wobjdata("w1", "TRUE", &work)];
    let [t2, w2] = [tooldata("t2", "TRUE", &other(&tool)), wobjdata("w2", "TRUE", &other(&work))];
    let data = format!("{t}{t2}{w}{w2}CONST jointtarget j1:={};\n", jointtarget());
    let is_measured = Stated { tool: Some(tool), work: Some(work), ..Stated::default() };
    let is_other = Stated { tool: Some(other(&tool)), work: Some(other(&work)), ..Stated::default() };
    let (no_tool, no_work) = (Some(LeftReason::ToolUnknown), Some(LeftReason::FrameUnknown));
    for (body, stated, wanted) in [
        ("CapAbsJ j1,v1,z1,t1\\WObj:=w1;", &Stated::default(), None),
        ("CapAbsJ j1,v1,z1,t1\\WObj:=w1;", &is_other, None),
        ("CapAbsJ j1,v1,z1,t2\\WObj:=w1;", &is_measured, no_tool),
        ("CapAbsJ j1,v1,z1,t1\\WObj:=w2;", &is_measured, no_work),
        ("CapAbsJ j1,v1,z1,t1;", &is_measured, None),
        ("CapAbsJ j1,v1,z1,t2;", &is_measured, no_tool),
        ("CapAbsJ j1,v1,z1,t1\\WObj:=w1;\nCapAbsJ j1,v1,z1,t2\\WObj:=w1;", &is_measured, no_tool),
        ("p1:=CalcRobT(j1,t2\\WObj:=w2);", &is_measured, None),
    ] {
        assert_eq!(left(&corrected(&cell, "m.mod", &module(&data, body), to, stated)), [wanted], "{body}");
    }
}
