//! Plates that look the same after a turn.

use super::plate::Plate;
use super::plate_kind::Turns;

/// How far a marker may lie from the place of another after a turn, in pitches, and its radius from that one's, as a share.
const SAME: f64 = 0.1;

/// A turn after which a plate looks the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlateTurn {
    /// Quarter turns, counter-clockwise on the printed face.
    pub quarters: u8,
    /// For every marker, its id and that of the marker at its place after the turn.
    ids: Vec<(u32, u32)>,
}

impl PlateTurn {
    /// Id of the marker where marker `id` comes to lie.
    pub fn id(&self, id: u32) -> u32 {
        self.ids.binary_search_by_key(&id, |pair| pair.0).map_or(id, |k| self.ids[k].1)
    }
}

impl Plate {
    /// The turns, other than none, after which the plate looks the same in an image.
    pub fn turns(&self) -> Vec<PlateTurn> {
        let odd = |n: u32| n % 2 == 1;
        let keeps_colours = |quarters: u8| match quarters {
            2 => odd(self.columns) == odd(self.rows),
            _ => !odd(self.columns) && !odd(self.rows),
        };
        let allowed = |quarters: &u8| match self.kind.print().turns {
            Turns::Never => false,
            Turns::KeepingColours => keeps_colours(*quarters),
            Turns::Any => true,
        };
        (1..4).filter(allowed).filter_map(|quarters| self.turned(quarters)).collect()
    }

    /// Those after which its markers lie in the same places, whatever their sizes.
    pub fn turns_of_places(&self) -> Vec<PlateTurn> {
        let mut alike = self.clone();
        alike.markers.iter_mut().for_each(|m| (m.outer_radius_m, m.inner_radius_m) = (0.0, 0.0));
        alike.turns()
    }

    /// That of them by so many quarter turns.
    pub fn turn_of_places(&self, quarters: u8) -> Option<PlateTurn> {
        self.turns_of_places().into_iter().find(|turn| turn.quarters == quarters)
    }

    fn turned(&self, quarters: u8) -> Option<PlateTurn> {
        let alike = |a: f64, b: f64| (a - b).abs() <= SAME * a.abs().max(b.abs());
        let ids = self.markers.iter().map(|marker| {
            let [x, y] = [marker.position_m.x, marker.position_m.y];
            let [x, y] = match quarters {
                1 => [-y, x],
                2 => [-x, -y],
                _ => [y, -x],
            };
            let there = self.markers.iter().find(|other| {
                (other.position_m.x - x).hypot(other.position_m.y - y) <= SAME * self.pitch_m
                    && alike(other.outer_radius_m, marker.outer_radius_m)
                    && alike(other.inner_radius_m, marker.inner_radius_m)
            })?;
            Some((marker.id, there.id))
        });
        Some(PlateTurn { quarters, ids: ids.collect::<Option<_>>()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::series::plate_kind::PlateKind;

    fn quarters(kind: PlateKind, columns: u32, rows: u32) -> Vec<u8> {
        Plate::lattice(kind, columns, rows, 0.01, 1e-4).turns().iter().map(|t| t.quarters).collect()
    }

    #[test]
    fn colours_decide_on_chessboards() {
        assert!(quarters(PlateKind::Chessboard, 9, 6).is_empty());
        assert_eq!(quarters(PlateKind::Chessboard, 9, 7), [2]);
        assert_eq!(quarters(PlateKind::Chessboard, 8, 6), [2]);
        assert_eq!(quarters(PlateKind::Chessboard, 8, 8), [1, 2, 3]);
        assert_eq!(quarters(PlateKind::Chessboard, 7, 7), [2]);
        assert!(quarters(PlateKind::Charuco, 9, 7).is_empty());
    }

    #[test]
    fn a_turn_takes_the_first_corner_to_the_place_of_another() {
        let turns = Plate::lattice(PlateKind::Chessboard, 8, 8, 0.01, 1e-4).turns();
        // Counter-clockwise on the face, the top-left comes to the bottom-left, the bottom-right, the top-right.
        assert_eq!(turns.iter().map(|t| t.id(0)).collect::<Vec<_>>(), [56, 63, 7]);
        assert_eq!(turns[1].id(9), 54);
    }
}
