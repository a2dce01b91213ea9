//! The manual. For those who calibrate: how to take a series, recordings, dark and white frames, warm-up, how accurate can I get, how to read the result,
//! controllers, programs, tool and work object, questions, codes, glossary. For those who want to know how it works: formulation, conventions, circles and boards, costs, planning,
//! a tour of the code, decisions.

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

#[doc = include_str!("cells.md")]
pub mod cells {}

#[doc = include_str!("recordings.md")]
pub mod recordings {}

#[doc = include_str!("flat_field.md")]
pub mod flat_field {}

#[doc = include_str!("warm_up.md")]
pub mod warm_up {}

#[doc = include_str!("accuracy.md")]
pub mod accuracy {}

#[doc = include_str!("controllers.md")]
pub mod controllers {}

#[doc = include_str!("faq.md")]
pub mod faq {}

#[doc = include_str!("reading_the_result.md")]
pub mod reading_the_result {}

#[doc = include_str!("solution_file.md")]
pub mod solution_file {}

#[doc = include_str!("codes.md")]
pub mod codes {}

#[doc = include_str!("circles.md")]
pub mod circles {}

#[doc = include_str!("camera_misfit.md")]
pub mod camera_misfit {}

#[doc = include_str!("photogrammetry.md")]
pub mod photogrammetry {}

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

#[doc = include_str!("frames.md")]
pub mod frames {}

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

    #[doc = include_str!("decisions/0008_the_urdf_alone.md")]
    pub mod d0008_the_urdf_alone {}
}
