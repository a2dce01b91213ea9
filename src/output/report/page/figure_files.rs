//! The figures of the report as files of their own, for papers and pages.

use super::frame::Chapter;

/// A drawing as a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FigureFile {
    /// Name: the chapter of the report, and a number where it has several.
    pub name: String,
    /// SVG with its style; light or dark as the reader's page.
    pub svg: String,
}

/// The drawings of some chapters, with what the style of their page says of drawings and colours.
pub(in crate::output::report) fn drawn(chapters: &[Chapter], style: &str) -> Vec<FigureFile> {
    let of_chapter = |chapter: &Chapter| {
        let all = drawings(&chapter.body.0);
        let name = |k: usize| match all.len() {
            1 => format!("{}.svg", chapter.id),
            _ => format!("{}-{}.svg", chapter.id, k + 1),
        };
        let file = |(k, svg): (usize, &&str)| FigureFile { name: name(k), svg: styled(svg, style) };
        all.iter().enumerate().map(file).collect::<Vec<_>>()
    };
    chapters.iter().flat_map(of_chapter).collect()
}

const OPENING: &str = "<svg";
const CLOSING: &str = "</svg>";

/// The outer drawings of a text.
fn drawings(html: &str) -> Vec<&str> {
    let (mut found, mut start, mut depth, mut at) = (Vec::new(), 0, 0usize, 0);
    let after = |at: usize| html[at..].find(OPENING).into_iter().chain(html[at..].find(CLOSING)).min();
    while let Some(next) = after(at) {
        let here = at + next;
        if html[here..].starts_with(OPENING) {
            if depth == 0 {
                start = here;
            }
            depth += 1;
            at = here + OPENING.len();
        } else {
            at = here + CLOSING.len();
            depth = depth.saturating_sub(1);
            if depth == 0 {
                found.push(&html[start..at]);
            }
        }
    }
    found
}

/// A drawing that carries its style.
fn styled(svg: &str, style: &str) -> String {
    let is_of_drawings =
        |line: &&str| ["svg ", ".scene", ":root", "@media (prefers"].iter().any(|start| line.starts_with(start));
    let rules: String = style.lines().filter(is_of_drawings).collect();
    match svg.split_once('>') {
        Some((opening, rest)) => format!("{opening}><style>{rules}svg{{background:var(--paper)}}</style>{rest}"),
        None => svg.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::drawings;

    #[test]
    fn a_drawing_inside_another_belongs_to_it() {
        let page = "<p>a</p><svg id=1><svg id=2></svg><g/></svg><p>b</p><svg id=3></svg>";
        assert_eq!(drawings(page), ["<svg id=1><svg id=2></svg><g/></svg>", "<svg id=3></svg>"]);
        assert!(drawings("<p>none</p>").is_empty());
    }
}
