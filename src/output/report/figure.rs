//! Figures of the report.

use maud::{Markup, PreEscaped, html};

/// A figure with its caption.
pub(super) fn figure(svg: &str, caption: &str) -> Markup {
    html! { figure { (PreEscaped(svg)) figcaption { (caption) } } }
}
