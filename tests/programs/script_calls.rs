//! Calls of URScript that are no moves to a target in numbers: what moves on top, moves elsewhere, or is in none of the files.

use crate::programs_support::Cell;
use crate::programs_support::text::{START, beside, script_pose, told};
use robotcal::programs::LeftReason;

/// A program; `@` stands for a new pose each time.
fn script(cell: &Cell, routines: &str, body: &str) -> String {
    let mut text = format!("def p():\n{routines}  set_tcp(p[0,0,0.05,0,0,0])\n  movej({START:?})\n{body}end\n");
    for k in 1.. {
        let Some(at) = text.find('@') else { break };
        text.replace_range(at..=at, &script_pose(&cell.nominal.base_from_tip(&beside(k))));
    }
    text
}

/// Asserts what becomes of targets beside the first one.
fn assert_told(cell: &Cell, (routines, body): (&str, &str), corrected: usize, left: &[LeftReason]) {
    let mut left: Vec<String> = left.iter().map(|reason| reason.name().to_owned()).collect();
    let (done, mut found) = told(cell, &[("a.script", script(cell, routines, body))], &[]);
    left.sort();
    found.sort();
    assert_eq!((done, found), (1 + corrected, left), "{routines}{body}");
}

#[test]
fn what_moves_on_top_of_targets_is_followed_through_routines_branches_and_loops() {
    let cell = Cell::ur(211);
    let frame = LeftReason::FrameUnknown;
    let conveyor = "  def on():\n    track_conveyor_linear(p[1,0,0,0,0,0],1000)\n  end\n  def off():\n    stop_conveyor_tracking()\n  end\n";
    for (routines, body, corrected, left) in [
        (conveyor, "  on()\n  movel(@)\n  off()\n  movel(@)\n", 1, vec![frame]),
        (conveyor, "  movel(@)\n  if x:\n    on()\n  end\n  movel(@)\n", 1, vec![frame]),
        (
            "",
            "  if x:\n    path_offset_enable()\n  else:\n    path_offset_disable()\n  end\n  movel(@)\n",
            0,
            vec![frame],
        ),
        ("", "  while x:\n    movel(@)\n    path_offset_enable()\n  end\n", 0, vec![frame]),
        (
            "",
            "  while x:\n    path_offset_enable()\n    movel(@)\n    path_offset_disable()\n  end\n  movel(@)\n",
            1,
            vec![frame],
        ),
        ("", "  path_offset_enable()\n  stop_conveyor_tracking()\n  movel(@)\n", 0, vec![frame]),
        ("  def go():\n    movel(@)\n  end\n", "  path_offset_enable()\n  go()\n", 0, vec![frame]),
        (
            "  thread t():\n    track_conveyor_linear(p[1,0,0,0,0,0],9)\n  end\n",
            "  k=run t()\n  movel(@)\n",
            0,
            vec![frame],
        ),
    ] {
        assert_told(&cell, (routines, body), corrected, &left);
    }
}

#[test]
fn behind_a_motion_that_the_text_does_not_tell_the_posture_is_not_that_before_it() {
    let cell = Cell::ur(212);
    let posture = LeftReason::PostureUnknown;
    for (routines, body, corrected, left) in [
        ("", "  speedj([0,0,0,0,-1.0,0],1.2,1.5)\n  movej(@)\n", 0, vec![posture]),
        ("", "  freedrive_mode()\n  sleep(9)\n  end_freedrive_mode()\n  movej(@)\n", 0, vec![posture]),
        ("", "  servoj(get_target_joint_positions())\n  movej(@)\n", 0, vec![LeftReason::Computed, posture]),
        ("  def turn():\n    speedj([0,0,0,0,-1.0,0],1.2,1.5)\n  end\n", "  turn()\n  movel(@)\n", 0, vec![posture]),
        // A path of the tool keeps it.
        ("", "  speedl([0,0,-0.1,0,0,0],0.5,0.2)\n  movel(@)\n", 1, vec![]),
        ("", "  force_mode(p[0,0,0,0,0,0],[0,0,1,0,0,0],[0,0,9,0,0,0],2,[1,1,1,1,1,1])\n  movel(@)\n", 1, vec![]),
    ] {
        assert_told(&cell, (routines, body), corrected, &left);
    }
}

#[test]
fn positions_that_a_call_in_none_of_the_files_is_given_are_left() {
    let cell = Cell::ur(213);
    let no_target = LeftReason::NotATarget;
    let home = format!("  movej({START:?})\n");
    let hands_on = "  def go(x):\n    cap_move(x)\n  end\n  def first(x):\n    go(x)\n  end\n";
    for (routines, body, corrected, left) in [
        ("", "  cap_move(@)\n".to_owned() + &home + "  movel(@)\n", 2, vec![no_target]),
        ("", "  cap_move(1,[@,@])\n".to_owned(), 0, vec![no_target, no_target]),
        ("", "  global w=@\n  cap_move(w)\n".to_owned(), 0, vec![no_target]),
        ("", "  x=cap_reached(target=@)\n".to_owned(), 0, vec![no_target]),
        ("", "  w=@\n  movel(w)\n  cap_move(w)\n".to_owned(), 1, vec![]),
        (hands_on, "  go(@)\n".to_owned(), 0, vec![no_target]),
        (hands_on, "  first(@)\n".to_owned(), 0, vec![no_target]),
        // Functions of the language, routines of the files and other computers do not go there.
        (
            "",
            "  w=@\n  d=pose_dist(w,@)\n  if (point_dist(w,@) > 0.1):\n    textmsg(\"far\", w)\n  end\n".to_owned(),
            0,
            vec![],
        ),
        ("", "  w=@\n  v=pose_trans(inv(w),make_list(3,w)[0])\n  movel(@)\n".to_owned(), 1, vec![]),
        ("", "  w=@\n  cap_move(w)\n  cap_move(w)\n".to_owned(), 0, vec![no_target]),
        ("  def far(x):\n    return pose_dist(x,@)\n  end\n", "  d=far(@)\n".to_owned(), 0, vec![]),
        ("", "  camera=rpc_factory(\"xmlrpc\",\"http://a\")\n  camera.look(@)\n".to_owned(), 0, vec![]),
        ("", "  w=@\n  cap_height(w[2])\n".to_owned(), 0, vec![]),
        ("", "  cap_close(40)\n  movel(@)\n".to_owned(), 1, vec![]),
        // Joint values are a position where the name is that of a motion.
        ("", format!("  my_movej({START:?})\n"), 0, vec![no_target]),
        ("", format!("  moveh([0, -1.2, d2r(9), 0.5, -1, 0.1], a=1)\n{home}"), 1, vec![no_target]),
        ("", format!("  q={START:?}\n  my_movej(q)\n"), 0, vec![no_target]),
        ("", format!("  q={START:?}\n  movej(q)\n  my_movej(q)\n"), 1, vec![]),
        ("", format!("  set_limits({START:?})\n  my_movej([1,2,3])\n{home}"), 1, vec![]),
    ] {
        assert_told(&cell, (routines, &body), corrected, &left);
    }
}

#[test]
fn behind_a_call_that_may_go_to_a_position_the_posture_is_not_known() {
    let cell = Cell::ur(214);
    let (no_target, posture) = (LeftReason::NotATarget, LeftReason::PostureUnknown);
    let file = cell.write("a.script", script(&cell, "", "  cap_move(@)\n  movel(@)\n").as_bytes());
    let told = cell.compensate(&[&file], &["--unordered"]).expect(1).told();
    assert!(told.has(4, "cap_move", no_target) && told.has(5, "movel", posture), "{told:?}");
}

/// On an arc in fixed mode the tool keeps its orientation to the path, whatever its targets say.
#[test]
fn targets_of_an_arc_on_which_the_tool_is_turned_with_the_path_are_left() {
    let cell = Cell::ur(215);
    let kept = vec![LeftReason::OrientationKept; 2];
    for (mode, left) in [
        ("", vec![]),
        (", 1.2, 0.25, 0, 0", vec![]),
        (", mode=0", vec![]),
        (", 1.2, 0.25, 0, 1", kept.clone()),
        (", a=1.2, mode=1", kept.clone()),
        (", a=1.2,\n    mode=0\n  ", vec![]),
        (", a=1.2,\n    mode=1\n  ", kept.clone()),
        (", acc=1.2, mode=1", kept.clone()),
        (", acc=1.2", kept.clone()),
        (", mode=0+m", kept.clone()),
        (", mode=m", kept),
    ] {
        assert_told(&cell, ("", &format!("  movec(@, @{mode})\n")), 2 - left.len(), &left);
    }
}
