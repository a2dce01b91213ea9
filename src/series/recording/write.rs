//! A series as a recording: joint states, images, transforms and marks on the images, for viewers and other programs.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use image::ImageFormat;
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};

use super::decodable;
use super::interfaces::{ANNOTATIONS, TRANSFORMS, definition};
use super::messages::{CAMERA_INFO, COMPRESSED_IMAGE, CameraInfo, JOINT_STATE};
use crate::error::{Code, Error, Notice, Result};
use crate::files::{self, FileKind, decode_picture};
use crate::geom::Pose;
use crate::series::{ImageObservations, Series, SeriesStop};

/// Joint states are written this often while the robot stands, ns.
const PERIOD_NS: i64 = 20_000_000;
/// The robot stands for this long before and after each image, ns.
const STANDING_NS: i64 = 500_000_000;
/// Distance of images in time where the series does not tell, ns.
const STEP_NS: i64 = 2_000_000_000;

/// Types of annotations of points, as Foxglove numbers them.
const POINTS: u8 = 1;
const LINE_LIST: u8 = 4;
/// Of points and lines, px.
const THICKNESS_PX: f64 = 2.0;

/// What a recording shows beside the images.
#[derive(Debug, Clone, Copy)]
pub struct RecordingContent<'a> {
    /// Names of the joints, in the order of the readings.
    pub joints: &'a [String],
    /// Readings of every stop, rad and m; a stop without any is left out.
    pub readings: &'a [Option<Vec<f64>>],
    /// What is known of the camera; nothing leaves its topic out.
    pub camera: Option<&'a CameraInfo>,
    /// Frames at every stop.
    pub frames: &'a [FramePoses],
    /// What to draw on the images.
    pub marks: &'a [ImageMarks],
}

/// A frame in its parent, at every stop.
#[derive(Debug, Clone)]
pub struct FramePoses {
    /// Name of the parent.
    pub parent: String,
    /// Name of the frame.
    pub child: String,
    /// `parent_from_child`; `None` where it is not known.
    pub poses: Vec<Option<Pose>>,
}

/// What is drawn on one image.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageMarks {
    /// File name of the image.
    pub image: String,
    /// Drawn one over the other.
    pub layers: Vec<MarkLayer>,
}

/// Points or lines of one colour.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkLayer {
    /// Points, or lines between every two of them.
    pub kind: MarkKind,
    /// Red, green and blue, 0 to 1.
    pub colour: [f64; 3],
    /// Places, px.
    pub points: Vec<[f64; 2]>,
}

/// How points are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MarkKind {
    /// One by one.
    Points,
    /// In pairs, as ends of lines.
    Lines,
}

impl From<&ImageObservations> for ImageMarks {
    /// Every observation as a green point.
    fn from(seen: &ImageObservations) -> Self {
        let points = seen.observations.iter().map(|o| o.uv).collect();
        let layers = vec![MarkLayer { kind: MarkKind::Points, colour: [0.0, 0.8, 0.2], points }];
        Self { image: seen.image.clone(), layers }
    }
}

/// What was written of a series.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// Stops in the recording.
    pub stops: usize,
    /// Images that cannot be decoded: their stops are left out.
    pub unreadable: Vec<Notice>,
    /// What else the user should know.
    pub notices: Vec<Notice>,
}

/// Writes the stops of a series as an MCAP recording that [`super::extract`] reads back as the same series.
///
/// Topics: `/joint_states`, `/camera/image/compressed` (png and jpg as they are, other formats as png), `/camera/camera_info`,
/// `/tf`, `/camera/annotations`, all of them ROS messages. Stamps are the times of the stops; where they are missing, not in order or too dense for
/// standstills, two seconds apart.
///
/// # Errors
/// A file that exists already or cannot be written, a series without any stop with joint readings and an image that can be decoded.
pub fn write_recording(path: &Path, series: &Series, shown: RecordingContent<'_>) -> Result<Written> {
    require_new(path)?;
    let unfinished = unfinished(path);
    let done = write_stops(&unfinished, series, shown);
    match &done {
        Ok(_) => std::fs::rename(&unfinished, path).map_err(|e| Error::io(path, &e))?,
        // The reason of the failure matters more than a file that could not be removed.
        Err(_) => drop(std::fs::remove_file(&unfinished)),
    }
    done
}

/// Refuses a recording that would replace something.
///
/// # Errors
/// As the name says.
pub fn require_new(path: &Path) -> Result<()> {
    match path.symlink_metadata() {
        Ok(_) => {
            Err(Error::new(Code::OutputExists, path.display(), "exists already", "name a new file, or remove this one"))
        }
        Err(_) => Ok(()),
    }
}

fn unfinished(path: &Path) -> PathBuf {
    let name = path.file_name().map_or_else(|| "recording".into(), |n| n.to_string_lossy());
    path.with_file_name(format!(".{name}.unfinished"))
}

fn write_stops(path: &Path, series: &Series, shown: RecordingContent<'_>) -> Result<Written> {
    let mut recording = Recording::create(path)?;
    let mut notices = Vec::new();
    let marks: BTreeMap<&str, &ImageMarks> = shown.marks.iter().map(|m| (m.image.as_str(), m)).collect();
    let all = series.stops.stops.iter().zip(shown.readings).enumerate();
    let with_both: Vec<(usize, &SeriesStop, &Vec<f64>, &PathBuf)> =
        all.filter_map(|(i, (stop, readings))| Some((i, stop, readings.as_ref()?, stop.path.as_ref()?))).collect();
    let left_out = series.stops.stops.len() - with_both.len();
    let images: Vec<&Path> = with_both.iter().map(|(.., image)| image.as_path()).collect();
    let refused = decodable::refused(&images);
    let is_decodable = with_both.into_iter().zip(&refused).filter(|(_, refused)| refused.is_none());
    let usable: Vec<_> = is_decodable.map(|(stop, _)| stop).collect();
    let unreadable: Vec<Notice> = refused.into_iter().flatten().collect();
    if usable.is_empty() {
        return Err(nothing_to_record(series, unreadable.first()));
    }
    if left_out > 0 {
        let what = format!("{left_out} images off the robot, or missing, are not in the recording");
        notices.push(Notice::new(Code::StopsNotRecorded, series.folder.display(), what, ""));
    }
    let stops = usable.len();
    let times = times(&usable.iter().map(|(_, stop, ..)| *stop).collect::<Vec<_>>());
    for (time, (i, stop, readings, image)) in times.into_iter().zip(usable) {
        for k in -(STANDING_NS / PERIOD_NS)..=STANDING_NS / PERIOD_NS {
            recording.joint_state(time + k * PERIOD_NS, shown.joints, readings)?;
            // The image is written at its time, among the joint states.
            if k == 0 {
                recording.image(time, image)?;
                shown.camera.map_or(Ok(()), |camera| recording.camera_info(time, camera))?;
                recording.transforms(time, i, shown.frames)?;
                marks.get(stop.image.as_str()).map_or(Ok(()), |marks| recording.marks(time, marks))?;
            }
        }
    }
    recording.finish()?;
    Ok(Written { stops, unreadable, notices })
}

fn nothing_to_record(series: &Series, unreadable: Option<&Notice>) -> Error {
    let what = match unreadable {
        Some(first) => format!("has no stop with an image that can be decoded: {first}"),
        None => "has no stop with both an image and joint readings".to_owned(),
    };
    Error::new(Code::StopsNotRecorded, series.folder.display(), what, "look at joints.csv and images/")
}

/// Times of the stops, ns, at least so far apart that every one is a standstill of its own.
fn times(stops: &[&SeriesStop]) -> Vec<i64> {
    let stated: Option<Vec<i64>> = stops.iter().map(|s| s.time_s.map(|t| (t * 1e9).round() as i64)).collect();
    let apart = |times: &Vec<i64>| {
        times.iter().all(|t| *t >= STANDING_NS) && times.windows(2).all(|w| w[1] - w[0] > 2 * STANDING_NS + PERIOD_NS)
    };
    stated.filter(apart).unwrap_or_else(|| (1..=stops.len() as i64).map(|k| k * STEP_NS).collect())
}

/// An MCAP file being written.
struct Recording {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    sequence: u32,
}

impl Recording {
    fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).map_err(|e| Error::io(path, &e))?;
        let options = WriteOptions::new().profile("ros2").compression(Some(Compression::Zstd));
        let writer = options.create(BufWriter::new(file)).map_err(|e| refused(path, &e))?;
        Ok(Self { path: path.to_path_buf(), writer, sequence: 0 })
    }

    fn message(&mut self, time_ns: i64, topic: &str, schema: &str, data: &[u8]) -> Result<()> {
        let written = self.channel(topic, schema).and_then(|channel_id| {
            let time = time_ns.max(0) as u64;
            let header = MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
            self.writer.write_to_known_channel(&header, data)
        });
        self.sequence = self.sequence.wrapping_add(1);
        written.map_err(|e| refused(&self.path, &e))
    }

    /// Schema and channel are written once: the writer knows what it has.
    fn channel(&mut self, topic: &str, schema: &str) -> mcap::McapResult<u16> {
        let id = self.writer.add_schema(schema, "ros2msg", definition(schema).as_bytes())?;
        self.writer.add_channel(id, topic, "cdr", &BTreeMap::new())
    }

    fn joint_state(&mut self, time_ns: i64, names: &[String], positions: &[f64]) -> Result<()> {
        let mut cdr = CdrWriter::with_header(time_ns, "");
        cdr.u32(names.len() as u32);
        names.iter().for_each(|name| cdr.string(name));
        cdr.f64s(positions);
        cdr.f64s(&[]);
        cdr.f64s(&[]);
        self.message(time_ns, "/joint_states", JOINT_STATE, &cdr.0)
    }

    fn image(&mut self, time_ns: i64, path: &Path) -> Result<()> {
        let mut bytes = files::read(path, FileKind::Image)?;
        let unreadable =
            |e: image::ImageError| Error::new(Code::ImageUnreadable, path.display(), e, "remove the image or its row");
        let format = match image::guess_format(&bytes) {
            Ok(ImageFormat::Jpeg) => "jpeg",
            Ok(ImageFormat::Png) => "png",
            _ => {
                let picture = decode_picture(std::io::Cursor::new(&bytes)).map_err(unreadable)?;
                let mut png = std::io::Cursor::new(Vec::new());
                picture.write_to(&mut png, ImageFormat::Png).map_err(unreadable)?;
                bytes = png.into_inner();
                "png"
            }
        };
        let mut cdr = CdrWriter::with_header(time_ns, "camera");
        cdr.string(format);
        cdr.u32(bytes.len() as u32);
        cdr.0.extend(&bytes);
        self.message(time_ns, "/camera/image/compressed", COMPRESSED_IMAGE, &cdr.0)
    }

    fn camera_info(&mut self, time_ns: i64, camera: &CameraInfo) -> Result<()> {
        let mut cdr = CdrWriter::with_header(time_ns, "camera");
        cdr.u32(camera.height_px);
        cdr.u32(camera.width_px);
        cdr.string(&camera.distortion_model);
        cdr.f64s(&camera.distortion);
        // Zeros say that the camera is not calibrated.
        let [fx, fy, cx, cy] = camera.intrinsics.unwrap_or_default();
        let one = f64::from(u8::from(camera.intrinsics.is_some()));
        let matrix = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, one];
        let rectification = [one, 0.0, 0.0, 0.0, one, 0.0, 0.0, 0.0, one];
        let projection = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, one, 0.0];
        matrix.iter().chain(&rectification).chain(&projection).for_each(|v| cdr.f64(*v));
        // Neither binned, nor cut out, nor rectified.
        (0..6).for_each(|_| cdr.u32(0));
        cdr.0.push(0);
        self.message(time_ns, "/camera/camera_info", CAMERA_INFO, &cdr.0)
    }

    /// All frames that are known at a stop.
    fn transforms(&mut self, time_ns: i64, stop: usize, frames: &[FramePoses]) -> Result<()> {
        let known: Vec<(&FramePoses, &Pose)> =
            frames.iter().filter_map(|f| Some((f, f.poses.get(stop)?.as_ref()?))).collect();
        if known.is_empty() {
            return Ok(());
        }
        let mut cdr = CdrWriter::new();
        cdr.u32(known.len() as u32);
        for (frame, pose) in known {
            cdr.header(time_ns, &frame.parent);
            cdr.string(&frame.child);
            pose.xyz().iter().chain(&pose.quaternion_xyzw()).for_each(|v| cdr.f64(*v));
        }
        self.message(time_ns, "/tf", TRANSFORMS, &cdr.0)
    }

    fn marks(&mut self, time_ns: i64, marks: &ImageMarks) -> Result<()> {
        let mut cdr = CdrWriter::new();
        // No circles.
        cdr.u32(0);
        cdr.u32(marks.layers.len() as u32);
        for layer in &marks.layers {
            cdr.time(time_ns);
            cdr.0.push(if layer.kind == MarkKind::Points { POINTS } else { LINE_LIST });
            cdr.u32(layer.points.len() as u32);
            // Viewers count from the corner of the top-left pixel, not from its centre.
            layer.points.iter().flatten().for_each(|v| cdr.f64(v + 0.5));
            cdr.colour(layer.colour);
            // No colours of single points.
            cdr.u32(0);
            cdr.colour(layer.colour);
            cdr.f64(THICKNESS_PX);
        }
        // No texts.
        cdr.u32(0);
        self.message(time_ns, "/camera/annotations", ANNOTATIONS, &cdr.0)
    }

    fn finish(mut self) -> Result<()> {
        self.writer.finish().map(|_| ()).map_err(|e| refused(&self.path, &e))
    }
}

fn refused(path: &Path, error: &mcap::McapError) -> Error {
    let why = match error {
        mcap::McapError::Io(cause) => cause.to_string(),
        other => other.to_string(),
    };
    let remedy = "check that the disk is not full";
    Error::new(Code::OutputFailed, path.display(), format!("cannot be written: {why}"), remedy)
}

/// Seconds and nanoseconds of a stamp.
fn split(time_ns: i64) -> (i32, u32) {
    const SECOND: i64 = 1_000_000_000;
    let seconds = i32::try_from(time_ns.div_euclid(SECOND)).unwrap_or(i32::MAX);
    (seconds, time_ns.rem_euclid(SECOND) as u32)
}

/// Plain CDR in little-endian order, the counterpart of [`super::cdr::Cdr`].
struct CdrWriter(Vec<u8>);

impl CdrWriter {
    fn new() -> Self {
        Self(vec![0, 1, 0, 0])
    }

    fn with_header(time_ns: i64, frame: &str) -> Self {
        let mut cdr = Self::new();
        cdr.header(time_ns, frame);
        cdr
    }

    fn header(&mut self, time_ns: i64, frame: &str) {
        self.time(time_ns);
        self.string(frame);
    }

    fn time(&mut self, time_ns: i64) {
        let (seconds, nanoseconds) = split(time_ns);
        self.u32(seconds as u32);
        self.u32(nanoseconds);
    }

    /// Red, green and blue, opaque.
    fn colour(&mut self, [r, g, b]: [f64; 3]) {
        [r, g, b, 1.0].into_iter().for_each(|v| self.f64(v));
    }

    /// Alignment counts from the end of the encapsulation header.
    fn align(&mut self, to: usize) {
        let body = self.0.len() - 4;
        self.0.resize(4 + body.next_multiple_of(to), 0);
    }

    fn u32(&mut self, value: u32) {
        self.align(4);
        self.0.extend(value.to_le_bytes());
    }

    fn f64(&mut self, value: f64) {
        self.align(8);
        self.0.extend(value.to_le_bytes());
    }

    fn f64s(&mut self, values: &[f64]) {
        self.u32(values.len() as u32);
        values.iter().for_each(|v| self.f64(*v));
    }

    fn string(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.0.extend(text.as_bytes());
        self.0.push(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_named_as_the_system_does() {
        let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
        let error = refused(Path::new("run.mcap"), &mcap::McapError::Io(std::io::Error::from(full.kind())));
        assert!(error.code == Code::OutputFailed && error.what.ends_with(&full.to_string()), "{error}");
    }
}
