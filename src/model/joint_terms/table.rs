//! The table of joint errors.

use serde::{Deserialize, Serialize};

use super::backlash::Backlash;
use super::gear::Gear;
use super::gravity::Gravity;
use super::harmonics::{Cosine, Sine};
use super::joint_error::{Exported, Index, JointError, TermContext};
use super::local::{Local, micro};
use super::offset::Offset;
use super::robot_model::RobotModel;
use super::sag::Sag;
use crate::urdf::{Chain, JointKind};

/// From rows of terms (variant, index where there are several) to all that asks which term it is. A joint has them in the order of the rows;
/// those in one row take turns, by index.
macro_rules! joint_terms {
    ($([$($(#[$doc:meta])* $term:ident$(($index:ident: $type:ty))?),+])+) => {
        /// One kind of joint error; its parameter is in rad (or m for a prismatic joint) unless said otherwise.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Term {
            $($($(#[$doc])* $term$(($type))?,)+)+
        }

        /// The kinds of joint errors, without their indices.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[allow(missing_docs)] // Each is named after its variant of [`Term`].
        pub enum TermKind {
            $($($term,)+)+
        }

        impl TermKind {
            /// All of them, in the order of the rows.
            pub const ALL: &'static [Self] = &[$($(Self::$term,)+)+];
        }

        impl Term {
            /// Name in parameter blocks.
            pub fn name(self) -> String {
                match self {
                    $($(Self::$term$(($index))? => format!("{}{}", $term::NAME, Index::suffix({ $($index)? })),)+)+
                }
            }

            /// The term of a name; `None` for an unknown one.
            #[allow(unused_parens, reason = "an index, or ()")]
            pub fn from_name(name: &str) -> Option<Self> {
                $($(
                    if let Some(($($index)?)) = name.strip_prefix($term::NAME).and_then(Index::from_suffix) && $term::exists({ $($index)? }) {
                        return Some(Self::$term$(($index))?);
                    }
                )+)+
                None
            }

            /// True where the parameter is a pure number.
            fn is_ratio(self) -> bool {
                match self { $($(Self::$term { .. } => $term::IS_RATIO,)+)+ }
            }

            /// Default prior sigma of a revolute joint, in the unit of the parameter.
            fn revolute_sigma(self) -> f64 {
                match self { $($(Self::$term { .. } => $term::PRIOR_SIGMA,)+)+ }
            }

            /// The smallest robot model that has such terms of every joint; those that contain it have them, too.
            pub(in crate::model) fn model(self) -> RobotModel {
                match self { $($(Self::$term { .. } => $term::MODEL,)+)+ }
            }

            /// The same for joints that carry the arm ([`Chain::carries_arm`]).
            pub(in crate::model) fn model_of_arm(self) -> RobotModel {
                match self { $($(Self::$term { .. } => $term::MODEL_OF_ARM,)+)+ }
            }

            /// Value of the basis function.
            pub fn basis(self, context: &TermContext) -> f64 {
                match self { $($(Self::$term$(($index))? => $term::basis({ $($index)? }, context),)+)+ }
            }

            /// Where compensation.toml has the parameter.
            pub fn exported(self) -> Exported {
                match self { $($(Self::$term$(($index))? => $term::exported({ $($index)? }),)+)+ }
            }

            /// Standard deviation in robots in use, for a revolute joint, in the unit of the parameter.
            fn revolute_typical(self) -> f64 {
                match self { $($(Self::$term { .. } => $term::TYPICAL,)+)+ }
            }

            /// What the term adds to the reading, by the symbols of compensation.toml; empty where that has nothing of it.
            pub fn summand(self) -> &'static str {
                match self { $($(Self::$term { .. } => $term::SUMMAND,)+)+ }
            }

            /// What these symbols mean, line by line.
            pub fn symbols(self) -> &'static [&'static str] {
                match self { $($(Self::$term { .. } => $term::SYMBOLS,)+)+ }
            }

            /// Which kind of term it is.
            pub fn kind(self) -> TermKind {
                match self { $($(Self::$term { .. } => TermKind::$term,)+)+ }
            }

            /// True where simulated robots of a chain have it.
            pub fn is_drawn(self, chain: &Chain) -> bool {
                match self { $($(Self::$term { .. } => $term::is_drawn(chain),)+)+ }
            }

            /// False where a chain does not say what the basis function needs.
            pub fn applies(self, chain: &Chain) -> bool {
                match self { $($(Self::$term { .. } => $term::applies(chain),)+)+ }
            }

            /// The terms that a joint has in the largest model, where gears have this many harmonics.
            #[allow(unused_parens, reason = "an index, or ()")]
            pub fn all(harmonics: u8) -> Vec<Self> {
                let mut all = Vec::new();
                $(
                    let mut row: Vec<(usize, Self)> = Vec::new();
                    $(
                        for (turn, ($($index)?)) in $term::indices(harmonics).into_iter().enumerate() {
                            row.push((turn, Self::$term$(($index))?));
                        }
                    )+
                    row.sort_by_key(|(turn, _)| *turn);
                    all.extend(row.into_iter().map(|(_, term)| term));
                )+
                all
            }
        }
    };
}

joint_terms! {
    [
        /// Constant offset of the zero position.
        Offset
    ]
    [
        /// Error of the gear ratio, dimensionless: `kappa q`.
        Gear
    ]
    [
        /// `a cos(k q)` of the reading: first, second, ... harmonic of a gear.
        Cosine(k: u8),
        /// `b sin(k q)` of the reading.
        Sine(k: u8)
    ]
    [
        /// Sag under gravity: the moment about the axis of a unit weight on a unit lever. Levers 0 and 1 are fixed in the
        /// joint's own link, levers 2 and 3 in the link after the next moving joint of the chain. Of a joint that others mimic, the
        /// last of them counts.
        Gravity(lever: u8)
    ]
    [
        /// Sag under gravity where the masses are known: the moment about the axis, over the largest that it can be
        /// ([`crate::urdf::Chain::largest_moment`]). The parameter is the sag at that moment.
        Sag
    ]
    [
        /// Backlash: `b tanh(dq / 2 mrad)` of the step from the previous stop.
        Backlash
    ]
    [
        /// What the joint is off by near one reading (given in urad or um) to which it came back for several stops: whatever it
        /// is, it does not change while the joint stands still, and is nearly the same when it comes back.
        Local(at: i32)
    ]
}

impl Term {
    /// Local error near a reading, rad or m.
    pub fn local(reading: f64) -> Self {
        Self::Local(micro(reading))
    }

    /// Unit of the parameter for a joint of `kind`.
    pub fn unit(self, kind: JointKind) -> &'static str {
        match kind {
            _ if self.is_ratio() => "1",
            JointKind::Prismatic => "m",
            _ => "rad",
        }
    }

    /// Default prior sigma, in the unit of the parameter.
    pub fn prior_sigma(self, kind: JointKind) -> f64 {
        self.of_joint(self.revolute_sigma(), kind)
    }

    /// A size of a revolute joint for a joint of `kind`: for a prismatic one a tenth of it in m, where it is no pure number.
    pub fn of_joint(self, revolute: f64, kind: JointKind) -> f64 {
        let per_metre = if kind == JointKind::Prismatic && !self.is_ratio() { 0.1 } else { 1.0 };
        revolute * per_metre
    }
}

/// A standard deviation for every kind of term, of a revolute joint, in the unit of the parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TermSizes([f64; TermKind::ALL.len()]);

impl TermSizes {
    /// No errors.
    pub const NONE: Self = Self([0.0; TermKind::ALL.len()]);

    fn of_model(model: RobotModel, size: impl Fn(Term) -> f64) -> Self {
        let terms = Term::all(1).into_iter().filter(|t| model.contains(t.model()));
        terms.fold(Self::NONE, |sizes, t| sizes.with(t.kind(), size(t)))
    }

    /// As robots in use have them, of the terms of a model.
    pub fn typical(model: RobotModel) -> Self {
        Self::of_model(model, Term::revolute_typical)
    }

    /// The prior sigmas, of the terms of a model.
    pub fn of_priors(model: RobotModel) -> Self {
        Self::of_model(model, Term::revolute_sigma)
    }

    /// With another size of one kind.
    #[must_use]
    pub fn with(mut self, kind: TermKind, size: f64) -> Self {
        self.0[kind as usize] = size;
        self
    }

    /// The size of a term.
    pub fn of(&self, term: Term) -> f64 {
        self.0[term.kind() as usize]
    }
}

/// A term of one joint with its parameter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct JointTerm {
    /// Index of the reading that it belongs to.
    pub reading: usize,
    /// Kind.
    pub term: Term,
    /// Parameter.
    pub value: f64,
}

impl JointTerm {
    /// Value of the basis function of a local error at a reading; `None` for other terms.
    pub fn local_basis(&self, reading: f64) -> Option<f64> {
        let context = TermContext { reading, approach: None, gravity: Default::default(), moment: 0.0 };
        matches!(self.term, Term::Local(_)).then(|| self.term.basis(&context))
    }
}
