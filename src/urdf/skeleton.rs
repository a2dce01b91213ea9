//! What `urdf-rs` is given to read: names, joints and their frames. It refuses a robot for a texture without a file, a mass without
//! inertia or a limit without velocity, none of which moves a link.

use std::ops::Range;

use roxmltree::Node;

/// Elements of a joint that say where its child is.
const FRAMES: [&str; 5] = ["origin", "parent", "child", "axis", "mimic"];

/// The text without the elements that do not say where a link is.
pub(super) fn skeleton(text: &str, robot: Node<'_, '_>) -> String {
    let mut kept = String::with_capacity(text.len());
    let mut at = 0;
    for cut in robot.children().filter(Node::is_element).flat_map(beside) {
        kept += &text[at..cut.start];
        at = cut.end;
    }
    kept + &text[at..]
}

/// What of a child of `<robot>` is left out, in the order of the text.
fn beside(element: Node<'_, '_>) -> Vec<Range<usize>> {
    let without = |keep: &[&str]| {
        let children = element.children().filter(Node::is_element);
        children.filter(|c| !keep.contains(&c.tag_name().name())).map(|c| c.range()).collect()
    };
    match element.tag_name().name() {
        "joint" => without(&FRAMES),
        "link" => without(&[]),
        _ => vec![element.range()],
    }
}
