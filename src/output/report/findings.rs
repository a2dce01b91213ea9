//! What was found out about the data, each with what to do about it.

use maud::{Markup, html};

use crate::error::Notice;
use crate::output::solution_json::SolutionRecord;
use crate::output::verdict::{Trust, Verdict};

/// Failed gates, then notes.
pub(super) fn section(r: &SolutionRecord) -> Markup {
    let v = Verdict::of(r);
    html! {
        @if v.trust == Trust::Failed {
            h3 { "Checks that failed" }
            ul { @for reason in &v.reasons { li { b { (reason.what) } @if !reason.remedy.is_empty() { br; "→ " (reason.remedy) } } } }
        } @else { p { "Every check passed." } }
        @if !r.notices.is_empty() {
            h3 { "Notes" }
            ul { @for group in Notice::alike(&r.notices) { (notes(&group)) } }
        }
    }
}

/// Notices that say the same: all places, then once what; each by itself where their numbers differ.
fn notes(group: &[&Notice]) -> Markup {
    let remedy = |n: &Notice| html! { @if !n.remedy.is_empty() { br; "→ " (n.remedy) } };
    let first = group[0];
    html! {
        @if group.iter().all(|n| n.what == first.what) {
            li { @for n in group { code { (n.place) } " " } (first.what) (remedy(first)) }
        } @else {
            @for n in group { li { code { (n.place) } " " (n.what) (remedy(n)) } }
        }
    }
}
