//! Names and numbers for people.

use crate::output::parameter_words::{LOCAL, split};
use crate::output::solution_json::{EstimateRecord, SolutionRecord};

/// True for the local error of a joint near a reading: noise of the series, no property of the robot.
pub(in crate::output::report) fn is_local(name: &str) -> bool {
    name.starts_with("robot/") && name.contains(LOCAL)
}

/// Name of a parameter in words: `robot/joint_3/origin.rx` -> "joint_3 origin, rotation about x".
pub(in crate::output::report) fn parameter(name: &str) -> String {
    let (block, component) = split(name);
    let part = component_words(component);
    let mut levels = block.splitn(2, '/');
    match (levels.next().unwrap_or_default(), levels.next()) {
        ("robot", Some(rest)) => match rest.strip_suffix("/origin") {
            Some(joint) => format!("{joint} origin, {part}"),
            None => format!("{rest} {part}"),
        },
        ("hand_camera", None) => format!("hand-eye transform, {part}"),
        ("hand_camera", Some(mounting)) => format!("hand-eye transform ({mounting}), {part}"),
        ("plate", Some(placement)) => format!("target pose ({placement}), {part}"),
        ("camera", Some(rest)) => {
            let camera = rest.rsplit_once('/').map_or(rest, |(camera, _)| camera);
            format!("{component} of camera {camera}")
        }
        ("plate_shape", None) => format!("plate {part}"),
        ("plate_shape", Some(plate)) => format!("plate {part} ({plate})"),
        _ => name.to_owned(),
    }
}

fn component_words(component: &str) -> String {
    match component {
        "x" | "y" | "z" => format!("shift along {component}"),
        "rx" | "ry" | "rz" => format!("rotation about {}", &component[1..]),
        "gear" => "gear scale".into(),
        "aspect" => "x/y scale".into(),
        _ => match component.split_once('_') {
            Some(("cos", k)) => format!("gear harmonic {k} (cosine)"),
            Some(("sin", k)) => format!("gear harmonic {k} (sine)"),
            Some(("gravity", k)) => format!("sag term {k}"),
            Some(("local", at)) => format!("local error near the reading {at}"),
            Some(("bow", axes)) => format!("bow {axes}"),
            _ => component.to_owned(),
        },
    }
}

/// Short name of a component, for heads of tables and lists: `cos_2` -> "cos 2q".
pub(in crate::output::report) fn short(component: &str) -> String {
    match component.split_once('_') {
        Some((wave @ ("cos" | "sin"), "1")) => format!("{wave} q"),
        Some((wave @ ("cos" | "sin"), k)) => format!("{wave} {k}q"),
        Some(("gravity", k)) => format!("sag {k}"),
        _ => component.replace('_', " "),
    }
}

/// Factor from SI to the unit for people, and that unit.
pub(in crate::output::report) fn unit(e: &EstimateRecord) -> (f64, &'static str) {
    let small = e.prior_sigma.is_some_and(|s| s < 1e-3);
    match (e.unit.as_str(), small) {
        ("m", _) => (1e3, "mm"),
        ("rad", true) => (60.0 * 180.0 / std::f64::consts::PI, "arcmin"),
        ("rad", false) => (180.0 / std::f64::consts::PI, "°"),
        ("1", true) => (1e6, "ppm"),
        ("px", _) => (1.0, "px"),
        _ => (1.0, ""),
    }
}

/// Decimals that show two significant digits of `sigma`.
fn decimals(sigma: f64) -> usize {
    // Rounded first, so that 0.998 is shown like 1.0.
    match format!("{sigma:.1e}").split_once('e').and_then(|(_, exponent)| exponent.parse::<i32>().ok()) {
        Some(exponent) if sigma > 0.0 => (1 - exponent).clamp(0, 9) as usize,
        _ => 3,
    }
}

/// "0.412 ± 0.035", both with as many decimals as sigma deserves.
pub(in crate::output::report) fn plus_minus(value: f64, sigma: f64) -> String {
    let d = decimals(sigma);
    format!("{} ± {sigma:.d$}", minus(&format!("{value:.d$}")))
}

/// With a true minus sign, and none before a zero.
fn minus(number: &str) -> String {
    match number.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| matches!(c, '0' | '.')) => rest.to_owned(),
        Some(rest) => format!("\u{2212}{rest}"),
        None => number.to_owned(),
    }
}

/// A number with a fixed number of decimals.
pub(in crate::output::report) fn fixed(value: f64, decimals: usize) -> String {
    minus(&format!("{value:.decimals$}"))
}

/// A positive number with three significant digits.
pub(in crate::output::report) fn significant(value: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    if value == 0.0 {
        return "0".into();
    }
    let d = (2.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    minus(&format!("{value:.d$}"))
}

/// A scale as few characters: 0.5, 20.
pub(in crate::output::report) fn plain(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let d = (-value.abs().log10().floor()).clamp(0.0, 6.0) as usize;
    let written = |d: usize| format!("{value:.d$}");
    let is_whole = |d: &usize| written(*d).parse().is_ok_and(|v: f64| (v - value).abs() < 1e-6 * value.abs());
    written((d..d + 3).find(is_whole).unwrap_or(d))
}

/// Semi-axes of an ellipsoid, mm.
pub(in crate::output::report) fn axes_mm(all: &[f64; 3]) -> String {
    all.map(|a| fixed(1e3 * a, 4)).join(" ")
}

/// "2nd", "11th".
pub(in crate::output::report) fn ordinal(n: usize) -> String {
    let ending = match (n % 10, n % 100) {
        (_, 11..=13) => "th",
        (1, _) => "st",
        (2, _) => "nd",
        (3, _) => "rd",
        _ => "th",
    };
    format!("{n}{ending}")
}

/// What the data are, in the plural.
pub(in crate::output::report) fn data(r: &SolutionRecord) -> &'static str {
    if r.images.is_empty() { "measurements" } else { "images" }
}

/// "1 image", "3 images".
pub(in crate::output::report) fn count(n: usize, what: &str) -> String {
    if n == 1 { format!("1 {what}") } else { format!("{n} {what}s") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_have_names_in_words() {
        for (name, words) in [
            ("robot/joint_3/origin.rx", "joint_3 origin, rotation about x"),
            ("robot/a/b.offset", "a/b offset"),
            ("robot/joint_3.cos_2", "joint_3 gear harmonic 2 (cosine)"),
            ("robot/joint_3.local_-0.3298", "joint_3 local error near the reading -0.3298"),
            ("hand_camera.rz", "hand-eye transform, rotation about z"),
            ("plate/placement_0.z", "target pose (placement_0), shift along z"),
            ("camera/front/lens.k1", "k1 of camera front"),
            ("plate_shape.scale", "plate scale"),
        ] {
            assert_eq!(parameter(name), words);
        }
    }

    #[test]
    fn ordinals_end_as_they_are_spoken() {
        let all = [1, 2, 3, 4, 11, 12, 13, 21, 22, 103, 111].map(ordinal);
        assert_eq!(all, ["1st", "2nd", "3rd", "4th", "11th", "12th", "13th", "21st", "22nd", "103rd", "111th"]);
    }

    #[test]
    fn numbers_show_what_their_sigma_deserves() {
        assert_eq!(plus_minus(-0.41234, 0.0354), "\u{2212}0.412 ± 0.035");
        assert_eq!(plus_minus(1234.5, 120.0), "1234 ± 120");
        assert_eq!(plus_minus(0.0, 0.9996), "0.0 ± 1.0");
        assert_eq!(fixed(-0.0001, 2), "0.00");
        assert_eq!(significant(0.01234), "0.0123");
        assert_eq!((plain(0.5), plain(20.0), plain(0.02)), ("0.5".into(), "20".into(), "0.02".into()));
        assert_eq!((plain(0.015), plain(2.5), plain(-0.25)), ("0.015".into(), "2.5".into(), "-0.25".into()), "steps");
    }
}
