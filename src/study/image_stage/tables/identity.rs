//! The section on identity.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::{Claim, Section};
use crate::output::report::page::svg::{Anchor, Svg};
use crate::plan::plate_design::LEAST_MINOR_AXIS_PX;
use crate::study::image_stage::{Appearance, DISPLACED_PX, DISPLACED_SIGMAS, Identity, IdentityView, MirrorAnswer};

/// Share of the wholly visible markers that must be found.
const LEAST_RECALL: f64 = 0.99;
/// Failing views that are listed.
const LISTED: usize = 20;

/// Sums over some views.
#[derive(Debug, Default, Clone, Copy)]
struct Sums {
    views: usize,
    unidentified: usize,
    visible: usize,
    found: usize,
    wrong: usize,
    displaced: usize,
}

impl Sums {
    fn of<'a>(views: impl Iterator<Item = &'a IdentityView>) -> Self {
        views.fold(Self::default(), |s, v| Self {
            views: s.views + 1,
            unidentified: s.unidentified + usize::from(!v.identified),
            visible: s.visible + v.visible,
            found: s.found + v.found,
            wrong: s.wrong + v.wrong,
            displaced: s.displaced + v.displaced,
        })
    }

    fn recall(&self) -> f64 {
        self.found as f64 / self.visible.max(1) as f64
    }
}

/// Groups of views: a name and which views belong to it.
type Group = (String, Box<dyn Fn(&IdentityView) -> bool>);

fn by_count() -> Vec<Group> {
    let limits = [20, 40, 80, 160, 320, usize::MAX];
    let group = |k: usize| -> Group {
        let (low, high) = (limits[k], limits[k + 1]);
        let name = if high == usize::MAX { format!("{low} or more") } else { format!("{low} to {}", high - 1) };
        (name, Box::new(move |v| (low..high).contains(&v.visible)))
    };
    (0..limits.len() - 1).map(group).collect()
}

fn by_tilt() -> Vec<Group> {
    let group = |k: u32| -> Group {
        let (low, high) = (15.0 * f64::from(k), 15.0 * f64::from(k + 1));
        (format!("{low:.0} to {high:.0}"), Box::new(move |v| v.tilt_deg >= low && v.tilt_deg < high + 1e-9))
    };
    (0..4).map(group).collect()
}

fn by_disturbance() -> Vec<Group> {
    let mut groups: Vec<Group> = vec![("none".into(), Box::new(|v| v.disturbances.is_empty()))];
    for name in ["things before it", "glare", "clutter", "motion", "coma"] {
        groups.push((name.into(), Box::new(move |v| v.disturbances.contains(&name))));
    }
    groups
}

/// What the study of identity says.
pub fn identity_section(study: &Identity) -> Section {
    let of_plate: Vec<&IdentityView> = study.views.iter().filter(|v| v.sight != Appearance::OtherPlate).collect();
    let all = Sums::of(of_plate.iter().copied());
    let tables = [("markers visible", by_count()), ("tilt, degrees", by_tilt()), ("disturbed by", by_disturbance())];
    let mut text = setup(study);
    for (what, groups) in &tables {
        let _ = write!(
            text,
            "\n| {what} | views | none identified | markers visible | found | wrong | displaced |\n|---|---|---|---|---|---|---|\n"
        );
        for (name, belongs) in groups {
            let s = Sums::of(of_plate.iter().copied().filter(|v| belongs(v)));
            let _ = writeln!(
                text,
                "| {name} | {} | {} | {} | {:.2} % | {} | {} |",
                s.views,
                s.unidentified,
                s.visible,
                100.0 * s.recall(),
                s.wrong,
                s.displaced
            );
        }
    }
    text += &misses(&of_plate);
    text += &failures(study);
    let plots = vec![("image-stage-identity.svg".to_owned(), plot(&of_plate, &tables[..2]))];
    Section { title: "Identity".to_owned(), claims: claims(study, &all), text, plots }
}

fn claims(study: &Identity, all: &Sums) -> Vec<Claim> {
    let wrong: usize = study.views.iter().map(|v| v.wrong).sum();
    let strange = study.views.iter().filter(|v| v.sight == Appearance::OtherPlate);
    let (strange, taken) = strange.fold((0, 0), |(n, taken), v| (n + 1, taken + usize::from(v.identified)));
    let answers = |answer: MirrorAnswer| study.views.iter().filter(|v| v.mirror == Some(answer)).count();
    let mirrors = study.views.iter().filter(|v| v.mirror.is_some()).count();
    let (named, as_the_view) = (answers(MirrorAnswer::Named), answers(MirrorAnswer::RefusedAsTheView));
    vec![
        Claim { words: format!("no wrong id: {wrong} in {} views", study.views.len()), holds: wrong == 0 },
        Claim {
            words: format!(
                "at least {:.0} % of the wholly visible markers with a minor axis above {LEAST_MINOR_AXIS_PX:.0} px are found: {:.3} % of {}",
                100.0 * LEAST_RECALL,
                100.0 * all.recall(),
                all.visible
            ),
            holds: all.recall() >= LEAST_RECALL,
        },
        Claim {
            words: format!(
                "mirror images are refused and named: {named} of {mirrors} named, {as_the_view} refused where the view itself could not be identified either, {} accepted",
                answers(MirrorAnswer::Accepted)
            ),
            holds: named + as_the_view == mirrors,
        },
        Claim {
            words: format!("a plate with another code is not taken for this one: {taken} of {strange} views"),
            holds: taken == 0,
        },
    ]
}

fn setup(study: &Identity) -> String {
    format!(
        "Views of the standard plate of 504 markers with seeds from {}: 0.12 to 1.2 megapixels, fields of 25 to 75 degrees with distortion, every roll, tilt to 60 \
         degrees, 20 to 504 markers in view; 8 or 12 bit, uneven light, blur of 0.5 to 1.2 px, noise, and in part cables and a gripper before the \
         plate, glare up to saturation, clutter around it, motion and coma. A marker counts as visible when its whole outer contour is in the \
         picture with nothing before it, not saturated, and with a minor axis of at least {LEAST_MINOR_AXIS_PX:.0} px; views with fewer than 20 such markers \
         are drawn again. An id is wrong when the observation is more than half a pitch from its marker; an observation is displaced when it is off by more than \
         {DISPLACED_PX} px and by more than {DISPLACED_SIGMAS} of its stated sigmas. One view in ten is also shown as its mirror image, and one in ten shows a plate with another code.\n",
        study.request.seed
    )
}

/// What became of the visible markers that were not found.
fn misses(views: &[&IdentityView]) -> String {
    let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
    for (reason, count) in views.iter().flat_map(|v| &v.missed) {
        *reasons.entry(reason).or_default() += count;
    }
    let mut sorted: Vec<(&str, usize)> = reasons.into_iter().collect();
    sorted.sort_by_key(|(reason, n)| (std::cmp::Reverse(*n), *reason));
    let words: Vec<String> = sorted.iter().map(|(reason, n)| format!("{n} {reason}")).collect();
    if words.is_empty() {
        String::new()
    } else {
        format!("\nVisible markers that were missed: {}.\n", words.join(", "))
    }
}

/// The views with failures, with their seeds.
fn failures(study: &Identity) -> String {
    let mut worst: Vec<&IdentityView> = study.views.iter().filter(|v| v.failed()).collect();
    let mut missed: Vec<&IdentityView> = study
        .views
        .iter()
        .filter(|v| !v.failed() && v.sight != Appearance::OtherPlate && v.found < v.visible)
        .collect();
    missed.sort_by_key(|v| (std::cmp::Reverse(v.visible - v.found), v.seed));
    worst.extend(missed);
    if worst.is_empty() {
        return "\nNo marker was missed.\n".to_owned();
    }
    let mut text = "\nThe worst views; each can be made again with `robotcal detect --study --part identity --views 1 --overlay --seed SEED`.\n\n\
                    | seed | markers visible | found | wrong | displaced | tilt, degrees | disturbed by |\n|---|---|---|---|---|---|---|\n"
        .to_owned();
    for v in worst.into_iter().take(LISTED) {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {:.0} | {} |",
            v.seed,
            v.visible,
            v.found,
            v.wrong,
            v.displaced,
            v.tilt_deg,
            v.disturbances.join(", ")
        );
    }
    text
}

const STYLE: &str = "text{font:11px sans-serif;fill:#222}.axis{stroke:#444}.limit{stroke:#c0392b;stroke-dasharray:4 3}.bar{fill:#2a8f5b}";

/// Share of markers that were not found in every group, with the limit.
fn plot(views: &[&IdentityView], tables: &[(&str, Vec<Group>)]) -> String {
    let (width, height, left, top, bottom) = (360.0, 220.0, 50.0, 24.0, 48.0);
    let limit = 100.0 * (1.0 - LEAST_RECALL);
    let mut svg = Svg::new(width * tables.len() as f64, height, "share of visible markers that were not found");
    for (panel, (what, groups)) in tables.iter().enumerate() {
        let shares: Vec<f64> = groups
            .iter()
            .map(|(_, belongs)| 100.0 * (1.0 - Sums::of(views.iter().copied().filter(|v| belongs(v))).recall()))
            .collect();
        let highest = shares.iter().copied().fold(1.2 * limit, f64::max);
        let x0 = width * panel as f64 + left;
        let (w, h) = (width - left - 12.0, height - top - bottom);
        let y = |value: f64| top + h * (1.0 - value / highest);
        svg.line([x0, top], [x0, top + h], "axis");
        svg.line([x0, top + h], [x0 + w, top + h], "axis");
        svg.line([x0, y(limit)], [x0 + w, y(limit)], "limit");
        svg.text([x0 + w, y(limit) - 4.0], Anchor::End, &format!("limit {limit:.0} %"));
        svg.text([x0 - 4.0, y(0.0) + 4.0], Anchor::End, "0 %");
        svg.text([x0 - 4.0, y(limit) + 4.0], Anchor::End, &format!("{limit:.1} %"));
        let step = w / shares.len() as f64;
        for (k, (share, (name, _))) in shares.iter().zip(groups).enumerate() {
            let x = x0 + step * (k as f64 + 0.5);
            svg.rect([x - 0.3 * step, y(*share)], [0.6 * step, y(0.0) - y(*share)], "bar");
            svg.text([x, y(*share) - 3.0], Anchor::Middle, &format!("{share:.2}"));
            svg.text([x, top + h + 14.0], Anchor::Middle, name);
        }
        svg.text([x0 + w / 2.0, height - 14.0], Anchor::Middle, what);
        svg.text([x0, 14.0], Anchor::Start, "visible markers that were not found");
    }
    svg.finish_alone(STYLE)
}
