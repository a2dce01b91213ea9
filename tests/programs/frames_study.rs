//! What touches make of a corrected program, in worlds with known truth, against the bound that these touches allow.

use nalgebra::{DMatrix, Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use robotcal::assess::Limits;
use robotcal::calibration::{Ends, Inputs};
use robotcal::frames::{Given, Knowledge, KnownRobot, TouchPlace, TouchRequest, Touches, fit, plan_touches};
use robotcal::geom::{Pose, skew};
use robotcal::identify::{Options, Solution, identify};
use robotcal::linalg::SymmetricFactor;
use robotcal::model::inverse::{reading_limits, solve_from};
use robotcal::model::joint_terms::Term;
use robotcal::model::robot::{Posture, Robot};
use robotcal::output::restore::found_model;
use robotcal::output::solution_json;
use robotcal::problem::Layout;
use robotcal::simulate::RobotErrors;
use robotcal::simulate::truth::Truth;
use robotcal::urdf::Chain;

use crate::programs_support::identified::identified_kr6;
use crate::programs_support::touching::{Toucher, ranges, spread};
use crate::robots::{kr6_to_link_6, repo};

/// Sigma of a touch per axis, m.
const TOUCH_M: f64 = 5e-5;
/// Joint vectors of a program.
const TARGETS: usize = 100;

/// A robot that was identified, and as it is.
struct Robots {
    known: KnownRobot,
    truth: Robot,
    nominal: Robot,
    /// What the bound is computed from, apart from the code that it judges.
    solved: Robot,
    layout: Layout,
    covariance: DMatrix<f64>,
    joint_sigma: f64,
    /// Joint vectors at which the plate could be seen from, though no image was taken there: where programs run.
    region: Vec<Vec<f64>>,
}

/// The cell of a robot, as planned and as it is.
struct Cell {
    planned_work: Pose,
    planned_tool: Vector3<f64>,
    work: Pose,
    tool: Vector3<f64>,
}

fn cell(rng: &mut ChaCha8Rng) -> Cell {
    let draw = |sigma: f64, rng: &mut ChaCha8Rng| spread(&[(-1.7 * sigma, 1.7 * sigma); 3], 1, rng).remove(0);
    let (planned_work, planned_tool) =
        (Pose::from_xyz_rpy([0.5, 0.1, 0.1], [0.0, 0.0, 0.5]), Vector3::new(0.02, 0.0, 0.12));
    let [m, r, t] = [3e-3, 5e-3, 1e-3].map(|sigma| draw(sigma, rng));
    let off = Pose::from_xyz_rpy([m[0], m[1], m[2]], [r[0], r[1], r[2]]);
    Cell { planned_work, planned_tool, work: planned_work * off, tool: planned_tool + Vector3::new(t[0], t[1], t[2]) }
}

fn point(p: Vector3<f64>) -> Pose {
    Pose::new(Matrix3::identity(), p)
}

impl Robots {
    fn of(s: &Solution, chain: &Chain, truth: Robot) -> Self {
        let stops: Vec<Posture> = s.fit.problem.stops.iter().filter_map(|stop| stop.posture.clone()).collect();
        let (solved, layout) = (s.fit.state.robot.without_local_errors(), s.fit.problem.layout.clone());
        let covariance = s.fit.covariance.reduced.clone();
        let sigma: Vec<f64> = s.fit.problem.joint_sigma(0);
        let known = KnownRobot::new(&solved, &layout, &covariance, None, sigma, stops).unwrap();
        Self {
            known,
            truth,
            nominal: Robot::nominal(chain.clone()),
            solved,
            layout,
            covariance,
            joint_sigma: 0.0,
            region: Vec::new(),
        }
    }

    /// Some of the joint vectors, each once.
    fn drawn(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
        let mut all = self.region.clone();
        (0..count).map(|_| all.swap_remove(rng.random_range(0..all.len()))).collect()
    }

    fn toucher(&self, cell: &Cell) -> Toucher<'_> {
        Toucher {
            truth: &self.truth,
            work: cell.work,
            tool: cell.tool,
            sigma_m: TOUCH_M,
            joint_sigma: self.joint_sigma,
        }
    }

    /// `[A, G, H]` of a point of the tip at a posture, by its own formulas.
    fn rows(&self, posture: &Posture, tool: &Vector3<f64>, work: &Pose) -> [DMatrix<f64>; 3] {
        let k = self.solved.kinematics(posture, &vec![0.0; posture.readings.len()]);
        let tip = k.base_from_tip;
        let mut by_tip = DMatrix::zeros(3, 6);
        by_tip.view_mut((0, 0), (3, 3)).copy_from(&tip.rotation);
        by_tip.view_mut((0, 3), (3, 3)).copy_from(&(-tip.rotation * skew(tool)));
        let place = work.inverse().transform(&tip.transform(tool));
        let mut a = DMatrix::zeros(3, 9);
        a.view_mut((0, 0), (3, 3)).copy_from(&tip.rotation);
        a.view_mut((0, 3), (3, 3)).copy_from(&-work.rotation);
        a.view_mut((0, 6), (3, 3)).copy_from(&(work.rotation * skew(&place)));
        let n = self.layout.locals.start;
        let (mut g, mut h) = (DMatrix::zeros(3, n), DMatrix::zeros(3, k.d_readings.len()));
        for (i, d) in k.d_twists.iter().enumerate() {
            g.view_mut((0, self.layout.twists.start + 6 * i), (3, 6)).copy_from(&(&by_tip * d));
        }
        for (i, d) in k.d_terms.iter().enumerate() {
            g.view_mut((0, self.layout.terms.start + i), (3, 1)).copy_from(&(&by_tip * d));
        }
        for (i, d) in k.d_readings.iter().enumerate() {
            h.set_column(i, &(&by_tip * d * self.joint_sigma));
        }
        [a, g, h]
    }

    /// Mean square error that the best linear prediction of the tool at the targets has, m^2: touches, the robot's covariance as prior, base
    /// and tool free (universal kriging, dense). Infinite where the touches leave a direction of the frames free.
    fn bound(&self, touches: &Touches, targets: &[Vec<f64>], tool: &Vector3<f64>, work: &Pose) -> f64 {
        let n = self.layout.locals.start;
        let c = self.covariance.view((0, 0), (n, n)).into_owned();
        let count = touches.all.len();
        let (mut a, mut g) = (DMatrix::zeros(3 * count, 9), DMatrix::zeros(3 * count, n));
        let mut v = DMatrix::zeros(3 * count, 3 * count);
        for (k, t) in touches.all.iter().enumerate() {
            let [ak, gk, hk] = self.rows(&touches.postures[t.posture], tool, work);
            a.rows_mut(3 * k, 3).copy_from(&ak);
            g.rows_mut(3 * k, 3).copy_from(&gk);
            let own = &hk * hk.transpose() + DMatrix::identity(3, 3) * TOUCH_M.powi(2);
            v.view_mut((3 * k, 3 * k), (3, 3)).copy_from(&own);
        }
        v += &g * &c * g.transpose();
        let v = SymmetricFactor::new(&v).unwrap();
        let va = v.solve_many(&a);
        let Ok(information) = SymmetricFactor::new(&(a.transpose() * &va)) else {
            return f64::INFINITY;
        };
        let square = |q: &Vec<f64>| {
            let [at, gt, _] = self.rows(&Posture::at(q), tool, work);
            let cross = &g * &c * gt.transpose();
            let vc = v.solve_many(&cross);
            let left = at.transpose() - a.transpose() * &vc;
            let all =
                &gt * &c * gt.transpose() - cross.transpose() * &vc + left.transpose() * information.solve_many(&left);
            all.trace()
        };
        targets.iter().map(square).sum::<f64>() / targets.len() as f64
    }

    /// Joints that bring the written robot to a pose of its tip.
    fn reached(&self, robot: &Robot, wanted: &Pose, start: &[f64]) -> Option<Vec<f64>> {
        let found = solve_from(robot, &reading_limits(&self.nominal.chain), wanted, start)?;
        // Another posture is no correction: `compensate` leaves the target.
        found.iter().zip(start).all(|(a, b)| (a - b).abs() < 0.3).then_some(found)
    }

    /// Where the tool really is in the work object.
    fn really(&self, q: &[f64], cell: &Cell) -> Vector3<f64> {
        cell.work.inverse().transform(&self.truth.base_from_tip(q).transform(&cell.tool))
    }

    /// Mean square error of an off-line program with measured frames, m^2.
    fn program(&self, robot: &Robot, targets: &[Vec<f64>], cell: &Cell, found: &Found) -> f64 {
        let (tool, work) = (found.tool, found.work);
        let square = |q: &Vec<f64>| {
            let meant = cell.planned_work.inverse() * self.nominal.base_from_tip(q) * point(cell.planned_tool);
            let wanted = found.aimed(self, q, work * meant * point(tool).inverse());
            let corrected = self.reached(robot, &wanted, q)?;
            Some((self.really(&corrected, cell) - meant.translation).norm_squared())
        };
        let all: Vec<f64> = targets.iter().filter_map(square).collect();
        assert!(10 * all.len() >= 8 * targets.len(), "{} of {} targets reached", all.len(), targets.len());
        all.iter().sum::<f64>() / all.len() as f64
    }
}

/// A KR 6 with errors of the size of the priors, identified from 40 stops.
fn kr6(seed: u64, errors: RobotErrors) -> Robots {
    let (made, s) = identified_kr6(errors, 2 * TARGETS, seed);
    let joint_sigma = made.truth.joint_noise_sigma[0];
    let region = made.truth.held_out.iter().map(|h| h.readings.clone()).collect();
    println!(
        "seed {seed}: {} terms, joint noise {:?} mrad found",
        s.fit.state.robot.terms.len(),
        s.fit.problem.joint_sigma(0).iter().map(|v| (1e6 * v).round() / 1e3).collect::<Vec<_>>()
    );
    Robots { joint_sigma, region, ..Robots::of(&s, &kr6_to_link_6(), made.truth.robot(&kr6_to_link_6()).unwrap()) }
}

/// Frames of touches, as `compensate` uses them.
struct Found {
    tool: Vector3<f64>,
    work: Pose,
    /// What the touches say of the robot beyond the solution.
    knowledge: Option<Knowledge>,
    bound_m2: f64,
    stated_m2: f64,
}

impl Found {
    /// Tool and base where the description has them.
    fn nominal(tool: Vector3<f64>, work: Pose) -> Self {
        Self { tool, work, knowledge: None, bound_m2: 0.0, stated_m2: 0.0 }
    }

    /// Where the tool is beside where the written robot has it.
    fn error(&self, robots: &Robots, q: &[f64]) -> Vector3<f64> {
        let of = |k: &Knowledge| k.error_m(&robots.known, &Posture::at(q), &point(self.tool), &self.work);
        self.knowledge.as_ref().map_or_else(Vector3::zeros, of)
    }

    /// The pose that the written robot aims at to arrive at another.
    fn aimed(&self, robots: &Robots, q: &[f64], wanted: Pose) -> Pose {
        Pose::new(wanted.rotation, wanted.translation - self.error(robots, q))
    }
}

/// Frames of touches at random joint vectors of the region, and the bound for them.
fn touched(robots: &Robots, cell: &Cell, count: usize, targets: &[Vec<f64>], rng: &mut ChaCha8Rng) -> Found {
    let q = robots.drawn(count, rng);
    let touches = robots.toucher(cell).places(&q, "fixture", rng);
    let found = fit(&robots.known, &touches, &Given::default(), &Limits::default()).unwrap();
    Found {
        tool: found.tools[0].translation,
        work: found.work.unwrap(),
        knowledge: Some(found.knowledge),
        bound_m2: robots.bound(&touches, targets, &cell.tool, &cell.work),
        stated_m2: found.expected.with_frames_m.powi(2),
    }
}

fn worlds(default: u64) -> u64 {
    std::env::var("WORLDS").map_or(default, |n| n.parse().unwrap())
}

#[test]
#[ignore = "minutes; its figures stand in the guide, frames; WORLDS robots"]
fn study_of_touches_against_their_bound() {
    let robots: Vec<Robots> =
        (1..=worlds(20)).into_par_iter().map(|seed| kr6(seed, RobotErrors::of_priors())).collect();
    println!("{} robots of 40 stops, 3 draws of touches each, {TARGETS} targets", robots.len());
    let mut ratios = Vec::new();
    for count in [6, 12, 30] {
        // Each robot alone, and each to the one after it.
        let of = |(k, robot): (usize, &Robots)| {
            let mut rng = ChaCha8Rng::seed_from_u64(100 * k as u64 + count as u64);
            let other = &robots[(k + 1) % robots.len()];
            let mut sums = [0.0; 6];
            for _ in 0..3 {
                let (own, others) = (cell(&mut rng), cell(&mut rng));
                let targets = robot.drawn(TARGETS, &mut rng);
                let a = touched(robot, &own, count, &targets, &mut rng);
                let b = touched(other, &others, count, &targets, &mut rng);
                let error = robot.program(robot.known.exported(), &targets, &own, &a);
                let written = robot.program(robot.known.exported(), &targets, &own, &Found::nominal(a.tool, a.work));
                // Taught on `robot` with its tool, run by `other`.
                let square = |q: &Vec<f64>| {
                    let taught = robot.known.exported().base_from_tip(q);
                    let taught = Pose::new(taught.rotation, taught.translation + a.error(robot, q));
                    let in_work = a.work.inverse() * taught * point(a.tool);
                    let wanted = b.aimed(other, q, b.work * in_work * point(b.tool).inverse());
                    let corrected = other.reached(other.known.exported(), &wanted, q)?;
                    Some((other.really(&corrected, &others) - robot.really(q, &own)).norm_squared())
                };
                let moved: Vec<f64> = targets.iter().filter_map(square).collect();
                let moved = moved.iter().sum::<f64>() / moved.len() as f64;
                let all = [error, a.bound_m2, a.stated_m2, moved, a.bound_m2 + b.bound_m2, written];
                sums.iter_mut().zip(all).for_each(|(s, v)| *s += v / 3.0);
            }
            sums
        };
        let all: Vec<[f64; 6]> = robots.par_iter().enumerate().map(of).collect();
        let rms = |k: usize| 1e3 * (all.iter().map(|s| s[k]).sum::<f64>() / all.len() as f64).sqrt();
        println!(
            "{count:>3} touches: tool off by {:.4} mm RMS, bound {:.4}, ratio {:.3}, stated {:.4}, frames alone {:.4}; retargeted {:.4}, bound {:.4}, ratio {:.3}",
            rms(0),
            rms(1),
            rms(0) / rms(1),
            rms(2),
            rms(5),
            rms(3),
            rms(4),
            rms(3) / rms(4)
        );
        ratios.extend([rms(0) / rms(1), rms(3) / rms(4)]);
    }
    assert!(ratios.iter().all(|r| *r <= 1.1), "{ratios:?}");
}

/// The calibrated robot without what a URDF cannot hold.
fn urdf_only(robot: &Robot) -> Robot {
    let mut robot = robot.clone();
    robot.terms.retain(|t| t.term == Term::Offset);
    robot
}

fn small() -> Robots {
    let record = solution_json::read(&std::fs::read(repo("reports/kr6_small/solution.json")).unwrap()).unwrap();
    let found = found_model(&record).unwrap();
    let chain = found.robot.chain.clone();
    let truth = Truth::read(&repo("datasets/kr6_small/truth.toml")).unwrap();
    Robots {
        known: found.known_robot(None).unwrap(),
        truth: truth.robot(&chain).unwrap(),
        nominal: Robot::nominal(chain),
        joint_sigma: truth.joint_noise_sigma[0],
        region: truth.held_out.iter().map(|h| h.readings.clone()).collect(),
        solved: found.robot,
        layout: found.layout,
        covariance: found.covariance,
    }
}

fn ur10e() -> Robots {
    let folder = repo("datasets/ur10e_observations");
    let inputs =
        Inputs::read(&repo("robots/ur10e/ur10e.urdf"), std::slice::from_ref(&folder), Ends::default()).unwrap();
    let observed = inputs.observe(&Limits::default(), &|_, _| {}).unwrap();
    let s = identify(observed.chain.clone(), &observed.series, &Options::default()).unwrap();
    let truth = Truth::read(&folder.join("truth.toml")).unwrap();
    let robot = truth.robot(&observed.chain).unwrap();
    let region = truth.held_out.iter().map(|h| h.readings.clone()).collect();
    Robots { joint_sigma: truth.joint_noise_sigma[0], region, ..Robots::of(&s, &observed.chain, robot) }
}

/// Makes a robot of a study.
type Maker = fn() -> Robots;

/// Tool position of an off-line program over 100 joint vectors, with 30 touches of 0.05 mm.
#[test]
#[ignore = "minutes; its figures stand in the guide, frames"]
fn study_of_programs_with_thirty_touches() {
    let named: [(&str, Maker, f64); 3] = [
        ("kr6_small", small, 0.05e-3),
        ("KR 6, 40 stops", || kr6(1, RobotErrors::default()), 0.04e-3),
        ("UR10e, all errors", ur10e, 0.1e-3),
    ];
    let mut missed = Vec::new();
    for (name, make, most) in named {
        let robots = make();
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        // The places are given in the base: base and tool are those of the description, and the real ones are off by what the robot's are.
        let planned = Vector3::new(0.02, 0.0, 0.12);
        let cell =
            Cell { planned_work: Pose::identity(), planned_tool: planned, work: Pose::identity(), tool: planned };
        let targets = robots.region[..TARGETS].to_vec();
        let exported = robots.known.exported();
        let as_written = Found::nominal(planned, Pose::identity());
        let nominal = robots.program(&robots.nominal, &targets, &cell, &as_written);
        let written = robots.program(exported, &targets, &cell, &as_written);
        let without_terms = robots.program(&urdf_only(exported), &targets, &cell, &as_written);
        let mut errors = Vec::new();
        let mut bounds = Vec::new();
        for _ in 0..10 {
            let found = touched(&robots, &cell, 30, &targets, &mut rng);
            errors.push(robots.program(exported, &targets, &cell, &found));
            bounds.push(found.bound_m2);
        }
        let rms = |all: &[f64]| 1e3 * (all.iter().sum::<f64>() / all.len() as f64).sqrt();
        let worst = 1e3 * errors.iter().fold(0.0f64, |m, e| m.max(*e)).sqrt();
        println!(
            "{name}: nominal {:.2} mm, corrected as written {:.2} (URDF alone {:.2}), with frames of 30 touches {:.4} RMS of 10 draws (worst {worst:.4}), bound {:.4}",
            rms(&[nominal]),
            rms(&[written]),
            rms(&[without_terms]),
            rms(&errors),
            rms(&bounds)
        );
        if rms(&errors) > 1e3 * most {
            missed.push(format!("{name}: {:.4} > {:.4}", rms(&errors), 1e3 * most));
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}

/// Planned touches against random ones, by what they leave at the targets.
#[test]
#[ignore = "a minute; its figures stand in the guide, frames"]
fn study_of_planned_touches() {
    let robots = small();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let cell = Cell { work: Pose::from_xyz_rpy([0.5, 0.0, 0.1], [0.0; 3]), ..cell(&mut rng) };
    let grid =
        |k: usize| Vector3::new(0.1 * (k % 4) as f64 - 0.15, 0.12 * (k / 4) as f64 - 0.18, 0.05 * ((k * 7) % 4) as f64);
    let points: Vec<(String, Vector3<f64>)> = (0..16).map(|k| (format!("p{k}"), grid(k))).collect();
    let targets = spread(&ranges(&robots.known.stops), TARGETS, &mut rng);
    for count in [6, 12, 30] {
        let request = TouchRequest {
            points: points.clone(),
            tool: point(cell.planned_tool),
            work: cell.work,
            count,
            sigma_m: TOUCH_M,
            tilt_rad: 0.8,
            targets: targets.iter().map(|q| Posture::at(q)).collect(),
            tries: 60,
        };
        let planned = plan_touches(&robots.known, &request, &Limits::default()).unwrap().touches;
        let at = |all: &[(usize, Vec<f64>)], rng: &mut ChaCha8Rng| {
            let q: Vec<Vec<f64>> = all.iter().map(|(_, q)| q.clone()).collect();
            let mut touches = robots.toucher(&cell).places(&q, "fixture", rng);
            touches.all.iter_mut().zip(all).for_each(|(t, (p, _))| t.seen = TouchPlace::Point(points[*p].1));
            robots.bound(&touches, &targets, &cell.planned_tool, &cell.work)
        };
        let chosen: Vec<(usize, Vec<f64>)> = planned.iter().map(|t| (t.point, t.readings.clone())).collect();
        // The same points and tilts, at random.
        let many = plan_touches(&robots.known, &TouchRequest { count: 120, ..request.clone() }, &Limits::default());
        let pool: Vec<(usize, Vec<f64>)> =
            many.unwrap().touches.iter().map(|t| (t.point, t.readings.clone())).collect();
        let random: Vec<f64> = (0..20)
            .map(|_| {
                let pick = spread(&vec![(0.0, pool.len() as f64); count], 1, &mut rng).remove(0);
                let set: Vec<_> = pick.iter().map(|p| pool[*p as usize].clone()).collect();
                at(&set, &mut rng)
            })
            .collect();
        let mut sorted: Vec<f64> = random.iter().map(|v| 1e3 * v.sqrt()).collect();
        sorted.sort_by(f64::total_cmp);
        let own = 1e3 * at(&chosen, &mut rng).sqrt();
        println!(
            "{count} touches: planned {own:.4} mm (stated {:.4}), random {:.4} median, {:.4} best of 20",
            1e3 * planned.last().unwrap().expected_m,
            sorted[10],
            sorted[0]
        );
        assert!(own < sorted[10]);
    }
}
