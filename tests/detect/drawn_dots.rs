//! Drawings of grids of dots for detectors that take every compact dark spot for a dot, as OpenCV's detector of blobs.

use std::collections::HashSet;

use image::GrayImage;

use crate::program::{robotcal, text};

/// What OpenCV's detector of blobs asks for unless it is told otherwise: area, px^2, inertia across over along, area over that of the hull.
const LEAST_AREA: f64 = 25.0;
const LEAST_INERTIA: f64 = 0.1;
const LEAST_CONVEXITY: f64 = 0.95;

/// Pixels that are darker than a level, in pieces that hang together by sides or corners.
fn pieces(image: &GrayImage, level: u8) -> Vec<Vec<[i64; 2]>> {
    let dark = image.enumerate_pixels().filter(|(_, _, p)| p.0[0] < level);
    let mut left: HashSet<[i64; 2]> = dark.map(|(x, y, _)| [i64::from(x), i64::from(y)]).collect();
    let mut all = Vec::new();
    while let Some(first) = left.iter().next().copied() {
        left.remove(&first);
        let (mut piece, mut at) = (vec![first], 0);
        while at < piece.len() {
            let [x, y] = piece[at];
            at += 1;
            for [dx, dy] in [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]] {
                if left.remove(&[x + dx, y + dy]) {
                    piece.push([x + dx, y + dy]);
                }
            }
        }
        all.push(piece);
    }
    all
}

/// Area of the convex hull of the centres of pixels.
fn hull_area(piece: &[[i64; 2]]) -> f64 {
    let mut corners = piece.to_vec();
    corners.sort_unstable();
    let left_of = |a: [i64; 2], b: [i64; 2], c: [i64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let chain = |points: &mut dyn Iterator<Item = [i64; 2]>| {
        let mut chain: Vec<[i64; 2]> = Vec::new();
        for p in points {
            while chain.len() > 1 && left_of(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let hull = [chain(&mut corners.iter().copied()), chain(&mut corners.iter().rev().copied())].concat();
    let twice: i64 =
        (0..hull.len()).map(|k| (hull[k], hull[(k + 1) % hull.len()])).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum();
    twice as f64 / 2.0
}

/// Area within the centres of the outermost pixels, by Pick's theorem.
fn area(piece: &[[i64; 2]]) -> f64 {
    let all: HashSet<&[i64; 2]> = piece.iter().collect();
    let is_outermost =
        |[x, y]: &&[i64; 2]| [[x - 1, *y], [x + 1, *y], [*x, y - 1], [*x, y + 1]].iter().any(|p| !all.contains(p));
    piece.len() as f64 - piece.iter().filter(is_outermost).count() as f64 / 2.0 - 1.0
}

fn is_blob(piece: &[[i64; 2]]) -> bool {
    let (n, area) = (piece.len() as f64, area(piece));
    let mean = [0, 1].map(|a| piece.iter().map(|p| p[a] as f64).sum::<f64>() / n);
    let moment =
        |a: usize, b: usize| piece.iter().map(|p| (p[a] as f64 - mean[a]) * (p[b] as f64 - mean[b])).sum::<f64>() / n;
    let [xx, xy, yy] = [moment(0, 0), moment(0, 1), moment(1, 1)];
    let (half, apart) = ((xx + yy) / 2.0, ((xx - yy) / 2.0).hypot(xy));
    area >= LEAST_AREA && half - apart >= LEAST_INERTIA * (half + apart) && area >= LEAST_CONVEXITY * hull_area(piece)
}

/// Letters, ticks and arrow heads were as many blobs again: OpenCV found no asymmetric grid of 4 x 11 at 20 mm beside them.
#[test]
fn nothing_beside_the_dots_of_a_drawn_grid_is_a_blob() {
    let folder = tempfile::tempdir().unwrap();
    for (shape, pitch_mm, dots, more) in
        [("4x11", "20", 44, Some("--asymmetric")), ("4x5", "10", 20, Some("--asymmetric")), ("7x6", "15", 42, None)]
    {
        for dpi in ["80", "110", "150"] {
            let out = folder.path().join(format!("{shape}_{dpi}"));
            let args =
                ["plate", "--kind", "circle-grid", "--shape", shape, "--pitch-mm", pitch_mm, "--dpi", dpi, "--out"];
            let args: Vec<&str> = args.into_iter().chain([out.to_str().unwrap()]).chain(more).collect();
            let done = robotcal(&args);
            assert!(done.status.success(), "{}", text(&done));
            let image = image::open(out.join("plate.png")).unwrap().to_luma8();
            for level in [60, 100, 140, 180, 220] {
                let blobs = pieces(&image, level).iter().filter(|piece| is_blob(piece)).count();
                assert_eq!(blobs, dots, "{shape} at {dpi} dpi below {level}");
            }
        }
    }
}
