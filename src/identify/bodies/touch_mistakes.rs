//! When touches scatter far more than is stated: the usual mistakes, each undone and the touches fitted again (those that the closed form fits
//! best), named where one of them explains it.
//!
//! Readings may be in another order, of another sign or of other rows; the places may be mirrored, or one of them wrong; the tool that was given
//! may be another; the tool may have been bent, or the work object moved, between two touches; all places may be further apart than is said. A place that may be wrong counts as unknown. The work object after some touch is
//! `D` away from where it was: `D` brings its places, as given, to where they are found while they count as unknown.

use std::cmp::Ordering;
use std::collections::BTreeSet;

use nalgebra::Vector3;
use rayon::prelude::*;

use super::points_start::each_place;
use super::touch_size::{TouchSize, of_size, size_of_places};
use crate::assess::Limits;
use crate::diagnose::{Finding, Mistake, MistakeKind, RowsOf};
use crate::error::Code;
use crate::frames::{FrameFit, Given, KnownRobot, Touch, TouchPlace, Touches, closed_form, fit};
use crate::geom::{Pose, log_so3, rigid_fit};
use crate::identify::mistakes::likeliest::{Explained, likeliest};
use crate::identify::mistakes::misread::all_misread;
use crate::identify::mistakes::readings::{
    Undone as ReadingsUndone, mirrored_signs_undone, mistakes_undone, signs_of_others,
};
use crate::model::mirror::mirror_images;
use crate::problem::BodySeen;

/// Of mistakes of one kind, those that are fitted: the closed form fits them best.
const FITTED: usize = 3;

/// Touches that are named.
const NAMED: usize = 5;

/// Touches with a mistake undone, what is known beside them, and what the mistake is.
struct Undone {
    touches: Touches,
    given: Given,
    what: What,
}

enum What {
    Kind(MistakeKind),
    /// This place, now an unknown contact, the last.
    Place(Vector3<f64>),
    /// The place of this touch alone, likewise.
    Touch(usize, Vector3<f64>),
    /// The tool that was given; now it is found.
    GivenTool(Pose),
    /// The tool, now the last body, from this posture on.
    Tool {
        from: usize,
    },
    /// The work object from this posture on, and how it was moved.
    Work {
        from: usize,
        moved: Pose,
    },
    /// The touched places do not go with the base that these joints move.
    NotCarried(Vec<String>),
    /// The place of the touches at these stops, or of those at others: any of them explains as much.
    OneOf(Vec<String>),
    /// All distances between the places.
    Size(TouchSize),
}

impl What {
    /// As [`MistakeKind::shrinks`].
    const fn shrinks(&self) -> f64 {
        match self {
            Self::Kind(kind) => kind.shrinks(),
            _ => 1.0,
        }
    }

    /// Stops of which a place counts as unknown.
    fn stops(&self, touches: &Touches) -> Option<Vec<String>> {
        let at = |is: &dyn Fn(usize, &Touch) -> bool| {
            let all = touches.all.iter().enumerate();
            Some(all.filter(|(k, touch)| is(*k, touch)).map(|(_, touch)| touch.stop.clone()).collect())
        };
        match self {
            Self::Place(place) => at(&|_, touch| touch.seen == TouchPlace::Point(*place)),
            Self::Touch(one, _) => at(&|k, _| k == *one),
            _ => None,
        }
    }
}

/// The mistake that explains why touches scatter; `None` where they do not, or none of them does. Where none does alone, it is looked for beside
/// touches that fit least, one after the other, as long as these are few.
pub fn touch_mistake(
    robot: &KnownRobot,
    touches: &Touches,
    given: &Given,
    (found, limits): (&FrameFit, &Limits),
) -> Option<Mistake> {
    if found.contradiction(limits) <= limits.touch_factor {
        return None;
    }
    let most = (limits.share_of_images_left_out * touches.all.len() as f64) as usize;
    let (mut rest, mut fitted, mut beside) = (touches.clone(), found.clone(), Vec::new());
    loop {
        if let Some((left, undone)) = explained(robot, &rest, given, (&fitted, limits)) {
            let kind = named(&undone, &left, &rest);
            // Of shifted rows one at the end has no partner.
            if !matches!(kind, MistakeKind::Rows { .. }) {
                let judged = undone.touches.all.iter().zip(&left.judged);
                beside.extend(judged.filter(|(_, judged)| judged.left_out).map(|(touch, _)| touch.stop.clone()));
            }
            return Some(mistake(touches, kind, (found.rms_m, left.rms_m), &beside));
        }
        let out = fit_least(robot, &rest, given, &fitted)?;
        beside.extend(out.iter().map(|k| rest.all[*k].stop.clone()));
        if beside.len() > most {
            return None;
        }
        rest = without(&rest, &out);
        fitted = fit(robot, &rest, given, limits).ok()?;
        let left = fitted.contradiction(limits);
        if left <= limits.touch_factor && left < limits.mistake_explains * found.contradiction(limits) {
            let kind = MistakeKind::Poses {
                code: Code::PlaceContradicted,
                what: format!("the touches at {} were of other places than is said", beside.join(", ")),
                remedy: "correct their rows in contacts.csv, or leave them out".to_owned(),
            };
            return Some(mistake(touches, kind, (found.rms_m, fitted.rms_m), &[]));
        }
    }
}

/// The joints with whose signs changed touches that fit the robot fit it as well: they do not tell it from its mirror image. `None` where they do.
pub fn mirror_image(
    robot: &KnownRobot,
    touches: &Touches,
    given: &Given,
    (found, limits): (&FrameFit, &Limits),
) -> Option<Vec<String>> {
    let fits = |fit: &FrameFit| fit.contradiction(limits) <= limits.touch_factor;
    if touches.all.is_empty() || !fits(found) {
        return None;
    }
    let own = robot.exported();
    mirror_images(&own.chain, limits.suspicious_misfit).into_iter().find_map(|mirror| {
        let mut otherwise = touches.clone();
        for posture in &mut otherwise.postures {
            mirror.iter().for_each(|&k| posture.readings[k] = -posture.readings[k]);
        }
        let other = fit(robot, &otherwise, given, limits).ok()?;
        (fits(&other) && left_out(&other) == left_out(found)).then(|| signs_of_others(own, &[], &mirror))
    })
}

/// With the stops that fit no more beside it.
fn mistake(touches: &Touches, kind: MistakeKind, (misfit, left): (f64, f64), beside: &[String]) -> Mistake {
    let frame = touches.frame.as_ref().map_or_else(String::new, |frame| format!(" in frame {frame}"));
    let alone = Mistake {
        kind,
        of: format!("touches{frame}"),
        misfit,
        misfit_undone: Some(left),
        by_images: false,
        rows_of: RowsOf::Readings,
    };
    if beside.is_empty() {
        return alone;
    }
    let found = Finding::from(alone.clone());
    let what = format!("{}; beside it {} fits no place that is said", found.seen(), beside.join(", "));
    let kind = MistakeKind::Poses { code: found.code(), what, remedy: found.remedy() };
    Mistake { kind, ..alone }
}

/// The touches that the fit left out, else that without which the others fit best.
fn fit_least(robot: &KnownRobot, touches: &Touches, given: &Given, fitted: &FrameFit) -> Option<Vec<usize>> {
    let all = 0..touches.all.len();
    let out: Vec<usize> = all.clone().filter(|&k| fitted.judged[k].left_out).collect();
    if !out.is_empty() {
        return Some(out);
    }
    let left = |k: usize| Some((closed_form(robot, &without(touches, &[k]), given)?.0, k));
    let least = all.filter_map(left).min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(vec![least.1])
}

fn without(touches: &Touches, out: &[usize]) -> Touches {
    let rest = touches.all.iter().enumerate().filter(|(k, _)| !out.contains(k));
    Touches { all: rest.map(|(_, touch)| touch.clone()).collect(), ..touches.clone() }
}

/// The mistake that explains most, and what it leaves.
fn explained(
    robot: &KnownRobot,
    touches: &Touches,
    given: &Given,
    (found, limits): (&FrameFit, &Limits),
) -> Option<(FrameFit, Undone)> {
    let fewest = limits.fewest_touches;
    let from = fewest..(touches.postures.len() + 1).saturating_sub(fewest);
    let with_given = |(touches, what): (Touches, What)| Undone { touches, given: *given, what };
    let [places, single] = other_places(touches);
    let tools = from.clone().filter(|_| given.tool.is_none()).map(|from| other_tool(touches, from));
    let works = from.filter_map(|from| {
        let (apart, known) = with_unknown_places(touches, |touch| touch.posture >= from);
        work_moved(touches, from, &known, &closed_form(robot, &apart, given)?.1)
    });
    let size = size_of_places(robot, touches, given, limits);
    let kinds = [
        read_otherwise(robot, touches).map(with_given).collect(),
        mirrored(robot, touches, limits).map(with_given).collect(),
        places.into_iter().map(with_given).collect(),
        single.into_iter().map(with_given).collect(),
        tools.map(with_given).collect(),
        works.map(with_given).collect(),
        not_carried(robot, touches).map(with_given).into_iter().collect(),
        size.map(|size| with_given((of_size(touches, size.off), What::Size(size)))).into_iter().collect(),
        given.tool.map(|tool| without_tool(touches, given, tool)).into_iter().collect::<Vec<Undone>>(),
    ];
    let all: Vec<Undone> = kinds.into_iter().flat_map(|undone| nearest(robot, undone)).collect();
    let tried = |undone: Undone| {
        let left = fit(robot, &undone.touches, &undone.given, limits).ok();
        left.filter(|fit| explains(fit, &undone.what, (found, limits))).map(|fit| (fit, undone))
    };
    let (best, undone) = best_of(all.into_par_iter().filter_map(tried).collect(), robot, limits)?;
    let one_of = one_of(robot, touches, given, (&best, &undone.what, found, limits));
    Some((best, Undone { what: one_of.map_or(undone.what, What::OneOf), ..undone }))
}

/// The best of those that explain: of readings and axes with what fits alike.
fn best_of(mut all: Vec<(FrameFit, Undone)>, robot: &KnownRobot, limits: &Limits) -> Option<(FrameFit, Undone)> {
    let (fewest_out, takes_more, _) = all.iter().map(|found| rank(found, limits)).min_by(|a, b| by_rank(*a, *b))?;
    all.retain(|found| {
        let (out, more, _) = rank(found, limits);
        (out, more) == (fewest_out, takes_more)
    });
    let explained = |(fit, undone): &(FrameFit, Undone)| match &undone.what {
        What::Kind(kind) => Some((fit.contradiction(limits), kind.clone())),
        _ => None,
    };
    let kinds: Vec<Explained> = all.iter().filter_map(explained).collect();
    if kinds.len() < all.len() {
        return all.into_iter().min_by(|a, b| by_rank(rank(a, limits), rank(b, limits)));
    }
    let (named, kind) = likeliest(&kinds, robot.exported(), limits)?;
    let (fit, undone) = all.swap_remove(named);
    Some((fit, Undone { what: What::Kind(kind), ..undone }))
}

/// True where a fit leaves little of what contradicts another.
fn explains(fit: &FrameFit, what: &What, (found, limits): (&FrameFit, &Limits)) -> bool {
    fit.contradiction(limits) < what.shrinks() * limits.mistake_explains * found.contradiction(limits)
        && fit.rms_m < limits.touch_sigma_m
}

/// Every known place as unknown, and that of every touch alone.
fn other_places(touches: &Touches) -> [Vec<(Touches, What)>; 2] {
    let places = known_places(touches.all.iter()).into_iter().map(|place| {
        let (other, _) = with_unknown_places(touches, |touch| touch.seen == TouchPlace::Point(place));
        (other, What::Place(place))
    });
    let single = (0..touches.all.len()).filter_map(|k| of_another_place(touches, k));
    [places.collect(), single.collect()]
}

/// The stops of one of which the place is wrong, where another place, or touch, explains nearly as much as the best: it must leave so much more that
/// the best explains it away. `None` where the best alone does.
fn one_of(
    robot: &KnownRobot,
    touches: &Touches,
    given: &Given,
    (best, what, found, limits): (&FrameFit, &What, &FrameFit, &Limits),
) -> Option<Vec<String>> {
    let own = what.stops(touches)?;
    let is_rival = |(touches, what): &(Touches, What)| {
        let left = fit(robot, touches, given, limits).ok().filter(|fit| explains(fit, what, (found, limits)));
        left.is_some_and(|left| best.contradiction(limits) > limits.mistake_explains * left.contradiction(limits))
    };
    let others: Vec<(Touches, What)> = other_places(touches).into_iter().flatten().collect();
    let rivals = others.into_par_iter().filter(is_rival).filter_map(|(_, what)| what.stops(touches));
    let stops: BTreeSet<String> = rivals.flatten().chain(own.clone()).collect();
    (stops.len() > own.len()).then(|| stops.into_iter().collect())
}

/// Those that the closed form fits best.
fn nearest(robot: &KnownRobot, undone: Vec<Undone>) -> Vec<Undone> {
    let misses = |undone: Undone| closed_form(robot, &undone.touches, &undone.given).map(|(rms_m, _)| (rms_m, undone));
    let mut all: Vec<(f64, Undone)> = undone.into_par_iter().filter_map(misses).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().take(FITTED).map(|(_, undone)| undone).collect()
}

/// What leaves fewer touches out is better, then what takes no more unknowns, then what fits better.
fn rank((fit, undone): &(FrameFit, Undone), limits: &Limits) -> (usize, bool, f64) {
    let takes_more = !matches!(undone.what, What::Kind(_) | What::NotCarried(_));
    (left_out(fit), takes_more, fit.contradiction(limits))
}

fn left_out(fit: &FrameFit) -> usize {
    fit.judged.iter().filter(|j| j.left_out).count()
}

fn by_rank(a: (usize, bool, f64), b: (usize, bool, f64)) -> Ordering {
    (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2))
}

fn readings(touches: &Touches) -> Vec<Vec<f64>> {
    touches.postures.iter().map(|p| p.readings.clone()).collect()
}

fn with_readings(touches: &Touches, (readings, kind): ReadingsUndone) -> (Touches, What) {
    let mut undone = touches.clone();
    undone.postures.iter_mut().zip(readings).for_each(|(p, readings)| p.readings = readings);
    (undone, What::Kind(kind))
}

/// The readings of a mirror image: they are fitted whatever fits better by the closed form.
fn mirrored(robot: &KnownRobot, touches: &Touches, limits: &Limits) -> impl Iterator<Item = (Touches, What)> {
    let of_mirror = mirrored_signs_undone(robot.exported(), &readings(touches), limits.suspicious_misfit);
    of_mirror.into_iter().map(move |undone| with_readings(touches, undone))
}

/// Other readings, or all places otherwise.
fn read_otherwise(robot: &KnownRobot, touches: &Touches) -> impl Iterator<Item = (Touches, What)> {
    let of_readings = mistakes_undone(robot.exported(), &readings(touches)).into_iter();
    let of_readings = of_readings.map(move |undone| with_readings(touches, undone));
    let of_places = all_misread().filter(|_| touches.frame.is_some()).filter_map(|misread| {
        let mut undone = touches.clone();
        for touch in &mut undone.all {
            touch.seen = match touch.seen {
                TouchPlace::Point(point) => seen(misread.undone(BodySeen::Point(point))?),
                TouchPlace::Pose(pose) => seen(misread.undone(BodySeen::Pose(pose))?),
                unknown @ TouchPlace::Unknown(_) => unknown,
            };
        }
        Some((undone, What::Kind(misread.kind())))
    });
    of_readings.chain(of_places)
}

fn seen(seen: BodySeen) -> TouchPlace {
    match seen {
        BodySeen::Point(point) => TouchPlace::Point(point),
        BodySeen::Pose(pose) => TouchPlace::Pose(pose),
    }
}

/// Places of points that are known, each once.
fn known_places<'a>(touches: impl Iterator<Item = &'a Touch>) -> Vec<Vector3<f64>> {
    each_place(touches.filter_map(|touch| match touch.seen {
        TouchPlace::Point(place) => Some(place),
        TouchPlace::Pose(_) | TouchPlace::Unknown(_) => None,
    }))
}

/// The known places of some touches as unknown contacts, the last, and where they are said to be.
fn with_unknown_places(touches: &Touches, of: impl Fn(&Touch) -> bool) -> (Touches, Vec<Vector3<f64>>) {
    let mut apart = touches.clone();
    let known = known_places(touches.all.iter().filter(|t| of(t)));
    for touch in apart.all.iter_mut().filter(|t| of(t)) {
        let TouchPlace::Point(place) = touch.seen else { continue };
        let index = known.iter().position(|p| *p == place).unwrap_or_default();
        touch.seen = TouchPlace::Unknown(touches.contacts.len() + index);
    }
    apart.contacts.extend(known.iter().map(|_| String::new()));
    (apart, known)
}

fn of_another_place(touches: &Touches, k: usize) -> Option<(Touches, What)> {
    let TouchPlace::Point(place) = touches.all[k].seen else { return None };
    let mut undone = touches.clone();
    undone.all[k].seen = TouchPlace::Unknown(touches.contacts.len());
    undone.contacts.push(String::new());
    Some((undone, What::Touch(k, place)))
}

/// With the joints that carry the base where they stood first: so the touches would be if the places stood still. `None` where nothing carries it, or
/// these joints stand at all touches as at the first.
fn not_carried(robot: &KnownRobot, touches: &Touches) -> Option<(Touches, What)> {
    let chain = &robot.exported().chain;
    let carrying: BTreeSet<usize> = chain.carrying_base().filter_map(|j| j.drive).map(|d| d.reading).collect();
    let first = touches.postures.first()?.readings.clone();
    let mut undone = touches.clone();
    for posture in &mut undone.postures {
        carrying.iter().for_each(|&k| posture.readings[k] = first[k]);
    }
    let moved = |k: &&usize| touches.postures.iter().any(|posture| posture.readings[**k] != first[**k]);
    let names: Vec<String> = carrying.iter().filter(moved).map(|&k| chain.readings[k].clone()).collect();
    (!names.is_empty()).then_some((undone, What::NotCarried(names)))
}

fn without_tool(touches: &Touches, given: &Given, tool: Pose) -> Undone {
    Undone { touches: touches.clone(), given: Given { tool: None, ..*given }, what: What::GivenTool(tool) }
}

fn other_tool(touches: &Touches, from: usize) -> (Touches, What) {
    let mut undone = touches.clone();
    let bodies = touches.bodies.len();
    undone.bodies.extend_from_within(..);
    undone.all.iter_mut().filter(|t| t.posture >= from).for_each(|t| t.body += bodies);
    (undone, What::Tool { from })
}

fn work_moved(
    touches: &Touches,
    from: usize,
    known: &[Vector3<f64>],
    places: &[Vector3<f64>],
) -> Option<(Touches, What)> {
    let found = places.get(touches.contacts.len()..)?;
    let pairs: Vec<(Vector3<f64>, Vector3<f64>)> = known.iter().copied().zip(found.iter().copied()).collect();
    let moved = rigid_fit(&pairs).filter(|_| pairs.len() > 2)?;
    let mut undone = touches.clone();
    for touch in undone.all.iter_mut().filter(|t| t.posture >= from) {
        touch.seen = match touch.seen {
            TouchPlace::Point(place) => TouchPlace::Point(moved.transform(&place)),
            TouchPlace::Pose(pose) => TouchPlace::Pose(moved * pose),
            unknown @ TouchPlace::Unknown(_) => unknown,
        };
    }
    Some((undone, What::Work { from, moved }))
}

fn named(undone: &Undone, left: &FrameFit, touches: &Touches) -> MistakeKind {
    let (code, what, remedy) = match &undone.what {
        What::Kind(kind) => return kind.clone(),
        What::Place(place) => place_elsewhere(place, left, touches),
        What::Touch(k, place) => touch_elsewhere(&touches.all[*k].stop, place, left),
        What::OneOf(stops) => untold(stops),
        What::GivenTool(tool) => tool_elsewhere(tool, left),
        What::Tool { from } => tool_moved(&stop_at(*from, touches), left, touches),
        What::Work { from, moved } => work_elsewhere(&stop_at(*from, touches), moved, touches),
        What::NotCarried(joints) => stands_still(joints),
        What::Size(size) => other_size(*size),
    };
    MistakeKind::Poses { code, what, remedy }
}

/// Code, what was seen, remedy.
type Words = (Code, String, String);

/// Name of the first stop with a posture.
fn stop_at(posture: usize, touches: &Touches) -> String {
    let touch = touches.all.iter().find(|t| t.posture == posture);
    touch.map_or_else(String::new, |t| t.stop.clone())
}

fn place_elsewhere(place: &Vector3<f64>, left: &FrameFit, touches: &Touches) -> Words {
    let found = left.places.last().unwrap_or(place);
    let of: BTreeSet<&str> =
        touches.all.iter().filter(|t| t.seen == TouchPlace::Point(*place)).map(|t| t.stop.as_str()).collect();
    let more = if of.len() > NAMED { ", .." } else { "" };
    let names: Vec<&str> = of.into_iter().take(NAMED).collect();
    let what = format!(
        "the place {} that was touched at {}{more} is at {} by the others, {:.2} mm away",
        in_metres(place),
        names.join(", "),
        in_metres(found),
        1e3 * (found - place).norm()
    );
    (Code::PlaceContradicted, what, "correct it in contacts.csv, or touch the point that was meant".to_owned())
}

fn touch_elsewhere(stop: &str, place: &Vector3<f64>, left: &FrameFit) -> Words {
    let found = left.places.last().unwrap_or(place);
    let what = format!(
        "the touch at {stop} was not of the place {}: by the others it was at {}, {:.2} mm away",
        in_metres(place),
        in_metres(found),
        1e3 * (found - place).norm()
    );
    (Code::PlaceContradicted, what, "correct its row in contacts.csv, or leave it out".to_owned())
}

fn untold(stops: &[String]) -> Words {
    let what = format!(
        "one of the touches at {} was not of the place that is said: whichever is taken as wrong, the others fit, and they do not tell which",
        stops.join(", ")
    );
    let remedy = "touch these points again, and some more with the tip turned another way";
    (Code::PlaceContradicted, what, remedy.to_owned())
}

fn tool_elsewhere(tool: &Pose, left: &FrameFit) -> Words {
    let found = &left.tools[0];
    let what = format!(
        "the tool that was given misses: by the touches its point is at {} on the tip, {:.2} mm away",
        in_metres(&found.translation),
        1e3 * (found.translation - tool.translation).norm()
    );
    let remedy = "leave --tool out: the touches find it; or give the frame of the tool as it is mounted now";
    (Code::ToolContradicted, what, remedy.to_owned())
}

fn tool_moved(from: &str, left: &FrameFit, touches: &Touches) -> Words {
    let half = touches.bodies.len();
    let moved = left.tools[half].translation - left.tools[0].translation;
    let what = format!(
        "from {from} on the point of the tool is {:.2} mm elsewhere on the tip: it was bent, exchanged or came loose",
        1e3 * moved.norm()
    );
    (Code::TargetDisplaced, what, before_or_after(from))
}

fn work_elsewhere(from: &str, moved: &Pose, touches: &Touches) -> Words {
    let places: Vec<Vector3<f64>> = touches.placed().map(|(_, place)| place).collect();
    let middle = places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64;
    let what = format!(
        "from {from} on the work object stands {:.2} mm, {:.2} mrad elsewhere: it was moved, or the base of the robot, or the zero of a joint slipped",
        1e3 * (moved.transform(&middle) - middle).norm(),
        1e3 * log_so3(&moved.rotation).norm()
    );
    (Code::WorkDisplaced, what, before_or_after(from))
}

fn stands_still(joints: &[String]) -> Words {
    let joints = joints.join(", ");
    let what = format!(
        "the touched places do not move with the base of the solution, which {joints} move: the work object stands still, or these joints did"
    );
    let remedy = format!(
        "touch it with {joints} at one value, or in a solution whose base stands still (identify --base); if it is on the base, write the readings at \
         which {joints} stood"
    );
    (Code::WorkNotCarried, what, remedy)
}

fn other_size(TouchSize { off, sigma }: TouchSize) -> Words {
    let what = format!(
        "the touched places lie {:.3} % (+- {:.3} %) {} than the robot of the solution has them",
        100.0 * off.abs(),
        100.0 * sigma,
        if off > 0.0 { "further apart" } else { "closer together" }
    );
    let remedy = "check the places, and the size of the plate, or of what else the robot was identified with: measure two far markers, give [scale] and run `identify` again";
    (Code::LengthsContradicted, what, remedy.to_owned())
}

fn before_or_after(from: &str) -> String {
    format!("use the touches before {from}, or those from it on")
}

/// A place in words.
pub(super) fn in_metres(place: &Vector3<f64>) -> String {
    format!("({:.4}, {:.4}, {:.4}) m", place.x, place.y, place.z)
}
