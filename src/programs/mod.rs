//! Robot programs as text with targets in it: read, corrected for the real robot, written back with every other byte as it was.
//!
//! | file | what |
//! |---|---|
//! | [`field`] | one number in the text, and its replacement |
//! | [`program`] | targets: joints or a pose, made of fields |
//! | [`codes`] | status and turn, confdata: which posture a pose means |
//! | [`posture`] | which joints a pose means |
//! | `meant` | the same from wherever the robot comes |
//! | [`measured_frames`], `frame_candidates` | tool and work object of the real robot instead of those of the program, and which of these they are |
//! | [`mod@compensate`] | targets of one robot to targets of another |
//! | `shared_points` | points that are used with several tools or work objects |
//! | `flow` | what statements set, followed through branches, loops and calls |
//! | `held` | one thing that statements set |
//! | `references` | what routines change that is given them by reference |
//! | `routines` | which routine a call means where several files have one of its name |
//! | `names` | names that stand for something else in one module than in another |
//! | `scan` | tokens that all languages share |
//! | `language`, `frame_text` | the table of languages, and how they write frames |
//! | `foreign` | files that hold no program which is read |
//! | `table`, `krl`, `rapid`, `urscript` | text -> targets |
//!
//! To add a language: a file that turns texts into a [`Program`], and a row of the table in `language`.

pub mod codes;
pub mod compensate;
mod external;
pub mod field;
mod flow;
mod foreign;
mod frame_candidates;
mod frame_text;
mod held;
mod itinerary;
mod krl;
mod language;
mod meant;
pub mod measured_frames;
mod names;
pub mod posture;
pub mod program;
mod rapid;
mod reason;
mod references;
mod routines;
mod scan;
mod setting;
mod shared_points;
mod table;
mod text_file;
mod urscript;

pub use compensate::{Correction, Models, Postures, TargetOutcome, compensate};
pub use foreign::packed;
pub use frame_candidates::{MeasuredTool, SameFrames};
pub use language::{Language, read};
pub use measured_frames::{KnownError, MeasuredFrames, RobotFrames};
pub use posture::Known;
pub use program::{Left, Program, Target, TargetKind};
pub use reason::{DeclaredPoint, LeftReason, Why};
pub use setting::ProgramSetting;
pub use text_file::TextFile;
