#!/usr/bin/env python3
"""Clean worlds of several cameras, series and trackers, made by other code than the program's: what is good is as good as is stated.

usage: python3 benches/worlds.py [FIRST LAST]     (seeds, default 1 40 of each kind; needs numpy; ROBOTCAL names the binary)

Robots of robots/ with errors of 0.3 mm and 1 mrad at every origin and 3 mrad at every zero. "cameras": two of them at the same stops, in
the hand, fixed, or one of each. "several": one to three series, each with a camera in the hand, a fixed one, tracker points, tracker poses
or a ball in sockets, cameras, mountings and boards shared or not. "cells": an arm on a rail, before a positioner, or before a second arm
that carries the board. A world is judged by `identify --at` at 60 joint vectors that were not measured: error of the position of the flange
(of cells in the frame of what carries the board), its mean in the frame of the tip taken off (and without a camera at rest the base that
fits best), over the stated sigma, RMS within the range of the stops.
"""
import csv
import math
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

import made_with
from bodies import ROBOTCAL, rotation, write

ROBOTS = {
    "kuka_kr6_r900": [0, -1.2, 1.4, 0, 0.9, 0],
    "ur10e": [0, -1.6, 1.9, -1.8, -1.57, 0],
    "lbr_iiwa_14": [0, 0.5, 0, -1.4, 0, 1.1, 0],
}
REACH = np.array([0.5, 0.3, 0.3, 0.9, 0.6, 1.5, 1.5])
WIDTH, HEIGHT = 1280, 1024
FEWEST_CORNERS = 20


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0.0]])


def turn(vector):
    angle = np.linalg.norm(vector)
    if angle < 1e-12:
        return np.eye(3) + skew(vector)
    k = skew(np.asarray(vector) / angle)
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def vector_of(rotation):
    angle = math.acos(np.clip((np.trace(rotation) - 1) / 2, -1, 1))
    v = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    return v / 2 if angle < 1e-9 else v * angle / (2 * math.sin(angle))


def rpy(roll, pitch, yaw):
    return turn([0, 0, yaw]) @ turn([0, pitch, 0]) @ turn([roll, 0, 0])


def pose(rotation=np.eye(3), position=(0, 0, 0)):
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = rotation, position
    return m


def quaternion_of(rotation):
    r = rotation
    k = np.array([
        [r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0],
        [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
        [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], 0],
        [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], np.trace(r)],
    ])
    return np.linalg.eigh(k, UPLO="L")[1][:, 3]


def adjoint(m):
    a = np.zeros((6, 6))
    a[:3, :3] = a[3:, 3:] = m[:3, :3]
    a[:3, 3:] = skew(m[:3, 3]) @ m[:3, :3]
    return a


class Chain:
    """The joints between two links of a URDF, with errors."""

    def __init__(self, root, base, tip, rng):
        joints = {j.find("child").get("link"): j for j in root.findall("joint")}
        chain, link = [], tip
        while link != base:
            chain.append(joints[link])
            link = joints[link].find("parent").get("link")
        self.names, self.steps, self.unit = [], [], []
        for joint in reversed(chain):
            origin = joint.find("origin")
            numbers = lambda key: [float(v) for v in ((origin.get(key) if origin is not None else None) or "0 0 0").split()]
            step, axis = pose(rpy(*numbers("rpy")), numbers("xyz")), None
            if joint.get("type") in ("revolute", "continuous", "prismatic"):
                axis = np.array([float(v) for v in joint.find("axis").get("xyz").split()])
                step = step @ pose(turn(rng.normal(0, 1e-3, 3)), rng.normal(0, 3e-4, 3))
                self.names.append(joint.get("name"))
                self.unit.append(0.1 if joint.get("type") == "prismatic" else 1.0)
            self.steps.append((step, axis, joint.get("type") == "prismatic"))
        # Metres of a rail are repeated to ten times better than radians of a joint.
        self.unit = np.array(self.unit)
        self.zeros = rng.normal(0, 3e-3, len(self.names)) * self.unit

    def tip_at(self, readings):
        m, values = np.eye(4), iter(readings + self.zeros)
        for step, axis, slides in self.steps:
            m = m @ step
            if axis is not None:
                by = axis * next(values)
                m = m @ (pose(position=by) if slides else pose(turn(by)))
        return m


def ends(root):
    """Root link and tip of a description."""
    children = {j.find("child").get("link") for j in root.findall("joint")}
    links = [link.get("name") for link in root.findall("link")]
    leaves = set(links) - {j.find("parent").get("link") for j in root.findall("joint")}
    tip = next((t for t in ("tool0", "tool_0", "flange") if t in links), None) or leaves.pop()
    return next(link for link in links if link not in children), tip


class Robot(Chain):
    """An arm of robots/ with errors."""

    def __init__(self, name, rng):
        self.urdf = f"robots/{name}/{name}.urdf"
        root = ElementTree.parse(self.urdf).getroot()
        self.base, self.tip = ends(root)
        super().__init__(root, self.base, self.tip, rng)
        self.middle = np.array(ROBOTS[name])
        self.reach = REACH[: len(self.names)]


LIMIT = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'
RAIL = f"""<r><link name="hall"/><joint name="e1" type="prismatic"><origin xyz="0 0 0.2"/><parent link="hall"/><child link="BASE"/>
<axis xyz="0 1 0"/>{LIMIT}</joint></r>"""
TABLE = f"""<r><link name="cell"/><link name="stand"/><link name="cradle"/><link name="table"/>
<joint name="floor" type="fixed"><parent link="cell"/><child link="BASE"/></joint>
<joint name="foot" type="fixed"><origin xyz="0.75 0.05 0.1"/><parent link="cell"/><child link="stand"/></joint>
<joint name="e1" type="revolute"><parent link="stand"/><child link="cradle"/><axis xyz="0 1 0"/>{LIMIT}</joint>
<joint name="e2" type="revolute"><origin xyz="0 0 0.12"/><parent link="cradle"/><child link="table"/><axis xyz="0 0 1"/>{LIMIT}</joint></r>"""


class Cell:
    """An arm on a rail, before a positioner, or before a second arm that carries the board: the tip as what carries the board sees it."""

    def __init__(self, kind, rng, folder):
        arm = ElementTree.parse("robots/kuka_kr6_r900/kuka_kr6_r900.urdf").getroot()
        (self.base, self.tip), self.manifest = ends(arm), ""
        for element in ElementTree.fromstring({"rail": RAIL, "positioner": TABLE}.get(kind, "<r/>").replace("BASE", self.base)):
            arm.append(element)
        self.base = {"rail": "hall", "positioner": "cell"}.get(kind, self.base)
        self.urdf = str(folder / "cell.urdf")
        ElementTree.ElementTree(arm).write(self.urdf)
        self.first, self.second, self.between = Chain(arm, self.base, self.tip, rng), None, np.eye(4)
        middle, reach = ROBOTS["kuka_kr6_r900"], list(REACH[:6])
        if kind == "rail":
            self.middle, self.reach = np.array([0, *middle]), np.array([0.6, *reach])
        elif kind == "positioner":
            self.second = Chain(arm, "cell", "table", rng)
            self.middle, self.reach = np.array([*middle, 0, 0]), np.array([*reach, 0.5, 1.5])
            self.manifest = '[plate_mount]\nlink = "table"\n'
        else:
            other = Path("robots/ur10e/ur10e.urdf").resolve()
            root = ElementTree.parse(other).getroot()
            base, tip = ends(root)
            self.second = Chain(root, base, tip, rng)
            self.middle = np.array([*middle, *ROBOTS["ur10e"]])
            self.reach = np.array([*reach, 0.2, 0.2, 0.2, 0.5, 0.5, 1.5])
            self.manifest = f'[robot_2]\nurdf = "{other}"\nbase = "{base}"\ntip = "{tip}"\n'
        chains = [c for c in (self.first, self.second) if c is not None]
        # Links of the second arm are called as those of the first, so that all its names get a prefix.
        prefix = "robot_2_" if kind == "two arms" else ""
        self.names = self.first.names + [prefix + n for c in chains[1:] for n in c.names]
        self.unit = np.concatenate([c.unit for c in chains])

    def ends_at(self, readings):
        """Tip of the arm, and what carries the board, each in the frame of its base."""
        n = len(self.first.names)
        return self.first.tip_at(readings[:n]), np.eye(4) if self.second is None else self.second.tip_at(readings[n:])

    def tip_at(self, readings):
        tip, board = self.ends_at(readings)
        return np.linalg.inv(self.between @ board) @ tip


class Camera:
    """A camera with the lens of Brown."""

    def __init__(self, rng):
        focal = WIDTH / 2 / math.tan(math.radians(rng.choice([45, 60, 80])) / 2)
        self.focal, self.centre = focal * (1 + rng.normal(0, 3e-3, 2)), [WIDTH, HEIGHT] / np.array(2.0) + rng.normal(0, 8, 2)
        self.lens = [rng.normal(-0.1, 0.05), rng.normal(0.03, 0.02), *rng.normal(0, 5e-4, 2)]

    def see(self, camera_from_board, board, sigma, rng):
        """Corners by their number, px; none where too few are seen."""
        points = board.corners @ camera_from_board[:3, :3].T + camera_from_board[:3, 3]
        middle, normal = camera_from_board[:3, 3], camera_from_board[:3, 2]
        far = np.linalg.norm(middle)
        if not 0.1 < far < 1.2 or normal @ middle > -0.45 * far or points[:, 2].min() < 0.05:
            return {}
        x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
        square, (k1, k2, p1, p2) = x * x + y * y, self.lens
        radial = 1 + k1 * square + k2 * square * square
        u = self.focal[0] * (x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x)) + self.centre[0]
        v = self.focal[1] * (y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y) + self.centre[1]
        inside = (u > 8) & (u < WIDTH - 8) & (v > 8) & (v < HEIGHT - 8) & (square < 1.2)
        seen = {int(i): (u[i] + rng.normal(0, sigma), v[i] + rng.normal(0, sigma)) for i in np.flatnonzero(inside)}
        return seen if len(seen) >= FEWEST_CORNERS else {}


class Board:
    """12 x 9 corners, 25 mm apart, each off by `error` per axis."""

    def __init__(self, rng, error):
        self.error = error
        self.nominal = np.array([[(c - 5.5) * 0.025, (4 - r) * 0.025, 0] for r in range(9) for c in range(12)])
        self.corners = self.nominal + rng.normal(0, 1, self.nominal.shape) * error
        a, b = self.nominal - self.nominal.mean(0), self.corners - self.corners.mean(0)
        u, _, vt = np.linalg.svd(a.T @ b)
        rotation = vt.T @ np.diag([1, 1, np.linalg.det(vt.T @ u.T)]) @ u.T
        self.frame = pose(rotation, self.corners.mean(0) - rotation @ self.nominal.mean(0))

    def write(self, folder):
        kind = f'format = 1\nkind = "points"\nmarkers = "plate.csv"\ntolerance_m = {max(self.error, 1e-6)}\n'
        (folder / "plate.toml").write_text(kind)
        write(folder / "plate.csv", ["id", "x_m", "y_m", "z_m"], [[i, *p] for i, p in enumerate(self.nominal)])


def looking(rng, distance):
    """camera_from_board of a board in front of a camera."""
    return pose(rpy(math.pi + rng.normal(0, 0.1), rng.normal(0, 0.1), rng.uniform(-3, 3)), [*rng.normal(0, 0.02, 2), distance])


def carried(rng):
    return pose(rpy(*rng.normal(0, 0.2, 2), rng.uniform(-3, 3)), [*rng.normal(0, 0.04, 2), 0.07])


class World:
    """A robot with its noise, and what files of a series have in common."""

    def __init__(self, seed, folder, robot=None):
        self.rng = np.random.default_rng(seed)
        self.robot = robot(self.rng) if robot else Robot(self.rng.choice(list(ROBOTS)), self.rng)
        self.sigma_px = self.rng.choice([0.02, 0.05, 0.2])
        self.joint_noise = self.rng.choice([0, 2e-5, 1e-4, 5e-4])
        self.board_error = self.rng.choice([0, 3e-5, 1e-4])
        self.folder = folder

    def stop(self, middle, wider=1.0):
        """Readings, and where the tip truly is."""
        readings = middle + self.rng.uniform(-1, 1, len(middle)) * self.robot.reach * wider
        return readings, self.robot.tip_at(readings + self.rng.normal(0, 1, len(middle)) * self.joint_noise * self.robot.unit)

    def write(self, folder, key, names, readings, manifest):
        write(folder / "joints.csv", [key, *self.robot.names], [[n, *q] for n, q in zip(names, readings)])
        ends = f'format = 1\njoint_unit = "rad"\nbase = "{self.robot.base}"\ntip = "{self.robot.tip}"\n'
        (folder / "series.toml").write_text(ends + manifest)

    def observations(self, folder, rows):
        square = self.sigma_px**2
        head = ["image", "marker", "u", "v", "cov_uu", "cov_uv", "cov_vv"]
        write(folder / "observations.csv", head, [[*row, square, 0, square] for row in rows])

    def judged(self, series, middle, stills, base_is_fitted=False):
        """Error over stated sigma, and the verdict."""
        readings = [middle + self.rng.uniform(-1, 1, len(middle)) * self.robot.reach for _ in range(60)]
        asked, out = self.folder / "at_in.csv", self.folder / "out"
        write(asked, self.robot.names, readings)
        command = [ROBOTCAL, "identify", "--urdf", self.robot.urdf, "--out", str(out), "--at", str(asked), "--at-unit", "rad"]
        done = subprocess.run(command + [p for s in series for p in ("--series", str(s))], capture_output=True, text=True)
        said = next((l for l in (done.stdout + done.stderr).splitlines() if l.startswith(("verdict", "error"))), "")
        if not (out / "at.csv").exists():
            return None, said
        with open(out / "at.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        found = [pose(rotation([float(r[k]) for k in ("qx", "qy", "qz", "qw")]), [float(r[k]) for k in ("x_m", "y_m", "z_m")]) for r in rows]
        stated = np.array([sum(float(r[f"c{k}{k}"]) for k in (1, 2, 3)) for r in rows])
        inside = np.array([not r["outside"].strip() for r in rows])
        inside = inside if inside.sum() > 5 else np.ones(len(rows), bool)
        errors = [misses([np.linalg.inv(s) @ self.robot.tip_at(q) for q in readings], found, inside, base_is_fitted) for s in stills]
        return min(errors) / math.sqrt(stated[inside].mean()), said


def misses(true, found, inside, base_is_fitted):
    """RMS error of the position, m."""
    at = np.flatnonzero(inside)
    base, tool = np.eye(4), np.eye(4)
    for _ in range(60 if base_is_fitted else 1):
        twists = []
        for i in at:
            off = np.linalg.inv(base @ true[i] @ tool) @ found[i]
            twists.append(np.r_[off[:3, 3], vector_of(off[:3, :3])])
        if not base_is_fitted:
            break
        by = np.vstack([np.c_[np.eye(6), adjoint(np.linalg.inv(base @ true[i] @ tool))] for i in at])
        x = np.linalg.lstsq(by, np.concatenate(twists), rcond=None)[0]
        tool, base = tool @ pose(turn(x[3:6]), x[:3]), pose(turn(x[9:]), x[6:9]) @ base
    positions = np.array(twists)[:, :3]
    return math.sqrt(((positions - positions.mean(0)) ** 2).sum(1).mean())


def cameras(seed, folder):
    """Two cameras at the same stops."""
    world = World(seed, folder)
    rng, robot, inverse = world.rng, world.robot, np.linalg.inv
    mounts = [("hand", "hand"), ("fixed", "fixed"), ("hand", "fixed")][rng.integers(3)]
    board = Board(rng, 0 if mounts[0] != mounts[1] else world.board_error)
    board.write(folder)
    lenses = [Camera(rng) for _ in mounts]
    tip = robot.tip_at(robot.middle)
    on_tip, in_cell, poses = carried(rng), None, []
    for k, mount in enumerate(mounts):
        if mount == "fixed":
            aside = tip @ on_tip @ pose(turn([0.5 * k, 0, 0])) @ inverse(tip @ on_tip)
            poses.append(aside @ tip @ on_tip @ inverse(looking(rng, 0.55)))
        elif in_cell is None:
            poses.append(carried(rng))
            in_cell = tip @ poses[0] @ looking(rng, 0.38)
        else:
            poses.append(inverse(tip) @ in_cell @ inverse(looking(rng, 0.45)))
    readings, images, seen = [], [], []
    for _ in range(20000):
        if len(readings) == (wanted := [15, 25, 40][seed % 3]):
            break
        q, tip = world.stop(robot.middle)
        views = [
            lens.see(inverse(tip @ p) @ in_cell if mount == "hand" else inverse(p) @ tip @ on_tip, board, world.sigma_px, rng)
            for lens, mount, p in zip(lenses, mounts, poses)
        ]
        if any(views):
            for k, view in enumerate(views):
                if view:
                    image = f"cam{k}_{len(readings):03}.png"
                    images.append([f"{len(readings):03}", f"cam{k}", image])
                    seen += [[image, corner, *uv] for corner, uv in view.items()]
            readings.append(q)
    write(folder / "images.csv", ["stop", "camera", "image"], images)
    world.observations(folder, seen)
    manifest = 'plate = "plate.toml"\n[observations]\npoint = "centre"\n' + "".join(
        f'[[camera]]\nname = "cam{k}"\nmount = "{m}"\nwidth_px = {WIDTH}\nheight_px = {HEIGHT}\n' for k, m in enumerate(mounts)
    )
    world.write(folder, "stop", [f"{i:03}" for i in range(len(readings))], readings, manifest)
    stills = [p for p, m in zip(poses, mounts) if m == "fixed"] + ([in_cell @ board.frame] if in_cell is not None else [])
    words = f"{robot.urdf.split('/')[1]}, cameras {' and '.join(mounts)}, {len(readings)} of {wanted} stops"
    return *world.judged([folder], robot.middle, stills), words


def in_sockets(world, middle, count):
    """Readings with a ball in four sockets, up to a noise of 0.05 mm, and the socket of each."""
    ball, rng, robot = np.array([0.02, -0.03, 0.11, 1.0]), world.rng, world.robot
    readings, sockets = [], []
    for socket in range(4):
        place = (robot.tip_at(middle + rng.uniform(-1, 1, len(middle)) * robot.reach) @ ball)[:3]
        while sockets.count(socket) < max(5, count // 4):
            q = middle + rng.uniform(-1, 1, len(middle)) * robot.reach * 1.3
            errors, wanted = rng.normal(0, 1, len(q)) * world.joint_noise, place + rng.normal(0, 5e-5, 3)
            at = lambda q: (robot.tip_at(q + errors) @ ball)[:3]
            for _ in range(50):
                missing = wanted - at(q)
                by = np.array([(at(q + h) - at(q - h)) / 2e-6 for h in 1e-6 * np.eye(len(q))]).T
                step = np.linalg.pinv(by) @ missing
                q = q + step * min(1.0, 0.2 / max(np.abs(step).max(), 1e-12))
            if np.linalg.norm(wanted - at(q)) < 1e-9 and np.abs(q - middle).max() < 2.5:
                readings.append(q)
                sockets.append(socket)
    return readings, sockets


def taken(world, camera, middle, view, bounds):
    """Readings of the stops at which the camera sees the board, whose pose before it is view(tip), and what it sees there."""
    (lens, board), (wanted, most) = camera, bounds
    readings, seen = [], []
    for _ in range(most):
        q, tip = world.stop(middle)
        corners = lens.see(view(tip), board, world.sigma_px, world.rng)
        if corners:
            seen += [[f"{len(readings):03}.png", corner, *uv] for corner, uv in corners.items()]
            readings.append(q)
        if len(readings) == wanted:
            break
    return readings, seen


def several(seed, folder):
    """One to three series of one robot."""
    world = World(1000 + seed, folder)
    rng, robot, inverse = world.rng, world.robot, np.linalg.inv
    kinds = [k for k in rng.choice(["hand", "fixed", "points", "poses", "sockets", ""], rng.integers(1, 4)) if k] or ["hand"]
    one_camera, one_board = rng.integers(2), rng.integers(2)
    one_mounting = one_camera and rng.integers(2)
    lens = board = on_flange = tracker = None
    stills, paths, first = [], [], None
    for k, kind in enumerate(kinds):
        path = folder / f"series_{k}"
        path.mkdir()
        paths.append(path)
        middle = robot.middle + rng.uniform(-1, 1, len(robot.middle)) * np.array([1.2, 0.15, 0.15, 0.3, 0.2, 1, 0.5])[: len(robot.middle)]
        first = middle if first is None else first
        count, tip = int(rng.choice([12, 20, 30])), robot.tip_at(middle)
        if kind in ("hand", "fixed"):
            if lens is None or not one_camera:
                lens, name = Camera(rng), f"camera {k}"
            if board is None or not one_board:
                board = Board(rng, world.board_error)
            board.write(path)
            if on_flange is None or not one_mounting:
                on_flange = carried(rng)
            if kind == "hand":
                standing = tip @ on_flange @ looking(rng, 0.38)
                view, still = (lambda t: inverse(t @ on_flange) @ standing), standing @ board.frame
            else:
                held = carried(rng)
                still = tip @ held @ inverse(looking(rng, 0.55))
                view = lambda t: inverse(still) @ t @ held
            stills = stills or [still]
            readings, seen = taken(world, (lens, board), middle, view, (count, 20000))
            world.observations(path, seen)
            mounting = 'mounting = "same"\n' if one_mounting and kind == "hand" else ""
            manifest = (
                f'camera_mount = "{kind}"\nplate = "plate.toml"\n[camera]\nname = "{name}"\n{mounting}'
                f'width_px = {WIDTH}\nheight_px = {HEIGHT}\n[observations]\npoint = "centre"\n'
            )
            world.write(path, "image", [f"{i:03}.png" for i in range(len(readings))], readings, manifest)
            continue
        if kind == "sockets":
            readings, sockets = in_sockets(world, middle, count)
            write(path / "contacts.csv", ["stop", "contact"], [[f"{i:03}", f"socket {s}"] for i, s in enumerate(sockets)])
            manifest = "[contact]\nsigma_m = 0.00005\n"
        else:
            if tracker is None or rng.integers(2):
                tracker, name_of_tracker = pose(turn(rng.normal(0, 1, 3)), rng.normal(0, 2, 3)), f"tracker {k}"
            targets = [pose(turn(rng.normal(0, 1, 3)), rng.normal(0, 0.08, 3)) for _ in range(rng.integers(1, 4) if kind == "points" else 1)]
            readings, rows = [], []
            for i in range(2 * count):
                q, t = world.stop(middle, 1.3)
                readings.append(q)
                for b, target in enumerate(targets):
                    m = inverse(tracker) @ t @ target
                    position = m[:3, 3] + rng.normal(0, 3e-5, 3)
                    turned = quaternion_of(m[:3, :3] @ turn(rng.normal(0, 1e-4, 3))) if kind == "poses" else []
                    rows.append([f"{i:03}", f"target {k} {b}", *position, *turned])
            head = ["stop", "target", "x_m", "y_m", "z_m"] + (["qx", "qy", "qz", "qw"] if kind == "poses" else [])
            write(path / f"{kind}.csv", head, rows)
            manifest = f'[tracker]\nname = "{name_of_tracker}"\nsigma_m = 0.00003\nsigma_rad = 0.0001\n'
        world.write(path, "stop", [f"{i:03}" for i in range(len(readings))], readings, manifest)
    words = f"{robot.urdf.split('/')[1]}, series of {', '.join(kinds)}"
    if stills:
        return *world.judged(paths, first, stills), words
    return *world.judged(paths, first, [np.eye(4)] + ([tracker] if tracker is not None else []), True), words


def cells(seed, folder):
    """A camera in the hand of an arm that does not stand alone."""
    kind = ["rail", "positioner", "two arms"][seed % 3]
    world = World(2000 + seed, folder, lambda rng: Cell(kind, rng, folder))
    rng, cell, inverse = world.rng, world.robot, np.linalg.inv
    board, lens, hand = Board(rng, world.board_error), Camera(rng), carried(rng)
    board.write(folder)
    tip, carrier = cell.ends_at(cell.middle)
    if kind == "two arms":
        held = carried(rng)
        cell.between = tip @ hand @ looking(rng, 0.4) @ inverse(carrier @ held)
    else:
        held = inverse(carrier) @ tip @ hand @ looking(rng, 0.4)
    wanted = int(rng.choice([24, 40]))
    readings, seen = taken(world, (lens, board), cell.middle, lambda tip: inverse(tip @ hand) @ held, (wanted, 60000))
    world.observations(folder, seen)
    manifest = (
        'camera_mount = "hand"\nplate = "plate.toml"\n[camera]\nname = "hand"\n'
        f'width_px = {WIDTH}\nheight_px = {HEIGHT}\n[observations]\npoint = "centre"\n{cell.manifest}'
    )
    world.write(folder, "image", [f"{i:03}.png" for i in range(len(readings))], readings, manifest)
    words = f"{kind}, {len(readings)} of {wanted} stops"
    return *world.judged([folder], cell.middle, [np.eye(4)], True), words


def main():
    made_with.say(ROBOTCAL)
    first, last = (int(v) for v in sys.argv[1:3]) if len(sys.argv) > 2 else (1, 40)
    for kind in (cameras, several, cells):
        ratios = []
        for seed in range(first, last + 1):
            with tempfile.TemporaryDirectory() as folder:
                ratio, said, words = kind(seed, Path(folder))
            print(f"{kind.__name__} {seed}: {'no result' if ratio is None else f'{ratio:.2f}'}; {words}; {said.strip()}", flush=True)
            if ratio is not None and "NOT" not in said:
                ratios.append(ratio)
        rms = math.sqrt(np.mean(np.square(ratios)))
        print(f"{kind.__name__}: {len(ratios)} of {last + 1 - first} good, error over stated sigma {rms:.2f} RMS, at most {max(ratios):.2f}")


if __name__ == "__main__":
    main()
