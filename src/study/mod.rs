//! Studies with known truth, and their tables; no code of the product knows them.

mod crossover;
mod crossover_table;
pub mod image_stage;
mod made_with;
mod monte_carlo;
mod monte_carlo_table;
mod planning;
mod planning_table;
mod simulated;

pub use crossover::{Study, StudyCell, StudyRequest, study};
pub use crossover_table::{study_html, study_markdown, study_verdict};
pub use made_with::made_with;
pub use monte_carlo::{
    BLOCKS, BlockResult, ErrorWithCovariance, MonteCarloCell, MonteCarloRequest, flange_error, monte_carlo,
};
pub use monte_carlo_table::monte_carlo_markdown;
pub use planning::{PlanStudy, PlanStudyRequest, PlanStudyRow, plan_study};
pub use planning_table::study_table;
pub use simulated::measured;
