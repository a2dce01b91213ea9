//! Normal equations of one marker.

use super::state::ANNULUS;

/// Normal matrix, or its factor.
pub(super) type Normal = [[f64; ANNULUS]; ANNULUS];

/// Cholesky factor in place: from the lower triangle to the upper triangular `U` of `U' U`.
pub(super) fn cholesky(m: &mut Normal, n: usize) -> Option<()> {
    for i in 0..n {
        let (above, below) = m.split_at_mut(i);
        above.iter_mut().zip(&below[0]).for_each(|(row, v)| row[i] = *v);
    }
    let diagonal: [f64; ANNULUS] = std::array::from_fn(|i| m[i][i]);
    for j in 0..n {
        let (done, below) = m.split_at_mut(j + 1);
        let row = &mut done[j];
        let pivot = row[j];
        if pivot.is_nan() || pivot <= 1e-12 * diagonal[j].abs() {
            return None;
        }
        let inverse = 1.0 / pivot.sqrt();
        row[j..n].iter_mut().for_each(|v| *v *= inverse);
        for (i, other) in (j + 1..n).zip(below) {
            let factor = row[i];
            other[i..n].iter_mut().zip(&row[i..n]).for_each(|(v, u)| *v -= factor * u);
        }
    }
    Some(())
}

/// Solves in place with a factor of [`cholesky`].
pub(super) fn solve(u: &Normal, n: usize, b: &mut [f64; ANNULUS]) {
    for i in 0..n {
        let v = b[i] / u[i][i];
        b[i] = v;
        b[i + 1..n].iter_mut().zip(&u[i][i + 1..n]).for_each(|(b, u)| *b -= v * u);
    }
    for i in (0..n).rev() {
        let known: f64 = u[i][i + 1..n].iter().zip(&b[i + 1..n]).map(|(u, b)| u * b).sum();
        b[i] = (b[i] - known) / u[i][i];
    }
}
