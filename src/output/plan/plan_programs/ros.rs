//! ROS: a `trajectory_msgs/JointTrajectory` as YAML, with the times of the triggers beside it.

use super::route::{EXPOSE_S, Purpose, Route, SETTLE_S, TEACH};
use crate::output::text::{list, quoted};

/// Seconds and nanoseconds of a time.
fn duration(time_s: f64) -> String {
    let nanoseconds = (time_s * 1e9).round() as u64;
    format!("{{sec: {}, nanosec: {}}}", nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000)
}

/// The whole file: `trajectory` is the message, `triggers` says when to take which image, `pauses` when to move the plate, and where no straight way is free.
pub(super) fn trajectory(route: &Route<'_>) -> String {
    let mut points = String::new();
    let (mut triggers, mut pauses) = (String::new(), String::new());
    let mut time_s = 0.0;
    let mut point = |readings: &[f64], time_s: f64| {
        let zeros = vec![0.0; readings.len()];
        points += &format!(
            "    - positions: {}\n      velocities: {}\n      time_from_start: {}\n",
            list(readings.iter().copied()),
            list(zeros),
            duration(time_s)
        );
    };
    for visit in &route.visits {
        if let Purpose::MovePlate(place, _) = &visit.purpose {
            pauses += &format!("  - {{time_s: {time_s:?}, move_plate_to: {}}}\n", quoted(place));
        }
        if !visit.way_is_free {
            pauses += &format!("  - {{time_s: {time_s:?}, teach: {}}}\n", quoted(TEACH));
        }
        time_s += visit.time_s;
        point(&visit.readings, time_s);
        if let Purpose::Image(image) | Purpose::MovePlate(_, image) = &visit.purpose {
            triggers += &format!("  - {{time_s: {:?}, image: {}}}\n", time_s + SETTLE_S, quoted(image));
            time_s += SETTLE_S + EXPOSE_S;
            point(&visit.readings, time_s);
        }
    }
    let names: Vec<String> = route.joints.iter().map(|j| quoted(j)).collect();
    let list_or_none = |name: &str, rows: &str| match rows.is_empty() {
        true => format!("{name}: []\n"),
        false => format!("{name}:\n{rows}"),
    };
    format!(
        "# trajectory: trajectory_msgs/JointTrajectory; the arm rests at every image. triggers: when to take which image.\n\
         trajectory:\n  header: {{frame_id: \"\"}}\n  joint_names: [{}]\n  points:\n{points}{}{}",
        names.join(", "),
        list_or_none("triggers", &triggers),
        list_or_none("pauses", &pauses)
    )
}
