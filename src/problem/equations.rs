//! The observations of one image as whitened equations.
//!
//! An observation with the weight `W = F F'` gives two equations `F' [J_p, J_e, r]`; all sums of the normal equations are products of
//! them. A marker moves its image as a shift of the whole plate does, so its derivatives are those of the first three components of the pose.

use std::ops::Range;

use nalgebra::{DMatrix, Matrix2, Matrix3, Matrix3x2, Matrix6x2, SMatrix, SVector, Vector2, Vector3};

use crate::linalg::{gram, product};
use crate::model::camera::MAX_PARAMETERS;
use crate::model::circle::Prediction;
use crate::model::plate_modes::MODES;

// Rows of an equation: derivatives by the pose and by the modes of the plate, residual, derivatives by the parameters of the formula
// that the camera has.
const POSE: usize = 0;
const P: usize = 6;
const MODE: usize = POSE + P;
const RESIDUAL: usize = MODE + MODES;
const FORMULA: usize = RESIDUAL + 1;

/// Control points of the displacement field that observations touch, of each ascending, by their places among those that the image touches, with the
/// derivative by their u and v: of one observation after the other.
#[derive(Debug, Clone, Default)]
struct Field {
    points: Vec<(usize, Matrix2<f64>)>,
    /// Where those of each observation end; empty for a lens without a field.
    ends: Vec<usize>,
}

impl Field {
    /// Those of an observation.
    fn of(&self, observation: usize) -> &[(usize, Matrix2<f64>)] {
        let Some(&end) = self.ends.get(observation) else { return &[] };
        let start = observation.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.points[start..end]
    }

    /// From control points by their places in the whole field to those among the touched ones, which are returned, ascending.
    fn number(&mut self) -> Vec<usize> {
        let mut place = vec![None; self.points.iter().map(|(k, _)| k + 1).max().unwrap_or_default()];
        self.points.iter().for_each(|(k, _)| place[*k] = Some(0));
        let touched: Vec<usize> = (0..place.len()).filter(|&k| place[k].is_some()).collect();
        touched.iter().enumerate().for_each(|(at, &k)| place[k] = Some(at));
        self.points.iter_mut().for_each(|(k, _)| *k = place[*k].unwrap_or_default());
        touched
    }
}

/// Intrinsic unknowns of one image before its displacement field: camera parameters (padded), then plate modes.
///
/// The field follows: u and v of every control point that the image touches.
pub const E: usize = MAX_PARAMETERS + MODES;

/// Whitened equations of one image, two an observation.
#[derive(Debug, Clone)]
pub struct Equations {
    /// One column an equation.
    columns: DMatrix<f64>,
    /// Marker of every observation.
    pub markers: Vec<usize>,
    field: Field,
    /// Control points of the field that any of them touches, ascending.
    pub touched: Vec<usize>,
}

/// One observation in the equations of its image.
#[derive(Debug, Clone, Copy)]
pub struct Sight<'a> {
    equations: [&'a [f64]; 2],
    field: &'a [(usize, Matrix2<f64>)],
}

/// Collects the equations of one image.
pub(super) struct Collector {
    /// Equations one after the other, two an observation, of [`Collector::rows`] each.
    columns: Vec<f64>,
    rows: usize,
    markers: Vec<usize>,
    /// By places in the whole field.
    field: Field,
}

impl Collector {
    /// For at most so many observations, with a lens formula of `formula` parameters.
    pub fn new(most: usize, formula: usize) -> Self {
        let rows = FORMULA + formula;
        let columns = Vec::with_capacity(2 * most * rows);
        Self { columns, rows, markers: Vec::with_capacity(most), field: Field::default() }
    }

    /// Adds an observation with its derivative by the modes of the plate, its residual and the square root `F'` of its weight.
    #[inline(always)]
    pub fn add(
        &mut self,
        marker: usize,
        p: &Prediction,
        by_modes: &SMatrix<f64, MODES, 2>,
        r: &Vector2<f64>,
        root: &Matrix2<f64>,
    ) {
        for (by_u, by_v) in [(root[(0, 0)], root[(0, 1)]), (0.0, root[(1, 1)])] {
            let end = self.columns.len() + self.rows;
            self.columns.extend(whitened(by_u, by_v, &p.d_pose));
            self.columns.extend(whitened(by_u, by_v, by_modes));
            self.columns.extend(whitened(by_u, by_v, &r.transpose()));
            self.columns.extend(whitened(by_u, by_v, &p.d_camera).take(end - self.columns.len()));
        }
        self.markers.push(marker);
        if !p.d_field.is_empty() {
            self.field.points.extend(p.d_field.iter().map(|(k, d)| (*k, root * d)));
            self.field.ends.push(self.field.points.len());
        }
    }

    pub fn finish(self) -> Equations {
        let Self { columns, rows, markers, mut field } = self;
        let touched = field.number();
        let columns = DMatrix::from_vec(rows, 2 * markers.len(), columns);
        Equations { columns, markers, field, touched }
    }
}

/// Rows of one whitened equation, of rows that are each a derivative of column and row of the image.
#[inline(always)]
fn whitened<const N: usize>(by_u: f64, by_v: f64, rows: &SMatrix<f64, N, 2>) -> impl Iterator<Item = f64> {
    let (u, v) = rows.as_slice().split_at(N);
    u.iter().zip(v).map(move |(u, v)| by_u * u + by_v * v)
}

/// Row of the equations that belongs to an intrinsic unknown before the field.
const fn intrinsic_row(e: usize) -> usize {
    if e < MAX_PARAMETERS { FORMULA + e } else { MODE + e - MAX_PARAMETERS }
}

impl Equations {
    /// Every observation, in their order.
    pub fn sights(&self) -> impl Iterator<Item = Sight<'_>> {
        (0..self.markers.len()).map(|k| self.sight(k))
    }

    /// One of the observations.
    #[inline(always)]
    pub fn sight(&self, observation: usize) -> Sight<'_> {
        let rows = self.columns.nrows();
        let (first, second) = self.columns.as_slice()[2 * rows * observation..][..2 * rows].split_at(rows);
        Sight { equations: [first, second], field: self.field.of(observation) }
    }

    /// Rows of the pose.
    pub fn pose_rows(&self) -> Range<usize> {
        POSE..POSE + P
    }

    /// Row of an intrinsic unknown before the field; `None` for padding.
    pub fn intrinsic_row(&self, e: usize) -> Option<usize> {
        Some(intrinsic_row(e)).filter(|row| *row < self.columns.nrows())
    }

    /// Sums of products of every row with other columns that have a value an equation (equations x columns).
    pub fn with_columns(&self, columns: &DMatrix<f64>) -> RowSums {
        RowSums(product(&self.columns, columns))
    }

    /// What steps of the pose (6 x steps) and of the intrinsics before the field (E x steps) change, equations x steps.
    pub fn along(&self, pose: &DMatrix<f64>, intrinsics: &DMatrix<f64>) -> DMatrix<f64> {
        let mut steps = DMatrix::zeros(self.columns.nrows(), pose.ncols());
        steps.rows_range_mut(self.pose_rows()).copy_from(pose);
        for (e, row) in (0..E).filter_map(|e| Some((e, self.intrinsic_row(e)?))) {
            steps.row_mut(row).copy_from(&intrinsics.row(e));
        }
        product(&self.columns.transpose(), &steps)
    }

    /// Sums of products of all rows.
    pub(super) fn products(&self) -> Products {
        Products(gram(&self.columns))
    }

    /// Blocks of every marker that was seen, by itself; observations of one marker stand together.
    pub(super) fn marker_terms(&self) -> Vec<MarkerTerms> {
        let mut all: Vec<MarkerTerms> = Vec::with_capacity(self.markers.chunk_by(|a, b| a == b).count());
        for (&marker, sight) in self.markers.iter().zip(self.sights()) {
            match all.last_mut().filter(|last| last.marker == marker) {
                Some(last) => last.add(&sight),
                None => {
                    let mut own = MarkerTerms { marker, upper: [0.0; 6], bm: Vector3::zeros() };
                    own.add(&sight);
                    all.push(own);
                }
            }
        }
        all
    }
}

/// Sums of products of the rows of an image with other columns.
pub struct RowSums(DMatrix<f64>);

impl RowSums {
    /// Of the pose, with one of the columns.
    pub fn pose(&self, column: usize) -> SVector<f64, P> {
        self.0.fixed_view::<P, 1>(POSE, column).into_owned()
    }

    /// Of an intrinsic unknown before the field, with one of the columns; zero for padding.
    pub fn intrinsic(&self, e: usize, column: usize) -> f64 {
        self.0.get((intrinsic_row(e), column)).copied().unwrap_or(0.0)
    }
}

/// `sum w w'` over the equations `w` of an image.
pub(super) struct Products(DMatrix<f64>);

impl Products {
    pub fn pose(&self) -> SMatrix<f64, P, P> {
        self.0.fixed_view::<P, P>(POSE, POSE).into_owned()
    }

    pub fn pose_with_residual(&self) -> SVector<f64, P> {
        self.0.fixed_view::<P, 1>(POSE, RESIDUAL).into_owned()
    }

    pub fn pose_with_intrinsics(&self) -> SMatrix<f64, P, E> {
        SMatrix::from_fn(|p, e| self.of(POSE + p, intrinsic_row(e)))
    }

    pub fn intrinsics(&self) -> SMatrix<f64, E, E> {
        SMatrix::from_fn(|e, f| self.of(intrinsic_row(e), intrinsic_row(f)))
    }

    pub fn intrinsics_with_residual(&self) -> SVector<f64, E> {
        SVector::from_fn(|e, _| self.of(intrinsic_row(e), RESIDUAL))
    }

    /// Zero for what is padding.
    fn of(&self, row: usize, column: usize) -> f64 {
        self.0.get((row, column)).copied().unwrap_or(0.0)
    }
}

impl<'a> Sight<'a> {
    fn rows<const N: usize>(&self, first: usize) -> SMatrix<f64, N, 2> {
        let [a, b] = self.equations;
        let of = |equation: &[f64]| SVector::from_column_slice(&equation[first..first + N]);
        SMatrix::from_columns(&[of(a), of(b)])
    }

    /// Derivatives by the position of the marker, one column an equation.
    pub fn by_marker(&self) -> Matrix3x2<f64> {
        self.rows(POSE)
    }

    /// Derivatives by the pose, one column an equation.
    pub fn by_pose(&self) -> Matrix6x2<f64> {
        self.rows(POSE)
    }

    /// Derivatives by the intrinsics before the field, one column an equation.
    pub fn by_intrinsics(&self) -> SMatrix<f64, E, 2> {
        SMatrix::from_fn(|e, k| self.equations[k].get(intrinsic_row(e)).copied().unwrap_or(0.0))
    }

    /// Derivatives by the field: control points by their places among those that the image touches, each with one row an equation.
    pub fn by_field(&self) -> &'a [(usize, Matrix2<f64>)] {
        self.field
    }

    /// Rows of both equations; see [`Equations::intrinsic_row`].
    pub fn row_range(&self, rows: Range<usize>) -> [&'a [f64]; 2] {
        let [a, b] = self.equations;
        [&a[rows.clone()], &b[rows]]
    }

    /// Residuals.
    pub fn residual(&self) -> Vector2<f64> {
        let [a, b] = self.equations;
        Vector2::new(a[RESIDUAL], b[RESIDUAL])
    }
}

/// Normal-equation blocks of one marker in one image, by itself.
#[derive(Debug, Clone)]
pub struct MarkerTerms {
    /// Index of the marker on its plate.
    pub marker: usize,
    /// Upper triangle of the information, column by column: there is one for every observation.
    upper: [f64; 6],
    /// Right-hand side.
    pub bm: Vector3<f64>,
}

impl MarkerTerms {
    /// 3x3 information.
    pub fn information(&self) -> Matrix3<f64> {
        let [xx, xy, yy, xz, yz, zz] = self.upper;
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    }

    fn add(&mut self, sight: &Sight) {
        let upper = [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)];
        let ([a, b], r) = (sight.row_range(POSE..POSE + 3), sight.residual());
        self.upper.iter_mut().zip(upper).for_each(|(own, (i, k))| *own += a[i] * a[k] + b[i] * b[k]);
        self.bm.iter_mut().enumerate().for_each(|(k, own)| *own += a[k] * r[0] + b[k] * r[1]);
    }
}
