//! What was found out about the data, each with what to do about it.

use maud::{Markup, html};

use crate::error::Notice;
use crate::output::verdict::{Trust, Verdict, VerdictReason};

/// Failed gates, then notes: doubts are some of them.
pub(in crate::output::report) fn section(v: &Verdict, notices: &[Notice]) -> Markup {
    html! {
        @match v.trust {
            Trust::Good => p { "Every check passed." },
            Trust::Doubts => p { "No check failed; some of the notes ask for a look." },
            Trust::Failed => {
                h3 { "Checks that failed" }
                (list(&v.reasons))
            },
        }
        @if !notices.is_empty() {
            h3 { "Notes" }
            ul { @for group in Notice::alike(notices) { (notes(&group)) } }
        }
    }
}

fn list(reasons: &[VerdictReason]) -> Markup {
    html! {
        ul { @for reason in reasons { li { b { (reason.what) } (remedy(&reason.remedy)) } } }
    }
}

/// On a line of its own; nothing where none is known.
pub(in crate::output::report) fn remedy(words: &str) -> Markup {
    html! { @if !words.is_empty() { br; span.note { "→ " (words) } } }
}

/// Notices that say the same: all places, then once what; each by itself where their numbers differ.
fn notes(group: &[&Notice]) -> Markup {
    let first = group[0];
    html! {
        @if group.iter().all(|n| n.what == first.what) {
            li { @for n in group { code { (n.place) } " " } (first.what) (remedy(&first.remedy)) }
        } @else {
            @for n in group { li { code { (n.place) } " " (n.what) (remedy(&n.remedy)) } }
        }
    }
}
