//! Which changes are tried, and at which stops; for [`super::pose_step`].

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use nalgebra::Vector3;

use super::candidates::{Candidate, Changed, Order, Shown, is_socket, stride};
use super::rows::{Chances, Linear, Step};
use crate::problem::{InstrumentKind, Problem};
use crate::series::CameraMount;

/// Places closer than this to each other, or to a line, m, count as one, or as on it.
const SAME_PLACE_M: f64 = 1e-3;

/// Whether one place that is wrong can be told from another: without any two of them, three that are in no line hold their frame. With fewer, a shift
/// of another and a turn of the frame explain the same.
fn tell_which(touched: &[Vector3<f64>]) -> bool {
    let mut places: Vec<Vector3<f64>> = Vec::new();
    for place in touched {
        if places.iter().all(|other| (other - place).norm() > SAME_PLACE_M) {
            places.push(*place);
        }
    }
    let on_line = |a: usize, b: usize| {
        let along = (places[b] - places[a]).normalize();
        places.iter().filter(|p| (*p - places[a]).cross(&along).norm() <= SAME_PLACE_M).count()
    };
    let pairs = (0..places.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
    places.len() > 4 && pairs.map(|(a, b)| on_line(a, b)).all(|on| on + 2 < places.len())
}

impl Linear {
    /// Ways to divide the stops, with at least so many of them on either side.
    pub(super) fn candidates(&self, problem: &Problem, fewest: usize) -> Vec<Candidate> {
        let changed = self.what_may_change(problem).into_iter();
        let divided = changed.flat_map(|changed| self.divisions(problem, changed, fewest));
        divided.chain(self.misstated(problem)).collect()
    }

    /// Given places that were touched more than once, each at all its touches: a single one may as well be another than is said.
    fn misstated(&self, problem: &Problem) -> Vec<Candidate> {
        let place = |first: usize| problem.body_measurements[first].seen.position();
        let places_of = |instrument: usize| {
            let own = problem.used_bodies().filter(move |(_, measured)| measured.instrument == instrument);
            own.map(|(k, _)| place(k)).collect::<Vec<_>>()
        };
        let is_told = |instrument: &usize| {
            problem.instruments[*instrument].kind == InstrumentKind::Places && tell_which(&places_of(*instrument))
        };
        let told: BTreeSet<usize> = (0..problem.instruments.len()).filter(is_told).collect();
        let mut all: Vec<Candidate> = Vec::new();
        for (first, measured) in problem.used_bodies().filter(|(_, measured)| told.contains(&measured.instrument)) {
            let changed = Changed::Place { first, instrument: measured.instrument };
            let is_known = |c: &Candidate| matches!(c.changed, Changed::Place { first: other, .. } if Shown::Measurement(other).tells_of(problem, changed));
            if all.iter().any(is_known) {
                continue;
            }
            let telling = |r: &usize| self.rows[*r].of(problem, changed).next().is_some();
            let rows: Vec<usize> = (0..self.rows.len()).filter(telling).collect();
            if let [row, _, ..] = rows[..] {
                let group = self.rows[row].group;
                all.push(Candidate { changed, order: Order::Whole, group, rows: Rc::new(rows), from: 0, fewest: 0 });
            }
        }
        all
    }

    /// Those by one change.
    fn divisions(&self, problem: &Problem, changed: Changed, fewest: usize) -> Vec<Candidate> {
        let mut all = Vec::new();
        if self.parameters(problem, changed) == 0 {
            return all;
        }
        let telling = |r: &usize| self.rows[*r].of(problem, changed).next().is_some();
        let every: Vec<usize> = (0..self.rows.len()).filter(telling).collect();
        for group in 0..self.rows.iter().map(|r| r.group + 1).max().unwrap_or(0) {
            let rows: Vec<usize> = every.iter().copied().filter(|r| self.rows[*r].group == group).collect();
            let elsewhere = every.len() - rows.len();
            let mut divide = |order, rows: Vec<usize>| {
                let rows = Rc::new(rows);
                let (from, fewest) = match order {
                    Order::Whole | Order::Drift => (0..1, 0),
                    Order::Time | Order::Up(_) => (fewest..(rows.len() + 1).saturating_sub(fewest), fewest),
                };
                let is_tried =
                    |from: &usize| changed != Changed::Fixture || self.are_divided(problem, &rows, *from, fewest);
                let from = from.rev().step_by(stride(rows.len())).filter(is_tried);
                all.extend(from.map(|from| Candidate { changed, order, group, rows: rows.clone(), from, fewest }));
            };
            let by_weight = (0..3).filter(|_| self.is_carried(problem, changed, &rows));
            for axis in by_weight {
                let mut rows = rows.clone();
                rows.sort_by(|a, b| {
                    self.up(problem, changed, *a, axis).total_cmp(&self.up(problem, changed, *b, axis))
                });
                divide(Order::Up(axis), rows);
            }
            if rows.len() >= 2 * fewest {
                divide(Order::Drift, rows.clone());
            }
            if rows.len() >= fewest && elsewhere >= fewest {
                divide(Order::Whole, rows.clone());
            }
            divide(Order::Time, rows);
        }
        all
    }

    /// True where at least two sockets hold the body so often on either side: one alone does not tell that others moved with it.
    fn are_divided(&self, problem: &Problem, rows: &[usize], from: usize, fewest: usize) -> bool {
        let held = |rows: &[usize]| {
            let mut held: BTreeMap<usize, usize> = BTreeMap::new();
            let shown = rows.iter().flat_map(|r| self.rows[*r].shown.iter());
            shown.filter_map(|shown| shown.socket(problem)).for_each(|socket| *held.entry(socket).or_default() += 1);
            held
        };
        let [before, behind] = [&rows[..from], &rows[from..]].map(held);
        let is_on_both = |(socket, count): &(&usize, &usize)| {
            **count >= fewest && behind.get(*socket).is_some_and(|count| *count >= fewest)
        };
        fewest > 0 && before.iter().filter(is_on_both).count() > 1
    }

    /// The change of focus, or of where pictures are cut out, that explains more than a plate or a camera that moved, if there is one: beyond what
    /// noise lets it, as it is told by the single images as well.
    pub(super) fn seen_otherwise(&self, problem: &Problem, moved: &Step, fewest: usize) -> Option<Step> {
        let is_body = matches!(moved.changed, Changed::Placement(_) | Changed::Mounting(_));
        let Shown::Image { index, .. } = *moved.shown.first().filter(|_| is_body)? else { return None };
        let camera = problem.images[index].camera;
        let once = |changed| {
            let mut tried = self.divisions(problem, changed, fewest);
            tried.retain(|c| c.order == Order::Time && c.group == moved.group);
            tried
        };
        let tried = match moved.order {
            Order::Time => [Changed::Focal(camera), Changed::Centre(camera)].map(once).concat(),
            // What moved once by much may creep, too, as far as one step from the fit tells.
            Order::Drift => once(Changed::Centre(camera)),
            Order::Up(_) | Order::Whole => return None,
        };
        let mut step = self.most(problem, &tried)?;
        let by_chance = step.change.len() as f64;
        if step.fall - by_chance <= moved.fall {
            return None;
        }
        // What the images tell by themselves is no part of the squares of the poses.
        (step.log_chance, step.fall) = (moved.log_chance, moved.fall);
        Some(step)
    }

    /// The first of single sockets that moved, where fewer than all of them explain more than one twist of all does: it takes up a part of what
    /// some of them miss, and accuses those that stood still. `tried`: what it was the best of.
    pub(super) fn one_by_one(
        &self,
        problem: &Problem,
        all: &Step,
        tried: &[Candidate],
        chances: Chances,
    ) -> Option<Step> {
        let is_single = |c: &&Candidate| matches!(c.changed, Changed::Instrument(i) if is_socket(problem, i));
        let mut single: Vec<Candidate> = tried.iter().filter(is_single).cloned().collect();
        let sockets = single.iter().map(|c| c.changed.columns(&problem.layout, &[]).start).collect::<BTreeSet<usize>>();
        let of_one = (single.len() as f64).ln();
        let (mut linear, mut first, mut told, mut more) = (None, None, 0, 0.0);
        for _ in 1..sockets.len() {
            let before: &Self = linear.as_ref().unwrap_or(self);
            let step = before.most(problem, &single)?;
            let (next, _) = before.with(problem, &step)?;
            told += step.told;
            single.retain(|c| c.changed != step.changed);
            first.get_or_insert(step);
            if self.log_chance_of(problem, &next, told, chances) + more <= all.log_chance {
                return first;
            }
            more += of_one;
            linear = Some(next);
        }
        None
    }

    /// A change at these images and at no others.
    pub(super) fn at(&self, problem: &Problem, changed: Changed, images: &[usize]) -> Option<Candidate> {
        let is_moved = |shown: Shown| matches!(shown, Shown::Image { index, .. } if images.contains(&index));
        let telling = (0..self.rows.len()).filter(|r| self.rows[*r].of(problem, changed).next().is_some());
        let (moved, mut rows): (Vec<usize>, Vec<usize>) =
            telling.partition(|r| self.rows[*r].of(problem, changed).any(is_moved));
        let group = self.rows[*moved.first()?].group;
        let from = rows.len();
        rows.extend(moved);
        Some(Candidate { changed, order: Order::Time, group, rows: Rc::new(rows), from, fewest: 0 })
    }

    fn what_may_change(&self, problem: &Problem) -> Vec<Changed> {
        let placements = (0..problem.placements.len()).map(Changed::Placement);
        let mountings = (0..problem.mountings.len()).map(Changed::Mounting);
        let instruments = (0..problem.instruments.len()).map(Changed::Instrument);
        let targets = (0..problem.layout.bodies.len()).map(Changed::Target);
        let zeros = (0..self.zeros.len()).map(Changed::Zero);
        let carried = targets.chain([Changed::Bracket, Changed::Fixture]);
        placements.chain(mountings).chain(instruments).chain(carried).chain(zeros).collect()
    }

    /// True for what the robot carries before a camera, or a camera that it carries: its weight may move it.
    fn is_carried(&self, problem: &Problem, changed: Changed, rows: &[usize]) -> bool {
        let first = rows.first().and_then(|r| self.rows[*r].of(problem, changed).next());
        let Some(Shown::Image { index, .. }) = first else { return false };
        match changed {
            Changed::Placement(_) => problem.images[index].mount == CameraMount::Fixed,
            Changed::Mounting(_) => problem.images[index].mount == CameraMount::Hand,
            _ => false,
        }
    }

    fn up(&self, problem: &Problem, changed: Changed, row: usize, axis: usize) -> f64 {
        match self.rows[row].of(problem, changed).next() {
            Some(Shown::Image { up, .. }) => up[axis],
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_place_is_told_among_five_of_which_any_three_span_a_plane() {
        let at = |x: f64, y: f64| Vector3::new(x, y, 0.0);
        let square = [at(0.0, 0.0), at(0.2, 0.0), at(0.0, 0.2), at(0.2, 0.2)];
        assert!(!tell_which(&[square, square].concat()));
        assert!(tell_which(&[&square[..], &[at(0.1, 0.07)]].concat()));
        let in_line = [at(0.0, 0.0), at(0.1, 0.0), at(0.2, 0.0), at(0.0, 0.2), at(0.2, 0.2)];
        assert!(!tell_which(&in_line));
        assert!(tell_which(&[&in_line[..], &[at(0.1, 0.15)]].concat()));
    }
}
