//! Universal Robots URScript.

use super::route::{EXPOSE_S, NAME, PULSE_S, Purpose, Route, SETTLE_S, SPEED};
use crate::urdf::JointKind;

/// Joints of every arm of this maker.
const AXES: usize = 6;

/// The script; `None` for an arm that is not one of six revolute joints.
pub(super) fn script(route: &Route<'_>) -> Option<String> {
    if route.joints.len() != AXES || !route.is_of_six(0) || route.kinds.contains(&JointKind::Prismatic) {
        return None;
    }
    let mut text = format!("def {NAME}():\n  # Joints in order: {}\n", route.joint_list());
    for visit in &route.visits {
        let q: Vec<String> = visit.readings.iter().map(|q| format!("{q:.7}")).collect();
        for halt in visit.halts() {
            text += &format!("  popup(\"{halt}\", blocking=True)\n");
        }
        text += &format!("  movej([{}], a=0.5, v={SPEED:?})\n", q.join(", "));
        if let Purpose::Image(image) | Purpose::MovePlate(_, image) = &visit.purpose {
            text += &format!(
                "  sleep({SETTLE_S:?})\n  # TRIGGER {image}\n  set_digital_out(0, True)\n  sleep({PULSE_S:?})\n  \
                 set_digital_out(0, False)\n  sleep({EXPOSE_S:?})\n"
            );
        }
    }
    Some(text + &format!("end\n{NAME}()\n"))
}
