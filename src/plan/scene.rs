//! What the robot must not touch: itself, the plate, the table, boxes.
//!
//! Every link is one or more capsules in the frame behind its joint. The check is one of distances, with a clearance.

use nalgebra::Vector3;

use super::setting::Setting;
use crate::geom::{OrientedBox, Pose, segment_distance_m};
use crate::model::robot::Robot;
use crate::series::{CameraMount, Plate};
use crate::urdf::{CarriedCapsule, Chain, JointKind};

/// A segment with a radius, in the frame behind a joint of the chain.
#[derive(Debug, Clone, PartialEq)]
pub struct Capsule {
    /// What it is, for messages.
    pub name: String,
    /// Index in the chain of the joint that carries it; `None`: fixed to the base.
    pub joint: Option<usize>,
    /// Number of moving joints before it.
    pub order: usize,
    /// Ends, m.
    pub ends_m: [Vector3<f64>; 2],
    /// Radius, m.
    pub radius_m: f64,
}

/// Sizes of what is not described by the URDF.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneOptions {
    /// Radius of a link without collision geometry, m; `None`: a share of the arm's length.
    pub link_radius_m: Option<f64>,
    /// Radius of the camera's body, m.
    pub camera_radius_m: f64,
    /// Least distance, m.
    pub clearance_m: f64,
    /// Height of the table, m, in the base frame (of the link above both ends, where the base is carried); `None`: below the lowest plate that
    /// stands still, at most the foot of the robot.
    pub table_z_m: Option<f64>,
    /// Boxes in the same frame.
    pub boxes: Vec<OrientedBox>,
    /// Links with collision geometry of their own, in place of capsules along the links that carry them.
    pub described: Vec<Capsule>,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self {
            link_radius_m: None,
            camera_radius_m: 0.03,
            clearance_m: 0.01,
            table_z_m: None,
            boxes: Vec::new(),
            described: Vec::new(),
        }
    }
}

/// Radius of a link as a share of the arm's length.
const RADIUS_SHARE: f64 = 0.055;
/// Half the thickness of a plate, m.
const HALF_PLATE_M: f64 = 0.006;
/// Margin of the plate around its outermost markers, in pitches.
const PLATE_MARGIN: f64 = 1.0;
/// Moving joints before a link that may be near the table: those of the foot.
const FOOT: usize = 1;

/// Everything that may collide.
#[derive(Debug, Clone)]
pub struct Scene {
    robot: Robot,
    /// What stands still where the base does not.
    cell: Option<Cell>,
    capsules: Vec<Capsule>,
    /// Pairs of capsules that are compared.
    pairs: Vec<(usize, usize)>,
    /// A fixed camera on a base that is carried.
    on_base: Option<OrientedBox>,
    /// Boxes that stand still, by name.
    boxes: Vec<(String, OrientedBox)>,
    /// Plates that stand still, one for each placement; empty for a plate in the hand.
    plates: Vec<OrientedBox>,
    /// Plates in the tip frame, one for each placement; empty for a camera in the hand.
    plates_in_hand: Vec<OrientedBox>,
    table_z_m: f64,
    clearance_m: f64,
}

/// What may hide something from an eye, in the base frame.
#[derive(Debug)]
pub struct InSight {
    eye_m: Vector3<f64>,
    boxes: Vec<OrientedBox>,
    /// Ends and radius, m.
    links: Vec<([Vector3<f64>; 2], f64)>,
}

impl InSight {
    /// True where something stands before a point of the base frame, m.
    pub fn hides(&self, point_m: &Vector3<f64>) -> bool {
        let sight = [&self.eye_m, point_m];
        self.boxes.iter().any(|b| b.is_cut_by(sight[0], sight[1]))
            || self.links.iter().any(|(ends, radius_m)| segment_distance_m(sight, [&ends[0], &ends[1]]) < *radius_m)
    }
}

/// The link above a base that joints carry and the arm.
#[derive(Debug, Clone, Copy)]
struct Cell {
    /// Last entry of the chain that is passed upwards.
    entry: usize,
    /// Moving joints before it.
    order: usize,
}

impl Cell {
    fn of(chain: &Chain) -> Option<Self> {
        let entry = chain.climbed().checked_sub(1).filter(|_| chain.base_moves())?;
        let order = chain.joints[..=entry].iter().filter(|j| j.kind != JointKind::Fixed).count();
        Some(Self { entry, order })
    }
}

/// The plate as a box in its own frame.
fn plate_box(plate: &Plate) -> OrientedBox {
    let margin = PLATE_MARGIN * plate.pitch_m;
    let half = |k: usize| plate.markers.iter().map(|m| m.position_m[k].abs()).fold(0.0, f64::max) + margin;
    let below = Vector3::new(0.0, 0.0, -HALF_PLATE_M);
    OrientedBox {
        pose: Pose::new(nalgebra::Matrix3::identity(), below),
        half_m: Vector3::new(half(0), half(1), HALF_PLATE_M),
    }
}

/// Capsules along the links, from each moving joint to the next and to the tip, where `described` has none. The link on which both arms
/// stand is no arm.
fn along_links(robot: &Robot, radius_m: f64, described: &[Capsule]) -> Vec<Capsule> {
    let above = Cell::of(&robot.chain).map(|cell| cell.order);
    let joints = &robot.chain.joints;
    let foot = robot.chain.base_from_foot().map_or_else(Vector3::zeros, |foot| foot.translation);
    let mut all = Vec::new();
    let (mut carrier, mut order, mut end) = (None, 0, Pose::identity());
    let mut close = |carrier: Option<usize>, order: usize, end: &Pose| {
        let name = carrier.map_or("base".to_owned(), |k: usize| format!("link after {}", joints[k].name));
        if above != Some(order) && !described.iter().any(|c| c.order == order) {
            let start = if carrier.is_none() { foot } else { Vector3::zeros() };
            let ends_m = [start, end.translation];
            all.push(Capsule { name, joint: carrier, order, ends_m, radius_m });
        }
    };
    for (k, joint) in joints.iter().enumerate() {
        end = end * joint.origin;
        if joint.kind != JointKind::Fixed {
            close(carrier, order, &end);
            (carrier, order, end) = (Some(k), order + 1, Pose::identity());
        }
    }
    close(carrier, order, &end);
    all
}

/// From the tip to the camera.
fn camera_in_hand(chain: &Chain, tip_from_camera: &Pose, radius_m: f64) -> Capsule {
    let moving = chain.joints.iter().filter(|j| j.kind != JointKind::Fixed).count();
    Capsule {
        name: "camera".into(),
        joint: Some(chain.joints.len() - 1),
        order: moving + 1,
        ends_m: [Vector3::zeros(), tip_from_camera.translation],
        radius_m,
    }
}

/// Capsules of the URDF's collision geometry, for [`SceneOptions::described`].
pub fn described(capsules: &[CarriedCapsule], chain: &Chain) -> Vec<Capsule> {
    let moving = |upto: usize| chain.joints[..=upto].iter().filter(|j| j.kind != JointKind::Fixed).count();
    let one = |c: &CarriedCapsule| Capsule {
        name: c.link.clone(),
        joint: c.joint,
        order: c.joint.map_or(0, moving),
        ends_m: c.ends_m,
        radius_m: c.radius_m,
    };
    capsules.iter().map(one).collect()
}

/// Height below which a robot does not reach as it stands, in the base frame, m: that of its foot, or, where it leans, of the arm that hangs from it.
fn floor_m(chain: &Chain) -> f64 {
    let stands = |foot: Pose| foot.translation.z - (1.0 - foot.rotation[(2, 2)]) * chain.arm_length_m();
    chain.base_from_foot().map_or(0.0, stands)
}

impl Scene {
    /// The scene of a setting.
    pub fn new(setting: &Setting, options: &SceneOptions) -> Self {
        let robot = &setting.robot;
        let radius = options.link_radius_m.unwrap_or_else(|| RADIUS_SHARE * robot.chain.arm_length_m());
        let mut capsules = options.described.clone();
        capsules.extend(along_links(robot, radius, &options.described));
        capsules.sort_by_key(|c| c.order);
        let plate = plate_box(&setting.plate);
        let placed = setting.placements.iter().map(|p| plate.placed(&p.1)).collect();
        let cell = Cell::of(&robot.chain);
        let (mut on_base, mut boxes, mut plates, mut plates_in_hand) = (None, Vec::new(), Vec::new(), Vec::new());
        match setting.mount {
            CameraMount::Hand => {
                capsules.push(camera_in_hand(&robot.chain, &setting.mounting, options.camera_radius_m));
                plates = placed;
            }
            CameraMount::Fixed => {
                let camera = OrientedBox { pose: setting.mounting, half_m: Vector3::repeat(options.camera_radius_m) };
                match cell {
                    Some(_) => on_base = Some(camera),
                    None => boxes.push(("camera".to_owned(), camera)),
                }
                plates_in_hand = placed;
            }
        }
        boxes.extend(options.boxes.iter().enumerate().map(|(k, b)| (format!("box {}", k + 1), *b)));
        let standing = plates.iter().filter(|_| cell.is_none());
        let lowest = standing.flat_map(|p| p.corners()).map(|c| c.z).fold(floor_m(&robot.chain), f64::min);
        let pairs = compared(&capsules, options.clearance_m);
        Self {
            robot: robot.clone(),
            cell,
            on_base,
            pairs,
            capsules,
            boxes,
            plates,
            plates_in_hand,
            table_z_m: options.table_z_m.unwrap_or(lowest - options.clearance_m),
            clearance_m: options.clearance_m,
        }
    }

    /// Capsules of links and camera.
    pub fn capsules(&self) -> &[Capsule] {
        &self.capsules
    }

    /// With the robot at these readings.
    pub fn at(&self, readings: &[f64]) -> PlacedScene<'_> {
        let links = self.robot.link_poses(readings);
        let placed = |c: &Capsule| c.ends_m.map(|e| c.joint.map_or(e, |j| links[j].transform(&e)));
        PlacedScene { ends: self.capsules.iter().map(placed).collect(), scene: self, links }
    }

    /// What comes too near at these readings with the plate at `placement`; `None` where nothing does.
    pub fn collision(&self, readings: &[f64], placement: usize) -> Option<String> {
        self.at(readings).collision(placement)
    }

    /// Height above the face of a plate up to which something is what the plate lies on or in, m.
    pub const fn support_m(&self) -> f64 {
        HALF_PLATE_M + self.clearance_m
    }

    /// True for a capsule that comes too near to something of a radius at a distance, m.
    fn is_near(&self, distance: f64, capsule: &Capsule, radius_m: f64) -> bool {
        distance < capsule.radius_m + radius_m + self.clearance_m
    }

    /// Height below which nothing may be, where what stands still is.
    fn lowest_m(&self) -> f64 {
        self.table_z_m + self.clearance_m
    }

    /// What joints carry with the base: plate or camera.
    fn on_base(&self, placement: usize) -> impl Iterator<Item = (&str, &OrientedBox)> {
        let plate = self.plates.get(placement).map(|plate| ("plate", plate));
        self.on_base.iter().map(|camera| ("camera", camera)).chain(plate)
    }

    /// Order of the outermost capsule.
    fn outermost(&self) -> usize {
        self.capsules.iter().map(|c| c.order).max().unwrap_or(0)
    }

    /// The table or the box that a carried body comes too near to.
    fn still_near(&self, body: &OrientedBox) -> Option<&str> {
        if body.corners().iter().any(|c| c.z < self.lowest_m()) {
            return Some("table");
        }
        // Corners and middle against boxes: a plate is thin, and a box it would cut through elsewhere reaches the arm first.
        let probes = body.corners().into_iter().chain([body.pose.translation]);
        let hit = |b: &OrientedBox| {
            probes
                .clone()
                .any(|p| b.distance_m(&p) < self.clearance_m || body.distance_m(&b.pose.translation) < self.clearance_m)
        };
        self.boxes.iter().find(|(_, b)| hit(b)).map(|(name, _)| name.as_str())
    }

    /// True where the straight way between two joint vectors is free, checked every `step` (rad or m of any joint).
    pub fn way_is_free(&self, from: &[f64], to: &[f64], placement: usize, step: f64) -> bool {
        let longest = from.iter().zip(to).map(|(a, b)| (b - a).abs()).fold(0.0, f64::max);
        let pieces = (longest / step).ceil().max(1.0) as usize;
        (1..pieces).all(|k| {
            let t = k as f64 / pieces as f64;
            let at: Vec<f64> = from.iter().zip(to).map(|(a, b)| a + t * (b - a)).collect();
            self.collision(&at, placement).is_none()
        })
    }
}

/// A scene with the robot at some readings.
#[derive(Debug)]
pub struct PlacedScene<'a> {
    scene: &'a Scene,
    links: Vec<Pose>,
    /// Ends of the capsules in the base frame, m.
    ends: Vec<Ends>,
}

/// Of a capsule, m.
type Ends = [Vector3<f64>; 2];

impl PlacedScene<'_> {
    /// What comes too near with the plate at `placement`; `None` where nothing does.
    pub fn collision(&self, placement: usize) -> Option<String> {
        let of_links = self.links_collide();
        if of_links.is_some() {
            return of_links;
        }
        let still_from_base = self.base_from_still().map_or_else(Pose::identity, |pose| pose.inverse());
        let in_still: Vec<Ends> = self.ends.iter().map(|e| e.map(|e| still_from_base.transform(&e))).collect();
        self.box_collides(&in_still)
            .or_else(|| self.carried_meets_link(placement))
            .or_else(|| self.table_collides(&in_still))
            .or_else(|| self.carried_meets_still(placement, &still_from_base))
            .or_else(|| self.plate_in_hand_collides(placement, &still_from_base, &in_still))
    }

    /// What may stand between an eye and what it looks at: boxes, and the links but the two that carry camera or plate.
    pub fn in_sight(&self, eye_m: Vector3<f64>) -> InSight {
        let base_from_still = self.base_from_still().unwrap_or_else(Pose::identity);
        // What the eye is in is the camera.
        let boxes = self.scene.boxes.iter().map(|(_, b)| b.placed(&base_from_still));
        let boxes = boxes.filter(|b| b.distance_m(&eye_m) > 0.0).collect();
        let last = self.scene.outermost();
        let carried = self.capsules().filter(|(c, _)| c.order + 1 < last);
        let is_apart =
            |(ends, radius_m): &(Ends, f64)| segment_distance_m([&eye_m, &eye_m], [&ends[0], &ends[1]]) > *radius_m;
        InSight { eye_m, boxes, links: carried.map(|(c, ends)| (*ends, c.radius_m)).filter(is_apart).collect() }
    }

    /// Where what stands still is, where the base does not.
    fn base_from_still(&self) -> Option<Pose> {
        self.scene.cell.map(|cell| self.links[cell.entry])
    }

    fn capsules(&self) -> impl Iterator<Item = (&Capsule, &Ends)> {
        self.scene.capsules.iter().zip(&self.ends)
    }

    /// Links and camera with each other.
    fn links_collide(&self) -> Option<String> {
        let is_near = |&&(a, b): &&(usize, usize)| {
            let [one, other] = [&self.scene.capsules[a], &self.scene.capsules[b]];
            let [[start, end], other_ends] = [&self.ends[a], &self.ends[b]];
            let distance = segment_distance_m([start, end], [&other_ends[0], &other_ends[1]]);
            self.scene.is_near(distance, one, other.radius_m)
        };
        let (a, b) = self.scene.pairs.iter().find(is_near)?;
        Some(format!("{} and {}", self.scene.capsules[*a].name, self.scene.capsules[*b].name))
    }

    /// The first link with these ends, of those whose order is meant, that comes too near to an obstacle.
    fn hit(&self, obstacle: &OrientedBox, ends: &[Ends], is_meant: impl Fn(usize) -> bool) -> Option<&str> {
        let mut links = self.scene.capsules.iter().zip(ends).filter(|(c, _)| is_meant(c.order));
        let near =
            |(c, e): &(&Capsule, &Ends)| self.scene.is_near(obstacle.distance_to_segment_m(&e[0], &e[1]), c, 0.0);
        links.find(near).map(|(c, _)| c.name.as_str())
    }

    /// Order of what the arm stands on.
    fn stands(&self) -> usize {
        self.scene.cell.map_or(0, |cell| cell.order)
    }

    fn box_collides(&self, in_still: &[Ends]) -> Option<String> {
        let stands = self.stands();
        let boxes = self.scene.boxes.iter();
        let hit = |(name, obstacle): &(String, OrientedBox)| {
            let link = self.hit(obstacle, in_still, |order| order != stands)?;
            Some(format!("{link} and {name}"))
        };
        boxes.into_iter().find_map(hit)
    }

    fn carried_meets_link(&self, placement: usize) -> Option<String> {
        // What carries them touches them.
        let stands = self.stands();
        let hit = |(name, obstacle): (&str, &OrientedBox)| {
            let link = self.hit(obstacle, &self.ends, |order| order > stands)?;
            Some(format!("{link} and {name}"))
        };
        self.scene.on_base(placement).find_map(hit)
    }

    fn table_collides(&self, in_still: &[Ends]) -> Option<String> {
        let (stands, lowest) = (self.stands(), self.scene.lowest_m());
        let mut links = self.scene.capsules.iter().zip(in_still).filter(|(c, _)| c.order.abs_diff(stands) > FOOT);
        let (link, _) = links.find(|(c, e)| e[0].z.min(e[1].z) - c.radius_m < lowest)?;
        Some(format!("{} and table", link.name))
    }

    fn carried_meets_still(&self, placement: usize, still_from_base: &Pose) -> Option<String> {
        self.scene.cell?;
        let near = |(name, carried): (&str, &OrientedBox)| {
            let other = self.scene.still_near(&carried.placed(still_from_base))?;
            Some(format!("{name} and {other}"))
        };
        self.scene.on_base(placement).find_map(near)
    }

    /// The plate in the hand against table, boxes and all links but the two that carry it.
    fn plate_in_hand_collides(&self, placement: usize, still_from_base: &Pose, in_still: &[Ends]) -> Option<String> {
        let still_from_tip = still_from_base * self.links.last()?;
        let plate = self.scene.plates_in_hand.get(placement)?.placed(&still_from_tip);
        let last = self.scene.outermost();
        if let Some(link) = self.hit(&plate, in_still, |order| order + 1 < last) {
            return Some(format!("{link} and plate"));
        }
        self.scene.still_near(&plate).map(|other| format!("plate and {other}"))
    }
}

/// Pairs of capsules with enough between them to come apart; neighbours touch by construction.
fn compared(capsules: &[Capsule], clearance_m: f64) -> Vec<(usize, usize)> {
    let length = |c: &Capsule| (c.ends_m[1] - c.ends_m[0]).norm();
    let apart = |a: usize, b: usize| {
        let (a, b) = (&capsules[a], &capsules[b]);
        let (low, high) = (a.order.min(b.order), a.order.max(b.order));
        let between: f64 =
            (low + 1..high).map(|o| capsules.iter().filter(|c| c.order == o).map(&length).fold(0.0, f64::max)).sum();
        between > a.radius_m + b.radius_m + clearance_m
    };
    let all = (0..capsules.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
    all.filter(|&(a, b)| apart(a, b)).collect()
}
