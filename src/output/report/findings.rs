//! What was found out about the data, each with what to do about it.

use maud::{Markup, html};

use crate::error::Notice;
use crate::output::verdict::{Trust, Verdict, VerdictReason};

/// Failed gates or doubts, then notes.
pub(super) fn section(v: &Verdict, notices: &[Notice]) -> Markup {
    // Most doubts are notes, and stand there.
    let is_noted = |reason: &&VerdictReason| notices.iter().any(|n| reason.what.ends_with(&n.what));
    let others: Vec<&VerdictReason> = v.reasons.iter().filter(|reason| !is_noted(reason)).collect();
    html! {
        @match v.trust {
            Trust::Good => p { "Every check passed." },
            Trust::Doubts => {
                @if others.is_empty() { p { "No check failed; some of the notes ask for a look." } }
                @else { p { "No check failed. What asks for a look:" } (list(others)) }
            },
            Trust::Failed => {
                h3 { "Checks that failed" }
                (list(v.reasons.iter()))
            },
        }
        @if !notices.is_empty() {
            h3 { "Notes" }
            ul { @for group in Notice::alike(notices) { (notes(&group)) } }
        }
    }
}

fn list<'a>(reasons: impl IntoIterator<Item = &'a VerdictReason>) -> Markup {
    html! {
        ul { @for reason in reasons { li { b { (reason.what) } (remedy(&reason.remedy)) } } }
    }
}

/// On a line of its own; nothing where none is known.
pub(super) fn remedy(words: &str) -> Markup {
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
