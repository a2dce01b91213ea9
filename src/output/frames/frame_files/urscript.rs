//! Universal Robots URScript: `set_tcp` and a plane (feature), m and rotation vector in rad.

use super::written::{Frames, NAME, Named, numbers, variable};
use crate::geom::log_so3;

fn frame(pose: &Named) -> String {
    let turn = log_so3(&pose.pose.rotation);
    format!("p[{},{}]", numbers(pose.pose.xyz(), 7), numbers([turn.x, turn.y, turn.z], 9))
}

pub(super) fn text(frames: &Frames) -> String {
    let mut text = format!("def {NAME}():\n");
    if let Some(tool) = &frames.tool {
        text += &format!("  # TCP on {}\n  set_tcp({})\n", frames.tip, frame(tool));
    }
    if let Some(work) = &frames.work {
        text += &format!("  # Plane in {}\n  global {}={}\n", frames.base, variable("plane", &work.name), frame(work));
    }
    text + "end\n"
}
