//! What kind of file it is, by its first bytes.

use std::io::Read;
use std::path::Path;

use crate::error::{Code, Error, Result};
use crate::files::{self, FileKind, word};

/// First bytes of a file, which say what it is.
pub(super) fn head(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let (file, _) = files::open(path, FileKind::Recording)?;
    file.take(16).read_to_end(&mut bytes).map_err(|e| Error::io(path, &e))?;
    Ok(bytes)
}

/// Names what a file is instead, with the command that converts it.
pub(super) fn not_recording(path: &Path, head: &[u8]) -> Error {
    let shown = word(path.display());
    let (what, remedy) = if head.starts_with(b"#ROSBAG V2") {
        let remedy =
            format!("convert it: pip install rosbags; rosbags-convert --src {shown} --dst run1 --dst-storage mcap");
        ("is a ROS 1 bag", remedy)
    } else if head.starts_with(&[0x28, 0xb5, 0x2f, 0xfd]) {
        ("is compressed as a whole", format!("expand it first: unzstd {shown}"))
    } else {
        ("is not a recording", "check the file: it begins neither as MCAP nor as sqlite does".to_string())
    };
    Error::new(Code::RecordingFormat, path.display(), what, remedy)
}
