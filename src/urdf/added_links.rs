//! Links fixed on links of a URDF, added to its text; every other byte stays.

use std::path::Path;

use roxmltree::Node;

use super::elements::escaped;
use super::patch::join;
use super::read::{elements, parse, without_undeclared_prefixes};
use crate::error::{Code, Error, Result};
use crate::geom::Pose;

/// A frame that becomes a link.
#[derive(Debug, Clone, PartialEq)]
pub struct AddedLink {
    /// Its name.
    pub name: String,
    /// The link that it is fixed on.
    pub parent: String,
    /// `parent_from_link`.
    pub origin: Pose,
}

/// Returns `text` with fixed joints and empty links at its end.
///
/// # Errors
/// XML that cannot be read or is laid out in a way that cannot be edited, names that are taken, parents that are not there.
pub fn add_links(text: &str, links: &[AddedLink]) -> Result<String> {
    let path = Path::new("URDF");
    let plain = without_undeclared_prefixes(path, text)?;
    let document = parse(path, &plain)?;
    let robot = document.root_element();
    let place = |link: &AddedLink| format!("URDF, link \"{}\"", link.name);
    let has = |kind: &'static str, name: &str| elements(robot, kind).any(|e| e.attribute("name") == Some(name));
    let mut added = String::new();
    for link in links {
        let joint = format!("{}_joint", link.name);
        if has("link", &link.name) || has("joint", &joint) {
            let what = "the robot description has a link or joint of this name";
            return Err(Error::new(Code::UrdfTwice, place(link), what, "give the frame another name"));
        }
        if !has("link", &link.parent) {
            let what = format!("its parent \"{}\" is no link of the robot description", link.parent);
            return Err(Error::new(Code::LinkUnknown, place(link), what, "give the description of the solution"));
        }
        let [name, joint, parent] = [&link.name, &joint, &link.parent].map(|n| escaped(n));
        let (xyz, rpy) = (join(&link.origin.xyz()), join(&link.origin.rpy()));
        added += &format!(
            "  <link name=\"{name}\"/>\n  <joint name=\"{joint}\" type=\"fixed\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{name}\"/>\n    \
             <origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>\n  </joint>\n"
        );
    }
    let Some(at) = closing_tag(text, robot) else {
        return Err(Error::new(
            Code::UrdfLayout,
            "URDF",
            "the robot is an empty element",
            "give a description with links",
        ));
    };
    // A closing tag that is indented keeps its line.
    let line = text[..at].trim_end_matches([' ', '\t']).len();
    let at = if text[..line].ends_with('\n') { line } else { at };
    let before = if text[..at].ends_with('\n') { "" } else { "\n" };
    Ok(format!("{}{before}{added}{}", &text[..at], &text[at..]))
}

/// Where the last tag of the robot begins; `None` where it is an empty element.
pub(super) fn closing_tag(text: &str, robot: Node<'_, '_>) -> Option<usize> {
    let end = robot.range().end;
    let at = text[..end].rfind("</").filter(|at| text[*at..end].trim_end().ends_with('>'));
    at.filter(|_| robot.has_children())
}
