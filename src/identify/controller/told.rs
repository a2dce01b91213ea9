//! How poses of a controller are to be read, by what was seen at them.
//!
//! A tool on the flange and a frame in the base are constant: hand-eye transform and target pose take them up, and what was seen fits the poses as
//! they are written, whether or not the robot reaches them. No constant makes up for another convention of rotation, inverted poses,
//! another unit, or numbers in the wrong column or row.

use std::collections::BTreeMap;

use crate::assess::Limits;
use crate::geom::Pose;
use crate::identify::bodies::placed::{SeenFrom, missed, placed};
use crate::identify::mistakes::exchanged::Exchanged;
use crate::identify::mistakes::suspects::some_of;
use crate::identify::photogrammetry::free_poses::free_poses_of;
use crate::init::{PosePair, hand_eye_misfit};
use crate::linalg::lower_median;
use crate::model::robot::Robot;
use crate::problem::{BodySeen, MeasuredSeries};
use crate::series::{CameraMount, ControllerPoses, LENGTH_UNITS, LengthUnit};
use crate::urdf::Chain;

/// A way to read poses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::identify) struct ReadAs {
    /// The mistake that is undone, by its place among [`ControllerPoses::otherwise`].
    pub otherwise: Option<usize>,
    /// The unit of the positions, where it is not metres.
    pub unit: Option<LengthUnit>,
    /// Where the numbers stand, where it is not where they should.
    pub misplaced: Option<Misplaced>,
}

/// Numbers of a table of poses that stand in the wrong column or row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::identify) enum Misplaced {
    /// Two coordinates of the position stand in each other's column.
    Columns(Exchanged),
    /// Every pose stands one row off: that of a stop in the row below, or above.
    Rows {
        /// True for the row below.
        below: bool,
    },
}

impl ReadAs {
    /// As they are written.
    pub const WRITTEN: Self = Self { otherwise: None, unit: None, misplaced: None };

    /// All ways with one mistake undone, and all with two.
    pub fn mistaken(poses: &ControllerPoses) -> [Vec<Self>; 2] {
        let others = || (0..poses.otherwise.len()).map(|k| Self { otherwise: Some(k), ..Self::WRITTEN });
        let in_units = |way: Self| LENGTH_UNITS.iter().map(move |unit| Self { unit: Some(*unit), ..way });
        [in_units(Self::WRITTEN).chain(others()).collect(), others().flat_map(in_units).collect()]
    }

    /// All ways with numbers in the wrong place. Whether poses are reached tells nothing of them: every one is, or its neighbour.
    fn misplaced() -> impl Iterator<Item = Self> {
        let columns = Exchanged::ALL.map(Misplaced::Columns);
        let rows = [true, false].map(|below| Misplaced::Rows { below });
        columns.into_iter().chain(rows).map(|misplaced| Self { misplaced: Some(misplaced), ..Self::WRITTEN })
    }

    /// The poses, read so.
    pub fn of(self, poses: &ControllerPoses) -> Vec<Option<Pose>> {
        let read = self.otherwise.map_or(&poses.base_from_flange, |k| &poses.otherwise[k].poses);
        let metres = self.unit.map_or(1.0, |unit| unit.metres);
        let in_metres = |pose: &Pose| Pose::new(pose.rotation, pose.translation * metres);
        let of = |row: Option<usize>| read.get(row?)?.as_ref().map(in_metres);
        let at = |row: usize| match self.misplaced {
            None => of(Some(row)),
            Some(Misplaced::Columns(exchanged)) => of(Some(row)).map(|pose| exchanged.undone(pose)),
            Some(Misplaced::Rows { below: true }) => of(Some(row + 1)),
            Some(Misplaced::Rows { below: false }) => of(row.checked_sub(1)),
        };
        (0..read.len()).map(at).collect()
    }
}

/// What was seen tells of the poses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::identify) enum PosesFit {
    /// Nothing: too little was seen.
    Open,
    /// They fit, read so.
    Fit(ReadAs),
    /// They fit in none of the usual ways.
    InNoWay,
}

/// What was seen at the stops of one camera and one target, or of one body.
enum SeenAtStops {
    Images(Vec<(usize, CameraMount, Pose)>),
    Body(Vec<(usize, BodySeen)>),
}

impl SeenAtStops {
    /// By the images, else by what a tracker saw; `None` where there are too few of both.
    fn of(series: &MeasuredSeries, limits: &Limits) -> Option<Self> {
        let enough = |count: usize| count >= limits.hand_eye_images;
        if let Some(images) = images(series, limits).filter(|images| enough(images.len())) {
            return Some(Self::Images(images));
        }
        let mut groups: BTreeMap<(&str, &str), Vec<(usize, BodySeen)>> = BTreeMap::new();
        for body in series.bodies.iter().filter(|body| !body.kind.is_parallel_to_base()) {
            groups.entry((&body.instrument, &body.body)).or_default().push((body.stop, body.seen));
        }
        let largest = groups.into_values().max_by_key(Vec::len);
        largest.filter(|seen| enough(seen.len())).map(Self::Body)
    }

    /// Median misfit with these poses of the flange, rad + m (m of points); infinite where they determine nothing.
    fn misfit(&self, poses: &[Option<Pose>]) -> f64 {
        match self {
            Self::Images(images) => {
                let pair = |(stop, mount, seen): &(usize, CameraMount, Pose)| {
                    Some(PosePair::of_flange(*mount, (*poses.get(*stop)?)?, *seen))
                };
                let pairs: Vec<PosePair> = images.iter().filter_map(pair).collect();
                let pairs: Vec<PosePair> = some_of(pairs.len()).map(|k| pairs[k]).collect();
                hand_eye_misfit(&pairs)
            }
            Self::Body(seen) => {
                let at = |(stop, seen): &(usize, BodySeen)| Some((*seen, (*poses.get(*stop)?)?));
                let seen: Vec<SeenFrom> = seen.iter().filter_map(at).collect();
                let by = placed(&seen, f64::INFINITY);
                by.map_or(f64::INFINITY, |by| lower_median(seen.iter().map(|seen| missed(seen, &by))))
            }
        }
    }
}

/// Poses of the camera at the placement with most of them.
fn images(series: &MeasuredSeries, limits: &Limits) -> Option<Vec<(usize, CameraMount, Pose)>> {
    let alone = MeasuredSeries { bodies: Vec::new(), lengths: Vec::new(), ..series.clone() };
    let robot = Robot::nominal(Chain::empty());
    let (_, free, _) = free_poses_of(&robot, std::slice::from_ref(&alone), limits, |_| Ok(())).ok()?;
    let mut groups: BTreeMap<&str, Vec<(usize, CameraMount, Pose)>> = BTreeMap::new();
    for (k, (stop, pose)) in series.stops.iter().zip(&free.poses).enumerate() {
        if let Some(pose) = pose {
            groups.entry(&stop.placement).or_default().push((k, series.mount, pose.camera_from_plate));
        }
    }
    groups.into_values().max_by_key(Vec::len)
}

/// How the poses fit what was seen in the series, which has no readings yet.
pub(in crate::identify) fn told(series: &MeasuredSeries, poses: &ControllerPoses, limits: &Limits) -> PosesFit {
    let Some(seen) = SeenAtStops::of(series, limits) else { return PosesFit::Open };
    let misfit = |way: ReadAs| seen.misfit(&way.of(poses));
    let as_written = misfit(ReadAs::WRITTEN);
    if as_written < limits.suspicious_misfit {
        return PosesFit::Fit(ReadAs::WRITTEN);
    }
    let explains = |left: f64| left < limits.suspicious_misfit && left < limits.mistake_explains * as_written;
    let best_of = |ways: Vec<ReadAs>| {
        let tried = ways.into_iter().map(|way| (misfit(way), way));
        tried.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(left, _)| explains(*left))
    };
    let [mut of_one, of_two] = ReadAs::mistaken(poses);
    of_one.extend(ReadAs::misplaced());
    [of_one, of_two].into_iter().find_map(best_of).map_or(PosesFit::InNoWay, |(_, way)| PosesFit::Fit(way))
}
