//! A small plate with a random code, for tests within this room.

use crate::series::{Plate, PlateKind};

/// A plate whose classes are drawn by a small congruential generator.
pub(crate) fn random_plate(columns: u32, rows: u32, pitch_m: f64, seed: u64) -> Plate {
    let mut plate = Plate::lattice(PlateKind::CodedCircles, columns, rows, pitch_m, 1e-4);
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    for m in &mut plate.markers {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let class = state >> 62;
        m.outer_radius_m = if class & 1 == 0 { 0.3 } else { 0.2 } * pitch_m;
        m.inner_radius_m = if class & 2 == 0 { 0.0 } else { 0.5 * m.outer_radius_m };
    }
    plate
}
