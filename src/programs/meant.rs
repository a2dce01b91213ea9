//! Which joints targets mean: the same from wherever the robot comes to them, else their posture is not known.
//!
//! In a loop that depends on targets further on in the text. So the targets are gone through until nothing new is found: a target of which nothing
//! is known yet says nothing of those that are reached from it.

use std::collections::{BTreeMap, BTreeSet};

use super::posture::{Before, Finder, Known, same_posture};
use super::program::{Approach, Arrival, Heed, MeantPosture, PoseTarget, Program, Target, TargetKind, Understood};
use super::reason::{LeftReason, Why};
use crate::model::robot::Robot;

/// An external axis that is no further (rad or m) from `--start` stands there.
const AT_START: f64 = 1e-6;

/// Whether the text tells where a reading stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum ReadingKnown {
    No,
    /// It would with `--start`, which is not given.
    WithStart,
    Yes,
}

/// What a target means.
#[derive(Debug, Clone)]
pub(super) struct Meant {
    /// The target with what its text leaves out.
    pub kind: TargetKind,
    /// Its readings, rad or m.
    pub readings: Vec<f64>,
    /// Whether the text tells where they stand, whichever way the robot comes.
    told: Vec<ReadingKnown>,
    /// True for readings that keep their value.
    pub held: Vec<bool>,
    /// How its posture is known.
    pub known: Known,
}

/// What was found of a target so far.
enum Found {
    Nothing,
    Meant(Box<Meant>, Approach),
    Left(Why),
}

/// What all targets of a program mean to the controller; `held` readings keep the value of the program.
pub(super) fn meant(
    program: &Program,
    controller: &Robot,
    finder: Finder<'_>,
    held: &[bool],
) -> Vec<Understood<Meant>> {
    let targets = &program.targets;
    let arrivals = targets.iter().map(arrivals).collect();
    let found = targets.iter().map(|_| Found::Nothing).collect();
    let stays = (0..held.len()).map(|i| stays(program, i, finder.start(i))).collect();
    let mut meaning = Meaning {
        targets,
        arrivals,
        controller,
        held,
        finder,
        stays,
        found,
        followed: BTreeMap::new(),
        has_more: false,
    };
    while meaning.finds_more() || meaning.begins_anywhere() {}
    let one = |found| match found {
        Found::Meant(meant, _) => Ok(*meant),
        Found::Left(why) => Err(why),
        Found::Nothing => Err(unreached()),
    };
    meaning.found.into_iter().map(one).collect()
}

fn unreached() -> Why {
    Why::new(LeftReason::PostureUnknown, "its posture is not known: nothing leads to it")
}

/// True where the text puts a reading nowhere else than at its start, rad or m: without one, nowhere at all.
fn stays(program: &Program, reading: usize, start: Option<f64>) -> bool {
    let is_there =
        |value: &Option<f64>| value.zip(start).is_some_and(|(value, start)| (value - start).abs() < AT_START);
    program.put.iter().filter(|(put, _)| *put == reading).all(|(_, value)| is_there(value))
}

fn arrivals(target: &Target) -> Vec<Arrival> {
    if !target.arrivals.is_empty() {
        return target.arrivals.clone();
    }
    vec![Arrival { from: target.approach, posture: target.kind.posture() }]
}

struct Meaning<'a> {
    targets: &'a [Target],
    /// All ways to each of them.
    arrivals: Vec<Vec<Arrival>>,
    controller: &'a Robot,
    held: &'a [bool],
    finder: Finder<'a>,
    /// True for readings that the program puts nowhere else than at `--start`; without that, nowhere.
    stays: Vec<bool>,
    found: Vec<Found>,
    /// Ways that were followed, by the target from which they come: the target, the number of the arrival, and where it begins.
    followed: BTreeMap<Option<usize>, BTreeSet<(usize, usize, Approach)>>,
    /// True where a way was followed since this was asked, or is to be followed once more.
    has_more: bool,
}

impl Meaning<'_> {
    /// Follows all ways that begin where something is known; true where one of them was new.
    fn finds_more(&mut self) -> bool {
        self.has_more = false;
        (0..self.targets.len()).for_each(|k| self.look_at(k));
        self.has_more
    }

    /// Where targets are reached from each other alone, nothing tells the joints at the first of them.
    fn begins_anywhere(&mut self) -> bool {
        let open = self.found.iter().position(|found| matches!(found, Found::Nothing));
        open.is_some_and(|k| {
            self.follow(k, 0, Approach::Unknown);
            true
        })
    }

    fn look_at(&mut self, k: usize) {
        let mut ways = BTreeSet::new();
        for (n, arrival) in self.arrivals[k].iter().enumerate() {
            let mut origins = BTreeSet::new();
            self.origins(arrival.from, &mut BTreeSet::new(), &mut origins);
            ways.extend(origins.into_iter().map(|origin| (origin, n)));
        }
        // Where a target tells all of itself, an unknown way to it says nothing against it.
        let is_told =
            self.arrivals[k].iter().all(|arrival| self.tells_itself(k, arrival)) && !self.targets[k].kind.is_partial();
        let has_known = ways.iter().any(|(origin, _)| origin.target().is_some());
        for (origin, n) in ways {
            if matches!(self.found[k], Found::Left(_)) {
                return;
            }
            match is_told && has_known && origin.target().is_none() {
                true => self.tells_no_more(k, &self.told(&self.targets[k].kind, None, origin)),
                false => self.follow(k, n, origin),
            }
        }
    }

    /// True where joints or codes beside a pose tell its posture.
    fn tells_itself(&self, k: usize, arrival: &Arrival) -> bool {
        match &self.targets[k].kind {
            TargetKind::Joints(_) => true,
            TargetKind::Pose(pose) => match arrival.posture {
                MeantPosture::Coded(.., heed) => heed != Heed::Unknown,
                MeantPosture::Near(_) => true,
                MeantPosture::ByWay(_) => pose.taught.is_some(),
            },
        }
    }

    /// Where a way begins: through targets that are left, in the posture in which the robot came to these.
    fn origins(&self, from: Approach, through: &mut BTreeSet<usize>, all: &mut BTreeSet<Approach>) {
        let Some(k) = from.target() else {
            all.insert(from);
            return;
        };
        match &self.found[k] {
            Found::Nothing => {}
            Found::Meant(..) => _ = all.insert(from),
            Found::Left(why) if self.loses_posture(k, why) => _ = all.insert(Approach::Unknown),
            Found::Left(_) if through.insert(k) => {
                self.arrivals[k].iter().for_each(|a| self.origins(a.from.beyond(), through, all));
            }
            Found::Left(_) => {}
        }
    }

    /// True where the robot stands in a posture of its own at a target that is left.
    fn loses_posture(&self, k: usize, why: &Why) -> bool {
        why.reason == LeftReason::PostureUnknown || matches!(self.targets[k].kind, TargetKind::Joints(_))
    }

    /// Follows a way to a target, unless that was done: what it means must be what the others say.
    fn follow(&mut self, k: usize, n: usize, origin: Approach) {
        if !self.followed.entry(origin.target()).or_default().insert((k, n, origin)) {
            return;
        }
        self.has_more = true;
        let new = self.by(k, n, origin);
        match (new, &self.found[k]) {
            (Err(why), _) => self.found[k] = Found::Left(why),
            (Ok(new), Found::Meant(known, first)) if !same_posture(&known.readings, &new.readings) => {
                self.found[k] = Found::Left(self.differing(k, *first, origin));
            }
            (Ok(new), Found::Nothing) => self.found[k] = Found::Meant(Box::new(new), origin),
            (Ok(new), _) => self.tells_no_more(k, &new.told),
        }
    }

    /// Another way to a target tells this much of its readings: what was found with more is looked at again.
    fn tells_no_more(&mut self, k: usize, told: &[ReadingKnown]) {
        let Found::Meant(known, _) = &mut self.found[k] else { return };
        let least: Vec<ReadingKnown> = known.told.iter().zip(told).map(|(known, told)| *known.min(told)).collect();
        if least != known.told {
            known.told = least;
            self.followed.remove(&Some(k));
            self.has_more = true;
        }
    }

    fn differing(&self, k: usize, one: Approach, other: Approach) -> Why {
        let place = |from: Approach| match from.target() {
            Some(k) => format!("from line {}", self.targets[k].line),
            None => "from where the text does not tell".to_owned(),
        };
        let ways = format!("the ways {} and {}", place(one), place(other));
        if self.targets[k].kind.leaves_out() {
            return Why::new(LeftReason::Incomplete, format!("it leaves numbers out, and {ways} give different ones"));
        }
        let words = format!("its posture is not known: {ways} lead to different ones");
        Why::new(LeftReason::PostureUnknown, words)
    }

    /// What a target means to a robot that comes from there.
    fn by(&mut self, k: usize, n: usize, origin: Approach) -> Understood<Meant> {
        let before = origin.target().and_then(|j| match &self.found[j] {
            Found::Meant(meant, _) => Some(&**meant),
            _ => None,
        });
        let straight = matches!(origin, Approach::From(_));
        let kept = before.filter(|_| straight);
        let kind = self.completed(k, kept, origin)?;
        let told = self.told(&self.targets[k].kind, kept, origin);
        let held = |own: Vec<bool>| own.iter().zip(self.held).map(|(a, h)| *a || *h).collect::<Vec<bool>>();
        match &kind {
            TargetKind::Joints(joints) => {
                let held = held(joints.fields.iter().map(Option::is_none).collect());
                let readings = joints.readings.clone();
                Ok(Meant { kind, readings, told, held, known: Known::Joints })
            }
            TargetKind::Pose(pose) => {
                let held = held(pose.fixed.iter().map(Option::is_some).collect());
                let aimed = PoseTarget { posture: self.arrivals[k][n].posture.clone(), ..(**pose).clone() };
                let before = Before { readings: before.map(|b| &b.readings[..]), straight };
                let (readings, known) = self.finder.joints(&aimed, &held, before)?;
                Ok(Meant { kind, readings, told, held, known })
            }
        }
    }

    /// Which readings of a target the text tells, be it with the target before or with `--start`.
    fn told(&self, kind: &TargetKind, before: Option<&Meant>, origin: Approach) -> Vec<ReadingKnown> {
        let kept = |i: usize| before.map_or(ReadingKnown::No, |b| b.told[i]).max(self.told_by_start(i, origin));
        match kind {
            TargetKind::Joints(joints) => {
                let one = |(i, q): (usize, &f64)| if q.is_finite() { ReadingKnown::Yes } else { kept(i) };
                joints.readings.iter().enumerate().map(one).collect()
            }
            TargetKind::Pose(_) => vec![ReadingKnown::Yes; self.held.len()],
        }
    }

    /// Where `--start` has an external axis, at the beginning of the program, or of a routine where no statement puts it elsewhere; rad or m.
    fn by_start(&self, reading: usize, origin: Approach) -> Option<f64> {
        self.finder.start(reading).filter(|_| self.told_by_start(reading, origin) == ReadingKnown::Yes)
    }

    fn told_by_start(&self, reading: usize, origin: Approach) -> ReadingKnown {
        let counts = match origin {
            Approach::Begin => true,
            Approach::Call => self.stays[reading],
            Approach::From(_) | Approach::Beyond(_) | Approach::Unknown => false,
        };
        match self.finder.start(reading) {
            _ if !counts => ReadingKnown::No,
            Some(_) => ReadingKnown::Yes,
            None => ReadingKnown::WithStart,
        }
    }

    /// True where `--start` would tell where an axis stands on all ways to a target.
    fn start_would_tell(&self, k: usize, reading: usize) -> bool {
        let mut origins = BTreeSet::new();
        self.arrivals[k].iter().for_each(|a| self.origins(a.from, &mut BTreeSet::new(), &mut origins));
        origins.iter().all(|origin| match (origin, origin.target().map(|j| &self.found[j])) {
            (Approach::From(_), Some(Found::Meant(meant, _))) => meant.told[reading] > ReadingKnown::No,
            _ => self.told_by_start(reading, *origin) > ReadingKnown::No,
        })
    }

    /// Why a pose stays as it is that leaves out an external axis of which nothing tells where it stands.
    fn axis_untold(&self, k: usize, reading: usize) -> Why {
        let name = &self.controller.chain.readings[reading];
        let gives_start = self.finder.start(reading).is_none() && self.start_would_tell(k, reading);
        let remedy = if gives_start { ", or give --start" } else { "" };
        let words = format!(
            "it leaves out {name}, and nothing tells where that stands (write its place in the target{remedy})"
        );
        Why::new(LeftReason::Incomplete, words)
    }

    /// The target with what its text leaves out, which is what the target before it says.
    fn completed(&self, k: usize, before: Option<&Meant>, origin: Approach) -> Understood<TargetKind> {
        let unknown =
            || Why::new(LeftReason::Incomplete, "it leaves numbers out, and the target before it is not known");
        let mut kind = self.targets[k].kind.clone();
        match &mut kind {
            TargetKind::Joints(joints) => {
                for (i, q) in joints.readings.iter_mut().enumerate().filter(|(_, q)| !q.is_finite()) {
                    // Axes that the target does not have keep their place, wherever that is.
                    let known = before.map(|b| b.readings[i]);
                    *q = match joints.fields[i] {
                        None => known.unwrap_or_else(|| self.finder.anywhere(i)),
                        Some(_) => known.ok_or_else(unknown)?,
                    };
                }
            }
            TargetKind::Pose(pose) if pose.is_partial() => {
                for (i, place) in pose.fixed.iter_mut().enumerate() {
                    if place.is_some_and(|value| !value.is_finite()) {
                        let kept = before.filter(|b| b.told[i] == ReadingKnown::Yes).map(|b| b.readings[i]);
                        *place = Some(kept.or(self.by_start(i, origin)).ok_or_else(|| self.axis_untold(k, i))?);
                    }
                }
                if pose.is_partial() {
                    let is_told = |b: &&Meant| b.told.iter().all(|told| *told == ReadingKnown::Yes);
                    let before = before.filter(is_told).ok_or_else(unknown)?;
                    pose.complete(&self.controller.base_from_tip(&before.readings));
                }
            }
            TargetKind::Pose(_) => {}
        }
        Ok(kind)
    }
}
