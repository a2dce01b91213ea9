//! The planned stops as programs of robot controllers, with dwell and trigger marks.
//!
//! All writers go through the same list of `Visit`s. A new language is one file and one row in [`programs`].

mod krl;
mod rapid;
mod ros;
mod route;
mod urscript;

use std::collections::BTreeMap;

use crate::plan::{Plan, PlanRequest};
use route::{NAME, Route};

/// Programs in all languages that can express the plan: file name -> bytes.
pub fn programs(request: &PlanRequest, plan: &Plan) -> BTreeMap<String, Vec<u8>> {
    let route = Route::of(request, plan);
    let mut files = BTreeMap::new();
    let mut add = |name: &str, text: Option<String>| {
        if let Some(text) = text {
            files.insert(format!("{NAME}.{name}"), text.into_bytes());
        }
    };
    add("src", krl::source(&route));
    add("dat", krl::data(&route));
    add("mod", rapid::module(&route));
    add("script", urscript::script(&route));
    add("trajectory.yaml", Some(ros::trajectory(&route)));
    files
}
