//! Rendered boards with known corners, independent of the library's own renderer.

#![allow(dead_code)]

use calib_targets_aruco::Dictionary;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use robotcal::detect::{Detection, Picture};

/// What was measured less the true pixels of the markers, px.
pub fn errors(detection: &Detection, truth: impl Fn(u32) -> [f64; 2]) -> Vec<[f64; 2]> {
    let error = |o: &robotcal::series::Observation| {
        let truth = truth(o.marker);
        [o.uv[0] - truth[0], o.uv[1] - truth[1]]
    };
    detection.observations.iter().map(error).collect()
}

/// Root of the mean square per axis.
pub fn rms(errors: &[[f64; 2]]) -> f64 {
    (errors.iter().map(|e| e[0] * e[0] + e[1] * e[1]).sum::<f64>() / (2 * errors.len()) as f64).sqrt()
}

/// The picture with left and right exchanged.
pub fn mirror(picture: &Picture) -> Picture {
    let mut pixels = picture.pixels.clone();
    pixels.chunks_exact_mut(picture.width).for_each(<[f32]>::reverse);
    Picture { pixels, ..*picture }
}

/// A projective map from the board (unit: one square, origin at the first inner corner, x right, y down) to pixels.
#[derive(Debug, Clone, Copy)]
pub struct View(pub [[f64; 3]; 3]);

impl View {
    /// A view centred on the board of `columns` x `rows` corners: turned by `angle`, with `square` px per square and some perspective.
    pub fn new(columns: u32, rows: u32, centre: [f64; 2], square: f64, angle: f64, tilt: [f64; 2]) -> Self {
        let (s, c) = angle.sin_cos();
        let middle = [(f64::from(columns) - 1.0) / 2.0, (f64::from(rows) - 1.0) / 2.0];
        // Perspective about the middle of the board.
        let turn = [[square * c, -square * s, 0.0], [square * s, square * c, 0.0], [tilt[0], tilt[1], 1.0]];
        let to_middle = [[1.0, 0.0, -middle[0]], [0.0, 1.0, -middle[1]], [0.0, 0.0, 1.0]];
        let shift = [[1.0, 0.0, centre[0]], [0.0, 1.0, centre[1]], [0.0, 0.0, 1.0]];
        Self(product(shift, product(turn, to_middle)))
    }

    pub fn pixel(&self, p: [f64; 2]) -> [f64; 2] {
        project(&self.0, p)
    }

    fn inverse(&self) -> [[f64; 3]; 3] {
        let m = &self.0;
        let minor = |r: usize, c: usize| {
            let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
            m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
        };
        std::array::from_fn(|i| std::array::from_fn(|j| minor(j, i)))
    }
}

fn product(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn project(m: &[[f64; 3]; 3], p: [f64; 2]) -> [f64; 2] {
    let row = |i: usize| m[i][0] * p[0] + m[i][1] * p[1] + m[i][2];
    [row(0) / row(2), row(1) / row(2)]
}

/// Fine pixels per pixel and axis.
const FINE: usize = 3;
/// Samples of a fine pixel that an edge cuts, on a lattice of Fibonacci.
const SAMPLES: f64 = 233.0;
const SAMPLES_STEP: f64 = 144.0;

/// What is printed beside the squares of a chessboard, or instead of them.
#[derive(Debug, Clone)]
pub enum Print {
    Chessboard,
    /// Markers of a dictionary in the light squares.
    Charuco {
        dictionary: Dictionary,
        ratio: f64,
        /// The first square is light.
        legacy: bool,
    },
    /// Dark dots: x, y (down) and radius.
    Dots(Vec<[f64; 3]>),
}

/// How a board is recorded.
#[derive(Debug, Clone)]
pub struct Scene {
    pub print: Print,
    pub columns: u32,
    pub rows: u32,
    pub size: (usize, usize),
    pub view: View,
    /// Focal length of an equidistant fisheye that bends the view around the middle of the picture, px.
    pub fisheye_px: Option<f64>,
    pub dark: f64,
    pub light: f64,
    /// Gaussian blur, px, beside the area of the pixel.
    pub blur: f64,
    /// Standard deviation of the noise, counts.
    pub noise: f64,
    /// Relative change of the light per px, along x and y.
    pub slope: [f64; 2],
    pub full_scale: f64,
}

impl Scene {
    pub fn new(columns: u32, rows: u32, view: View) -> Self {
        Self {
            print: Print::Chessboard,
            columns,
            rows,
            size: (640, 480),
            view,
            fisheye_px: None,
            dark: 30.0,
            light: 190.0,
            blur: 0.9,
            noise: 0.0,
            slope: [0.0; 2],
            full_scale: 255.0,
        }
    }

    /// Shade of the printed plane: 0 dark, 1 light; a quiet margin around the board.
    fn shade(&self, [x, y]: [f64; 2]) -> f64 {
        if let Print::Dots(dots) = &self.print {
            let inside = |d: &[f64; 3]| (x - d[0]).powi(2) + (y - d[1]).powi(2) < d[2] * d[2];
            return if dots.iter().any(inside) { 0.0 } else { 1.0 };
        }
        let inside = x >= -1.0 && y >= -1.0 && x < f64::from(self.columns) && y < f64::from(self.rows);
        if !inside {
            return 1.0;
        }
        let (c, r) = ((x + 1.0) as u32, (y + 1.0) as u32);
        let light_first = matches!(self.print, Print::Charuco { legacy: true, .. });
        if (c + r).is_multiple_of(2) != light_first {
            0.0
        } else {
            self.light_square([x + 1.0 - f64::from(c), y + 1.0 - f64::from(r)], c, r)
        }
    }

    /// Shade inside a light square; `at` runs from 0 to 1 along both sides.
    fn light_square(&self, at: [f64; 2], c: u32, r: u32) -> f64 {
        let Print::Charuco { dictionary, ratio, .. } = &self.print else { return 1.0 };
        let side = dictionary.marker_size() + 2;
        let bit = at.map(|t| ((t - 0.5) / ratio + 0.5) * side as f64);
        if bit.iter().any(|b| *b < 0.0 || *b >= side as f64) {
            return 1.0;
        }
        let [x, y] = bit.map(|b| b as usize);
        if x == 0 || y == 0 || x == side - 1 || y == side - 1 {
            return 0.0;
        }
        // Light squares before this one, row by row.
        let before = (r * (self.columns + 1) + c) as usize;
        let code = dictionary.codes()[before / 2];
        let index = (y - 1) * (side - 2) + x - 1;
        1.0 - f64::from(((code >> index) & 1) as u8)
    }

    /// True position of a corner.
    pub fn corner(&self, marker: u32) -> [f64; 2] {
        let straight = self.view.pixel([f64::from(marker % self.columns), f64::from(marker / self.columns)]);
        self.about_middle(straight, f64::atan)
    }

    /// Behind a fisheye, moves a pixel along its radius: tan(angle) to angle, or back.
    fn about_middle(&self, pixel: [f64; 2], radius: impl Fn(f64) -> f64) -> [f64; 2] {
        let Some(focal) = self.fisheye_px else { return pixel };
        let middle = [self.size.0, self.size.1].map(|n| (n as f64 - 1.0) / 2.0);
        let off = [0, 1].map(|k| (pixel[k] - middle[k]) / focal);
        let from = off[0].hypot(off[1]).max(1e-12);
        [0, 1].map(|k| middle[k] + focal * off[k] * radius(from) / from)
    }

    /// Renders on a grid three times as fine, blurs there and sums up the pixels: a corner is right to 0.0003 px.
    pub fn render(&self, seed: u64) -> Picture {
        let (width, height) = self.size;
        let inverse = self.view.inverse();
        let margin = (4.0 * self.blur).ceil() as usize;
        let (w, h) = (FINE * (width + 2 * margin), FINE * (height + 2 * margin));
        let step = 1.0 / FINE as f64;
        let edge = |n: usize| n as f64 * step - margin as f64 - 0.5;
        let shade = |x: f64, y: f64| self.shade(project(&inverse, self.about_middle([x, y], f64::tan)));
        let samples: Vec<[f64; 2]> = (0..SAMPLES as u32)
            .map(f64::from)
            .map(|s| [(s + 0.5) / SAMPLES * step, (s * SAMPLES_STEP + 0.5) / SAMPLES % 1.0 * step])
            .collect();
        let corners: Vec<f64> =
            (0..=h).flat_map(|y| (0..=w).map(move |x| (x, y))).map(|(x, y)| shade(edge(x), edge(y))).collect();
        let sharp: Vec<f32> = (0..w * h)
            .map(|k| {
                let (x, y) = (k % w, k / w);
                let rim: f64 = [y, y + 1].map(|y| y * (w + 1) + x).map(|at| corners[at] + corners[at + 1]).iter().sum();
                if rim == 0.0 || rim == 4.0 {
                    return rim as f32 / 4.0;
                }
                let shades = samples.iter().map(|[across, down]| shade(edge(x) + across, edge(y) + down));
                shades.sum::<f64>() as f32 / SAMPLES as f32
            })
            .collect();
        let blurred = blur(&sharp, w, h, self.blur * FINE as f64, margin * FINE);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::new(0.0, self.noise.max(1e-12)).expect("a positive sigma");
        let pixels = blurred
            .iter()
            .enumerate()
            .map(|(k, &shade)| {
                let shade = f64::from(shade);
                let (x, y) = ((k % width) as f64 - width as f64 / 2.0, (k / width) as f64 - height as f64 / 2.0);
                let light = 1.0 + self.slope[0] * x + self.slope[1] * y;
                let value = (self.dark + (self.light - self.dark) * shade) * light + normal.sample(&mut rng);
                value.round().clamp(0.0, self.full_scale) as f32
            })
            .collect();
        Picture { width, height, pixels, full_scale: self.full_scale as f32 }
    }
}

impl Scene {
    /// The picture with another ground than paper beyond a margin around the squares, in squares: `ground` says its counts at a pixel.
    pub fn on_ground(&self, picture: Picture, margin: f64, ground: impl Fn([f64; 2]) -> f64) -> Picture {
        let inverse = self.view.inverse();
        let [right, below] = [self.columns, self.rows].map(|n| f64::from(n) + margin);
        let mut picture = picture;
        for (k, value) in picture.pixels.iter_mut().enumerate() {
            let at = [(k % picture.width) as f64, (k / picture.width) as f64];
            let [x, y] = project(&inverse, at);
            if x < -1.0 - margin || y < -1.0 - margin || x > right || y > below {
                *value = ground(at).round() as f32;
            }
        }
        picture
    }
}

/// Counts of a floor of dark and light tiles with these sides (px along and across), turned by `angle`: the mean of nine places of a pixel.
pub fn tiles(sides: [f64; 2], angle: f64, [dark, light]: [f64; 2]) -> impl Fn([f64; 2]) -> f64 {
    let (sin, cos) = angle.sin_cos();
    move |[u, v]: [f64; 2]| {
        let is_dark = |k: u32| {
            let (x, y) = (u + f64::from(k % 3) / 3.0 - 1.0 / 3.0, v + f64::from(k / 3) / 3.0 - 1.0 / 3.0);
            let tile = ((x * cos + y * sin) / sides[0]).floor() + ((y * cos - x * sin) / sides[1]).floor();
            tile.rem_euclid(2.0) < 1.0
        };
        (0..9).map(|k| if is_dark(k) { dark } else { light }).sum::<f64>() / 9.0
    }
}

/// Separable Gaussian over the fine picture with its margin; returns the pixels without it.
fn blur(sharp: &[f32], w: usize, h: usize, sigma: f64, margin: usize) -> Vec<f32> {
    let kernel: Vec<f32> =
        (0..=2 * margin).map(|k| (-0.5 * ((k as f64 - margin as f64) / sigma).powi(2)).exp() as f32).collect();
    let total: f32 = kernel.iter().sum::<f32>() * FINE as f32;
    // One pixel is the sum over its fine pixels of the blurred values: both in one kernel.
    let wide: Vec<f32> = (0..kernel.len() + FINE - 1)
        .map(|k| (0..FINE).filter_map(|f| kernel.get(k.checked_sub(f)?)).sum::<f32>() / total)
        .collect();
    let (width, height) = ((w - 2 * margin) / FINE, (h - 2 * margin) / FINE);
    let mut rows = vec![0.0; h * width];
    for (row, fine) in rows.chunks_exact_mut(width).zip(sharp.chunks_exact(w)) {
        for (i, g) in wide.iter().enumerate() {
            row.iter_mut().zip(fine[i..].iter().step_by(FINE)).for_each(|(sum, s)| *sum += g * s);
        }
    }
    let mut pixels = vec![0.0; height * width];
    for (y, row) in pixels.chunks_exact_mut(width).enumerate() {
        for (g, fine) in wide.iter().zip(rows[y * FINE * width..].chunks_exact(width)) {
            row.iter_mut().zip(fine).for_each(|(sum, s)| *sum += g * s);
        }
    }
    pixels
}
