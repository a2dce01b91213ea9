//! A grey image in sensor counts.

/// A grey image in full depth; pixel (0, 0) is the centre of the top-left pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Grey values in sensor counts, row by row.
    pub pixels: Vec<f32>,
    /// Count at which the sensor saturates (255 for 8 bit, 4095 for 12 bit, ...).
    pub full_scale: f32,
}

impl Picture {
    /// What is bright in it is dark, and the other way round.
    pub fn negative(mut self) -> Self {
        self.pixels.iter_mut().for_each(|p| *p = self.full_scale - *p);
        self
    }

    /// Grey value of a pixel; column `x`, row `y`.
    pub fn at(&self, x: usize, y: usize) -> f32 {
        self.pixels[y * self.width + x]
    }
}
