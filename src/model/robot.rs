//! The robot: `base_from_tip(q) = prod_i [ origin_i Exp(xi_i) Motion_i(qt_i) ]` and its derivatives.

use nalgebra::{DMatrix, DVector, Matrix6, Vector3, Vector6};

use super::joint_terms::{GRAVITY_TERMS, JointTerm, RobotModel, Term, TermContext, USUAL_HARMONICS, levers};
use crate::geom::{Pose, adjoint, right_jacobian_se3};
use crate::urdf::{CarriedMass, Chain, Joint, JointKind};

/// Where the robot stood: readings in the order of [`Chain::readings`], rad or m.
#[derive(Debug, Clone, PartialEq)]
pub struct Posture {
    /// Readings.
    pub readings: Vec<f64>,
    /// Step of every reading from the stop before; `None` for the first stop or an unknown order.
    pub approach: Option<Vec<f64>>,
}

impl Posture {
    /// A stop that was reached from nowhere in particular.
    pub fn at(readings: &[f64]) -> Self {
        Self { readings: readings.to_vec(), approach: None }
    }

    /// Stops in the order of their rows, each with the step from the last one before it that was on the robot; `None` off it.
    pub fn in_order<'a>(rows: impl IntoIterator<Item = Option<&'a [f64]>>, order_known: bool) -> Vec<Option<Self>> {
        let mut before: Option<&[f64]> = None;
        let mut of_row = |readings: &'a [f64]| {
            let step = |before: &[f64]| readings.iter().zip(before).map(|(q, b)| q - b).collect();
            let approach = before.replace(readings).filter(|_| order_known).map(step);
            Self { readings: readings.to_vec(), approach }
        };
        rows.into_iter().map(|row| row.map(&mut of_row)).collect()
    }
}

/// A chain with its deviations from nominal.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// Nominal chain.
    pub chain: Chain,
    /// Body-fixed twist on every origin of the chain, `[rho (m), phi (rad)]`.
    pub twists: Vec<Vector6<f64>>,
    /// Joint terms.
    pub terms: Vec<JointTerm>,
}

/// The pose of the tip with its derivatives as body twists of `base_from_tip`.
#[derive(Debug, Clone)]
pub struct Kinematics {
    /// Pose of the tip.
    pub base_from_tip: Pose,
    /// With respect to the twist of every joint of the chain.
    pub d_twists: Vec<Matrix6<f64>>,
    /// With respect to the true position behind every reading.
    pub d_readings: Vec<Vector6<f64>>,
    /// With respect to every joint term's parameter.
    pub d_terms: Vec<Vector6<f64>>,
}

/// What all stops of a robot share: `origin_i Exp(xi_i)` of every joint, and the right Jacobian of its twist.
#[derive(Debug, Clone)]
pub struct LinearOrigins(Vec<(Pose, Matrix6<f64>)>);

fn motion_twist(joint: &Joint) -> Vector6<f64> {
    let (rho, phi) = match joint.kind {
        JointKind::Fixed => (Vector3::zeros(), Vector3::zeros()),
        JointKind::Revolute => (Vector3::zeros(), joint.axis),
        JointKind::Prismatic => (joint.axis, Vector3::zeros()),
    };
    Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z)
}

impl Robot {
    /// The robot as described, without any deviation.
    pub fn nominal(chain: Chain) -> Self {
        let twists = vec![Vector6::zeros(); chain.joints.len()];
        Self { chain, twists, terms: Vec::new() }
    }

    /// Pose of the tip for exact readings at a stop of unknown approach.
    pub fn base_from_tip(&self, readings: &[f64]) -> Pose {
        self.base_from_tip_at(&Posture::at(readings))
    }

    /// Pose of the tip for exact readings at a stop.
    pub fn base_from_tip_at(&self, stop: &Posture) -> Pose {
        self.pose_at(stop, &vec![0.0; stop.readings.len()])
    }

    /// Pose of the tip at a stop whose true positions lie `noise` (rad or m) beside what readings and terms say.
    pub fn pose_at(&self, stop: &Posture, noise: &[f64]) -> Pose {
        let positions = self.positions(stop, noise).0;
        let mut pose = Pose::identity();
        for (i, joint) in self.chain.joints.iter().enumerate() {
            pose = pose * joint.origin * Pose::exp(&self.twists[i]) * joint.motion(positions[i]);
        }
        pose
    }

    /// Pose behind every joint of the chain, in the base frame, for exact readings.
    pub fn link_poses(&self, readings: &[f64]) -> Vec<Pose> {
        let positions = self.positions(&Posture::at(readings), &vec![0.0; readings.len()]).0;
        let mut pose = Pose::identity();
        let behind = |(i, joint): (usize, &Joint)| {
            pose = pose * joint.origin * Pose::exp(&self.twists[i]) * joint.motion(positions[i]);
            pose
        };
        self.chain.joints.iter().enumerate().map(behind).collect()
    }

    /// Where the link stands that carries the first moving joint of the arm, `base_from_foot`, where joints carry the base, at these readings; `None`
    /// where the base stands still ([`Chain::base_from_foot`]).
    pub fn moving_base_from_foot(&self, readings: &[f64]) -> Option<Pose> {
        let climbed = self.chain.climbed();
        let fixed = self.chain.joints[climbed..].iter().take_while(|j| j.kind == JointKind::Fixed).count();
        let before = (climbed + fixed).checked_sub(1).filter(|_| self.chain.base_moves())?;
        self.link_poses(readings).get(before).copied()
    }

    /// What the kinematics of all stops share.
    pub fn linear_origins(&self) -> LinearOrigins {
        let moved =
            |(joint, twist): (&Joint, &Vector6<f64>)| (joint.origin.perturbed(twist), right_jacobian_se3(twist));
        LinearOrigins(self.chain.joints.iter().zip(&self.twists).map(moved).collect())
    }

    /// As [`Robot::pose_at`], with all derivatives.
    pub fn kinematics(&self, stop: &Posture, noise: &[f64]) -> Kinematics {
        self.kinematics_from(&self.linear_origins(), stop, noise)
    }

    /// As [`Robot::base_from_tip_at`], with all derivatives.
    pub fn kinematics_at(&self, stop: &Posture) -> Kinematics {
        self.kinematics(stop, &vec![0.0; stop.readings.len()])
    }

    /// As [`Robot::kinematics`], where the origins of this robot are at hand.
    pub fn kinematics_from(&self, origins: &LinearOrigins, stop: &Posture, noise: &[f64]) -> Kinematics {
        let (positions, bases) = self.positions(stop, noise);
        let mut d_twists = vec![Matrix6::zeros(); self.chain.joints.len()];
        let (base_from_tip, d_readings) = self.inwards(origins, &positions, |i, rest_from_tip| {
            d_twists[i] = adjoint(&rest_from_tip.inverse()) * origins.0[i].1;
        });
        let d_terms = self.terms.iter().zip(bases).map(|(t, basis)| d_readings[t.reading] * basis).collect();
        Kinematics { base_from_tip, d_twists, d_readings, d_terms }
    }

    /// Of [`Robot::kinematics_from`] the pose of the tip and the derivatives by the readings alone, without noise.
    pub fn tip_by_readings(&self, origins: &LinearOrigins, stop: &Posture) -> (Pose, Vec<Vector6<f64>>) {
        let positions = self.positions(stop, &vec![0.0; stop.readings.len()]).0;
        self.inwards(origins, &positions, |_, _| ())
    }

    /// From the tip inwards: its pose and the derivatives by the readings. `behind` is told of every joint what lies behind its origin.
    fn inwards(
        &self,
        origins: &LinearOrigins,
        positions: &[f64],
        mut behind: impl FnMut(usize, &Pose),
    ) -> (Pose, Vec<Vector6<f64>>) {
        let mut d_readings = vec![Vector6::zeros(); self.chain.readings.len()];
        let mut rest_from_tip = Pose::identity();
        for (i, joint) in self.chain.joints.iter().enumerate().rev() {
            if let Some(drive) = joint.drive {
                let column = adjoint(&rest_from_tip.inverse()) * motion_twist(joint);
                d_readings[drive.reading] += column * drive.multiplier;
            }
            rest_from_tip = joint.motion(positions[i]) * rest_from_tip;
            behind(i, &rest_from_tip);
            rest_from_tip = origins.0[i].0 * rest_from_tip;
        }
        (rest_from_tip, d_readings)
    }

    /// Local error of every reading at a stop, rad or m.
    pub fn local_errors(&self, stop: &Posture) -> Vec<f64> {
        let mut errors = vec![0.0; stop.readings.len()];
        for t in &self.terms {
            errors[t.reading] += t.local_basis(stop.readings[t.reading]).map_or(0.0, |basis| t.value * basis);
        }
        errors
    }

    /// `origin_i Exp(xi_i) Motion_i(offset_i)` for every joint: the corrected URDF, in which controller angles stay as they are. The offset
    /// of a joint that is passed upwards stands before the origin behind its motion.
    pub fn corrected_origins(&self) -> Vec<Pose> {
        let mut offsets = vec![0.0; self.chain.readings.len()];
        for t in self.terms.iter().filter(|t| t.term == Term::Offset) {
            offsets[t.reading] += t.value;
        }
        let mut before = Pose::identity();
        let corrected = |(joint, twist): (&Joint, &Vector6<f64>)| {
            let zero = joint.motion(joint.drive.map_or(0.0, |d| d.multiplier * offsets[d.reading]));
            let moved = std::mem::replace(&mut before, Pose::identity()) * joint.origin.perturbed(twist);
            if joint.states_origin() {
                moved * zero
            } else {
                before = zero;
                moved
            }
        };
        self.chain.joints.iter().zip(&self.twists).map(corrected).collect()
    }

    /// Names of the joints of the chain, each with the corrected `<origin>` that the URDF states for it.
    pub fn urdf_origins(&self) -> Vec<(&str, Pose)> {
        let stated = |j: &Joint, origin: Pose| if j.upwards { origin.inverse() } else { origin };
        let all = self.chain.joints.iter().zip(self.corrected_origins()).filter(|(j, _)| j.states_origin());
        all.map(|(j, o)| (j.name.as_str(), stated(j, o))).collect()
    }

    /// The robot that a result states: without the local errors, which are noise near readings of one series, not properties of
    /// the robot, and stand in no exported file.
    pub fn without_local_errors(&self) -> Self {
        let mut robot = self.clone();
        robot.terms.retain(|t| !matches!(t.term, Term::Local(_)));
        robot
    }

    /// The robot as others have it from corrected URDF and compensation.toml: its origins are the corrected ones, in which moments of
    /// gravity are taken, too; offsets are in them, local errors are gone.
    pub fn as_exported(&self) -> Self {
        let mut chain = self.chain.clone();
        chain.joints.iter_mut().zip(self.corrected_origins()).for_each(|(j, o)| j.origin = o);
        let largest = |chain: &Chain, reading: usize| {
            let joint = chain.joints.iter().rposition(|j| j.drive.is_some_and(|d| d.reading == reading));
            joint.map_or(0.0, |j| chain.largest_moment(j))
        };
        let mut terms = self.terms.clone();
        terms.retain(|t| !matches!(t.term, Term::Offset | Term::Local(_)));
        // The parameter is the sag at the largest moment, the file has the compliance.
        for t in terms.iter_mut().filter(|t| t.term == Term::Sag) {
            let (before, after) = (largest(&self.chain, t.reading), largest(&chain, t.reading));
            t.value *= if before > 0.0 { after / before } else { 0.0 };
        }
        Self { terms, ..Self::nominal(chain) }
    }

    /// What a controller has to add to every reading so that no offset is left, be it a term or in the origins since before the fit, rad or m.
    pub fn zero_corrections(&self) -> Vec<f64> {
        // q + offset + gear q = (q + shift)(1 + gear)
        let of =
            |r: usize| (self.chain.found_zero(r) + self.sum_of(r, Term::Offset)) / (1.0 + self.sum_of(r, Term::Gear));
        (0..self.chain.readings.len()).map(of).collect()
    }

    /// This robot under a controller that adds `shifts` (rad or m) to its readings. What of the offsets they do not take stays an offset; the
    /// terms are those of the new readings (exact for gears and harmonics, gravity as before), in their order. Of a joint whose zero was found
    /// before the fit the origin takes the shift, so that gravity is that of the posture however far off it was.
    pub fn mastered_by(&self, shifts: &[f64]) -> Self {
        let mut robot = self.clone();
        let by_origin = |r: usize| if self.chain.found_zero(r) == 0.0 { 0.0 } else { shifts[r] };
        for (joint, twist) in robot.chain.joints.iter_mut().zip(&mut robot.twists) {
            let by = joint.drive.map_or(0.0, |d| d.multiplier * by_origin(d.reading));
            if by != 0.0 {
                // Exp(xi) M(-s) = M(-s) Exp(Ad(M(s)) xi)
                joint.origin = joint.origin * joint.motion(-by);
                *twist = adjoint(&joint.motion(by)) * *twist;
            }
        }
        for t in &mut robot.terms {
            let (reading, shift) = (t.reading, shifts[t.reading]);
            let turned = |k: u8| (f64::from(k) * shift).sin_cos();
            // a cos k(q - s) + b sin k(q - s), sorted by cos kq and sin kq.
            t.value = match t.term {
                Term::Offset => t.value + by_origin(reading) - shift * (1.0 + self.sum_of(reading, Term::Gear)),
                Term::Cosine(k) => turned(k).1 * t.value - turned(k).0 * self.sum_of(reading, Term::Sine(k)),
                Term::Sine(k) => turned(k).1 * t.value + turned(k).0 * self.sum_of(reading, Term::Cosine(k)),
                _ => t.value,
            };
        }
        robot
    }

    /// Derivatives of twists (six rows each) and terms of [`Robot::mastered_by`] by those of this robot, of which they are linear functions.
    pub fn mastered_by_own(&self, shifts: &[f64]) -> DMatrix<f64> {
        let numbers = |robot: &Self| {
            let twists = robot.twists.iter().flat_map(|t| t.iter().copied());
            DVector::from_iterator(self.numbers(), twists.chain(robot.terms.iter().map(|t| t.value)))
        };
        let with_one = |one: Option<usize>| {
            let at = |k: usize| if Some(k) == one { 1.0 } else { 0.0 };
            let mut robot = self.clone();
            robot.twists.iter_mut().enumerate().for_each(|(k, t)| *t = Vector6::from_fn(|i, _| at(6 * k + i)));
            let first = 6 * self.twists.len();
            robot.terms.iter_mut().enumerate().for_each(|(k, t)| t.value = at(first + k));
            numbers(&robot.mastered_by(shifts))
        };
        let none = with_one(None);
        let columns: Vec<DVector<f64>> = (0..self.numbers()).map(|k| with_one(Some(k)) - &none).collect();
        DMatrix::from_columns(&columns)
    }

    /// Number of its twists and terms.
    fn numbers(&self) -> usize {
        6 * self.twists.len() + self.terms.len()
    }

    /// Sum of the terms of one kind of a reading.
    fn sum_of(&self, reading: usize, term: Term) -> f64 {
        self.terms.iter().filter(|t| t.reading == reading && t.term == term).map(|t| t.value).sum()
    }

    /// True position of every joint of the chain, and the basis function of every term.
    fn positions(&self, stop: &Posture, noise: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut contexts: Vec<TermContext> = (0..stop.readings.len())
            .map(|r| TermContext {
                reading: stop.readings[r],
                approach: stop.approach.as_ref().map(|a| a[r]),
                gravity: [0.0; GRAVITY_TERMS as usize],
                moment: 0.0,
            })
            .collect();
        if self.terms.iter().any(|t| matches!(t.term, Term::Gravity(_) | Term::Sag)) {
            self.fill_gravity(&mut contexts);
        }
        let mut moved: Vec<f64> = stop.readings.iter().zip(noise).map(|(q, dq)| q + dq).collect();
        let bases: Vec<f64> = self.terms.iter().map(|t| t.term.basis(&contexts[t.reading])).collect();
        self.terms.iter().zip(&bases).for_each(|(t, basis)| moved[t.reading] += t.value * basis);
        let position = |joint: &Joint| joint.drive.map_or(0.0, |d| d.multiplier * moved[d.reading] + d.offset);
        (self.chain.joints.iter().map(position).collect(), bases)
    }

    /// Gravity moments in the nominal posture, gravity along -z of the base (of the link above both ends, where the base is carried); a
    /// sagging joint turns the way its moment pulls.
    fn fill_gravity(&self, contexts: &mut [TermContext]) {
        let joints = &self.chain.joints;
        // Pose behind every joint, base frame; the driven ones with their readings.
        let (mut pose, mut poses, mut driven) = (Pose::identity(), Vec::with_capacity(joints.len()), Vec::new());
        for (index, joint) in joints.iter().enumerate() {
            let position = joint.drive.map_or(0.0, |d| d.multiplier * contexts[d.reading].reading + d.offset);
            pose = pose * joint.origin * joint.motion(position);
            driven.extend(joint.drive.map(|d| (index, d.reading)));
            poses.push(pose);
        }
        let down = Vector3::new(0.0, 0.0, -1.0);
        let above = self.chain.climbed().checked_sub(1).filter(|_| self.chain.base_moves());
        let weight = above.map_or(down, |above| poses[above].rotation * down);
        // What a joint carries lies before its motion where it is passed upwards, which is about the axis the other way.
        let carried = |index: usize| match joints[index].upwards {
            true => index.checked_sub(1).map_or_else(Pose::identity, |before| poses[before]),
            false => poses[index],
        };
        let axis_of = |index: usize| if joints[index].upwards { -joints[index].axis } else { joints[index].axis };
        let levers = |index: usize| levers(&axis_of(index)).map(|l| carried(index).rotation * l);
        for (k, &(index, reading)) in driven.iter().enumerate() {
            let axis = poses[index].rotation * axis_of(index);
            let moment = |lever: Vector3<f64>| match joints[index].kind {
                JointKind::Prismatic => axis.dot(&weight),
                _ => axis.dot(&lever.cross(&weight)),
            };
            let of_mass = |m: &CarriedMass| {
                m.mass_kg * moment(carried(m.joint).transform(&m.centre_m) - poses[index].translation)
            };
            let largest = self.chain.largest_moment(index);
            if largest > 0.0 {
                contexts[reading].moment = self.chain.masses_on(index).map(of_mass).sum::<f64>() / largest;
            }
            let own = levers(index).map(moment);
            let farther = if joints[index].upwards { k.checked_sub(1) } else { Some(k + 1) };
            let next = farther.and_then(|k| driven.get(k)).map_or([0.0; 2], |&(next, _)| levers(next).map(moment));
            contexts[reading].gravity = [own[0], own[1], next[0], next[1]];
        }
    }
}

impl RobotModel {
    /// True where this model has such a term of a reading of a chain.
    pub fn has(self, term: Term, chain: &Chain, reading: usize) -> bool {
        let smallest = if chain.carries_arm(reading) { term.model_of_arm() } else { term.model() };
        self.contains(smallest) && term.applies(chain)
    }

    /// The nominal robot with the terms of this model.
    pub fn robot(self, chain: Chain) -> Robot {
        self.robot_with(chain, USUAL_HARMONICS)
    }

    /// As [`RobotModel::robot`], with this many harmonics of every gear.
    pub fn robot_with(self, chain: Chain, harmonics: u8) -> Robot {
        let all = Term::all(harmonics);
        let of_chain = (0..chain.readings.len()).flat_map(|reading| all.iter().map(move |&term| (reading, term)));
        let own = of_chain.filter(|&(reading, term)| self.has(term, &chain, reading));
        let terms = own.map(|(reading, term)| JointTerm { reading, term, value: 0.0 }).collect();
        Robot { terms, ..Robot::nominal(chain) }
    }
}
