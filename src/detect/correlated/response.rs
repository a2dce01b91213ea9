//! Noise of neighbouring pixels from windows of which a fit follows much.
//!
//! Of noise `n` with the correlation `rho(l)` a fit leaves `r = (1 - H) n`, of which the odd part is `M n`, `M = D (1 - H)`. The covariance of two
//! pixels of it at lag l is
//!
//! ```text
//! c(l) = sum_l' A(l, l') rho(l'),   A(l, l') = mean over the pairs (a, b) at l of sum over the pairs (p, q) at l' of M_ap M_bq
//! ```
//!
//! linear in `rho`. With `H = U U'`, `V = D U` and `S_l`, which has a 1 where two pixels are at lag l or its opposite, the sums over pairs are
//!
//! ```text
//! tr(S_l D S_l' D') - 2 tr(V' S_l D S_l' U) + tr(V' S_l V  U' S_l' U) + tr(V' S_l V  K)
//! ```
//!
//! each pair counted twice. The last term is the noise of even pixels beside the window, in whose sums the noise of all lags adds up. What
//! `M` hides is left as it was expected. For white noise alone, `l' = 0`, it is `tr(S_l D D') - tr(V' S_l V (2 - U' U - K))`.
//!
//! `V` and `S_l V` are odd: half of their pixels stand for all.

use nalgebra::{DMatrix, DMatrixView, DVector, Dyn, SMatrix, SVector};

use super::raster::{LAGS, NONE, Raster, UNKNOWN, number};
use super::residuals::{OddPart, Residuals};
use crate::linalg::{add_combination, sum_of_products, wide};

/// Share of its square that the odd part of an even column of `U` has at most.
const EVEN: f64 = 1e-6;
/// Pixels whose surroundings are kept at a time: they fit the nearer caches.
const BLOCK: usize = 32;

pub(super) type Response = SMatrix<f64, UNKNOWN, UNKNOWN>;
pub(super) type Lags = SVector<f64, UNKNOWN>;

/// Sums over the pairs of pixels of windows.
pub(super) struct Sums {
    /// `M_ap M_bq`, a row a lag of (a, b), a column one of (p, q).
    pub products: Response,
    /// Pairs (a, b).
    pub counts: Lags,
}

impl Sums {
    pub const NOTHING: Self = Self {
        products: SMatrix::from_array_storage(nalgebra::ArrayStorage([[0.0; UNKNOWN]; UNKNOWN])),
        counts: SMatrix::from_array_storage(nalgebra::ArrayStorage([[0.0; UNKNOWN]])),
    };

    /// Adds the pairs of a window.
    pub fn add(&mut self, part: &OddPart) {
        self.add_noise(part);
        let columns = columns_with_odd_part(part);
        if columns.is_empty() {
            return;
        }
        let Fitted { own, all, once } = Fitted::of(part, &columns);
        // The lags in rows, both columns of `U` in columns.
        let [own, all] = [&own, &all].map(|m| DMatrixView::from_slice(m.as_slice(), UNKNOWN, columns.len().pow(2)));
        let twice = own * all.transpose();
        let beside = own * beside(part, &columns);
        for (lag, other) in (0..UNKNOWN).flat_map(|lag| (0..UNKNOWN).map(move |other| (lag, other))) {
            let both = if other == 0 { 1.0 } else { 2.0 };
            let fitted = twice[(lag, other)] - 2.0 * once[(lag, other)] + both * beside[lag];
            self.products[(lag, other)] += pairs(lag) * fitted;
        }
    }

    /// The same of white noise alone, which is the first column; `None` where more than all noise is followed.
    pub fn add_white(&mut self, part: &OddPart) -> Option<()> {
        self.add_noise(part);
        let columns = columns_with_odd_part(part);
        let beside = beside(part, &columns);
        let column = |i: usize| part.all.followed[columns[i]].as_slice();
        let left = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            // The lower triangle is all that is read.
            let followed = if i < j { 0.0 } else { sum_of_products(column(i), column(j)) };
            let own = if i == j { 2.0 } else { 0.0 };
            own - followed - beside[j * columns.len() + i]
        });
        let (factor, raster) = (left.cholesky()?.unpack(), Raster::new(&part.odd.at));
        let mut sums = [0.0; LAGS];
        for (first, by) in factor.column_iter().enumerate() {
            let mut combined = vec![0.0; part.odd.at.len()];
            wide(
                #[inline(always)]
                || {
                    (first..columns.len()).for_each(|i| {
                        add_combination(&mut combined, [&part.odd.followed[columns[i]]], [by[i]]);
                    })
                },
            );
            raster.add_products(&mut sums, -1.0, &raster.plane(|k| combined[k]));
        }
        (0..UNKNOWN).for_each(|lag| self.products[(lag, 0)] += sums[NONE + lag]);
        Some(())
    }

    /// The part without a fit: `D S_l' D'`, in which the pixel opposite counts where it is as near.
    fn add_noise(&mut self, part: &OddPart) {
        let Self { products, counts } = self;
        let at = |k: usize| part.all.at[k];
        let mut add = |lag: usize, a: usize, b: usize| {
            let ([p, _], [_, opposite]) = (part.opposites[a], part.opposites[b]);
            counts[lag] += 1.0;
            products[(lag, lag)] += 1.0;
            if let Some(other) = number([0, 1].map(|axis| at(p)[axis] - at(opposite)[axis])) {
                products[(lag, other - NONE)] -= 1.0;
            }
        };
        (0..part.opposites.len()).for_each(|a| add(0, a, a));
        Raster::new(&part.odd.at).for_pairs(|lag, a, b| add(lag - NONE, a, b));
    }
}

/// Of the pairs at a lag that a trace counts, so many are one.
const fn pairs(lag: usize) -> f64 {
    if lag == 0 { 1.0 } else { 0.5 }
}

fn columns_with_odd_part(part: &OddPart) -> Vec<usize> {
    let square = |column: &[f64]| column.iter().map(|v| v * v).sum::<f64>();
    let is_odd = |k: &usize| square(&part.odd.followed[*k]) > EVEN * square(&part.all.followed[*k]);
    (0..part.odd.followed.len()).filter(is_odd).collect()
}

/// `K`, column after column.
fn beside(OddPart { all: Residuals { beside, .. }, .. }: &OddPart, columns: &[usize]) -> DVector<f64> {
    let of = |k: usize| (columns[k % columns.len()], columns[k / columns.len()]);
    DVector::from_fn(columns.len().pow(2), |k, _| beside.as_ref().map_or(0.0, |beside| beside[of(k)]))
}

/// What a fit makes of noise; the rows are the lags, for every column of `U` after each other.
struct Fitted {
    /// `V' S_l V` and `U' S_l U`.
    own: DMatrix<f64>,
    all: DMatrix<f64>,
    /// `tr(V' S_l D S_l' U)`.
    once: DMatrix<f64>,
}

impl Fitted {
    fn of(part: &OddPart, columns: &[usize]) -> Self {
        let (raster, size) = (Raster::new(&part.all.at), UNKNOWN * columns.len());
        let (u, v) = (Field::of_all(&raster, part, columns), Field::of_odd(&raster, part, columns));
        let zeros = || DMatrix::zeros(size, columns.len());
        let mut fitted = Self { own: zeros(), all: zeros(), once: DMatrix::zeros(UNKNOWN, UNKNOWN) };
        let [mut around_u, mut around_v, mut odd] = [2, 1, 1].map(|times| vec![0.0; times * size * BLOCK]);
        let mut is_lone = vec![true; part.all.at.len()];
        let halves: Vec<[usize; 2]> = part.opposites.iter().copied().filter(|[k, other]| k < other).collect();
        for pairs in halves.chunks(BLOCK) {
            let first: Vec<usize> = pairs.iter().map(|pair| pair[0]).collect();
            pairs.as_flattened().iter().for_each(|k| is_lone[*k] = false);
            v.add_within(&first, 2.0, &mut around_v, &mut fitted.own);
            u.add_within(pairs.as_flattened(), 1.0, &mut around_u, &mut fitted.all);
            let used = size * pairs.len();
            odd_part(&around_u[..2 * used], &mut odd[..used], size);
            let v = DMatrixView::from_slice(&around_v[..used], UNKNOWN, used / UNKNOWN);
            // Transposed.
            let odd: DMatrixView<f64, Dyn, Dyn> =
                DMatrixView::from_slice_with_strides(&odd[..used], used / UNKNOWN, UNKNOWN, UNKNOWN, 1);
            fitted.once.gemm(2.0, &v, &odd, 1.0);
        }
        let lone: Vec<usize> = (0..is_lone.len()).filter(|k| is_lone[*k]).collect();
        lone.chunks(BLOCK).for_each(|pixels| u.add_within(pixels, 1.0, &mut around_u, &mut fitted.all));
        fitted
    }
}

/// The odd part of rows of so many values, every second one of a pixel opposite that before it.
fn odd_part(rows: &[f64], odd: &mut [f64], size: usize) {
    for (rows, odd) in rows.chunks_exact(2 * size).zip(odd.chunks_exact_mut(size)) {
        let (own, opposite) = rows.split_at(size);
        let both = own.iter().zip(opposite).zip(odd);
        both.for_each(|((own, opposite), odd)| *odd = std::f64::consts::FRAC_1_SQRT_2 * (own - opposite));
    }
}

/// Columns of a matrix on the raster of a window.
struct Field<'a> {
    raster: &'a Raster<'a>,
    planes: Vec<Vec<f64>>,
}

impl<'a> Field<'a> {
    fn of_all(raster: &'a Raster, part: &OddPart, columns: &[usize]) -> Self {
        let plane = |column: &usize| {
            let values = &part.all.followed[*column];
            raster.with_room(raster.room(), 0.0, |k| values[k])
        };
        Self { raster, planes: columns.iter().map(plane).collect() }
    }

    fn of_odd(raster: &'a Raster, part: &OddPart, columns: &[usize]) -> Self {
        let mut odd = vec![0.0; part.all.at.len()];
        let mut plane = |column: &usize| {
            let values = part.opposites.iter().zip(&part.odd.followed[*column]);
            values.for_each(|([k, _], value)| odd[*k] = *value);
            raster.with_room(raster.room(), 0.0, |k| odd[k])
        };
        Self { raster, planes: columns.iter().map(&mut plane).collect() }
    }

    /// Finds `S_l m` at some pixels, the lags for every column of `m` after each other, and adds its products with `m`, times `scale`.
    fn add_within(&self, pixels: &[usize], scale: f64, around: &mut [f64], products: &mut DMatrix<f64>) {
        let size = products.nrows();
        let found = &mut around[..size * pixels.len()];
        wide(
            #[inline(always)]
            || {
                for (pixel, found) in pixels.iter().zip(found.chunks_exact_mut(size)) {
                    for (plane, found) in self.planes.iter().zip(found.as_chunks_mut().0) {
                        *found = self.raster.around(plane, *pixel);
                    }
                }
            },
        );
        let own = DMatrix::from_fn(pixels.len(), self.planes.len(), |k, i| {
            self.planes[i][self.raster.room() + self.raster.cell(pixels[k])]
        });
        products.gemm(scale, &DMatrixView::from_slice(found, size, pixels.len()), &own, 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::correlated::raster::SIDE;

    /// A ring about (0.5, 0), from which pixels are missing that have opposites; three columns with an odd part and one without.
    fn window() -> OddPart {
        let is_in =
            |[x, y]: &[i32; 2]| (9..=25).contains(&(x * x - x + y * y)) && ![[4, 1], [0, -4]].contains(&[*x, *y]);
        let at: Vec<[i32; 2]> = (-6..7).flat_map(|y| (-6..8).map(move |x| [x, y])).filter(is_in).collect();
        let column = |f: fn(f64, f64) -> f64| at.iter().map(|[x, y]| f(f64::from(*x) - 0.5, f64::from(*y))).collect();
        let followed: Vec<Vec<f64>> = vec![
            column(|x, y| 0.03 * x + 0.01 * y * y),
            column(|_, _| 0.1),
            column(|x, y| 0.02 * y - 0.002 * x * x * y + 0.05),
            column(|x, y| 0.01 * (x + y) + 0.03 * (x * y).sin()),
        ];
        let beside = DMatrix::from_fn(4, 4, |i, j| if i == j { 0.2 } else { 0.01 * (i + j) as f64 });
        let values = vec![0.0; at.len()];
        OddPart::of(Residuals { at, values, followed, beside: Some(beside) }, [0.5, 0.0])
    }

    /// Sums over pairs, of the odd part of what is left of noise, pixel by pixel.
    fn as_defined(part: &OddPart) -> (Response, Lags) {
        let (n, odd) = (part.all.at.len(), part.opposites.len());
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let mut d = DMatrix::zeros(odd, n);
        part.opposites.iter().enumerate().for_each(|(k, [a, b])| (d[(k, *a)], d[(k, *b)]) = (half, -half));
        let u = DMatrix::from_fn(n, 4, |k, i| part.all.followed[i][k]);
        let left = &d * (DMatrix::identity(n, n) - &u * u.transpose());
        let followed = &d * &u * part.all.beside.as_ref().unwrap() * u.transpose() * d.transpose();
        let (mut products, mut counts) = (Response::zeros(), Lags::zeros());
        let between = |p: [i32; 2], q: [i32; 2]| number([q[0] - p[0], q[1] - p[1]]).map(|lag| lag - NONE);
        let noise: Vec<DMatrix<f64>> = (0..UNKNOWN)
            .map(|lag| DMatrix::from_fn(n, n, |p, q| f64::from(between(part.all.at[p], part.all.at[q]) == Some(lag))))
            .map(|noise| &left * noise * left.transpose())
            .collect();
        for (a, b) in (0..odd).flat_map(|a| (0..=a).map(move |b| (a, b))) {
            let Some(lag) = between(part.odd.at[a], part.odd.at[b]) else { continue };
            counts[lag] += 1.0;
            for (other, noise) in noise.iter().enumerate() {
                products[(lag, other)] += noise[(a, b)] + if other == 0 { 1.0 } else { 2.0 } * followed[(a, b)];
            }
        }
        (products, counts)
    }

    #[test]
    fn the_response_is_that_of_noise_pixel_by_pixel() {
        assert_eq!(UNKNOWN, 3 * SIDE + NONE + 1);
        let part = window();
        assert!(part.opposites.len() > 40 && part.opposites.len() + 2 == part.all.at.len());
        let (products, counts) = as_defined(&part);
        let (mut all, mut white) = (Sums::NOTHING, Sums::NOTHING);
        all.add(&part);
        white.add_white(&part).unwrap();
        assert_eq!((all.counts, white.counts), (counts, counts));
        assert!((all.products - products).amax() < 1e-10, "{}", all.products - products);
        assert!((white.products.column(0) - products.column(0)).amax() < 1e-10);
    }
}
