//! The four ROS messages that a calibration needs.

use super::cdr::{Cdr, Decoded};

/// Names of the types in a recording.
pub(super) const JOINT_STATE: &str = "sensor_msgs/msg/JointState";
pub(super) const IMAGE: &str = "sensor_msgs/msg/Image";
pub(super) const COMPRESSED_IMAGE: &str = "sensor_msgs/msg/CompressedImage";
pub(super) const CAMERA_INFO: &str = "sensor_msgs/msg/CameraInfo";

/// Stamp of a message header, ns, and its frame.
fn header<'a>(cdr: &mut Cdr<'a>) -> Decoded<(i64, &'a str)> {
    let (seconds, nanoseconds) = (cdr.i32()?, cdr.u32()?);
    Ok((i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds), cdr.string()?))
}

/// Stamp of a message header, ns.
pub(super) fn stamp(cdr: &mut Cdr<'_>) -> Decoded<i64> {
    header(cdr).map(|(stamp_ns, _)| stamp_ns)
}

/// Stamp of a message that begins with a header, ns, and its frame.
pub(super) fn header_of(message: &[u8]) -> Decoded<(i64, &str)> {
    header(&mut Cdr::new(message)?)
}

/// Stamp of an image, ns, where it can be read and is of this frame.
pub(super) fn stamp_in(message: &[u8], frame: Option<&str>) -> Option<i64> {
    let (stamp_ns, own) = header_of(message).ok()?;
    frame.is_none_or(|frame| frame == own).then_some(stamp_ns)
}

/// `sensor_msgs/JointState` without the values of velocity and effort.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct JointState {
    pub stamp_ns: i64,
    /// What the messages of a publisher have in common: frame, and whether velocities and efforts are there.
    pub marks: Vec<String>,
    pub names: Vec<String>,
    /// As recorded: angles in rad or deg, lengths in m.
    pub positions: Vec<f64>,
}

impl JointState {
    pub fn read(message: &[u8]) -> Decoded<Self> {
        let mut cdr = Cdr::new(message)?;
        let (stamp_ns, frame) = header(&mut cdr)?;
        let (names, positions) = (cdr.strings()?, cdr.f64s()?);
        if names.len() != positions.len() && !positions.is_empty() {
            return Err(format!("has {} names and {} positions", names.len(), positions.len()));
        }
        // What ends early has none; its positions count all the same.
        let mut has = |what: &str| match cdr.f64s() {
            Ok(values) if !values.is_empty() => what.to_owned(),
            _ => format!("no {what}"),
        };
        let marks = vec![format!("frame_id \"{}\"", frame.escape_debug()), has("velocities"), has("efforts")];
        Ok(Self { stamp_ns, marks, names, positions })
    }

    /// The joints that have a position: drivers write NaN for those that they do not measure.
    pub fn finite(self) -> Self {
        let both = self.names.into_iter().zip(self.positions).filter(|(_, q)| q.is_finite());
        let (names, positions) = both.unzip();
        Self { stamp_ns: self.stamp_ns, marks: self.marks, names, positions }
    }

    /// The joints whose position is no number.
    pub fn not_finite(&self) -> Vec<String> {
        let both = self.names.iter().zip(&self.positions).filter(|(_, q)| !q.is_finite());
        both.map(|(name, _)| name.clone()).collect()
    }
}

/// `sensor_msgs/Image`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RawImage {
    pub width: u32,
    pub height: u32,
    pub encoding: String,
    pub big_endian: bool,
    /// Bytes from row to row.
    pub step: usize,
    pub data: Vec<u8>,
}

impl RawImage {
    pub fn read(message: &[u8]) -> Decoded<Self> {
        let mut cdr = Cdr::new(message)?;
        stamp(&mut cdr)?;
        let (height, width) = (cdr.u32()?, cdr.u32()?);
        let encoding = cdr.string()?.to_string();
        let big_endian = cdr.u8()? != 0;
        let step = cdr.u32()? as usize;
        Ok(Self { width, height, encoding, big_endian, step, data: cdr.bytes()?.to_vec() })
    }
}

/// Formats of videos, whose pieces are no pictures of their own.
const VIDEOS: [&str; 4] = ["theora", "h264", "h265", "hevc"];

/// Bytes of a `sensor_msgs/CompressedImage`; its free-text format is not needed, the bytes tell.
pub(super) fn compressed_image(message: &[u8]) -> Decoded<Vec<u8>> {
    let mut cdr = Cdr::new(message)?;
    stamp(&mut cdr)?;
    let format = cdr.string()?;
    if format.contains("compressedDepth") {
        return Err("is a depth image".into());
    }
    if let Some(video) = VIDEOS.into_iter().find(|video| format.to_lowercase().contains(video)) {
        return Err(format!("is a piece of a {video} video"));
    }
    Ok(cdr.bytes()?.to_vec())
}

/// What `sensor_msgs/CameraInfo` says of the camera, for starting values.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CameraInfo {
    /// Image width, px.
    pub width_px: u32,
    /// Image height, px.
    pub height_px: u32,
    /// Name of the distortion model as ROS writes it.
    pub distortion_model: String,
    /// Distortion coefficients in the order of that model.
    pub distortion: Vec<f64>,
    /// fx, fy, cx, cy in px; `None` when the camera was not calibrated, or its image is binned or cut out.
    pub intrinsics: Option<[f64; 4]>,
}

impl CameraInfo {
    pub(super) fn read(message: &[u8]) -> Decoded<Self> {
        let mut cdr = Cdr::new(message)?;
        stamp(&mut cdr)?;
        let (height_px, width_px) = (cdr.u32()?, cdr.u32()?);
        let distortion_model = cdr.string()?.to_string();
        let distortion = cdr.f64s()?;
        let mut array = |count: usize| (0..count).map(|_| cdr.f64()).collect::<Decoded<Vec<f64>>>();
        let k = array(9)?;
        array(9 + 12)?;
        let binned = [cdr.u32()?, cdr.u32()?].iter().any(|b| *b > 1);
        let cut = [cdr.u32()?, cdr.u32()?, cdr.u32()?, cdr.u32()?].iter().any(|r| *r != 0);
        let intrinsics = [k[0], k[4], k[2], k[5]];
        let known = !binned && !cut && intrinsics.iter().all(|v| v.is_finite() && *v > 0.0);
        Ok(Self { width_px, height_px, distortion_model, distortion, intrinsics: known.then_some(intrinsics) })
    }
}
