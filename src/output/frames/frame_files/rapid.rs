//! ABB RAPID: `tooldata` and `wobjdata`, mm, quaternion with the scalar part first.

use super::written::{Frames, Named, numbers, variable};

fn frame(pose: &Named) -> String {
    let [qx, qy, qz, qw] = pose.pose.quaternion_xyzw();
    let position = numbers(pose.pose.xyz().map(|v| 1e3 * v), 4);
    format!("[[{position}],[{}]]", numbers([qw, qx, qy, qz], 9))
}

pub(super) fn text(frames: &Frames) -> String {
    let mut text = "MODULE RobotcalFrames\n".to_owned();
    if let Some(tool) = &frames.tool {
        let (name, pose) = (variable("tool", &tool.name), frame(tool));
        let load = match &frames.payload {
            Some(load) => {
                format!(
                    "[{},[{}],[1,0,0,0],0,0,0]",
                    numbers([load.mass_kg], 3),
                    numbers(load.centre_m.map(|v| 1e3 * v), 1)
                )
            }
            None => {
                text += "  ! The load is not known: enter it, or identify it, before the tool is used\n";
                "[-1,[0,0,0],[1,0,0,0],0,0,0]".to_owned()
            }
        };
        text += &format!("  PERS tooldata {name}:=[TRUE,{pose},{load}];\n");
    }
    if let Some(work) = &frames.work {
        let (name, pose) = (variable("wobj", &work.name), frame(work));
        text += &format!("  ! Work object in {}\n", frames.base);
        text += &format!("  PERS wobjdata {name}:=[FALSE,TRUE,\"\",{pose},[[0,0,0],[1,0,0,0]]];\n");
    }
    text + "ENDMODULE\n"
}
