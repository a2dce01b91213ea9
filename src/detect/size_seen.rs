//! What to say of a board or grid that has other columns and rows than the plate file states.

use super::Detection;
use crate::error::{Code, Error, Notice};
use crate::series::{Plate, PlateKind};

const CORRECT: &str = "correct columns and rows of the plate file, or take images in which nothing covers an outer line and no other board \
                       is in view; ";

/// What columns and rows count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Counted {
    InnerCorners,
    Dots,
    /// Every other row is shifted.
    ShiftedDots,
}

impl Counted {
    fn name(self) -> &'static str {
        match self {
            Self::InnerCorners => "inner corners",
            Self::Dots | Self::ShiftedDots => "dots",
        }
    }

    fn rule(self) -> &'static str {
        match self {
            Self::InnerCorners => "they count inner corners, one less than squares",
            Self::Dots => "they count dots",
            Self::ShiftedDots => "they count the dots of a row, and the rows",
        }
    }

    fn of(plate: &Plate) -> Self {
        if plate.kind == PlateKind::CircleGrid { Self::Dots } else { Self::InnerCorners }
    }
}

/// All four ends are in view; `seen` in any order.
pub(super) fn other_size(counted: Counted, seen: [u32; 2], stated: [u32; 2]) -> Error {
    let [columns, rows] = match as_stated(seen, stated) {
        exchanged if exchanged == stated => [stated[1], stated[0]],
        other => other,
    };
    let [stated_columns, stated_rows] = stated;
    let what = format!("{columns} x {rows} {} are seen, not {stated_columns} x {stated_rows}", counted.name());
    Error::new(Code::PlateContradicted, "image", what, format!("{CORRECT}{}", counted.rule()))
}

/// The rows of a grid of dots are shifted and should not be, or the other way round; `seen`: columns and rows.
pub(super) fn other_rows(counted: Counted, [columns, rows]: [u32; 2]) -> Error {
    let shifted = counted == Counted::ShiftedDots;
    let every_other = if shifted { "every other row shifted" } else { "no row shifted" };
    let what = format!("{columns} x {rows} dots are seen with {every_other}");
    let remedy = format!("correct asymmetric (here {shifted}), columns and rows of the plate file: {}", counted.rule());
    Error::new(Code::PlateContradicted, "image", what, remedy)
}

/// Dots of a further line are seen; all that is known of their number.
pub(super) fn beyond([columns, rows]: [u32; 2]) -> Error {
    let what = format!("a line of dots more is seen than the {columns} x {rows} of the plate file");
    Error::new(
        Code::PlateContradicted,
        "image",
        what,
        format!("correct columns and rows of the plate file: {}", Counted::Dots.rule()),
    )
}

/// Two opposite ends are in view.
pub(super) fn end_to_end(counted: Counted, seen: u32, [columns, rows]: [u32; 2]) -> Error {
    let what = format!("{seen} {} are seen from end to end one way, which are not {columns} x {rows}", counted.name());
    Error::new(Code::PlateContradicted, "image", what, format!("{CORRECT}{}", counted.rule()))
}

/// The refusal where an outer line is not there.
pub(super) fn line_missing(plate: &Plate, detection: &Detection) -> Error {
    let (counted, stated) = (Counted::of(plate), [plate.columns, plate.rows]);
    if let Some(seen) = detection.size_seen.filter(|[a, b]| ![[*a, *b], [*b, *a]].contains(&stated)) {
        return other_size(counted, seen, stated);
    }
    let ([columns, rows], what) = (stated, counted.name());
    Error::new(
        Code::PlateLineHidden,
        "image",
        format!("an outer line of the {columns} x {rows} {what} is not where it should be in view"),
        format!(
            "check columns and rows of the plate file ({what}); a covered line is accepted beside images that show the whole board"
        ),
    )
}

/// What to say where no image shows all of a board that has no code.
pub(super) fn nowhere_whole(plate: &Plate) -> Notice {
    Notice::new(
        Code::PlateLineHidden,
        "plate",
        format!(
            "no image shows the whole board: that it has {} x {} {} is taken from the plate file",
            plate.columns,
            plate.rows,
            Counted::of(plate).name()
        ),
        "count them, or take one image with all of the board",
    )
}

/// What to say of one of two equal plates.
pub(super) fn twin() -> Notice {
    let what = "two equal plates are in view, of which one is taken";
    Notice::new(Code::PlateTwice, "image", what, "take the image so that the stated one alone is in view")
}

/// A board may be turned by a quarter: the order of the two numbers in which one of them is as stated, or the larger comes first where it is
/// stated first.
fn as_stated([a, b]: [u32; 2], [columns, rows]: [u32; 2]) -> [u32; 2] {
    let agree = |x: u32, y: u32| usize::from(x == columns) + usize::from(y == rows);
    match agree(a, b).cmp(&agree(b, a)) {
        std::cmp::Ordering::Greater => [a, b],
        std::cmp::Ordering::Less => [b, a],
        std::cmp::Ordering::Equal if (a >= b) == (columns >= rows) => [a, b],
        std::cmp::Ordering::Equal => [b, a],
    }
}

#[cfg(test)]
mod tests {
    use super::as_stated;

    #[test]
    fn one_of_the_numbers_is_as_stated() {
        for (seen, stated, said) in [
            ([6, 9], [10, 6], [9, 6]),
            ([9, 6], [10, 6], [9, 6]),
            ([9, 7], [7, 10], [7, 9]),
            ([5, 8], [10, 7], [8, 5]),
            ([8, 5], [7, 10], [5, 8]),
        ] {
            assert_eq!(as_stated(seen, stated), said, "{seen:?} for {stated:?}");
        }
    }
}
