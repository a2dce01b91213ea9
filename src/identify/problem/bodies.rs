//! What was measured of bodies on the tip, in all series: who shares what, by name.

use crate::problem::{
    BodyMeasurement, BodySeen, Instrument, InstrumentKind, Layout, LengthEnds, MeasuredLength, MeasuredSeries,
    SeenLength, intern,
};

/// Instruments, bodies and what was measured, by index.
#[derive(Debug, Default)]
pub(super) struct Bodies {
    /// The instruments.
    pub instruments: Vec<Instrument>,
    /// Names of the bodies.
    pub names: Vec<String>,
    /// Measurements, in the order of their stops.
    pub measurements: Vec<BodyMeasurement>,
    /// Measured distances.
    pub lengths: Vec<MeasuredLength>,
    /// Number of variance components: one for every kind of instrument in a series.
    pub components: usize,
}

impl Bodies {
    /// Of all series; `places` has the stop of every row of each.
    pub fn of(series: &[MeasuredSeries], places: &[Vec<usize>]) -> Self {
        let mut all = Self::default();
        for (index, (s, stops)) in series.iter().zip(places).enumerate() {
            let mut components: Vec<(InstrumentKind, usize)> = Vec::new();
            for seen in &s.bodies {
                let component = match components.iter().find(|(kind, _)| *kind == seen.kind) {
                    Some((_, component)) => *component,
                    None => {
                        components.push((seen.kind, all.components));
                        all.components += 1;
                        all.components - 1
                    }
                };
                let instrument = all.instrument(&seen.instrument, seen.kind, component);
                let body = intern(&mut all.names, &seen.body);
                all.measurements.push(BodyMeasurement {
                    stop: stops[seen.stop],
                    read: (index, seen.stop),
                    instrument,
                    body,
                    seen: seen.seen,
                    sigma_m: seen.sigma_m,
                    sigma_rad: seen.sigma_rad,
                    rejected: None,
                });
            }
            all.lengths.extend(
                s.lengths.iter().enumerate().filter_map(|(k, l)| all.length(l, (index, k))).collect::<Vec<_>>(),
            );
        }
        all.measurements.sort_by_key(|m| m.stop);
        all
    }

    fn instrument(&mut self, name: &str, kind: InstrumentKind, component: usize) -> usize {
        let found = self.instruments.iter().position(|i| i.name == name && i.kind == kind);
        found.unwrap_or_else(|| {
            self.instruments.push(Instrument { name: name.to_owned(), kind, component });
            self.instruments.len() - 1
        })
    }

    /// By names of instruments, else of bodies, with where it was read.
    fn length(&self, length: &SeenLength, read: (usize, usize)) -> Option<MeasuredLength> {
        let pair = |of: &dyn Fn(&String) -> Option<usize>| Some([of(&length.between[0])?, of(&length.between[1])?]);
        let instruments = pair(&|name| self.instruments.iter().position(|i| &i.name == name));
        let bodies = || pair(&|name| self.names.iter().position(|n| n == name));
        let ends = instruments.map(LengthEnds::Instruments).or_else(|| bodies().map(LengthEnds::Bodies))?;
        let SeenLength { distance_m, sigma_m, .. } = *length;
        Some(MeasuredLength { ends, distance_m, sigma_m, read, left_out: false })
    }

    /// Holds turns that nothing sees: of bodies that are seen as points only, and of frames that are parallel to the base.
    pub fn hold_unseen_turns(&self, layout: &mut Layout) {
        let is_seen_as_pose =
            |body: usize| self.measurements.iter().any(|m| m.body == body && matches!(m.seen, BodySeen::Pose(_)));
        let bodies =
            layout.bodies.iter().enumerate().filter(|(body, _)| !is_seen_as_pose(*body)).map(|(_, r)| r.clone());
        let frames = layout.instruments.iter().zip(&self.instruments).filter(|(_, i)| i.kind.is_parallel_to_base());
        let held: Vec<usize> = bodies.chain(frames.map(|(r, _)| r.clone())).flat_map(|r| r.skip(3)).collect();
        held.into_iter().for_each(|c| layout.columns[c].free = false);
    }
}
