//! Pixels by their places, two by two by their lag.

/// Lags looked at, px.
pub(super) const REACH: i32 = 3;
pub(super) const SIDE: usize = 2 * REACH as usize + 1;
/// Rows 0 to `REACH`, columns from -`REACH`: the lag of none is number `REACH`, those before it stand for their opposites.
pub(in crate::detect) const LAGS: usize = (REACH as usize + 1) * SIDE;
/// Number of the lag of none.
pub(in crate::detect) const NONE: usize = REACH as usize;

/// The lag of none and those after it.
pub(super) const UNKNOWN: usize = LAGS - NONE;

/// Number of a lag or its opposite; `None` where it is beyond reach.
pub(super) fn number([x, y]: [i32; 2]) -> Option<usize> {
    let [x, y] = if y < 0 || (y == 0 && x < 0) { [-x, -y] } else { [x, y] };
    (x.abs() <= REACH && y <= REACH).then(|| y as usize * SIDE + (x + REACH) as usize)
}

/// Pixels on their raster.
pub(in crate::detect) struct Raster<'a> {
    /// Column and row of every pixel.
    at: &'a [[i32; 2]],
    low: [i32; 2],
    width: i32,
    /// Index of the pixel plus one; 0 where there is none.
    cells: Vec<u32>,
}

impl<'a> Raster<'a> {
    pub fn new(at: &'a [[i32; 2]]) -> Self {
        let least = |axis: usize| at.iter().map(|p| p[axis]).min().unwrap_or(0);
        let most = |axis: usize| at.iter().map(|p| p[axis]).max().unwrap_or(0);
        // A margin on every side: no lag leaves the raster.
        let low = [least(0) - REACH, least(1)];
        let (width, height) = (most(0) - low[0] + REACH + 1, most(1) - low[1] + REACH + 1);
        let mut cells = vec![0; (width * height) as usize];
        for (k, [x, y]) in at.iter().enumerate() {
            cells[((y - low[1]) * width + x - low[0]) as usize] = k as u32 + 1;
        }
        Self { at, low, width, cells }
    }

    /// Index of the pixel at a place.
    pub fn find(&self, [x, y]: [i32; 2]) -> Option<usize> {
        let (i, j) = (x - self.low[0], y - self.low[1]);
        let inside = (0..self.width).contains(&i) && j >= 0;
        let cell = inside.then(|| self.cells.get((j * self.width + i) as usize)).flatten()?;
        (*cell as usize).checked_sub(1)
    }

    /// A value of every pixel at its place, 0 where there is none: two planes, the second from `ahead(lag)` on, hold the values of every two pixels
    /// at that lag beside each other.
    pub fn plane(&self, value: impl Fn(usize) -> f64) -> Vec<f64> {
        self.with_room(0, 0.0, value)
    }

    /// The same with so much room before it, and what stands where there is no pixel.
    pub fn with_room<T: Copy>(&self, room: usize, none: T, value: impl Fn(usize) -> T) -> Vec<T> {
        let mut plane = vec![none; room + self.cells.len()];
        (0..self.at.len()).for_each(|k| plane[room + self.cell(k)] = value(k));
        plane
    }

    /// Room before a plane in which no opposite of a lag leaves it.
    pub fn room(&self) -> usize {
        self.ahead(LAGS - 1)
    }

    /// Place of a pixel in a plane.
    pub fn cell(&self, pixel: usize) -> usize {
        let [x, y] = self.at[pixel];
        ((y - self.low[1]) * self.width + x - self.low[0]) as usize
    }

    /// Places of all pixels.
    pub fn cells_of_pixels(&self) -> impl Iterator<Item = usize> {
        (0..self.at.len()).map(|pixel| self.cell(pixel))
    }

    /// The value at a pixel, and for every lag after that of none the sum of those there and at its opposite, in a plane with [`Self::room`].
    #[inline(always)]
    pub fn around(&self, plane: &[f64], pixel: usize) -> [f64; UNKNOWN] {
        let (here, width) = (self.room() + self.cell(pixel), self.width as usize);
        let side = |from: usize| -> &[f64] { &plane[from - NONE..][..SIDE] };
        let mut sums = [0.0; UNKNOWN];
        sums[0] = plane[here];
        let row = side(here);
        (1..=NONE).for_each(|x| sums[x] = row[NONE + x] + row[NONE - x]);
        for (y, sums) in (1..).zip(sums[NONE + 1..].chunks_exact_mut(SIDE)) {
            let (ahead, before) = (side(here + y * width), side(here - y * width));
            (0..SIDE).for_each(|x| sums[x] = ahead[x] + before[SIDE - 1 - x]);
        }
        sums
    }

    /// Places from a pixel to that at a lag, not before that of none.
    pub fn ahead(&self, lag: usize) -> usize {
        lag / SIDE * self.width as usize + lag % SIDE - NONE
    }

    /// Calls `pair` with the number of a lag that is not zero and the indices of every two pixels at it.
    pub fn for_pairs(&self, mut pair: impl FnMut(usize, usize, usize)) {
        for k in 0..self.at.len() {
            let cell = self.cell(k);
            for lag in NONE + 1..LAGS {
                let other = self.cells[cell + self.ahead(lag)] as usize;
                if other > 0 {
                    pair(lag, k, other - 1);
                }
            }
        }
    }
}
