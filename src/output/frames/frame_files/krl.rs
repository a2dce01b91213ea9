//! KUKA KRL: `$TOOL` and `$BASE`, mm and degrees, `R = Rz(A) Ry(B) Rx(C)`.

use super::written::{Frames, NAME, Named};

fn frame(pose: &Named) -> String {
    let [x, y, z] = pose.pose.xyz().map(|v| 1e3 * v + 0.0);
    let [c, b, a] = pose.pose.rpy().map(|v| v.to_degrees() + 0.0);
    format!("{{X {x:.4},Y {y:.4},Z {z:.4},A {a:.6},B {b:.6},C {c:.6}}}")
}

pub(super) fn text(frames: &Frames) -> String {
    let mut text = format!("&ACCESS RVP\nDEF {NAME}()\n");
    if let Some(tool) = &frames.tool {
        let value = frame(tool);
        text += &format!("; TCP on {}. In $config.dat: TOOL_DATA[n]={value}\n$TOOL={value}\n", frames.tip);
    }
    if let Some(work) = &frames.work {
        let value = frame(work);
        text += &format!("; Base in {}. In $config.dat: BASE_DATA[n]={value}\n$BASE={value}\n", frames.base);
    }
    text + "END\n"
}
