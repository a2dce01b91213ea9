//! Loops that are left or begun again from within, and threads: what they set for the text behind them.

use crate::programs_support::Cell;
use crate::programs_support::text::{beside, krl_moves, krl_pose as krl, krl_text, script_pose, told};
use robotcal::geom::Pose;
use robotcal::programs::LeftReason;

#[test]
fn behind_a_loop_of_krl_that_is_left_from_within_holds_what_held_there() {
    let mut cell = Cell::kuka(101);
    let q = cell.readings();
    let pose = krl(&cell, &q);
    let moves = |body: &str| krl_moves(&cell, &krl_text(&pose, body));
    let [flange, other] = ["MOVE", "SET\nMOVE"].map(moves);
    let out = "IF $IN[1] THEN\nEXIT\nENDIF";
    for (body, wanted) in [
        (format!("LOOP\nSET\n{out}\n$TOOL=$NULLFRAME\nENDLOOP\nMOVE"), &other),
        (format!("LOOP\n{out}\nSET\n$TOOL=$NULLFRAME\nENDLOOP\nMOVE"), &flange),
        (format!("LOOP\nSET\nLOOP\n$TOOL=$NULLFRAME\n{out}\nENDLOOP\nSET\n{out}\nENDLOOP\nMOVE"), &other),
        (format!("SET\nREPEAT\n{out}\nUNTIL $IN[2]\nMOVE"), &other),
    ] {
        assert_eq!(&moves(&body), wanted, "{body}");
    }
    let (tool, work) = (LeftReason::ToolUnknown.name().to_owned(), LeftReason::FrameUnknown.name().to_owned());
    for (body, left) in [
        (format!("REPEAT\nSET\n{out}\n$TOOL=$NULLFRAME\nUNTIL $IN[2]\nMOVE"), &tool),
        (format!("FOR I=1 TO 3\nSET\n{out}\n$TOOL=$NULLFRAME\nENDFOR\nMOVE"), &tool),
        (format!("LOOP\n{out}\n$BASE={{X 9,Y 0,Z 0,A 0,B 0,C 0}}\n{out}\nENDLOOP\nMOVE"), &work),
    ] {
        assert_eq!(told(&cell, &[("a.src", krl_text(&pose, &body))], &[]), (0, vec![left.clone()]), "{body}");
    }
}

#[test]
fn loops_and_threads_of_scripts_hand_on_what_they_set() {
    let mut cell = Cell::ur(102);
    let q = cell.readings();
    let pose = script_pose(&cell.nominal.base_from_tip(&q));
    let (set, unset) = ("set_tcp(p[0,0,0.1,0,0,0])", "set_tcp(p[0,0,0,0,0,0])");
    let text = |body: &str| format!("def p():\n  {unset}\n  movej({q:?})\n{body}end\n");
    let step = format!("  movel({pose})\n");
    let corrected = |body: &str| {
        let file = cell.write("a.script", text(body).as_bytes());
        let new = cell.compensate(&[&file], &["--unordered"]).expect(0).text("a.script");
        new.lines().find(|l| l.trim().starts_with("movel")).map(|l| l.trim().to_owned())
    };
    let other = corrected(&format!("  {set}\n{step}"));
    assert_ne!(other, corrected(&step));
    for condition in ["True", "(True)"] {
        let body =
            format!("  while {condition}:\n    {set}\n    if a:\n      break\n    end\n    {unset}\n  end\n{step}");
        assert_eq!(corrected(&body), other, "{body}");
    }
    let tool = vec![LeftReason::ToolUnknown.name().to_owned()];
    for (body, left) in [
        (format!("  while a:\n    {set}\n    if b:\n      break\n    end\n    {unset}\n  end\n{step}"), &tool),
        (format!("  while a:\n  {step}    {set}\n    if b:\n      continue\n    end\n    {unset}\n  end\n"), &tool),
        (format!("  while a:\n  {step}    if b:\n      continue\n    end\n    {set}\n    {unset}\n  end\n"), &vec![]),
        (format!("  thread t():\n    {set}\n  end\n  h = run t()\n{step}"), &tool),
        (format!("  thread t():\n    sleep(1)\n  end\n  h = run t()\n{step}"), &vec![]),
    ] {
        let (done, reasons) = told(&cell, &[("a.script", text(&body))], &[]);
        assert_eq!((done, &reasons), (2 - left.len(), left), "{body}");
    }
}

/// The tool that `get_inverse_kin` names is at its pose, not that of `set_tcp`.
#[test]
fn the_tool_of_inverse_kinematics_is_the_one_that_it_names() {
    let mut cell = Cell::ur(103);
    let q = cell.readings();
    let pose = Pose::new(nalgebra::Matrix3::identity(), nalgebra::Vector3::new(0.0, 0.0, 0.1));
    let pose = script_pose(&(cell.nominal.base_from_tip(&q) * pose));
    let (long, short) = ("p[0,0.01,0.12,0.1,0,0]", "p[0,0,0.1,0,0,0]");
    let text = |tool: &str, arguments: &str| {
        format!("def p():\n  t = {long}\n  set_tcp({tool})\n  movej(get_inverse_kin({arguments}))\nend\n")
    };
    let corrected = |tool: &str, arguments: &str| {
        let file = cell.write("a.script", text(tool, arguments).as_bytes());
        let new = cell.compensate(&[&file], &["--unordered"]).expect(0).text("a.script");
        let line = new.lines().find(|l| l.contains("movej")).unwrap();
        let pose = line.split_once("p[").unwrap().1.split_once(']').unwrap().0.to_owned();
        assert_eq!(text(tool, arguments).matches(&pose).count(), 0);
        pose
    };
    let active = |tool: &str| corrected(tool, &format!("{pose}, qnear={q:?}"));
    let (by_long, by_short) = (active(long), active(short));
    assert_ne!(by_long, by_short);
    for (arguments, wanted) in [
        (format!("{pose}, qnear={q:?}, tcp={long}"), &by_long),
        (format!("{pose}, tcp={long}, qnear={q:?}"), &by_long),
        (format!("qnear={q:?}, tcp=t, x={pose}"), &by_long),
        (format!("{pose}, {q:?}, 1e-10, 1e-10, {long}"), &by_long),
        (format!("x={pose}, qnear={q:?}, maxPositionError=1e-6, tcp=\"active_tcp\""), &by_short),
    ] {
        assert_eq!(&corrected(short, &arguments), wanted, "{arguments}");
    }
    for (arguments, reason) in [
        (format!("{pose}, {q:?}, tcp=get_tcp_offset()"), LeftReason::ToolUnknown),
        (format!("{pose}, {q:?}, wrist={long}"), LeftReason::Computed),
    ] {
        let told = told(&cell, &[("a.script", text(short, &arguments))], &[]);
        assert_eq!(told, (0, vec![reason.name().to_owned()]), "{arguments}");
    }
}

/// A thread goes on beside the text: it may set the tool behind every statement that takes time, and what runs it may do so beside the thread.
#[test]
fn what_a_thread_sets_may_hold_until_it_has_ended() {
    let cell = Cell::ur(104);
    let step = |k: usize| format!("  movel({})\n", script_pose(&cell.nominal.base_from_tip(&beside(k))));
    let [first, second] = [step(1), step(2)];
    let set = |z: f64| format!("  set_tcp(p[0,0,{z},0,0,0])\n");
    let (own, other) = (set(0.1), set(0.2));
    let thread = |body: &str| format!("  thread t():\n  sleep(3)\n{body}  end\n");
    let sets = thread(&other);
    let tool = LeftReason::ToolUnknown.name();
    for (body, left) in [
        (format!("{sets}  k=run t()\n{own}{first}{second}"), 1),
        (format!("{sets}  k=run t()\n{own}  sleep(1)\n{first}{second}"), 2),
        (format!("{sets}  k=run t()\n{own}  sync()\n{first}{own}{second}"), 1),
        (format!("{sets}  k=run t()\n  join k\n{own}{first}{second}"), 0),
        (format!("{sets}  k=run t()\n{own}  join k\n{first}{second}"), 2),
        (format!("{sets}  k=run t()\n{own}  kill k\n{first}{second}"), 0),
        (format!("{sets}  k=run t()\n  kill k\n{own}{first}{second}"), 0),
        (format!("{sets}  k=run t()\n  join l\n{own}{first}{second}"), 1),
        (format!("{sets}  k=run t()\n  k=run t()\n  join k\n{own}{first}{second}"), 1),
        (format!("{sets}  k=run t()\n  k=run u()\n  join k\n{own}{first}{second}"), 1),
        (format!("{sets}  while a:\n  k=run t()\n  join k\n{own}{first}{second}  end\n"), 0),
        (format!("{sets}  if a:\n  k=run t()\n  end\n{own}{first}{second}"), 1),
        // What it sets for a while counts, too, and so does what it calls.
        (format!("{}  k=run t()\n{own}{first}{second}", thread(&format!("{other}  sleep(1)\n{own}"))), 1),
        (format!("  def s():\n{other}  end\n{}  k=run t()\n{own}{first}{second}", thread("  s()\n")), 1),
        (format!("{}  k=run t()\n{own}{first}{second}", thread(&own)), 0),
        (format!("{sets}  def go():\n{first}{second}  end\n  k=run t()\n{own}  go()\n"), 1),
        (format!("{sets}  def s():\n{own}  end\n  k=run t()\n  s()\n{first}{second}"), 1),
        // The thread has what is set beside it.
        (format!("{}{own}  k=run t()\n  sleep(1)\n{other}", thread(&format!("{first}{second}"))), 2),
        (format!("{}{own}  k=run t()\n  sleep(1)\n{other}", thread(&format!("{own}{first}{second}"))), 1),
        (format!("{}{own}  k=run t()\n  sleep(1)\n{own}", thread(&format!("{first}{second}"))), 0),
        (format!("{}{own}  k=run t()\n  join k\n{other}", thread(&format!("{first}{second}"))), 0),
    ] {
        let start = beside(0);
        let text = format!("def p():\n{own}  movej({start:?})\n{body}end\n");
        let near: Vec<String> = start.iter().map(|q| q.to_degrees().to_string()).collect();
        let near = format!("--start={}", near.join(","));
        assert_eq!(told(&cell, &[("a.script", text)], &[&near]), (3 - left, vec![tool.to_owned(); left]), "{body}");
    }
}
