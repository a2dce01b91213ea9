//! `robotcal detect --study`: the report on what the image stage reaches on rendered pictures.

use std::path::Path;

use clap::{Args, ValueEnum};

use crate::cli::Verdict;
use crate::cli::terminal::progress;
use crate::cli::terminal::say::say_line;
use crate::error::{Code, Error, Result};
use crate::identify::SeenImage;
use crate::output::ResultFolder;
use crate::output::overlay::{Palette, overlay_png};
use crate::plan::plate_design::{PlateRequest, design};
use crate::study::image_stage::tables::{
    REPORT, Section, bias_section, identity_section, image_study_files, precision_section,
};
use crate::study::image_stage::{
    Bias, Identity, IdentityRequest, IdentityView, Plates, Precision, bias, bias_cases, identity, identity_view,
    precision, precision_cells,
};

/// Flags of the study.
#[derive(Debug, Args)]
pub(super) struct StudyArgs {
    /// Make the report on precision and identity instead: rendered pictures with known truth
    #[arg(long, conflicts_with_all = ["series", "images"])]
    study: bool,
    /// Parts of the study [default: all]
    #[arg(long, value_enum, requires = "study")]
    part: Vec<Part>,
    /// Views in the study of identity
    #[arg(long, value_name = "N", default_value_t = 20_000, requires = "study")]
    views: u64,
    /// Seed of the first view
    #[arg(long, value_name = "N", default_value_t = 1, requires = "study")]
    seed: u64,
}

/// Parts of the study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Part {
    /// Errors of the centres against the Cramer-Rao bound, and the honesty of the stated covariance
    Precision,
    /// Gradients, wide-angle lenses, close views, coma
    Bias,
    /// No wrong id, few markers missed, mirror images refused
    Identity,
}

/// A picture beside the report, by its name.
type Drawn = (String, Vec<u8>);

impl Part {
    /// Its section of the report, and pictures beside it where they are asked for.
    fn run(self, args: &StudyArgs, overlay: bool) -> Result<(Section, Vec<Drawn>)> {
        Ok(match self {
            Self::Precision => (precision_section(&run_precision(args.seed)), Vec::new()),
            Self::Bias => (bias_section(&run_bias()?), Vec::new()),
            Self::Identity => {
                let study = run_identity(args)?;
                let drawn = if overlay { failed_views(&study)? } else { Vec::new() };
                (identity_section(&study), drawn)
            }
        })
    }
}

/// Pictures of failed views that are drawn.
const DRAWN: usize = 20;

impl StudyArgs {
    pub(super) fn wanted(&self) -> bool {
        self.study
    }
}

/// Runs the parts and writes the report into `out`; with `overlay` also pictures of the views that failed (of a single view in any case).
pub(super) fn run(args: &StudyArgs, out: &Path, overlay: bool) -> Result<Verdict> {
    if args.views == 0 {
        return Err(Error::new(Code::OptionRange, "--views", "0 views show nothing", "give 1 or more"));
    }
    let place = ResultFolder::among(out)?.for_files(&[REPORT])?;
    let mut sections = Vec::new();
    let mut pictures = Vec::new();
    for part in Part::value_variants().iter().filter(|part| args.part.is_empty() || args.part.contains(part)) {
        let (section, drawn) = part.run(args, overlay)?;
        sections.push(section);
        pictures.extend(drawn);
    }
    let mut files = image_study_files(&sections, &command(args));
    files.extend(pictures);
    let listed: Vec<(String, &[u8])> = files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect();
    place.write_beside(&listed, &[])?;
    let claims = || sections.iter().flat_map(|s: &Section| &s.claims);
    claims().for_each(|c| say_line!("{}", c.line()));
    say_line!("report    {}", out.join(REPORT).display());
    Ok(if claims().all(|c| c.holds) { Verdict::Good } else { Verdict::GateFailed })
}

fn command(args: &StudyArgs) -> String {
    let mut text = "robotcal detect --study".to_owned();
    for part in &args.part {
        if let Some(name) = part.to_possible_value() {
            text += &format!(" --part {}", name.get_name());
        }
    }
    text + &format!(" --views {} --seed {}", args.views, args.seed)
}

/// Pictures for each cell of the study of precision.
const PICTURES: u64 = 3;

fn run_precision(seed: u64) -> Vec<Precision> {
    let cells = precision_cells(
        &[4.0, 6.0, 10.0, 18.0, 30.0],
        &[0.6, 1.0, 1.5],
        &[20.0, 60.0, 200.0],
        &[0.0, 30.0, 45.0, 60.0],
    );
    let bar = progress::bar(cells.len(), "cells");
    let study = cells.into_iter().flat_map(|c| {
        let reached = precision(c, PICTURES, seed);
        bar.inc(1);
        reached
    });
    let study = study.collect();
    bar.finish_and_clear();
    study
}

fn run_bias() -> Result<Vec<Bias>> {
    let plate = design(&PlateRequest::default())?.plate;
    let cases = bias_cases(&[0.6, 1.0, 1.5]);
    let bar = progress::bar(cases.len(), "cases");
    let study = cases.iter().map(|c| bias(c, &plate)).inspect(|_| bar.inc(1)).collect();
    bar.finish_and_clear();
    study
}

fn run_identity(args: &StudyArgs) -> Result<Identity> {
    let bar = progress::bar(args.views as usize, "views");
    let study = identity(IdentityRequest { views: args.views, seed: args.seed }, || bar.inc(1));
    bar.finish_and_clear();
    study
}

/// Overlays of the failed views; of the only one in any case.
fn failed_views(study: &Identity) -> Result<Vec<Drawn>> {
    let only = study.views.len() == 1;
    let plates = Plates::standard()?;
    let missed = |v: &&IdentityView| only || v.failed() || v.found < v.visible;
    let drawn = study.views.iter().filter(missed).take(DRAWN).map(|view| {
        let (_, picture, detection) = identity_view(&plates, view.seed);
        let name = format!("view-{}.png", view.seed);
        let size = Some((picture.width, picture.height));
        let image = SeenImage { name: name.clone(), path: None, size, detection };
        let palette = Palette::of(std::slice::from_ref(&image));
        Ok((name, overlay_png(&picture, &image, plates.own(), &palette)?))
    });
    drawn.collect()
}
