//! The frame of every page: self-contained, readable on a phone.

use maud::{DOCTYPE, Markup, PreEscaped, html};

/// A page with its style; `body` is what stands in it.
pub fn page(title: &str, style: &str, body: &Markup) -> String {
    let page: Markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(style)) }
            }
            body { (body) }
        }
    };
    page.into_string()
}
