//! Images of a series that go into a recording: each can be decoded.

use std::io::{BufReader, Cursor};
use std::path::Path;

use rayon::prelude::*;

use crate::error::{Code, Error, Notice, Result};
use crate::files::{self, FileKind, batches, decode_picture, decoded_bytes};

/// Memory of the pictures that are decoded at a time, bytes.
const MOST_IN_FLIGHT: u64 = 256 << 20;

/// Why each image cannot be decoded; `None` for those that can, in the order of the images.
pub(super) fn refused(images: &[&Path]) -> Vec<Option<Notice>> {
    let sizes: Vec<u64> = images.iter().map(|image| size(image)).collect();
    let judged = |image: &&Path| decoded(image).err().map(|e| Notice::new(e.code, e.place, e.what, LEFT_OUT));
    let batches = batches(&sizes, MOST_IN_FLIGHT).into_iter();
    batches.flat_map(|batch| images[batch].par_iter().map(judged).collect::<Vec<_>>()).collect()
}

const LEFT_OUT: &str = "it is not in the recording: copy or record it again";

/// Memory of a picture by its header, bytes; none where that cannot be read.
fn size(image: &Path) -> u64 {
    let file = files::open(image, FileKind::Image).ok();
    file.and_then(|(file, _)| decoded_bytes(BufReader::new(file)).ok()).unwrap_or(0)
}

fn decoded(image: &Path) -> Result<()> {
    let bytes = files::read(image, FileKind::Image)?;
    if let Err(e) = decode_picture(Cursor::new(&bytes)) {
        return Err(Error::new(Code::ImageUnreadable, image.display(), e, ""));
    }
    match files::is_whole(image)? {
        true => Ok(()),
        false => Err(Error::new(Code::ImageTruncated, image.display(), "the file ends before its image does", "")),
    }
}
