//! Simulated robots that a tracker or sockets measure, with known truth.

use nalgebra::{Vector3, Vector6};
use robotcal::assess::{MeasuredPoint, fit_points};
use robotcal::geom::Pose;
use robotcal::identify::{Options, RobotModel, Solution, identify};
use robotcal::model::robot::{Posture, Robot};
use robotcal::problem::{BodySeen, InstrumentKind, MeasuredSeries, MeasuredStop, SeenBody, SeenLength};
use robotcal::urdf::Chain;

use crate::robots::kr6;
use crate::support::small::Dice;

/// What measures, and how well.
#[derive(Clone, Copy, PartialEq)]
pub enum Kind {
    Points,
    Poses,
}

pub struct World {
    pub truth: Robot,
    pub chain: Chain,
    pub series: MeasuredSeries,
    pub sigma_m: f64,
    pub noise_rad: f64,
}

pub fn chain() -> Chain {
    kr6()
}

pub fn stop(k: usize, readings: Vec<f64>) -> MeasuredStop {
    let (image, placement) = (format!("{k:03}"), "placement_0".to_owned());
    MeasuredStop { row: k, image, readings: Some(readings), placement, observations: Vec::new().into(), left_out: None }
}

/// Robot with errors of 0.5 mm and 1 mrad an axis.
pub fn truth(dice: &mut Dice, chain: &Chain) -> Robot {
    let mut robot = Robot::nominal(chain.clone());
    for twist in &mut robot.twists {
        for k in 0..6 {
            twist[k] = dice.normal(if k < 3 { 5e-4 } else { 1e-3 });
        }
    }
    robot
}

/// Readings of the middle of the workspace.
pub fn readings(dice: &mut Dice) -> Vec<f64> {
    let middle = [0.0, -1.2, 1.4, 0.0, 0.6, 0.0];
    let reach = [1.2, 0.5, 0.6, 1.8, 0.9, 2.5];
    middle.iter().zip(reach).map(|(m, r)| m + dice.between(-r, r)).collect()
}

/// Readings near `q` with which a robot whose readings are off by `errors` has the ball where it is wanted.
pub fn with_ball_at(
    truth: &Robot,
    mut q: Vec<f64>,
    errors: &[f64],
    ball: &Pose,
    wanted: &Vector3<f64>,
) -> Option<Vec<f64>> {
    for _ in 0..30 {
        let kinematics = truth.kinematics(&Posture::at(&q), errors);
        let body = kinematics.base_from_tip * *ball;
        let missing = wanted - body.translation;
        if missing.norm() < 1e-12 {
            return (q.iter().all(|q| q.abs() < 3.0)).then_some(q);
        }
        let by_reading = |d: &Vector6<f64>| {
            let (rho, phi) = (d.fixed_rows::<3>(0).into_owned(), d.fixed_rows::<3>(3).into_owned());
            kinematics.base_from_tip.rotation * (rho + phi.cross(&ball.translation))
        };
        let j = nalgebra::Matrix3xX::from_columns(&kinematics.d_readings.iter().map(by_reading).collect::<Vec<_>>());
        let step = j.svd(true, true).pseudo_inverse(1e-9).unwrap() * missing;
        let longest = step.amax();
        let share = if longest > 0.3 { 0.3 / longest } else { 1.0 };
        q.iter_mut().zip(step.iter()).for_each(|(q, s)| *q += share * s);
    }
    None
}

/// The ball on the tip, m.
const BALL: [f64; 3] = [0.02, -0.03, 0.11];

impl World {
    pub fn new(seed: u64, kind: Kind, stops: usize, sigmas: (f64, f64), noise_rad: f64) -> Self {
        let mut dice = Dice::new(seed);
        let chain = chain();
        let truth = truth(&mut dice, &chain);
        Self::taken(dice, truth, kind, stops, sigmas, noise_rad, |dice| {
            let q = readings(dice);
            let errors = (0..q.len()).map(|_| dice.normal(noise_rad)).collect();
            (q, errors)
        })
    }

    /// Poses at stops within ten degrees of each other, of a robot with a share of the usual errors. Its joints are off by `drive_rad`
    /// at each reading, in waves of five degrees, and by as much noise where `repeats` is false.
    pub fn neighbours(seed: u64, share: f64, drive_rad: f64, repeats: bool) -> Self {
        let mut dice = Dice::new(seed);
        let chain = chain();
        let mut truth = truth(&mut dice, &chain);
        truth.twists.iter_mut().for_each(|twist| *twist *= share);
        Self::taken(dice, truth, Kind::Poses, 60, (3e-5, 5e-5), drive_rad, |dice| {
            let middle = [0.1, -1.1, 1.3, 0.2, 0.7, -0.1];
            let q: Vec<f64> = middle.iter().map(|m| m + dice.between(-0.1, 0.1)).collect();
            let wave = |(r, q): (usize, &f64)| drive_rad * std::f64::consts::SQRT_2 * (75.0 * q + r as f64).sin();
            let errors = match repeats {
                true => q.iter().enumerate().map(wave).collect(),
                false => q.iter().map(|_| dice.normal(drive_rad)).collect(),
            };
            (q, errors)
        })
    }

    pub fn taken(
        mut dice: Dice,
        truth: Robot,
        kind: Kind,
        stops: usize,
        (sigma_m, sigma_rad): (f64, f64),
        noise_rad: f64,
        mut at: impl FnMut(&mut Dice) -> (Vec<f64>, Vec<f64>),
    ) -> Self {
        let tip_from_body = dice.pose(0.15, 1.0);
        let base_from_tracker = dice.pose(2.5, 2.0);
        let mut all = Vec::new();
        let mut seen = Vec::new();
        for k in 0..stops {
            let (q, errors) = at(&mut dice);
            let body = truth.pose_at(&Posture::at(&q), &errors) * tip_from_body;
            let tracker_from_body = base_from_tracker.inverse() * body;
            let jitter = Vector3::from_fn(|_, _| dice.normal(sigma_m));
            let turn = Vector3::from_fn(|_, _| dice.normal(sigma_rad));
            let noise = Vector6::new(jitter.x, jitter.y, jitter.z, turn.x, turn.y, turn.z);
            let measured = tracker_from_body.perturbed(&noise);
            let what = match kind {
                Kind::Points => BodySeen::Point(measured.translation),
                _ => BodySeen::Pose(measured),
            };
            seen.push(SeenBody {
                stop: k,
                instrument: "tracker".into(),
                kind: InstrumentKind::Tracker,
                body: "reflector".into(),
                seen: what,
                sigma_m,
                sigma_rad: sigma_rad.max(1e-6),
            });
            all.push(stop(k, q));
        }
        let mut series = MeasuredSeries::without_images("run", true, all);
        series.bodies = seen;
        Self { chain: truth.chain.clone(), truth, series, sigma_m, noise_rad }
    }

    /// A ball on the tip, put into sockets with the tip turned to many directions.
    pub fn sockets(seed: u64, places: usize, stops_each: usize, sigma_m: f64, noise_rad: f64) -> Self {
        let mut dice = Dice::new(seed);
        let chain = chain();
        let truth = truth(&mut dice, &chain);
        let ball = Pose::new(nalgebra::Matrix3::identity(), BALL.into());
        let mut world =
            Self { series: MeasuredSeries::without_images("run", true, Vec::new()), truth, chain, sigma_m, noise_rad };
        let mut centres = Vec::new();
        for place in 0..places {
            let centre = (world.truth.pose_at(&Posture::at(&readings(&mut dice)), &[0.0; 6]) * ball).translation;
            for _ in 0..stops_each {
                let q = loop {
                    if let Some(q) = world.reached(&mut dice, &ball, &centre) {
                        break q;
                    }
                };
                let k = world.series.stops.len();
                world.series.bodies.push(SeenBody {
                    stop: k,
                    instrument: format!("socket {place}"),
                    kind: InstrumentKind::Socket,
                    body: "ball".into(),
                    seen: BodySeen::Point(Vector3::zeros()),
                    sigma_m,
                    sigma_rad: 1.0,
                });
                world.series.stops.push(stop(k, q));
            }
            centres.push(centre);
        }
        for (k, pair) in centres.windows(2).enumerate() {
            world.series.lengths.push(SeenLength {
                between: [format!("socket {k}"), format!("socket {}", k + 1)],
                distance_m: (pair[1] - pair[0]).norm() + dice.normal(5e-5),
                sigma_m: 5e-5,
            });
        }
        world
    }

    /// Where the true robot has the ball at what was measured, the noise of the stop included.
    pub fn ball_at(&self, seen: &SeenBody) -> Vector3<f64> {
        let readings = self.series.stops[seen.stop].readings.as_ref().unwrap();
        self.truth.base_from_tip(readings).transform(&BALL.into())
    }

    /// The ball in these sockets instead, by their names and places, one stop after the other.
    pub fn put(&mut self, dice: &mut Dice, touched: impl Iterator<Item = (String, Vector3<f64>)>) {
        let ball = Pose::new(nalgebra::Matrix3::identity(), BALL.into());
        let first = self.series.bodies[0].clone();
        let (mut stops, mut bodies) = (Vec::new(), Vec::new());
        for (k, (instrument, place)) in touched.enumerate() {
            let q = (0..).find_map(|_| self.reached(dice, &ball, &place)).unwrap();
            stops.push(stop(k, q));
            bodies.push(SeenBody { stop: k, instrument, ..first.clone() });
        }
        (self.series.stops, self.series.bodies) = (stops, bodies);
    }

    /// Readings with which the true robot, its joint errors included, has the ball in the socket up to its noise.
    pub fn reached(&self, dice: &mut Dice, ball: &Pose, centre: &Vector3<f64>) -> Option<Vec<f64>> {
        let q = readings(dice);
        let errors: Vec<f64> = (0..q.len()).map(|_| dice.normal(self.noise_rad)).collect();
        let wanted = centre + Vector3::from_fn(|_, _| dice.normal(self.sigma_m));
        with_ball_at(&self.truth, q, &errors, ball, &wanted)
    }

    pub fn solve(&self, model: RobotModel) -> Solution {
        self.solve_with(&Options { model, ..Options::default() })
    }

    pub fn solve_with(&self, options: &Options) -> Solution {
        identify(self.chain.clone(), std::slice::from_ref(&self.series), options).unwrap()
    }

    /// RMS error of points on the tip, mm, over joint vectors that were not measured, the base frame and the point fitted.
    pub fn error_mm(&self, robot: &Robot) -> f64 {
        let mut dice = Dice::new(999);
        let points: Vec<MeasuredPoint> = (0..120)
            .map(|_| {
                let readings = readings(&mut dice);
                let at = self.truth.base_from_tip(&readings).transform(&Vector3::new(0.05, 0.02, 0.1));
                MeasuredPoint { position_m: at, readings }
            })
            .collect();
        1e3 * fit_points(robot, &points).unwrap().rms_m
    }
}
