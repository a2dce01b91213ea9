//! A plan: what it starts from (`plan_start`), its series folder and plan.json (`plan_files`; of touches `touch_plan`), and its stops as robot programs (`plan_programs`).

pub mod plan_files;
pub mod plan_programs;
pub mod plan_start;
pub mod touch_plan;
