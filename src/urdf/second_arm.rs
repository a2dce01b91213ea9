//! Two arms in one description: the elements of the second joined to those of the first by a joint whose origin nobody knows.

use std::collections::BTreeSet;
use std::ops::Range;

use roxmltree::Node;

use super::added_links::closing_tag;
use super::elements::escaped;
use super::read::{RobotDescription, parse, without_undeclared_prefixes};
use crate::error::{Code, Error, Notice, Result};

/// Name of the fixed joint from the base of one arm to that of the other; its origin is estimated from wherever it starts.
pub const BASE_FROM_BASE: &str = "base_from_base";

/// Before all names of the second arm where some of them are those of the first.
pub const SECOND_ARM_PREFIX: &str = "robot_2_";

/// Elements of the second description that are taken over.
const TAKEN: [&str; 2] = ["link", "joint"];

/// Attributes that hold names of links and joints: element, attribute.
const NAMED: [(&str, &str); 5] =
    [("link", "name"), ("joint", "name"), ("parent", "link"), ("child", "link"), ("mimic", "joint")];

impl RobotDescription {
    /// True where the description says that the bases of two arms are somewhere beside each other.
    pub fn has_two_bases(&self) -> bool {
        self.joints.iter().any(|j| j.name == BASE_FROM_BASE)
    }

    /// This robot and a second one, whose root stands at an unknown place beside `base` (default: the root), and the prefix that the names
    /// of the second have now; empty where they stay. Of the second, links and joints are taken over.
    ///
    /// # Errors
    /// Several roots, a base that is not there, a name that only looks like [`BASE_FROM_BASE`].
    pub fn with_second(&self, base: Option<&str>, second: &Self) -> Result<(Self, &'static str)> {
        let base = match base {
            Some(name) => self.known_link(name, "base")?,
            None => self.only_root()?,
        };
        let own: BTreeSet<&str> = self.links().chain(self.joints.iter().map(|j| j.name.as_str())).collect();
        let is_shared = second.links().chain(second.joints.iter().map(|j| j.name.as_str())).any(|n| own.contains(n));
        let prefix = if is_shared { SECOND_ARM_PREFIX } else { "" };
        let joined = format!(
            "\n  <joint name=\"{BASE_FROM_BASE}\" type=\"fixed\">\n    <origin xyz=\"0 0 0\" rpy=\"0 0 0\"/>\n    <parent link=\"{}\"/>\n    <child link=\"{}\"/>\n  </joint>\n",
            escaped(base),
            escaped(&format!("{prefix}{}", second.only_root()?))
        );
        let elements = taken(second, prefix)?;
        let plain = without_undeclared_prefixes(&self.path, &self.text)?;
        let end = closing_tag(&self.text, parse(&self.path, &plain)?.root_element());
        let end = end.ok_or_else(|| unjoined(self, "has no end of <robot>"))?;
        let text = format!("{}{elements}{joined}{}", &self.text[..end], &self.text[end..]);
        let mut both = Self::from_text(&self.path, text)?;
        both.notices.extend(second.notices.iter().cloned());
        if is_shared {
            let what = format!("the second arm has names of the first: its joints are {}", {
                let moving = second.joints.iter().filter(|j| j.joint_type != urdf_rs::JointType::Fixed);
                moving.map(|j| format!("{prefix}{}", j.name)).collect::<Vec<_>>().join(", ")
            });
            let remedy = "name their columns so in joints.csv";
            both.notices.push(Notice::new(Code::SecondArmRenamed, second.path.display(), what, remedy));
        }
        Ok((both, prefix))
    }
}

fn unjoined(description: &RobotDescription, what: &str) -> Error {
    Error::new(Code::UrdfSyntax, description.path.display(), what, "check the file with check_urdf")
}

/// Text of the links and joints of a description, their names with a prefix.
fn taken(description: &RobotDescription, prefix: &str) -> Result<String> {
    let text = &description.text;
    let plain = without_undeclared_prefixes(&description.path, text)?;
    let document = parse(&description.path, &plain)?;
    let mut all = String::new();
    for element in document.root_element().children().filter(|n| TAKEN.contains(&n.tag_name().name())) {
        let mut names: Vec<Range<usize>> = element.descendants().filter_map(name_in).collect();
        names.sort_by_key(|range| range.start);
        let mut from = element.range().start;
        all.push_str("\n  ");
        for range in names {
            all.push_str(&text[from..range.start]);
            all.push_str(prefix);
            from = range.start;
        }
        all.push_str(&text[from..element.range().end]);
    }
    Ok(all)
}

/// Where the name of a link or joint stands in an element that has one.
fn name_in(node: Node<'_, '_>) -> Option<Range<usize>> {
    let (_, attribute) = NAMED.into_iter().find(|(tag, _)| node.is_element() && node.tag_name().name() == *tag)?;
    Some(node.attribute_node(attribute)?.range_value())
}
