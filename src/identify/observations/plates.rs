//! Which series show one plate: those that name the same plate.toml, and those whose plates are described alike.
//!
//! The folder of every run may have a plate.toml of its own. Were each taken for a plate of its own, with a size of its own, `N` copies would
//! make the scale of one print look `sqrt(N)` times as well known as it is.

use super::stated::on_the_tip_beside_others;
use crate::error::{Code, Error, Notice, Result};
use crate::problem::MeasuredSeries;
use crate::series::{Plate, Series};

/// A plate as the first series that shows it has it.
struct Known<'a> {
    plate: &'a Plate,
    is_on_the_tip: bool,
    /// Its names by the files that describe it; the first is taken.
    names: Vec<String>,
    /// Series that show it.
    series: Vec<&'a str>,
}

impl Known<'_> {
    /// What there is to say where several files describe it, and none of them has a name for it.
    fn notice(&self) -> Option<Notice> {
        let is_silent = self.names.len() == 1 || self.plate.name.is_some();
        (!is_silent).then(|| {
            Notice::new(
                Code::PlatesAlike,
                format!("series {}", self.series.join(", ")),
                "their plate.toml files describe the plate alike: it is taken for one plate, with one size and one shape",
                "where they are several prints, give each plate.toml a name of its own (name = \"..\")",
            )
        })
    }
}

/// Gives series that show one plate one name of it; `views` are the series as their files say, in the order of `measured`.
///
/// # Errors
/// Plates of one `name` that are described otherwise.
pub(super) fn name_plates(views: &[&Series], measured: &mut [MeasuredSeries]) -> Result<Vec<Notice>> {
    let mut all: Vec<Known> = Vec::new();
    for (view, own) in views.iter().zip(measured).filter(|(_, own)| own.has_images) {
        // Sizes of dots that the detector found are no part of the description.
        let (plate, is_on_the_tip) = (&view.plate, on_the_tip_beside_others(view));
        let is_it = |known: &Known| {
            known.names.contains(&own.plate_name) || (known.is_on_the_tip == is_on_the_tip && known.plate == plate)
        };
        match all.iter_mut().find(|known| is_it(known)) {
            Some(known) => {
                known.series.push(&view.name);
                if !known.names.contains(&own.plate_name) {
                    known.names.push(std::mem::replace(&mut own.plate_name, known.names[0].clone()));
                } else {
                    own.plate_name.clone_from(&known.names[0]);
                }
            }
            None => {
                refuse_other_of_its_name(view, &all)?;
                all.push(Known { plate, is_on_the_tip, names: vec![own.plate_name.clone()], series: vec![&view.name] });
            }
        }
    }
    Ok(all.iter().filter_map(Known::notice).collect())
}

/// A name is that of one plate.
fn refuse_other_of_its_name(view: &Series, all: &[Known]) -> Result<()> {
    let Some(name) = &view.plate.name else { return Ok(()) };
    let other = |known: &&Known| known.plate.name.as_ref() == Some(name) && known.plate != &view.plate;
    match all.iter().find(other) {
        None => Ok(()),
        Some(known) => Err(Error::new(
            Code::SeriesDisagree,
            view.manifest_file().display(),
            format!("its plate '{name}' is described otherwise than that of series {}", known.series.join(", ")),
            "give different plates different names in plate.toml, and one plate one description",
        )),
    }
}
