//! One picture of a recording, before and after it is decoded.

use std::io::Cursor;

use image::{DynamicImage, ImageFormat};

use super::cdr::Decoded;
use super::message::Message;
use super::messages::{self, RawImage};
use super::pixels;
use crate::files::{decode_picture, decoded_bytes};

/// A picture with its grey values of 16 bits takes up to three times its own memory.
const GREY_WORDS: u64 = 3;

/// A picture as the recording has it.
pub(super) enum Frame {
    Raw(RawImage),
    Compressed(Vec<u8>),
}

impl Frame {
    /// The picture in a message.
    pub fn read(message: &Message<'_>) -> Decoded<Self> {
        match message.schema {
            messages::COMPRESSED_IMAGE => messages::compressed_image(message.data).map(Self::Compressed),
            _ => RawImage::read(message.data).map(Self::Raw),
        }
    }

    pub fn decode(&self) -> Decoded<DynamicImage> {
        match self {
            Self::Raw(raw) => pixels::to_image(raw),
            Self::Compressed(bytes) => {
                decode_picture(Cursor::new(bytes)).map_err(|e| format!("is no picture that can be read ({e})"))
            }
        }
    }

    /// Memory of the message, bytes.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Raw(raw) => raw.data.len(),
            Self::Compressed(bytes) => bytes.len(),
        }
    }

    /// Memory that decoding takes, bytes, as its header says.
    pub fn decoded_bytes(&self) -> u64 {
        match self {
            // A mosaic becomes three colours.
            Self::Raw(raw) => GREY_WORDS * 3 * raw.data.len() as u64,
            Self::Compressed(bytes) => GREY_WORDS * decoded_bytes(Cursor::new(bytes)).unwrap_or(0),
        }
    }

    /// Bytes that can be written as they are, with the extension of their format.
    pub fn file(&self) -> Option<(&[u8], &'static str)> {
        let Self::Compressed(bytes) = self else { return None };
        match image::guess_format(bytes) {
            Ok(ImageFormat::Jpeg) => Some((bytes, "jpg")),
            Ok(ImageFormat::Png) => Some((bytes, "png")),
            _ => None,
        }
    }
}
