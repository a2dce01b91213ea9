//! Where corners of squares may be: the ChESS detector of the `chess-corners` library, with its response computed for many pixels at once.
//!
//! With the values `s` on a ring of 16 pixels and `m` of the cross of five in its middle, the response is
//!
//! ```text
//! sum_(k < 4) |s_k + s_(k+8) - s_(k+4) - s_(k+12)| - sum_(k < 8) |s_k - s_(k+8)| - 16 |mean s - mean m|
//! ```

use calib_targets_chessboard::{ChessCorner, detect_corners};
use calib_targets_core::{AxisEstimate, DetectorConfig, ImageRefiner, default_chess_config};
use chess_corners_core::{
    CenterOfMassRefiner, ChessParams, CornerDescriptor, CornerRefiner, ImageView, Refiner, RefinerKind, ResponseMap,
    describe_corners, detect_peaks_from_response_with_refine_radius, merge_corners_simple,
    refine_corners_on_image_with_fallback,
};

use crate::detect::pictures::bytes::Bytes;
use crate::linalg::wide;

/// Pixels of the ring, by their offsets from its middle.
const RING: [[isize; 2]; 16] = [
    [0, -5],
    [2, -5],
    [3, -3],
    [5, -2],
    [5, 0],
    [5, 2],
    [3, 3],
    [2, 5],
    [0, 5],
    [-2, 5],
    [-3, 3],
    [-5, 2],
    [-5, 0],
    [-5, -2],
    [-3, -3],
    [-2, -5],
];
const CROSS: [[isize; 2]; 5] = [[0, 0], [0, -1], [0, 1], [1, 0], [-1, 0]];
/// Radius of the ring, px.
const RADIUS: usize = 5;

/// Pixels that are looked at together, for the processor's sake.
const LANES: usize = 64;

/// Saddle fit over 9 x 9 px: half the scatter of the library's default on real images.
pub(super) fn corner_config() -> DetectorConfig {
    let mut refiner = ImageRefiner::saddle_point();
    if let ImageRefiner::SaddlePoint(config) = &mut refiner {
        config.radius = 4;
        config.max_offset = 3.0;
    }
    default_chess_config().with_refiner(refiner)
}

/// What `detect_corners` of the library finds with [`corner_config`].
pub(super) fn find_corners(bytes: &Bytes) -> Vec<ChessCorner> {
    let config = corner_config();
    let view = ImageView::from_u8_slice(bytes.width, bytes.height, &bytes.data);
    match (view, response(bytes), config.refiner) {
        (Some(view), Some(response), Some(ImageRefiner::SaddlePoint(saddle))) => {
            let refiner = Refiner::from_kind(RefinerKind::SaddlePoint(saddle));
            refined(view, &response, refiner, &config.chess_params(), config.merge_radius)
        }
        _ => detect_corners(&bytes.view(), &config),
    }
}

/// The peaks of the response, at the saddle points where there are any.
fn refined(
    view: ImageView,
    response: &ResponseMap,
    mut refiner: Refiner,
    parameters: &ChessParams,
    merge_radius: f32,
) -> Vec<ChessCorner> {
    let mut fallback = CenterOfMassRefiner::new(parameters.center_of_mass);
    let reach = refiner.radius().max(fallback.radius());
    let peaks = detect_peaks_from_response_with_refine_radius(response, parameters, reach);
    let mut corners =
        refine_corners_on_image_with_fallback(peaks, Some(view), Some(response), &mut refiner, &mut fallback);
    let merged = merge_corners_simple(&mut corners, merge_radius);
    let (width, height, method) = (view.width(), view.height(), parameters.orientation_method);
    let described = describe_corners(view.data(), width, height, parameters.ring_radius(), merged, method);
    described.iter().map(corner).collect()
}

fn corner(found: &CornerDescriptor) -> ChessCorner {
    let axes = found.axes.map(|axes| axes.map(|a| AxisEstimate { angle: a.angle, fit_std_error: a.fit_std_error }));
    ChessCorner::new([found.x, found.y].into(), axes.unwrap_or_default(), found.response)
}

/// The response of all pixels whose ring is in the picture, 0 elsewhere; `None` for narrow pictures.
fn response(bytes: &Bytes) -> Option<ResponseMap> {
    let (width, height) = (bytes.width, bytes.height);
    if width < 2 * RADIUS + LANES || height < 2 * RADIUS {
        return None;
    }
    let mut values = vec![0.0; width * height];
    let rows = values.chunks_exact_mut(width).enumerate().take(height - RADIUS).skip(RADIUS);
    wide(
        #[inline(always)]
        || {
            for (y, row) in rows {
                let last = width - RADIUS - LANES;
                for x in (RADIUS..last).step_by(LANES).chain([last]) {
                    let around = |[right, down]: [isize; 2]| {
                        let first = (y * width + x).wrapping_add_signed(down * width as isize + right);
                        &bytes.data[first..first + LANES]
                    };
                    row[x..x + LANES].copy_from_slice(&respond(around));
                }
            }
        },
    );
    Some(ResponseMap::new(width, height, values))
}

/// The response of pixels beside each other; `around` gives those at an offset from them.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "lanes of many arrays beside each other")]
fn respond<'a>(around: impl Fn([isize; 2]) -> &'a [u8]) -> [f32; LANES] {
    let (mut crossing, mut opposite, mut ring, mut cross) = ([0; LANES], [0; LANES], [0; LANES], [0; LANES]);
    for k in 0..4 {
        let (a, b) = (widened(around(RING[k])), widened(around(RING[k + 4])));
        let (c, d) = (widened(around(RING[k + 8])), widened(around(RING[k + 12])));
        for lane in 0..LANES {
            let (along, across) = (a[lane] + c[lane], b[lane] + d[lane]);
            crossing[lane] += (along - across).abs();
            opposite[lane] += (a[lane] - c[lane]).abs() + (b[lane] - d[lane]).abs();
            ring[lane] += along + across;
        }
    }
    for offset in CROSS {
        let values = widened(around(offset));
        for lane in 0..LANES {
            cross[lane] += values[lane];
        }
    }
    let mut response = [0.0; LANES];
    for lane in 0..LANES {
        let off = (f32::from(ring[lane]) / 16.0 - f32::from(cross[lane]) / 5.0).abs();
        response[lane] = f32::from(crossing[lane]) - f32::from(opposite[lane]) - 16.0 * off;
    }
    response
}

#[inline(always)]
fn widened(bytes: &[u8]) -> [i16; LANES] {
    std::array::from_fn(|lane| i16::from(bytes[lane]))
}

#[cfg(test)]
mod tests {
    use chess_corners_core::chess_response_u8;

    use super::*;

    #[test]
    fn the_response_and_the_corners_are_those_of_the_library() {
        let (width, height) = (219, 90);
        let square = |k: usize| if (k % width / 11 + k / width / 11).is_multiple_of(2) { 40 } else { 200 };
        let grain = |k: usize| (k.wrapping_mul(2_654_435_761) >> 7) as u8 % 40;
        let bytes = Bytes { width, height, data: (0..width * height).map(|k| square(k) + grain(k)).collect() };
        let config = corner_config();
        let expected = chess_response_u8(&bytes.data, width, height, &config.chess_params());
        assert_eq!(response(&bytes).unwrap().data(), expected.data());
        let corners = find_corners(&bytes);
        assert!(corners.len() > 60, "{}", corners.len());
        assert_eq!(corners, detect_corners(&bytes.view(), &config));
    }
}
