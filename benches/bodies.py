#!/usr/bin/env python3
"""Trackers and contacts of real robots: what `robotcal identify` reaches on measurements that it has not seen.

usage: python3 benches/bodies.py FOLDER     (FOLDER holds mukca-*, ur10-A, nachi-* and tracker-nachi-2025-01-15.csv; needs numpy)

The corrected robot (`show --at`: URDF with compensation.toml) is judged alone: on unseen sockets the ball and the places are fitted
again, on unseen tracker points the frame of the tracker and the reflector. RMS of lengths, mm. ROBOTCAL names the binary.
"""
import csv
import os
import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import made_with

ROBOTCAL = os.environ.get("ROBOTCAL", "target/release/robotcal")
DRAWS = int(os.environ.get("DRAWS", "5"))


def read(path):
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], rows[1:]


def write(path, head, rows):
    with open(path, "w", newline="") as file:
        csv.writer(file).writerows([head] + rows)


def identify(urdf, series, out):
    command = [ROBOTCAL, "identify", "--urdf", str(urdf), "--out", str(out)]
    command += [part for folder in series for part in ("--series", str(folder))]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode > 1:
        sys.exit(done.stderr)
    return out / "solution.json"


def rotation(q):
    x, y, z, w = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


def poses(solution, joints, readings):
    """Rotations and positions of the tip at readings, rad."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / "at.in.csv", joints, readings)
        command = [ROBOTCAL, "show", str(solution), "--at", f"{folder}/at.in.csv", "--at-unit", "rad", "--out", folder]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode > 1:
            sys.exit(done.stderr)
        head, rows = read(Path(folder) / "at.csv")
    columns = [head.index(name) for name in ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")]
    values = np.array([[float(row[c]) for c in columns] for row in rows])
    return np.array([rotation(q) for q in values[:, 3:]]), values[:, :3]


def sockets_mm(tips, contacts):
    """RMS about the sockets, the ball and the places fitted."""
    names = sorted(set(contacts))
    rows = []
    for turn, contact in zip(tips[0], contacts):
        row = np.zeros((3, 3 + 3 * len(names)))
        row[:, :3] = turn
        at = 3 + 3 * names.index(contact)
        row[:, at:at + 3] = -np.eye(3)
        rows.append(row)
    matrix, right = np.vstack(rows), -tips[1].reshape(-1)
    residual = (matrix @ np.linalg.lstsq(matrix, right, rcond=None)[0] - right).reshape(-1, 3)
    return 1e3 * np.sqrt((residual**2).sum(1).mean())


def points_mm(tips, points):
    """RMS of tracker points, the frame of the tracker and the reflector fitted."""
    turns, positions = tips
    reflector = np.zeros(3)
    for _ in range(500):
        carried = positions + turns @ reflector
        u, _, v = np.linalg.svd((points - points.mean(0)).T @ (carried - carried.mean(0)))
        turn = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
        matrix = np.vstack([np.hstack([np.eye(3), turn @ own]) for own in turns])
        found = np.linalg.lstsq(matrix, (points - positions @ turn.T).reshape(-1), rcond=None)[0]
        moved, reflector = np.linalg.norm(found[3:] - reflector), found[3:]
        if moved < 1e-10:
            break
    residual = points - ((positions + turns @ reflector) @ turn.T + found[:3])
    return 1e3 * np.sqrt((residual**2).sum(1).mean())


def sockets(folder, work):
    """One place left out in turn; then trained on one place, mean over the others."""
    head, joints = read(folder / "joints.csv")
    contact_head, contacts = read(folder / "contacts.csv")
    contact_of = {row[0]: row[1] for row in contacts}
    place_of = {stop: contact.split("/")[0] for stop, contact in contact_of.items()}
    places = sorted(set(place_of.values()))
    settings = (folder / "series.toml").read_text().split("[[distance]]")

    def trained(chosen):
        run = work / "run"
        shutil.rmtree(run, ignore_errors=True)
        run.mkdir(parents=True)
        write(run / "joints.csv", head, [row for row in joints if place_of[row[0]] in chosen])
        write(run / "contacts.csv", contact_head, [row for row in contacts if place_of[row[0]] in chosen])
        known = [part for part in settings[1:] if any(f'"{place}/' in part for place in chosen)]
        (run / "series.toml").write_text("[[distance]]".join([settings[0]] + known))
        return identify(folder / "robot.urdf", [run], work / "out")

    def judged(solution, place):
        rows = [row for row in joints if place_of[row[0]] == place]
        return sockets_mm(poses(solution, head[1:], [row[1:] for row in rows]), [contact_of[row[0]] for row in rows])

    others = lambda place: [other for other in places if other != place]
    left_out = [judged(trained(others(place)), place) for place in places]
    single = []
    for place in places:
        solution = trained([place])
        single.append(np.mean([judged(solution, other) for other in others(place)]))
    each = ", ".join(f"{mm:.2f}" for mm in left_out)
    print(f"{folder.name}: left out {np.mean(left_out):.3f} ({each}); of single places {np.mean(single):.3f}", flush=True)


def tracker_poses(folder, work, count=60):
    """Some poses spread over the series, then neighbouring ones; judged on every tenth of the rest."""
    head, joints = read(folder / "joints.csv")
    pose_head, measured = read(folder / "poses.csv")
    place = {row[0]: [float(x) for x in row[2:5]] for row in measured}
    time = head.index("time_s")
    joints.sort(key=lambda row: float(row[time]))
    columns = [k for k, name in enumerate(head) if name.endswith("_joint")]

    def judged(chosen):
        run = work / "run"
        shutil.rmtree(run, ignore_errors=True)
        run.mkdir(parents=True)
        stops = {joints[k][0] for k in chosen}
        write(run / "joints.csv", head, [joints[k] for k in sorted(chosen)])
        write(run / "poses.csv", pose_head, [row for row in measured if row[0] in stops])
        shutil.copy(folder / "series.toml", run)
        solution = identify(folder / "robot.urdf", [run], work / "out")
        rest = [row for k, row in enumerate(joints) if k not in chosen][::10]
        tips = poses(solution, [head[k] for k in columns], [[row[k] for k in columns] for row in rest])
        return points_mm(tips, np.array([place[row[0]] for row in rest]))

    spread = []
    for draw in range(DRAWS):
        random.seed(draw)
        spread.append(judged(set(random.sample(range(len(joints)), count))))
    near = [judged(set(range(first, first + count))) for first in (3000, 6000, 9000)]
    words = lambda all: ", ".join(f"{mm:.3f}" for mm in all)
    print(f"{folder.name}: {count} spread {np.mean(spread):.3f} ({words(spread)}); neighbours {words(near)}", flush=True)


def images_and_points(real, work, count=10):
    """A few tracker points beside the images of one series, judged on the other points."""
    head, points = read(real / "tracker-nachi-2025-01-15.csv")
    joints = head[3:]
    series = ["nachi-2025-01-17", "nachi-2025-02-04", "nachi-2025-02-19"]
    urdf = real / series[0] / "robot.urdf"
    ends = [line for line in (real / series[0] / "series.toml").read_text().splitlines() if line.startswith(("base", "tip"))]
    of_images = {name: identify(urdf, [real / name], work / name) for name in series}
    sums = {}
    for draw in range(DRAWS):
        random.seed(draw)
        chosen = set(random.sample(range(len(points)), count))
        run = work / "points"
        shutil.rmtree(run, ignore_errors=True)
        run.mkdir(parents=True)
        write(run / "joints.csv", ["stop"] + joints, [[f"p{k}"] + points[k][3:] for k in sorted(chosen)])
        write(run / "points.csv", ["stop", "target", "x_m", "y_m", "z_m"], [[f"p{k}", "ndi"] + points[k][:3] for k in sorted(chosen)])
        settings = ["format = 1", 'joint_unit = "rad"', *ends, "[robot]", 'order = "unknown"', "[tracker]", 'name = "ndi"', "sigma_m = 0.0001"]
        (run / "series.toml").write_text("\n".join(settings) + "\n")
        rest = [row for k, row in enumerate(points) if k not in chosen]
        seen = np.array([[float(x) for x in row[:3]] for row in rest])
        judged = lambda solution: points_mm(poses(solution, joints, [row[3:] for row in rest]), seen)
        sums.setdefault("points alone", []).append(judged(identify(urdf, [run], work / "out")))
        for name in series:
            sums.setdefault(f"{name} images alone", []).append(judged(of_images[name]))
            sums.setdefault(f"{name} both", []).append(judged(identify(urdf, [real / name, run], work / "out")))
    for name, errors in sums.items():
        print(f"{name}: {np.mean(errors):.3f} ({', '.join(f'{mm:.3f}' for mm in errors)})", flush=True)


def main():
    made_with.say(ROBOTCAL)
    real = Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as work:
        for name in ("mukca-panda_1", "mukca-panda_3", "mukca-dinova_1"):
            sockets(real / name, Path(work))
        tracker_poses(real / "ur10-A", Path(work))
        images_and_points(real, Path(work))


if __name__ == "__main__":
    main()
