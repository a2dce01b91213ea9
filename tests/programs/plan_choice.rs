//! The choice of poses against an independent formulation: the conic programmes of optimal design, solved by Clarabel.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, ExponentialConeT, IPSolver, NonnegativeConeT, SecondOrderConeT, SolverStatus,
    SupportedConeT, ZeroConeT,
};
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robotcal::linalg::{LinearRow, SymmetricFactor};
use robotcal::plan::criterion::Criterion;
use robotcal::plan::information::Identified;
use robotcal::plan::relax::{Design, NoDesign};
use robotcal::plan::rounding::round;

/// Factors `F_i` (p x k) of the information of candidates, `M_i = F_i F_i'`; the first belongs to what is known.
fn factors(seed: u64, candidates: usize, p: usize, k: usize) -> Vec<DMatrix<f64>> {
    println!("seed {seed}");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..=candidates).map(|_| DMatrix::from_fn(p, k, |_, _| rng.random_range(-1.0..1.0))).collect()
}

fn informations(factors: &[DMatrix<f64>], known: f64) -> (DMatrix<f64>, Vec<DMatrix<f64>>) {
    let squares: Vec<DMatrix<f64>> = factors.iter().map(|f| f * f.transpose()).collect();
    (&squares[0] * known, squares[1..].to_vec())
}

/// A conic programme in Clarabel's form, built row by row: `b - A x` in the cone.
#[derive(Default)]
struct Conic {
    row: Vec<usize>,
    column: Vec<usize>,
    value: Vec<f64>,
    b: Vec<f64>,
    cones: Vec<SupportedConeT<f64>>,
}

impl Conic {
    /// One row whose slack is `constant + sum coefficients x`.
    fn slack(&mut self, constant: f64, coefficients: &[(usize, f64)]) {
        for &(c, v) in coefficients {
            self.row.push(self.b.len());
            self.column.push(c);
            self.value.push(-v);
        }
        self.b.push(constant);
    }

    fn minimise(self, objective: &[f64]) -> Vec<f64> {
        let n = objective.len();
        let a = CscMatrix::new_from_triplets(self.b.len(), n, self.row, self.column, self.value);
        let p = CscMatrix::<f64>::zeros((n, n));
        let settings = DefaultSettings { verbose: false, ..DefaultSettings::default() };
        let mut solver = DefaultSolver::new(&p, objective, &a, &self.b, &self.cones, settings).unwrap();
        solver.solve();
        assert_eq!(solver.solution.status, SolverStatus::Solved);
        solver.solution.x
    }

    /// `0 <= w <= 1`, `sum w = count`, one row, for the first `n` unknowns.
    fn polytope(&mut self, n: usize, count: usize, extra: Option<&LinearRow>) {
        let all: Vec<(usize, f64)> = (0..n).map(|k| (k, -1.0)).collect();
        self.slack(count as f64, &all);
        self.cones.push(ZeroConeT(1));
        let before = self.b.len();
        for k in 0..n {
            self.slack(0.0, &[(k, 1.0)]);
            self.slack(1.0, &[(k, -1.0)]);
        }
        if let Some(r) = extra {
            let row: Vec<(usize, f64)> = r.coefficients.iter().enumerate().map(|(k, c)| (k, -c)).collect();
            self.slack(r.high, &row);
        }
        self.cones.push(NonnegativeConeT(self.b.len() - before));
    }

    /// `|z|^2 <= t w` with `w` unknown (or the constant one).
    fn rotated(&mut self, z: &[usize], t: usize, w: Option<usize>) {
        let (constant, extra) = w.map_or((1.0, vec![]), |w| (0.0, vec![(w, 1.0)]));
        let with = |sign: f64| [vec![(t, sign)], extra.clone()].concat();
        self.slack(constant, &with(1.0));
        self.slack(constant, &with(-1.0));
        z.iter().for_each(|&k| self.slack(0.0, &[(k, 2.0)]));
        self.cones.push(SecondOrderConeT(z.len() + 2));
    }
}

/// `min tr(B' M(w)^-1 B)` as a second-order cone programme: `min sum t_i`, `sum F_i Z_i = B`, `|Z_i|^2 <= t_i w_i`.
fn oracle_variance(
    factors: &[DMatrix<f64>],
    known: f64,
    b: &DMatrix<f64>,
    count: usize,
    extra: Option<&LinearRow>,
) -> f64 {
    let (n, p, k, r) = (factors.len() - 1, b.nrows(), factors[0].ncols(), b.ncols());
    // Unknowns: w (n), t (n + 1), Z (n + 1 blocks of k x r).
    let z = |i: usize, row: usize, column: usize| n + (n + 1) + i * k * r + row * r + column;
    let mut conic = Conic::default();
    conic.polytope(n, count, extra);
    let before = conic.b.len();
    for row in 0..p {
        for column in 0..r {
            let mut terms = Vec::new();
            for (i, f) in factors.iter().enumerate() {
                let scale = if i == 0 { known.sqrt() } else { 1.0 };
                terms.extend((0..k).map(|m| (z(i, m, column), -scale * f[(row, m)])));
            }
            conic.slack(b[(row, column)], &terms);
        }
    }
    conic.cones.push(ZeroConeT(conic.b.len() - before));
    for i in 0..=n {
        let all: Vec<usize> = (0..k * r).map(|m| z(i, m / r, m % r)).collect();
        conic.rotated(&all, n + i, i.checked_sub(1));
    }
    let unknowns = n + (n + 1) * (1 + k * r);
    let objective: Vec<f64> = (0..unknowns).map(|u| f64::from(u8::from((n..2 * n + 1).contains(&u)))).collect();
    let x = conic.minimise(&objective);
    x[n..2 * n + 1].iter().sum()
}

/// `max log det M(w)` by second-order and exponential cones (Sagnol and Harman): `sum F_i Z_i = J` lower triangular,
/// `|Z_i e_j|^2 <= t_ij w_i`, `sum_i t_ij <= J_jj`, maximise `sum log J_jj = log det M / 1`.
fn oracle_determinant(factors: &[DMatrix<f64>], known: f64, count: usize) -> f64 {
    let (n, p, k) = (factors.len() - 1, factors[0].nrows(), factors[0].ncols());
    let t = |i: usize, j: usize| n + i * p + j;
    let z = |i: usize, m: usize, j: usize| n + (n + 1) * p + (i * k + m) * p + j;
    let diagonal = |j: usize| n + (n + 1) * p * (1 + k) + j;
    let logarithm = |j: usize| diagonal(j) + p;
    let mut conic = Conic::default();
    conic.polytope(n, count, None);
    let before = conic.b.len();
    for row in 0..p {
        for j in row..p {
            // Above the diagonal J is zero; on it J_jj; below it is free.
            let mut terms: Vec<(usize, f64)> = Vec::new();
            for (i, f) in factors.iter().enumerate() {
                let scale = if i == 0 { known.sqrt() } else { 1.0 };
                terms.extend((0..k).map(|m| (z(i, m, j), scale * f[(row, m)])));
            }
            if j == row {
                terms.push((diagonal(j), -1.0));
            }
            conic.slack(0.0, &terms);
        }
    }
    conic.cones.push(ZeroConeT(conic.b.len() - before));
    let before = conic.b.len();
    for j in 0..p {
        let mut terms: Vec<(usize, f64)> = (0..=n).map(|i| (t(i, j), -1.0)).collect();
        terms.push((diagonal(j), 1.0));
        conic.slack(0.0, &terms);
    }
    conic.cones.push(NonnegativeConeT(conic.b.len() - before));
    for i in 0..=n {
        for j in 0..p {
            let column: Vec<usize> = (0..k).map(|m| z(i, m, j)).collect();
            conic.rotated(&column, t(i, j), i.checked_sub(1));
        }
    }
    for j in 0..p {
        // exp(logarithm) <= J_jj.
        conic.slack(0.0, &[(logarithm(j), 1.0)]);
        conic.slack(1.0, &[]);
        conic.slack(0.0, &[(diagonal(j), 1.0)]);
        conic.cones.push(ExponentialConeT());
    }
    let mut objective = vec![0.0; logarithm(p - 1) + 1];
    (0..p).for_each(|j| objective[logarithm(j)] = -1.0);
    let x = conic.minimise(&objective);
    (0..p).map(|j| x[logarithm(j)]).sum()
}

#[test]
fn the_relaxation_finds_what_the_conic_programme_finds() {
    for seed in 1..=6 {
        let f = factors(seed, 14, 5, 2);
        let known = 0.3;
        let (known_information, candidates) = informations(&f, known);
        let m0 = &known_information + DMatrix::identity(5, 5) * 0.0;
        let mut rng = ChaCha8Rng::seed_from_u64(100 + seed);
        let b = DMatrix::from_fn(5, 3, |_, _| rng.random_range(-1.0..1.0));
        let weights: Vec<f64> = (0..14).map(|_| rng.random_range(0.0..1.0)).collect();
        let limit = LinearRow { coefficients: weights, low: f64::NEG_INFINITY, high: 2.5 };
        for rows in [vec![], vec![limit]] {
            let criterion = Criterion::MeanVariance(b.clone());
            let design = Design { known: &m0, candidates: &candidates, criterion: &criterion, count: 6, rows: &rows };
            let relaxed = design.relax().unwrap();
            let oracle = oracle_variance(&f, known, &b, 6, rows.first());
            println!("I {:.8} {oracle:.8} certified {:.8}", relaxed.value, relaxed.efficiency);
            assert!((relaxed.value / oracle - 1.0).abs() < 1e-4);
            assert!(relaxed.bound <= oracle * (1.0 + 1e-5), "the bound is none: {} {oracle}", relaxed.bound);
            assert!(relaxed.efficiency > 0.9999);
        }
        let criterion = Criterion::Volume(5);
        let design = Design { known: &m0, candidates: &candidates, criterion: &criterion, count: 6, rows: &[] };
        let relaxed = design.relax().unwrap();
        // log det J with J = sum F_i Z_i at the optimum is log det M.
        let oracle = oracle_determinant(&f, known, 6) / 5.0;
        println!("D {:.8} {oracle:.8}", -relaxed.value);
        assert!((-relaxed.value - oracle).abs() < 1e-4);
    }
}

#[test]
fn the_certificate_never_promises_more_than_the_best_of_all_choices() {
    for seed in 11..=14 {
        let f = factors(seed, 12, 4, 1);
        let (m0, candidates) = informations(&f, 1.0);
        let m0 = m0 + DMatrix::identity(4, 4) * 0.01;
        for criterion in [Criterion::MeanVariance(DMatrix::identity(4, 4)), Criterion::Volume(2)] {
            let design = Design { known: &m0, candidates: &candidates, criterion: &criterion, count: 5, rows: &[] };
            let relaxed = design.relax().unwrap();
            let rounded = round(&design, &relaxed).unwrap();
            assert_eq!(rounded.chosen.len(), 5);
            let best = (0_u32..1 << 12)
                .filter(|set| set.count_ones() == 5)
                .map(|set| {
                    let w: Vec<f64> = (0..12).map(|k| f64::from(set >> k & 1)).collect();
                    criterion.value(&design.information(&w)).unwrap()
                })
                .fold(f64::INFINITY, f64::min);
            println!("relaxed {} best {best} rounded {}", relaxed.value, rounded.value);
            assert!(relaxed.bound <= best + 1e-9, "{} {best}", relaxed.bound);
            assert!(rounded.value >= best - 1e-9);
            let share = criterion.share(best, rounded.value);
            assert!(share > 0.97, "rounding lost {share}");
            assert!(rounded.efficiency <= share + 1e-9, "{} {share}", rounded.efficiency);
        }
    }
}

#[test]
fn derivatives_of_the_criteria_are_those_of_differences() {
    let f = factors(21, 6, 5, 2);
    let (m0, candidates) = informations(&f, 1.0);
    let m = candidates.iter().fold(m0 + DMatrix::identity(5, 5) * 0.1, |m, c| m + c * 0.4);
    for criterion in [Criterion::MeanVariance(DMatrix::identity(5, 2)), Criterion::Volume(3), Criterion::Volume(5)] {
        let at = criterion.evaluate(&m).unwrap();
        let all: Vec<&DMatrix<f64>> = candidates.iter().collect();
        let hessian = at.hessian(&all, &criterion);
        let h = 1e-5;
        let gradient = |m: &DMatrix<f64>, k: usize| criterion.evaluate(m).unwrap().gradient(&candidates[k]);
        for i in 0..6 {
            let [up, down] = [1.0, -1.0].map(|s: f64| &m + &candidates[i] * (s * h));
            let slope = (criterion.value(&up).unwrap() - criterion.value(&down).unwrap()) / (2.0 * h);
            assert!((slope - at.gradient(&candidates[i])).abs() < 1e-7 * slope.abs().max(1.0), "{criterion:?}");
            for j in 0..6 {
                let second = (gradient(&up, j) - gradient(&down, j)) / (2.0 * h);
                assert!((second - hessian[(i, j)]).abs() < 1e-6 * hessian.amax(), "{criterion:?} {i} {j}");
            }
        }
    }
}

#[test]
fn what_no_image_tells_is_left_out_without_changing_the_criterion() {
    const COLUMNS: usize = 12;
    const SEEN: usize = 7;
    let mut rng = ChaCha8Rng::seed_from_u64(41);
    // Images see seven sums of twelve columns in units of their own.
    let sigma: Vec<f64> = (0..COLUMNS).map(|k| 10f64.powi(k as i32 % 5 - 3)).collect();
    let sums = DMatrix::from_fn(COLUMNS, SEEN, |i, _| 30.0 * rng.random_range(-1.0..1.0) / sigma[i]);
    let candidates: Vec<DMatrix<f64>> =
        factors(41, 19, SEEN, 3).iter().map(|f| &sums * f).map(|f| &f * f.transpose()).collect();
    let prior: Vec<f64> = sigma.iter().map(|s| s * s).collect();
    let known = DMatrix::from_fn(COLUMNS, COLUMNS, |i, j| if i == j { 1.0 / prior[i] } else { 0.0 });
    let whole = candidates.iter().fold(DMatrix::zeros(COLUMNS, COLUMNS), |sum, m| sum + m);
    let told = Identified::of(&whole, &prior);
    assert_eq!(told.rows(), SEEN + 1);
    let b = DMatrix::from_fn(COLUMNS, 4, |i, _| rng.random_range(-1.0..1.0) / sigma[i]);
    let criterion = Criterion::MeanVariance(b);
    let reduced = told.criterion(&criterion);
    let sum = |start: DMatrix<f64>, of: &dyn Fn(&DMatrix<f64>) -> DMatrix<f64>| {
        candidates.iter().step_by(3).fold(start, |sum, m| sum + of(m))
    };
    let (full, small) = (sum(known.clone(), &|m| m.clone()), sum(told.known(&known), &|m| told.information(m)));
    let (at, within) = (criterion.evaluate(&full).unwrap(), reduced.evaluate(&small).unwrap());
    assert!((at.value / within.value - 1.0).abs() < 1e-9, "{} {}", at.value, within.value);
    for m in &candidates {
        let (a, b) = (at.gradient(m), within.gradient(&told.information(m)));
        // The full form cancels: large variances of what is not seen against large information beside it.
        assert!((a - b).abs() < 1e-6 * a.abs(), "{a} {b}");
    }
    let covariance = told.covariance(&SymmetricFactor::new(&small).unwrap().inverse());
    let off =
        DMatrix::from_fn(COLUMNS, COLUMNS, |i, j| (covariance[(i, j)] - at.covariance[(i, j)]) / (sigma[i] * sigma[j]));
    assert!(off.amax() < 1e-9, "{}", off.amax());
    assert_eq!(Identified::everything(COLUMNS).information(&candidates[0]), candidates[0]);
}

#[test]
fn limits_hold_after_rounding_and_contradictions_are_told() {
    let f = factors(31, 40, 4, 2);
    let (m0, candidates) = informations(&f, 1.0);
    let m0 = m0 + DMatrix::identity(4, 4) * 0.01;
    let criterion = Criterion::MeanVariance(DMatrix::identity(4, 4));
    let group = |low: f64, high: f64, odd: usize| LinearRow {
        coefficients: (0..40).map(|k| f64::from(u8::from(k % 4 == odd))).collect(),
        low,
        high,
    };
    let rows = [group(3.0, 4.0, 0), group(0.0, 2.0, 1)];
    let design = Design { known: &m0, candidates: &candidates, criterion: &criterion, count: 10, rows: &rows };
    let rounded = round(&design, &design.relax().unwrap()).unwrap();
    let count = |odd: usize| rounded.chosen.iter().filter(|k| *k % 4 == odd).count();
    assert!((3..=4).contains(&count(0)) && count(1) <= 2, "{:?}", rounded.chosen);
    assert!(rounded.efficiency > 0.9);
    let rows = [group(7.0, 9.0, 0), group(7.0, 9.0, 1)];
    let impossible = Design { rows: &rows, ..design.clone() };
    assert_eq!(impossible.relax(), Err(NoDesign::Contradiction));
    assert_eq!(Design { count: 41, rows: &[], ..design }.relax(), Err(NoDesign::TooFew));
}
