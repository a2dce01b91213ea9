//! Reading a URDF file.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use roxmltree::{Document, Node, ParsingOptions};
use urdf_rs::JointType;

use super::elements::{JointElement, SEARCHED_M, Source, UNLIMITED_M};
use super::inertial::{Inertial, inertial};
use super::skeleton::skeleton;
use crate::error::{Code, Error, Notice, Result, closest_name, plain_name};
use crate::files::{self, FileKind};

/// A robot as its URDF describes it, with the text it came from.
#[derive(Debug, Clone)]
pub struct RobotDescription {
    /// The file.
    pub path: PathBuf,
    /// Name of the robot.
    pub name: String,
    /// The whole text, byte for byte, for [`super::patch_origins`].
    pub text: String,
    /// What was seen while reading that the user should know.
    pub notices: Vec<Notice>,
    /// Links in the order of the file.
    pub(super) links: Vec<String>,
    /// Joints in the order of the file.
    pub(super) joints: Vec<JointElement>,
    pub(super) inertials: BTreeMap<String, Inertial>,
    /// Index in `joints` of the joint above a link.
    pub(super) joint_above: BTreeMap<String, usize>,
}

/// Reads a URDF file.
///
/// # Errors
/// Names file, line and joint: unreadable file or XML, unexpanded xacro, an unknown joint type, numbers that are none,
/// a zero axis, links or joints of the same name, unknown links, a link with two parents, loops.
pub fn read(path: &Path) -> Result<RobotDescription> {
    let bytes = files::read(path, FileKind::Robot)?;
    refuse_no_text(path, &bytes)?;
    if let Some(encoding) = files::utf16(&bytes) {
        let remedy = format!("convert it: iconv -f {encoding} -t UTF-8 in.urdf > out.urdf");
        return Err(Error::new(Code::TextEncoding, path.display(), "is UTF-16 text, not UTF-8", remedy));
    }
    let text = String::from_utf8(bytes).map_err(|e| {
        let what = format!("is not UTF-8 text (byte {})", e.utf8_error().valid_up_to());
        Error::new(Code::TextEncoding, path.display(), what, "convert it: iconv -f LATIN1 -t UTF-8 in.urdf > out.urdf")
    })?;
    RobotDescription::from_text(path, text)
}

/// Refuses a file that does not begin as XML, whatever encodes it, and is no text.
fn refuse_no_text(path: &Path, bytes: &[u8]) -> Result<()> {
    let marks = [&[0xef, 0xbb, 0xbf][..], &[0xff, 0xfe], &[0xfe, 0xff]];
    let rest = marks.iter().find_map(|mark| bytes.strip_prefix(*mark)).unwrap_or(bytes);
    let first = rest.iter().find(|b| **b != 0 && !b.is_ascii_whitespace());
    if first.is_none_or(|b| *b == b'<') || std::str::from_utf8(bytes).is_ok() {
        return Ok(());
    }
    let what = match image::guess_format(bytes) {
        Ok(_) => "is a picture, no robot description",
        Err(_) => "is no XML",
    };
    Err(Error::new(Code::UrdfSyntax, path.display(), what, "give a URDF file"))
}

/// What the library reads in a description that has so many links and joints.
fn read_by_urdf_rs(path: &Path, skeleton: &str, (links, joints): (usize, usize)) -> Result<urdf_rs::Robot> {
    let refused = |what: String| Error::new(Code::UrdfSyntax, path.display(), what, "check the file with check_urdf");
    let read = urdf_rs::read_from_string(skeleton.trim_start_matches('\u{feff}'));
    let read = read.map_err(|e| refused(format!("urdf-rs cannot read it: {e}")))?;
    match read.joints.len() == joints && read.links.len() == links {
        true => Ok(read),
        false => Err(refused("two readers disagree on the number of its links and joints".to_owned())),
    }
}

/// Mass and centre of mass of the links that state them, by link name.
fn inertials_of(source: &Source<'_>, robot: Node<'_, '_>, links: &[String]) -> Result<BTreeMap<String, Inertial>> {
    let mut all = BTreeMap::new();
    for (node, link) in elements(robot, "link").zip(links) {
        if let Some(found) = inertial(source, node, link)? {
            all.insert(link.clone(), found);
        }
    }
    Ok(all)
}

impl RobotDescription {
    /// Reads a URDF from its text; `path` is for messages only.
    ///
    /// # Errors
    /// As [`read`].
    pub fn from_text(path: &Path, text: String) -> Result<Self> {
        let plain = without_undeclared_prefixes(path, &text)?;
        let document = parse(path, &plain)?;
        let robot = document.root_element();
        let source = Source {
            file: path.display().to_string(),
            document: &document,
            line_ends: text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(at, _)| at).collect(),
            has_quaternions: version(robot) >= (1, 1),
        };
        refuse_xacro(&source)?;
        if robot.tag_name().name() != "robot" {
            let what = format!("the root element is <{}>, not <robot>", robot.tag_name().name());
            return Err(Error::new(Code::UrdfSyntax, source.place(robot), what, "give a URDF file"));
        }
        plain_name("robot", robot.attribute("name").unwrap_or_default(), source.place(robot))?;
        let links = named(&source, robot, "link")?;
        let joint_nodes: Vec<_> = elements(robot, "joint").collect();
        named(&source, robot, "joint")?;
        joint_nodes.iter().try_for_each(|n| source.check(*n))?;
        let read = read_by_urdf_rs(path, &skeleton(&plain, robot), (links.len(), joint_nodes.len()))?;
        let mut notices = Vec::new();
        let joints = joint_nodes
            .iter()
            .zip(&read.joints)
            .map(|(node, joint)| source.joint(*node, joint, &mut notices))
            .collect::<Result<Vec<_>>>()?;
        let mut description = Self {
            path: path.to_path_buf(),
            name: read.name,
            notices,
            inertials: inertials_of(&source, robot, &links)?,
            links,
            joint_above: joints.iter().enumerate().map(|(k, j)| (j.child.clone(), k)).collect(),
            joints,
            text: String::new(),
        };
        description.check_tree()?;
        let of_all = [description.unlimited_notice(), description.placeholder_notice()];
        description.notices.extend(of_all.into_iter().flatten());
        Ok(Self { text, ..description })
    }

    /// Joints without limits, and what counts as their range.
    fn unlimited_notice(&self) -> Option<Notice> {
        let unlimited: Vec<&JointElement> = self.joints.iter().filter(|joint| joint.is_unlimited).collect();
        let first = unlimited.first()?;
        let names: Vec<&str> = unlimited.iter().map(|joint| joint.name.as_str()).collect();
        let ranges = [
            (JointType::Revolute, "half a turn".to_owned()),
            (JointType::Prismatic, format!("{UNLIMITED_M} m ({SEARCHED_M} m where a posture is looked for)")),
        ];
        let there = ranges.into_iter().filter(|(kind, _)| unlimited.iter().any(|joint| joint.joint_type == *kind));
        let ranges: Vec<String> = there.map(|(_, range)| range).collect();
        let what = format!(
            "no limits of {}, which URDF demands: where their range counts, {} to both sides of zero is taken; urdfdom and pinocchio may refuse the \
             file, and the corrected one with it",
            names.join(", "),
            ranges.join(" or ")
        );
        let remedy = "write <limit lower=\"...\" upper=\"...\" effort=\"...\" velocity=\"...\"/>, or type=\"continuous\" where a joint turns without end";
        Some(Notice::new(Code::UrdfUnlimited, &first.place, what, remedy))
    }

    fn placeholder_notice(&self) -> Option<Notice> {
        let mass = self.placeholder_mass()?;
        let what =
            format!("all links have the same mass ({mass} kg): a placeholder, not used for the sag of the joints");
        let remedy = "state the true masses and centres, or none";
        Some(Notice::new(Code::UrdfMassPlaceholder, self.path.display(), what, remedy))
    }

    /// Mass and centre of mass of every link whose URDF states an `<inertial>`, by link name.
    pub fn inertials(&self) -> &BTreeMap<String, Inertial> {
        &self.inertials
    }
}

/// Undeclared prefixes that are let pass.
const MOST_PREFIXES: usize = 8;

/// Elements within elements: a robot description has some ten.
const DEEPEST: usize = 64;

/// Refuses elements that are nested deeper than any robot's: the parsers follow them by recursion.
fn refuse_depth(path: &Path, text: &str) -> Result<()> {
    let (mut depth, mut rest) = (0_usize, text);
    while let Some(at) = rest.find('<') {
        rest = &rest[at..];
        let special = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")];
        if let Some((start, end)) = special.into_iter().find(|(start, _)| rest.starts_with(start)) {
            // Without its end the parser stops there as well.
            let Some(length) = rest[start.len()..].find(end) else { return Ok(()) };
            rest = &rest[start.len() + length + end.len()..];
            continue;
        }
        if rest.starts_with("</") {
            depth = depth.saturating_sub(1);
        } else if !rest.starts_with("<!") {
            depth += 1;
        }
        if depth > DEEPEST {
            let line = 1 + text[..text.len() - rest.len()].matches('\n').count();
            let what = format!("elements are nested more than {DEEPEST} deep");
            return Err(Error::new(
                Code::UrdfSyntax,
                format!("{}:{line}", path.display()),
                what,
                "give a URDF that describes a robot",
            ));
        }
        let mut quote = None;
        let end = rest.bytes().position(|byte| {
            match quote {
                Some(open) if byte == open => quote = None,
                None if matches!(byte, b'"' | b'\'') => quote = Some(byte),
                _ => {}
            }
            byte == b'>' && quote.is_none()
        });
        let Some(end) = end else { return Ok(()) };
        depth -= usize::from(rest[..end].ends_with('/') && !rest.starts_with("</") && depth > 0);
        rest = &rest[end + 1..];
    }
    Ok(())
}

/// The text with `drake:name` written `drake_name` where nothing declares the prefix, as the parsers of ROS and Drake let it pass. Every
/// byte keeps its place. A xacro stays as it is.
///
/// # Errors
/// Elements that are nested too deep for any parser.
pub(super) fn without_undeclared_prefixes<'a>(path: &Path, text: &'a str) -> Result<Cow<'a, str>> {
    refuse_depth(path, text)?;
    let mut plain = Cow::Borrowed(text);
    for _ in 0..MOST_PREFIXES {
        let Err(roxmltree::Error::UnknownNamespace(prefix, _)) = document(&plain) else { break };
        if prefix == "xacro" {
            return Ok(Cow::Borrowed(text));
        }
        let places = ["<", "</", " ", "\t", "\n"];
        plain = places.iter().fold(plain, |text, before| {
            text.replace(&format!("{before}{prefix}:"), &format!("{before}{prefix}_")).into()
        });
    }
    Ok(plain)
}

/// A document type is let pass, as the parsers of ROS do, where it declares no entities: what those stand for has no place in the text, where
/// it could be corrected.
fn document(text: &str) -> std::result::Result<Document<'_>, roxmltree::Error> {
    let allow_dtd = !text.contains("<!ENTITY");
    Document::parse_with_options(text, ParsingOptions { allow_dtd, ..ParsingOptions::default() })
}

/// Parses XML that [`without_undeclared_prefixes`] let pass, with an error that knows the line.
pub(super) fn parse<'a>(path: &Path, text: &'a str) -> Result<Document<'a>> {
    document(text).map_err(|error| {
        let line = || text.lines().position(|line| line.contains("<!ENTITY")).map_or(1, |line| line as u32 + 1);
        let (line, what, remedy) = match &error {
            roxmltree::Error::UnknownNamespace(prefix, at) if prefix == "xacro" => return xacro(path, at.row),
            roxmltree::Error::DtdDetected => {
                (line(), "declares entities (<!ENTITY ..>)".into(), "write what they stand for in their place")
            }
            roxmltree::Error::UnexpectedEndOfStream | roxmltree::Error::UnclosedRootNode => {
                let what = "ends here with elements that are not closed, as a file that was cut off";
                (text.lines().count().max(1) as u32, what.into(), "give the whole file, down to </robot>")
            }
            _ => (error.pos().row, format!("is not well-formed XML: {error}"), "correct the XML there"),
        };
        Error::new(Code::UrdfSyntax, format!("{}:{line}", path.display()), what, remedy)
    })
}

fn xacro(path: &Path, line: u32) -> Error {
    let file = path.file_name().map_or_else(|| "in.xacro".into(), |n| n.to_string_lossy());
    let stem = file.split('.').next().unwrap_or("out");
    let what = "is an unexpanded xacro, not a URDF: it describes no robot yet";
    let remedy = format!("expand it first: xacro {file} > {stem}.expanded.urdf");
    Error::new(Code::UrdfXacro, format!("{}:{line}", path.display()), what, remedy)
}

/// Refuses macros, and substitutions in the attributes of links and joints.
fn refuse_xacro(source: &Source<'_>) -> Result<()> {
    let is_xacro = |namespace: Option<&str>| namespace.is_some_and(|uri| uri.contains("xacro"));
    let found = source.document.descendants().filter(Node::is_element).find(|node| {
        let kinematic = || node.ancestors().any(|a| matches!(a.tag_name().name(), "link" | "joint"));
        let substituted = |value: &str| value.contains("${") || value.contains("$(");
        is_xacro(node.tag_name().namespace())
            || node.attributes().any(|a| is_xacro(a.namespace()))
            || (node.attributes().any(|a| substituted(a.value())) && kinematic())
    });
    found.map_or(Ok(()), |node| Err(xacro(Path::new(&source.file), source.line(node))))
}

/// `version` of `<robot>` as (major, minor); 1.0 where it is missing or malformed, as urdfdom reads it.
pub(super) fn version(robot: Node<'_, '_>) -> (u32, u32) {
    let parts = robot.attribute("version").and_then(|v| v.trim().split_once('.'));
    parts.and_then(|(major, minor)| Some((major.parse().ok()?, minor.parse().ok()?))).unwrap_or((1, 0))
}

/// Children of `<robot>` with that tag.
pub(super) fn elements<'a, 'i>(robot: Node<'a, 'i>, tag: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    robot.children().filter(move |n| n.is_element() && n.tag_name().name() == tag)
}

/// Names of all elements of a tag; each must have one, of its own.
fn named(source: &Source<'_>, robot: Node<'_, '_>, tag: &'static str) -> Result<Vec<String>> {
    let mut seen = BTreeSet::new();
    let mut names = Vec::new();
    for node in elements(robot, tag) {
        let name = node.attribute("name").unwrap_or_default();
        if name.trim().is_empty() {
            return Err(Error::new(
                Code::UrdfElement,
                source.place(node),
                format!("a <{tag}> without a name"),
                "give it a name",
            ));
        }
        plain_name(tag, name, source.place(node))?;
        if !seen.insert(name) {
            let what = format!("a second {tag} named \"{name}\"");
            return Err(Error::new(Code::UrdfTwice, source.place(node), what, "rename one of them"));
        }
        names.push(name.to_string());
    }
    Ok(names)
}

/// Names that a message lists.
const MOST_NAMED: usize = 100;

/// A remedy that names what was probably meant, else everything there is.
pub(super) fn suggest<'a>(given: &str, known: impl Iterator<Item = &'a str> + Clone) -> String {
    match closest_name(given, known.clone()) {
        Some(meant) => format!("\"{meant}\" is there"),
        None => {
            let (first, more) = (known.clone().take(MOST_NAMED), known.count() > MOST_NAMED);
            format!("there are: {}{}", first.collect::<Vec<_>>().join(", "), if more { ", ..." } else { "" })
        }
    }
}
