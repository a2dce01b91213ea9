//! `robotcal convert`: a recording becomes a series folder.

use std::path::PathBuf;

use clap::Args;

use super::Verdict;
use super::recording::RecordingArgs;
use crate::error::Result;
use crate::series::{Extracted, convert_recording};
use crate::urdf;

/// Flags of `convert`.
#[derive(Debug, Args)]
pub(super) struct ConvertArgs {
    /// Recording: an .mcap file or a rosbag2 folder
    #[arg(value_name = "RECORDING")]
    from: PathBuf,
    /// New series folder
    #[arg(value_name = "FOLDER")]
    to: PathBuf,
    /// Robot description: only the joints of its chain are taken [default: all that are recorded]
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Base link
    #[arg(long, value_name = "LINK", requires = "urdf")]
    base: Option<String>,
    /// Tip link
    #[arg(long, value_name = "LINK", requires = "urdf")]
    tip: Option<String>,
    #[command(flatten)]
    recording: RecordingArgs,
}

pub(super) fn run(args: &ConvertArgs) -> Result<Verdict> {
    let joints = match &args.urdf {
        Some(file) => urdf::read(file)?.chain(args.base.as_deref(), args.tip.as_deref())?.readings,
        None => Vec::new(),
    };
    let extracted = convert_recording(&args.from, &args.to, &args.recording.options(&joints)?)?;
    print!("{}", text(&extracted));
    println!("written   {}", args.to.display());
    Ok(Verdict::Good)
}

/// What was taken, as a person reads it.
fn text(extracted: &Extracted) -> String {
    let reports = &extracted.reports;
    let worst = |of: fn(&crate::series::StopReport) -> f64| reports.iter().map(of).fold(0.0, f64::max);
    let pictures: usize = reports.iter().map(|r| r.pictures).sum();
    let mut text = format!(
        "stops     {} from {pictures} images of {} and the joints {} of {}\n\
         time      images recorded {:+.1} ms later than joint states, counted from their stamps\n\
         joints    nearest sample within {:.1} ms, fastest {:.2e} rad/s (m/s) at an exposure\n",
        reports.len(),
        extracted.image_topic,
        extracted.stops.joints.join(", "),
        extracted.joint_topic,
        1e3 * extracted.image_delay_s,
        1e3 * worst(|r| r.nearest_sample_s),
        worst(|r| r.speed),
    );
    let noises: Vec<f64> = reports.iter().filter_map(|r| r.noise_counts).collect();
    if !noises.is_empty() {
        let rms = (noises.iter().map(|n| n * n).sum::<f64>() / noises.len() as f64).sqrt();
        text += &format!("noise     {rms:.2} counts in one image\n");
    }
    for notice in &extracted.notices {
        text += &format!("note      {notice}\n");
    }
    text
}
