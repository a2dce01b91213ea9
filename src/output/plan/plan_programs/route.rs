//! The list of motions that all writers of programs go through.

use crate::plan::order::motion;
use crate::plan::{Plan, PlanRequest, image_name};
use crate::urdf::{Chain, JointKind};

/// Name of the programs.
pub(super) const NAME: &str = "robotcal_plan";
/// Time for the arm to come to rest before the trigger, s.
pub(super) const SETTLE_S: f64 = 1.0;
/// Time after the trigger, s.
pub(super) const EXPOSE_S: f64 = 0.5;
/// Length of the trigger pulse, s.
pub(super) const PULSE_S: f64 = 0.2;
/// Greatest joint speed, rad/s (or m/s).
pub(super) const SPEED: f64 = 0.5;
/// Letters of a name in a text in quotes; RAPID allows 80 in all.
const LONGEST_NAME: usize = 40;
/// Shortest time of a motion, s.
const LEAST_TIME_S: f64 = 1.0;

/// What happens at the end of a motion.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Purpose {
    /// Nothing: a posture on the way.
    Pass,
    /// An image is taken.
    Image(String),
    /// The operator moves the plate to this place before the motion, then an image is taken.
    MovePlate(String, String),
}

/// Axes of an arm in the languages of its maker; which of more are external, the description of the robot does not tell.
pub(super) const ARM_AXES: usize = 6;

/// One motion of the program.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Visit {
    /// Readings, rad or m.
    pub readings: Vec<f64>,
    /// What for.
    pub purpose: Purpose,
    /// Time of the motion, s.
    pub time_s: f64,
    /// False where the straight way there touches something.
    pub way_is_free: bool,
}

/// What an operator is asked for where no straight way is free.
pub(super) const TEACH: &str = "The straight way from here is not free: teach a posture in between";

impl Visit {
    /// What an operator has to do before the motion.
    pub fn halts(&self) -> Vec<String> {
        let plate = match &self.purpose {
            Purpose::MovePlate(place, _) => Some(format!("Move the plate to {}", harmless(place))),
            _ => None,
        };
        plate.into_iter().chain((!self.way_is_free).then(|| TEACH.to_owned())).collect()
    }
}

/// What every writer needs.
pub(super) struct Route<'a> {
    pub joints: &'a [String],
    pub kinds: &'a [JointKind],
    /// Leading joints that are not of the arm.
    pub external: usize,
    pub visits: Vec<Visit>,
}

/// Readings of a visit as teach pendants show them, by the axes of the controller.
pub(super) struct Axes<T> {
    /// Of the arm, A1 and so on.
    pub arm: Vec<T>,
    /// External axes: a rail that carries the arm, a positioner that carries the plate.
    pub external: Vec<T>,
}

/// Prismatic joints before the arm that are a rail or a cross slide; three of them are the main axes of a gantry.
const MOST_SLIDES: usize = 2;

impl<'a> Route<'a> {
    /// The motions of a plan.
    pub fn of(request: &'a PlanRequest, plan: &Plan) -> Self {
        let chain = &request.setting.robot.chain;
        let mut visits: Vec<Visit> = Vec::new();
        let mut placement = None;
        for (k, leg) in plan.legs.iter().enumerate() {
            let stop = &plan.pool[leg.stop];
            let image = image_name(k);
            let moved = placement.is_some_and(|p| p != stop.placement);
            placement = Some(stop.placement);
            let purpose = match moved {
                true => Purpose::MovePlate(request.setting.placements[stop.placement].0.clone(), image),
                false => Purpose::Image(image),
            };
            let ways = leg.via.iter().map(|q| (q.clone(), Purpose::Pass));
            for (readings, purpose) in ways.chain([(stop.readings.clone(), purpose)]) {
                let length = visits.last().map_or(0.0, |v| motion(&v.readings, &readings));
                let time_s = (length / SPEED).max(LEAST_TIME_S);
                visits.push(Visit { readings, purpose, time_s, way_is_free: leg.is_free });
            }
        }
        Self { joints: &chain.readings, kinds: &chain.reading_kinds, external: external_axes(chain), visits }
    }
}

/// Number of leading readings that move what carries the plate, or slide the arm as a whole.
fn external_axes(chain: &Chain) -> usize {
    let climbed = chain.joints[..chain.climbed()].iter().filter_map(|joint| joint.drive);
    let behind = climbed.map(|drive| drive.reading + 1).max().unwrap_or(0);
    let slides = chain.reading_kinds[behind..].iter().take_while(|kind| **kind == JointKind::Prismatic).count();
    behind + if slides <= MOST_SLIDES { slides } else { 0 }
}

impl Route<'_> {
    /// Names of the joints for a comment.
    pub fn joint_list(&self) -> String {
        self.joints.iter().map(|j| harmless(j)).collect::<Vec<_>>().join(", ")
    }

    /// Names of the joints for a comment, in the order of the axes of a controller.
    pub fn axis_list(&self) -> String {
        let Axes { arm, external } = self.by_axis(self.joints);
        let names = |joints: Vec<&String>| joints.into_iter().map(|j| harmless(j)).collect::<Vec<_>>().join(", ");
        let arm = names(arm);
        if external.is_empty() { arm } else { format!("{arm}; external: {}", names(external)) }
    }

    /// What stands in the order of the joints, by axes.
    pub fn by_axis<'a, T>(&self, all: &'a [T]) -> Axes<&'a T> {
        let (external, arm) = all.split_at(self.external.min(all.len()));
        Axes { arm: arm.iter().collect(), external: external.iter().collect() }
    }

    /// True where the axes of the arm are no more than a controller of six has, so that each has its place.
    pub fn is_of_six(&self, external: usize) -> bool {
        let axes = self.by_axis(self.kinds);
        axes.arm.len() <= ARM_AXES && axes.external.len() <= external
    }

    /// Readings as teach pendants show them: degrees, or mm.
    pub fn shown(&self, readings: &[f64]) -> Vec<f64> {
        let one = |(q, kind): (&f64, &JointKind)| match kind {
            JointKind::Prismatic => 1e3 * q,
            _ => q.to_degrees(),
        };
        readings.iter().zip(self.kinds).map(one).collect()
    }
}

/// A name inside a comment or a text in quotes of any controller: printable ASCII, without quotes, escapes and marks that begin or
/// end a comment; short, since controllers limit the length of texts.
pub(super) fn harmless(name: &str) -> String {
    let safe = |c: char| if (c.is_ascii_graphic() && !"\"'\\;!#&%{}".contains(c)) || c == ' ' { c } else { '_' };
    name.chars().take(LONGEST_NAME).map(safe).collect()
}
