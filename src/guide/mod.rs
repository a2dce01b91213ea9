//! The manual: formulation, conventions, glossary, a tour of the program, how to take a series, how to read the result, codes, circles and boards, decisions.

#[doc = include_str!("formulation.md")]
pub mod formulation {}

#[doc = include_str!("conventions.md")]
pub mod conventions {}

#[doc = include_str!("glossary.md")]
pub mod glossary {}

#[doc = include_str!("tour.md")]
pub mod tour {}

#[doc = include_str!("capture.md")]
pub mod capture {}

#[doc = include_str!("trackers_and_contacts.md")]
pub mod trackers_and_contacts {}

#[doc = include_str!("reading_the_result.md")]
pub mod reading_the_result {}

#[doc = include_str!("codes.md")]
pub mod codes {}

#[doc = include_str!("circles.md")]
pub mod circles {}

#[doc = include_str!("boards.md")]
pub mod boards {}

#[doc = include_str!("corners.md")]
pub mod corners {}

#[doc = include_str!("costs.md")]
pub mod costs {}

#[doc = include_str!("planning.md")]
pub mod planning {}

#[doc = include_str!("programs.md")]
pub mod programs {}

#[doc = include_str!("decisions.md")]
pub mod decisions {
    #[doc = include_str!("decisions/0001_one_gram_product.md")]
    pub mod d0001_one_gram_product {}

    #[doc = include_str!("decisions/0002_joint_noise.md")]
    pub mod d0002_joint_noise {}

    #[doc = include_str!("decisions/0003_dependencies.md")]
    pub mod d0003_dependencies {}

    #[doc = include_str!("decisions/0004_boards.md")]
    pub mod d0004_boards {}

    #[doc = include_str!("decisions/0005_marker_tolerance.md")]
    pub mod d0005_marker_tolerance {}

    #[doc = include_str!("decisions/0006_writing_results.md")]
    pub mod d0006_writing_results {}

    #[doc = include_str!("decisions/0007_one_stage_or_two.md")]
    pub mod d0007_one_stage_or_two {}
}
