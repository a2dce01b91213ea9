//! Corners at the rim of what is found that are out of line with those further inside.
//!
//! The edge of a hand across the last line of squares makes corners with it, some pixels off. Along a line of corners p0, p1, p2, p3 that begins at the
//! rim, `w0 p0 - 3 w1 p1 + 3 w2 p2 - w3 p3` is small, however the board is seen: the weights `w = 1 + c (k - 2)` are those of a perspective in which
//! the last three are in step, as `w1 p1 - 2 w2 p2 + w3 p3` is 0 along the line.

use std::collections::BTreeMap;

use super::fit::Saddle;
use super::look::quantile;

/// Out of line by this share of a square at least ...
const LEAST_SQUARES: f64 = 0.03;
/// ... and by so many times as much as most are: lenses bend boards most at the rim.
const USUAL: f64 = 10.0;

/// One corner that is out of line, if there is any.
pub(super) fn out_of_line(kept: &BTreeMap<(i32, i32), Saddle>) -> Option<(i32, i32)> {
    let at = |key: (i32, i32)| kept.get(&key).map(|saddle| saddle.uv);
    let directions = [(1, 0), (-1, 0), (0, 1), (0, -1)];
    // How far out of line a corner is, and the length of the square beside it.
    let off = |(u, v): (i32, i32), (du, dv): (i32, i32)| {
        let [p0, p1, p2, p3] = [0, 1, 2, 3].map(|k| at((u + k * du, v + k * dv)));
        let (p0, p1, p2, p3) = (p0?, p1?, p2?, p3?);
        let (along, bend) = ([0, 1].map(|a| p3[a] - p1[a]), [0, 1].map(|a| 2.0 * p2[a] - p1[a] - p3[a]));
        let c = (bend[0] * along[0] + bend[1] * along[1]) / (along[0].powi(2) + along[1].powi(2));
        let third = [0, 1].map(|a| (1.0 - 2.0 * c) * p0[a] - 3.0 * (1.0 - c) * p1[a] + 3.0 * p2[a] - (1.0 + c) * p3[a]);
        Some((third[0].hypot(third[1]), (p2[0] - p1[0]).hypot(p2[1] - p1[1])))
    };
    let all = || kept.keys().flat_map(|&key| directions.map(|direction| (key, direction)));
    let usual = quantile(all().filter_map(|(key, direction)| Some(off(key, direction)?.0)), 0.5)?;
    let rim = all().filter(|((u, v), (du, dv))| !kept.contains_key(&(u - du, v - dv)));
    rim.filter_map(|(key, direction)| {
        let (off, side) = off(key, direction)?;
        Some((key, off / f64::max(LEAST_SQUARES * side, USUAL * usual)))
    })
    .filter(|(_, times)| *times > 1.0)
    .max_by(|(_, a), (_, b)| a.total_cmp(b))
    .map(|(key, _)| key)
}
