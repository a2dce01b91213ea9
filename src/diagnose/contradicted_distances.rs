//! Measured distances that miss what all else says by more than chance allows: those that were left out of the fit, and those in it that are doubtful.
//! The statistic is that of [`crate::solve::LengthMisfit`].

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight, some_of};
use crate::assess::{Accuracy, Limits};
use crate::error::Code;
use crate::fit::Fit;
use crate::series::{LENGTH_UNITS, LengthUnit};
use crate::solve::LengthMisfit;

/// Most distances that are named.
const MOST_NAMED: usize = 4;

/// One measured distance.
#[derive(Debug, Clone, PartialEq)]
pub struct DistanceOff {
    /// Names of its ends.
    pub between: [String; 2],
    /// As stated, m.
    pub stated_m: f64,
    /// Its stated sigma, m.
    pub sigma_m: f64,
    /// As fitted, m.
    pub fitted_m: f64,
}

/// Measured distances of a series that are off by the same ratio.
#[derive(Debug, Clone, PartialEq)]
pub struct ContradictedDistances {
    /// The series.
    pub series: String,
    /// The distances.
    pub distances: Vec<DistanceOff>,
    /// As stated over as fitted, less one.
    pub off: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// The unit that they seem to be in.
    pub unit: Option<LengthUnit>,
    /// Gate where they are left out.
    pub weight: Weight,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<ContradictedDistances> {
    let (lengths, limits) = (&fit.problem.lengths, setting.limits);
    if lengths.is_empty() {
        return Vec::new();
    }
    let Ok(covariance) = fit.own_covariance() else { return Vec::new() };
    let misfits = fit.adjustment.length_misfits(&covariance);
    let count = misfits.len();
    let (out, used): (Vec<_>, Vec<_>) = misfits.into_iter().partition(|m| lengths[m.index].left_out);
    let doubtful =
        used.into_iter().filter(|m| m.is_beyond(limits.distance_doubtful, count)).map(|m| (vec![m], Weight::Note));
    let contradicted = alike(out, fit, limits).into_iter().map(|all| (all, Weight::Gate));
    contradicted.chain(doubtful).filter_map(|(all, weight)| together(&all, fit, setting, weight)).collect()
}

/// The unit in which a distance seems to be that is off by so much.
fn unit_of(off: f64, limits: &Limits) -> Option<LengthUnit> {
    let is_unit = |unit: &&LengthUnit| ((1.0 + off) * unit.metres - 1.0).abs() < limits.scale_of_unit;
    LENGTH_UNITS.iter().find(is_unit).copied()
}

/// Those of one series that are off by the same ratio, or seem to be in one unit, together.
fn alike(misfits: Vec<LengthMisfit>, fit: &Fit, limits: &Limits) -> Vec<Vec<LengthMisfit>> {
    let series = |m: &LengthMisfit| fit.problem.lengths[m.index].read.0;
    let mut groups: Vec<Vec<LengthMisfit>> = Vec::new();
    for own in misfits {
        let unit = unit_of(own.relative(), limits);
        let is_like = |m: &LengthMisfit| match unit {
            Some(_) => unit_of(m.relative(), limits) == unit,
            None => m.is_alike(&own, limits.plate_size_sigmas),
        };
        let same = |group: &&mut Vec<LengthMisfit>| group.iter().all(|m| series(m) == series(&own) && is_like(m));
        match groups.iter_mut().find(same) {
            Some(group) => group.push(own),
            None => groups.push(vec![own]),
        }
    }
    groups
}

fn together(all: &[LengthMisfit], fit: &Fit, setting: &CheckContext, weight: Weight) -> Option<ContradictedDistances> {
    let lengths = &fit.problem.lengths;
    let series = &setting.series[lengths[all.first()?.index].read.0];
    let distance = |m: &LengthMisfit| {
        let own = &lengths[m.index];
        let between = series.lengths[own.read.1].between.clone();
        DistanceOff { between, stated_m: own.distance_m, sigma_m: own.sigma_m, fitted_m: m.fitted_m }
    };
    let information = |m: &LengthMisfit| m.relative_sigma().powi(-2);
    let whole: f64 = all.iter().map(information).sum();
    let off = all.iter().map(|m| information(m) * m.relative()).sum::<f64>() / whole;
    // They have the lengths of the robot in common: together they know them no better than the best of them.
    let sigma = all.iter().map(LengthMisfit::relative_sigma).fold(f64::INFINITY, f64::min);
    let unit = unit_of(off, setting.limits);
    let distances = all.iter().map(distance).collect();
    Some(ContradictedDistances { series: series.name.clone(), distances, off, sigma, unit, weight })
}

impl Kind for ContradictedDistances {
    fn code(&self) -> Code {
        Code::LengthsContradicted
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        let ends = self.distances.iter().map(|d| Subject::Place(format!("[[distance]] {}", d.between.join(" to "))));
        [Subject::Series(self.series.clone())].into_iter().chain(ends).collect()
    }

    fn quantities(&self) -> Vec<Quantity> {
        let of = |d: &DistanceOff| {
            let stated = Quantity::new("stated", d.stated_m, "m").with_sigma(d.sigma_m);
            [stated, Quantity::new("fitted", d.fitted_m, "m")]
        };
        let size = Quantity::new("relative_size", self.off, "1").with_sigma(self.sigma);
        [size].into_iter().chain(self.distances.iter().flat_map(of)).collect()
    }

    fn place(&self) -> String {
        format!("series {}, [[distance]]", self.series)
    }

    fn seen(&self) -> String {
        let of = |d: &DistanceOff| {
            let [from, to] = &d.between;
            format!(
                "{from} to {to} is stated as {} m (sigma {}), and {:.5} m by all else",
                d.stated_m, d.sigma_m, d.fitted_m
            )
        };
        let named: Vec<String> = self.distances.iter().map(of).collect();
        let unit = self.unit.map_or_else(String::new, |unit| format!(": in {}, it seems", unit.name));
        let out = if self.weight == Weight::Gate { "; left out" } else { "" };
        format!("{}{unit}{out}", some_of(&named, MOST_NAMED))
    }

    fn remedy(&self) -> String {
        match self.unit {
            Some(unit) => format!("distance_m is in metres: multiply by {}", unit.metres),
            None => "measure it again and look at its ends, unit and sigma; if it is right, the URDF is of another robot or size, or the tracker's scale is wrong"
                .into(),
        }
    }
}
