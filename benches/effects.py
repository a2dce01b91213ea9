#!/usr/bin/env python3
"""Worlds in which robot, plate or camera do what a model may not have: what is good is still as good as is stated, or is not called good.

usage: python3 benches/effects.py [SEEDS [EFFECT ..]]     (default 6 seeds of every effect; needs numpy; ROBOTCAL names the binary)

One camera, in the hand or fixed, 40 stops, 0.05 px, joint noise of 0.02 or 0.1 mrad, errors of the robot and judgement as in worlds.py. What
repeats belongs to the true robot by which a world is judged; what differs from stop to stop does not.
"""
import json
import math
import sys
import tempfile
from pathlib import Path

import numpy as np

import made_with
from bodies import ROBOTCAL
from worlds import HEIGHT, WIDTH, Board, Camera, World, carried, looking, pose, turn

STOPS = 40
# Falls to 1/e within so many stops.
WARM_UP = 10


def gear(readings):
    readings[3] *= 1.002


def eccentric(readings):
    readings[1] += 5e-4 * math.sin(readings[1] + 0.7)
    readings[3] += 8e-4 * math.cos(readings[3])


def ripple(readings):
    readings[1] += 4e-4 * math.sin(20 * readings[1])
    readings[2] += 4e-4 * math.sin(20 * readings[2] + 1)


def bent(tip_at):
    """Joints 2 and 3 give way with the reach of the arm, 0.6 and 0.3 mrad a metre."""

    def bent_tip(readings):
        reach = np.hypot(*tip_at(readings)[:2, 3])
        return tip_at(readings + reach * np.array([0, 6e-4, 3e-4] + [0] * (len(readings) - 3)))

    return bent_tip


def on_weak_base(tip_at):
    """The base tilts by 1 mrad for a metre of reach."""

    def tilted_tip(readings):
        tip = tip_at(readings)
        return pose(turn([-1e-3 * tip[1, 3], 1e-3 * tip[0, 3], 0])) @ tip

    return tilted_tip


def after(change):
    """The arm whose joints stand elsewhere than they read."""

    def of(tip_at):
        def tip(readings):
            readings = readings.copy()
            change(readings)
            return tip_at(readings)

        return tip

    return of


# What repeats: the arm with it, from the arm without.
ARMS = {
    "gear ratio off by 0.2 %": after(gear),
    "eccentric gears": after(eccentric),
    "ripple of gears, 20 a turn": after(ripple),
    "joints give way": bent,
    "base gives way": on_weak_base,
}

# Errors of the joints at stop k, rad.
JOINTS = {
    "backlash": lambda q, k, rng: 3e-4 * np.sign(np.sin(7 * q + 3 * k)) * (np.arange(len(q)) % 3 == 1),
    "zeros drift by 0.6 mrad": lambda q, k, rng: 6e-4 * (k / STOPS - 0.5) * (-1.0) ** np.arange(len(q)),
    "arm not at rest at 3 of 10 stops": lambda q, k, rng: rng.normal(0, 2e-3, len(q)) * (rng.random() < 0.3),
    "readings to 0.1 degree": lambda q, k, rng: q - np.deg2rad(np.round(np.rad2deg(q), 1)),
}

# Displacement of the plate (or of a fixed camera) and of the camera on its mount (or of the plate in the hand) at stop k.
BODIES = {
    "plate creeps by 0.3 mm": (lambda k, up: pose(position=[3e-4 * k / STOPS, 0, 0]), None),
    "camera creeps by 0.4 mm": (None, lambda k, up: pose(position=[0, 0, 4e-4 * (1 - math.exp(-k / WARM_UP))])),
    "camera bends by 0.5 mrad": (None, lambda k, up: pose(turn(5e-4 * np.cross([0, 0, 1.0], up)))),
}

# Relative change of the focal length, and displacement of the centre, px.
CAMERAS = {
    "autofocus, 0.2 %": lambda k, rng: (rng.normal(0, 2e-3), [0, 0]),
    "focal length drifts by 0.2 %": lambda k, rng: (2e-3 * (1 - math.exp(-k / WARM_UP)), [0, 0]),
    "stabiliser, 1.5 px": lambda k, rng: (0, rng.normal(0, 1.5, 2)),
    "centre drifts by 1.5 px": lambda k, rng: (0, [1.5 * k / STOPS, 0.5 * k / STOPS]),
}

# Corners as they are from where the file has them.
PLATES = {
    "plate bent by 0.5 mm": lambda x: x + np.outer(5e-4 * (x**2).sum(1) / (x**2).sum(1).max(), [0, 0, 1]),
    "plate 0.2 % longer than wide": lambda x: x * [1.002, 1, 1],
    "plate 0.3 % larger": lambda x: x * 1.003,
}

# What the images have of the corners, px.
CORNERS = {
    "rows of pixels shear by 1 mrad": lambda u, v: (u + 1e-3 * v, v),
    "corners in whole pixels": lambda u, v: (round(u), round(v)),
}

EFFECTS = ["none", *ARMS, *JOINTS, *BODIES, *CAMERAS, *PLATES, *CORNERS]


def world(effect, seed, folder):
    """Error over stated sigma, the verdict, and the codes of what was found."""
    rng, world = np.random.default_rng(777 + seed), World(5000 + seed, folder)
    world.sigma_px, world.joint_noise = 0.05, [2e-5, 1e-4][seed % 2]
    board, camera, inverse = Board(world.rng, 0), Camera(world.rng), np.linalg.inv
    robot, is_fixed = world.robot, seed % 3 == 2
    board.corners = PLATES.get(effect, lambda x: x)(board.corners)
    board.write(folder)
    on_tip = carried(world.rng)
    tip = robot.tip_at(robot.middle)
    still = tip @ on_tip @ (inverse(looking(world.rng, 0.55)) if is_fixed else looking(world.rng, 0.38))
    robot.tip_at = ARMS.get(effect, lambda tip_at: tip_at)(robot.tip_at)
    readings, seen = [], []
    while len(readings) < STOPS:
        k = len(readings)
        q = robot.middle + world.rng.uniform(-1, 1, len(robot.middle)) * robot.reach
        errors = JOINTS.get(effect, lambda *_: 0)(q, k, rng) + rng.normal(0, 1, len(q)) * world.joint_noise
        tip = robot.tip_at(q + errors)
        of_still, of_carried = BODIES.get(effect, (None, None))
        own = on_tip @ of_carried(k, -(tip @ on_tip)[2, :3]) if of_carried else on_tip
        stands = still @ of_still(k, None) if of_still else still
        changed = Camera.__new__(Camera)
        focal, centre = CAMERAS.get(effect, lambda *_: (0, [0, 0]))(k, rng)
        changed.focal, changed.centre, changed.lens = camera.focal * (1 + focal), np.add(camera.centre, centre), camera.lens
        view = inverse(stands) @ tip @ own if is_fixed else inverse(tip @ own) @ stands
        corners = changed.see(view, board, world.sigma_px, rng)
        if corners:
            shown = CORNERS.get(effect, lambda u, v: (u, v))
            seen += [[f"{k:03}.png", corner, *shown(*uv)] for corner, uv in corners.items()]
            readings.append(q)
    world.observations(folder, seen)
    manifest = (
        f'camera_mount = "{"fixed" if is_fixed else "hand"}"\nplate = "plate.toml"\n[camera]\n'
        f'width_px = {WIDTH}\nheight_px = {HEIGHT}\n[observations]\npoint = "centre"\n'
    )
    world.write(folder, "image", [f"{k:03}.png" for k in range(STOPS)], readings, manifest)
    ratio, said = world.judged([folder], robot.middle, [still])
    solution = folder / "out" / "solution.json"
    found = json.loads(solution.read_text())["findings"] if solution.exists() else []
    return ratio, said, {f["code"] for f in found} - {"joint_beyond_limits"}


def main():
    made_with.say(ROBOTCAL)
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 6
    print("| effect | good | error over stated sigma of these, RMS | at most | found |\n|---|---|---|---|---|")
    for effect in sys.argv[2:] or EFFECTS:
        ratios, codes = [], {}
        for seed in range(seeds):
            with tempfile.TemporaryDirectory() as folder:
                ratio, said, found = world(effect, seed, Path(folder))
            for code in found:
                codes[code] = codes.get(code, 0) + 1
            if ratio is not None and "NOT" not in said:
                ratios.append(ratio)
        size = f"{math.sqrt(np.mean(np.square(ratios))):.2f} | {max(ratios):.2f}" if ratios else "- | -"
        words = ", ".join(f"`{code}` {count}" for code, count in sorted(codes.items(), key=lambda item: -item[1]))
        print(f"| {effect} | {len(ratios)} of {seeds} | {size} | {words} |", flush=True)


if __name__ == "__main__":
    main()
