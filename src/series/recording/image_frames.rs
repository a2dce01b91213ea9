//! Images of one topic that are of several cameras, and what is said of these: the frames of their headers tell them apart.

use std::collections::BTreeMap;

use super::cdr::Decoded;
use super::messages::{self, CameraInfo};
use crate::error::{Code, Error, Result};

/// Times of the images of a topic by their frames, ns.
#[derive(Debug, Default)]
pub(super) struct ByFrame(BTreeMap<String, Vec<i64>>);

impl ByFrame {
    pub fn note(&mut self, frame: &str, time_ns: i64) {
        match self.0.get_mut(frame) {
            Some(times) => times.push(time_ns),
            None => _ = self.0.insert(frame.to_owned(), vec![time_ns]),
        }
    }

    pub fn times(&self) -> impl Iterator<Item = &Vec<i64>> {
        self.0.values()
    }

    pub fn retain(&mut self, keep: impl Fn(&i64) -> bool) {
        self.0.values_mut().for_each(|times| times.retain(&keep));
    }

    /// The frame that all images have that are taken, if there is one, and their times.
    ///
    /// # Errors
    /// Images of several cameras, and none is asked for; no image of the one that is.
    pub fn chosen(mut self, asked: Option<&str>, place: &str) -> Result<(Option<String>, Vec<i64>)> {
        if let Some(asked) = asked.filter(|_| !self.0.is_empty()) {
            return match self.0.remove(asked) {
                Some(times) => Ok((Some(asked.to_owned()), times)),
                None => {
                    let what = format!("has no images of frame \"{}\"; it has: {}", asked.escape_debug(), self.named());
                    Err(Error::new(Code::TopicMissing, place, what, "name another --image-frame"))
                }
            };
        }
        if self.takes_turns() {
            let what = format!("has images of several cameras, told apart by their frame_id: {}", self.named());
            return Err(Error::new(Code::TopicAmbiguous, place, what, "name one with --image-frame"));
        }
        let alone = if self.0.len() == 1 { self.0.keys().next().cloned() } else { None };
        Ok((alone, self.0.into_values().flatten().collect()))
    }

    /// Whether images of one frame come between those of another: a driver that was started anew may have another name for the same camera.
    fn takes_turns(&self) -> bool {
        let span = |times: &Vec<i64>| Some((*times.iter().min()?, *times.iter().max()?));
        let mut spans: Vec<(i64, i64)> = self.times().filter_map(span).collect();
        spans.sort_unstable();
        spans.windows(2).any(|pair| pair[1].0 <= pair[0].1)
    }

    /// The frames with the number of their images.
    fn named(&self) -> String {
        let rows = self.0.iter().map(|(frame, times)| format!("\"{}\" ({})", frame.escape_debug(), times.len()));
        rows.collect::<Vec<_>>().join(", ")
    }
}

/// The first camera info of each frame of a topic.
#[derive(Debug, Default)]
pub(super) struct Infos(BTreeMap<String, CameraInfo>);

impl Infos {
    pub fn note(&mut self, message: &[u8]) -> Decoded<()> {
        let (_, frame) = messages::header_of(message)?;
        if !self.0.contains_key(frame) {
            self.0.insert(frame.to_owned(), CameraInfo::read(message)?);
        }
        Ok(())
    }

    /// That of a frame, or the only one where nobody asked for the frame: it may be that of another camera.
    pub fn of(&self, frame: Option<&str>, is_asked_for: bool) -> Option<&CameraInfo> {
        let only = || if self.0.len() == 1 && !is_asked_for { self.0.values().next() } else { None };
        frame.and_then(|frame| self.0.get(frame)).or_else(only)
    }
}
