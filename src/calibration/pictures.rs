//! Where the pictures of recordings wait while a calibration runs.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::error::Result;
use crate::series::{RecordingOptions, Series, Source};

/// A folder for pictures of recordings, removed when it is dropped.
#[derive(Debug)]
pub struct Pictures(PathBuf);

impl Pictures {
    /// A folder of this process alone; nothing is created before it is needed.
    pub fn new() -> Self {
        // Processes that share the folder for temporary files need not share their numbers.
        let time = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |d| d.as_nanos());
        Self(std::env::temp_dir().join(format!("robotcal-{}-{time:x}", std::process::id())))
    }

    /// Takes the stops out of the recordings among `all`; the other series stay as they are.
    ///
    /// # Errors
    /// Those of [`Series::with_recording`].
    pub fn of_recordings(&self, all: Vec<Series>, options: &RecordingOptions) -> Result<Vec<Series>> {
        let one = |series: Series| match series.source {
            Source::Recording(_) => {
                let images = self.0.join(&series.name);
                series.with_recording(&images, options)
            }
            _ => Ok(series),
        };
        all.into_iter().map(one).collect()
    }
}

impl Default for Pictures {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for Pictures {
    fn drop(&mut self) {
        remove(&self.0);
    }
}

fn remove(folder: &Path) {
    if folder.exists()
        && let Err(error) = std::fs::remove_dir_all(folder)
    {
        tracing::warn!("{} could not be removed: {error}", folder.display());
    }
}
