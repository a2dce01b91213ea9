//! A small writer of inline SVG.

use std::fmt::Write;

/// A drawing in user units; x to the right, y down.
pub struct Svg {
    width: f64,
    height: f64,
    label: String,
    body: String,
}

/// Where a text hangs on its point.
#[derive(Debug, Clone, Copy)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}

pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A coordinate to a hundredth of a unit; a value that is none becomes zero.
fn n(value: f64) -> f64 {
    if value.is_finite() { (value * 100.0).round() / 100.0 + 0.0 } else { 0.0 }
}

impl Svg {
    /// An empty drawing; `label` says in words what it shows.
    pub fn new(width: f64, height: f64, label: &str) -> Self {
        Self { width, height, label: escaped(label), body: String::new() }
    }

    fn add(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a String cannot fail.
        let _ = self.body.write_fmt(element);
    }

    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], class: &str) {
        let [x1, y1, x2, y2] = [from[0], from[1], to[0], to[1]].map(n);
        self.add(format_args!("<line class=\"{class}\" x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"/>"));
    }

    pub fn rect(&mut self, at: [f64; 2], size: [f64; 2], class: &str) {
        let [x, y, w, h] = [at[0], at[1], size[0].max(0.0), size[1].max(0.0)].map(n);
        self.add(format_args!("<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\"/>"));
    }

    pub fn circle(&mut self, at: [f64; 2], radius: f64, class: &str) {
        let [x, y, r] = [at[0], at[1], radius].map(n);
        self.add(format_args!("<circle class=\"{class}\" cx=\"{x}\" cy=\"{y}\" r=\"{r}\"/>"));
    }

    pub fn text(&mut self, at: [f64; 2], anchor: Anchor, text: &str) {
        let [x, y] = at.map(n);
        let (anchor, text) = (anchor.name(), escaped(text));
        self.add(format_args!("<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\">{text}</text>"));
    }

    /// Text that runs upwards beside an axis.
    pub fn text_upwards(&mut self, at: [f64; 2], text: &str) {
        let ([x, y], text) = (at.map(n), escaped(text));
        self.add(format_args!(
            "<text x=\"{x}\" y=\"{y}\" text-anchor=\"middle\" transform=\"rotate(-90 {x} {y})\">{text}</text>"
        ));
    }

    /// What is drawn says what it is when one points at it.
    pub fn titled(&mut self, title: &str, draw: impl FnOnce(&mut Self)) {
        let title = escaped(title);
        self.add(format_args!("<g><title>{title}</title>"));
        draw(self);
        self.add(format_args!("</g>"));
    }

    /// Vectors as one path, cut off at a rectangle (corner, size).
    pub fn vectors_inside(
        &mut self,
        at: [f64; 2],
        size: [f64; 2],
        all: impl Iterator<Item = ([f64; 2], [f64; 2])>,
        class: &str,
    ) {
        let [x, y, w, h] = [at[0], at[1], size[0], size[1]].map(n);
        self.add(format_args!("<svg x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" viewBox=\"{x} {y} {w} {h}\">"));
        self.vectors(all, class);
        self.add(format_args!("</svg>"));
    }

    /// Vectors as one path: a line each from its foot.
    pub fn vectors(&mut self, all: impl Iterator<Item = ([f64; 2], [f64; 2])>, class: &str) {
        let mut d = String::new();
        for (foot, vector) in all {
            let [x, y, dx, dy] = [foot[0], foot[1], vector[0], vector[1]].map(n);
            let _ = write!(d, "M{x} {y}l{dx} {dy}");
        }
        self.add(format_args!("<path class=\"{class}\" d=\"{d}\"/>"));
    }

    /// The drawing as a file of its own, with its style.
    pub fn finish_alone(mut self, style: &str) -> String {
        self.body.insert_str(0, &format!("<style>{style}</style>"));
        self.finish()
    }

    /// The whole element; it shrinks with the page and keeps its shape.
    pub fn finish(self) -> String {
        let Self { width, height, label, body } = self;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" aria-label=\"{label}\" viewBox=\"0 0 {width} {height}\" \
             style=\"max-width:{width}px\">{body}</svg>"
        )
    }
}

/// A round number (1, 2 or 5 times a power of ten) at most `value`.
pub fn round_below(value: f64) -> f64 {
    if !(value > 0.0 && value.is_finite()) {
        return 1.0;
    }
    let power = 10f64.powf(value.log10().floor());
    [5.0, 2.0, 1.0].iter().map(|m| m * power).find(|v| *v <= value * (1.0 + 1e-9)).unwrap_or(power)
}

/// Round ticks from zero to at most `largest`, about five.
pub fn ticks(largest: f64) -> Vec<f64> {
    let step = round_below(largest / 4.0);
    (0..=20).map(|k| step * f64::from(k)).take_while(|t| *t <= largest * (1.0 + 1e-9)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round_and_ticks_stay_inside() {
        assert_eq!(round_below(0.37), 0.2);
        assert_eq!(round_below(5.0), 5.0);
        assert_eq!(round_below(0.0), 1.0);
        assert_eq!(ticks(1.0), [0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0]);
        assert_eq!(ticks(f64::NAN), [] as [f64; 0]);
    }

    #[test]
    fn text_cannot_break_out_of_the_drawing() {
        let mut svg = Svg::new(10.0, 10.0, "a \"label\" <b>");
        svg.text([f64::NAN, 1.0], Anchor::Start, "</text><script>");
        let text = svg.finish();
        assert!(!text.contains("<script>") && !text.contains("NaN") && text.contains("&quot;label&quot;"), "{text}");
    }
}
