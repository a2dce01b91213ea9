//! Figures of the report.

use maud::{Markup, PreEscaped, html};

/// A figure with its caption.
pub(in crate::output::report) fn figure(svg: &str, caption: &str) -> Markup {
    html! { figure { (PreEscaped(svg)) figcaption { (caption) } } }
}

/// A figure whose parts say what they are when one points at them or touches them.
pub(in crate::output::report) fn pointed(svg: &str, caption: &str) -> Markup {
    html! { figure { (PreEscaped(svg)) output aria-live="polite" {} figcaption { (caption) } } }
}
