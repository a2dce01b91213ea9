//! The frame of every page: self-contained, readable on a phone.

use maud::{DOCTYPE, Markup, PreEscaped, html};

/// Style of the reports.
pub const STYLE: &str = include_str!("style.css");
/// Their script: it says what is pointed at, and turns the scene.
pub const SCRIPT: &str = include_str!("report.js");

/// Nothing is fetched, whatever stands in the page.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:";

/// A page with its style; `body` is what stands in it.
pub fn page(title: &str, style: &str, body: &Markup) -> String {
    framed(title, style, &html! { body { (body) } })
}

/// A chapter of a longer page.
pub struct Chapter {
    /// Where links go, letters and `-`.
    pub id: &'static str,
    /// Its heading.
    pub title: String,
    /// What stands in it; an empty one is left out.
    pub body: Markup,
}

impl Chapter {
    /// A chapter under its heading.
    pub fn new(id: &'static str, title: &str, body: Markup) -> Self {
        Self { id, title: title.to_owned(), body }
    }
}

/// A page with a first part that stands by itself, a list of contents, chapters, and a script.
pub fn page_of_chapters(title: &str, style: &str, script: &str, first: &Markup, chapters: &[Chapter]) -> String {
    let chapters = || chapters.iter().filter(|c| !c.body.0.is_empty());
    let body = html! {
        body.chapters {
            @if let Some(first) = chapters().next() { a.skip href={ "#" (first.id) } { "To the chapters" } }
            header { (first) }
            nav.contents aria-label="Contents" {
                h2 { "Contents" }
                ol { @for c in chapters() { li { a href={ "#" (c.id) } { (c.title) } } } }
            }
            main { @for c in chapters() { section id=(c.id) aria-labelledby={ (c.id) "-title" } {
                h2 id={ (c.id) "-title" } { (c.title) }
                (c.body)
            } } }
            script { (PreEscaped(script)) }
        }
    };
    framed(title, style, &body)
}

fn framed(title: &str, style: &str, body: &Markup) -> String {
    let page: Markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                title { (title) }
                style { (PreEscaped(style)) }
            }
            (body)
        }
    };
    page.into_string()
}
