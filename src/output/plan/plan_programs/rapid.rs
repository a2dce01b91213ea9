//! ABB RAPID: one module with joint targets.

use super::route::{ARM_AXES, Axes, EXPOSE_S, PULSE_S, Purpose, Route, SETTLE_S};

/// External axes in a joint target.
const EXTERNAL: usize = 6;
/// What RAPID writes for an external axis that is not there.
const ABSENT: &str = "9E9";

/// The module; `None` for more axes than a joint target has.
pub(super) fn module(route: &Route<'_>) -> Option<String> {
    if !route.is_of_six(EXTERNAL) {
        return None;
    }
    let mut targets = String::new();
    let mut body = String::new();
    for (k, visit) in route.visits.iter().enumerate() {
        let shown = route.shown(&visit.readings);
        let Axes { arm, external } = route.by_axis(&shown);
        let cells = |values: Vec<&f64>, most: usize, absent: &str| {
            let mut cells: Vec<String> = values.into_iter().map(|q| format!("{q:.5}")).collect();
            cells.resize(most, absent.to_owned());
            cells.join(",")
        };
        let (arm, external) = (cells(arm, ARM_AXES, "0"), cells(external, EXTERNAL, ABSENT));
        targets += &format!("  CONST jointtarget p{k} := [[{arm}],[{external}]];\n");
        for halt in visit.halts() {
            body += &format!("    TPWrite \"{halt}, then start\";\n    Stop;\n");
        }
        body += &format!("    MoveAbsJ p{k}\\NoEOffs, v100, fine, tool0;\n");
        if let Purpose::Image(image) | Purpose::MovePlate(_, image) = &visit.purpose {
            body += &format!(
                "    WaitTime {SETTLE_S:?};\n    ! TRIGGER {image}\n    PulseDO\\PLength:={PULSE_S:?}, doTrigger;\n    \
                 WaitTime {EXPOSE_S:?};\n"
            );
        }
    }
    let joints = route.axis_list();
    Some(format!(
        "MODULE RobotcalPlan\n  ! Joints in order: {joints}\n{targets}  PROC robotcal_plan()\n{body}  ENDPROC\nENDMODULE\n"
    ))
}
