//! Is the robot as far from nominal as robots are?

use nalgebra::DVector;

use super::kind::{CheckContext, Kind, Quantity, Subject, Weight};
use crate::assess::Accuracy;
use crate::error::Code;
use crate::fit::Fit;
use crate::problem::Problem;

/// A parameter of the robot is far from nominal.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterOff {
    /// Its name.
    pub parameter: String,
    /// Its value.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
    /// How many times what robots usually deviate by.
    pub usual_deviations: f64,
    /// Gate or note.
    pub weight: Weight,
}

pub(super) fn check(fit: &Fit, _: &Accuracy, setting: &CheckContext) -> Vec<ParameterOff> {
    let problem = &fit.problem;
    let values = fit.state.values(&problem.layout);
    let of_column = |c: usize| {
        let column = &problem.layout.columns[c];
        let usual_deviations = usual_deviations(problem, &values, c);
        (usual_deviations > setting.limits.sigmas_beyond_tolerance).then(|| {
            let parameter = column.name.clone();
            let is_far = usual_deviations > setting.limits.far_beyond_tolerance;
            let weight = if is_far { Weight::Gate } else { Weight::Note };
            ParameterOff { parameter, value: values[c], unit: column.unit, usual_deviations, weight }
        })
    };
    problem.layout.robot().filter_map(of_column).collect()
}

/// How many times what robots usually deviate by a parameter is off.
pub(super) fn usual_deviations(problem: &Problem, values: &DVector<f64>, column: usize) -> f64 {
    ((values[column] - problem.layout.columns[column].prior_mean) / problem.stated_sigma(column)).abs()
}

impl Kind for ParameterOff {
    fn code(&self) -> Code {
        Code::ParameterOff
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn subjects(&self) -> Vec<Subject> {
        vec![Subject::Parameter(self.parameter.clone())]
    }

    fn quantities(&self) -> Vec<Quantity> {
        vec![
            Quantity::new("value", self.value, self.unit),
            Quantity::new("usual_deviations", self.usual_deviations, "1"),
        ]
    }

    fn place(&self) -> String {
        self.parameter.clone()
    }

    fn seen(&self) -> String {
        let Self { value, unit, usual_deviations, .. } = self;
        format!("{value:.3e} {unit} is {usual_deviations:.0} times what robots usually deviate by")
    }

    fn remedy(&self) -> String {
        "check that the URDF is of this robot, and its mastering".into()
    }
}
