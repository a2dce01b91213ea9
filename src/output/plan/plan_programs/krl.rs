//! KUKA KRL: a .src with the motions and a .dat with the axis positions.

use super::route::{Axes, EXPOSE_S, NAME, PULSE_S, Purpose, Route, SETTLE_S};

/// External axes, E1 and so on.
const EXTERNAL: usize = 6;

/// The .src; `None` for more axes than KRL has.
pub(super) fn source(route: &Route<'_>) -> Option<String> {
    if !route.is_of_six(EXTERNAL) {
        return None;
    }
    let mut text = format!(
        "&ACCESS RVP\nDEF {NAME}()\n; Joints in order: {}\n; Trigger: output 1. Slowly: 10 percent.\n\
         BAS(#INITMOV,0)\nBAS(#VEL_PTP,10)\n",
        route.axis_list()
    );
    for (k, visit) in route.visits.iter().enumerate() {
        for halt in visit.halts() {
            text += &format!("; {halt}, then continue\nHALT\n");
        }
        text += &format!("PTP XP{k}\n");
        if let Purpose::Image(image) | Purpose::MovePlate(_, image) = &visit.purpose {
            text += &format!(
                "WAIT SEC {SETTLE_S:?}\n; TRIGGER {image}\nPULSE($OUT[1],TRUE,{PULSE_S:?})\nWAIT SEC {EXPOSE_S:?}\n"
            );
        }
    }
    Some(text + "END\n")
}

/// The .dat; `None` as for [`source`].
pub(super) fn data(route: &Route<'_>) -> Option<String> {
    if !route.is_of_six(EXTERNAL) {
        return None;
    }
    let mut text = format!("&ACCESS RVP\nDEFDAT {NAME} PUBLIC\n");
    for (k, visit) in route.visits.iter().enumerate() {
        let shown = route.shown(&visit.readings);
        let Axes { arm, external } = route.by_axis(&shown);
        let named = [("A", arm), ("E", external)].into_iter().flat_map(|(letter, values)| {
            values.into_iter().enumerate().map(move |(k, q)| format!("{letter}{} {q:.5}", k + 1))
        });
        let axes: Vec<String> = named.collect();
        text += &format!("DECL E6AXIS XP{k}={{{}}}\n", axes.join(","));
    }
    Some(text + "ENDDAT\n")
}
