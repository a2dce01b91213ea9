#!/usr/bin/env python3
"""Camera and poses on the same corners: robotcal beside cv2.calibrateCamera + cv2.solvePnP and mrcal, in one run.

usage: peers_camera.py ROBOTCAL WORKDIR FOLDER_OF_SERIES SERIES...

The corners are those that `robotcal detect` finds. Every fourth corner, (marker + 7 image) % 4 == 0, is left out of the calibration; each
program calibrates on the rest, camera and a pose for every image, and predicts what was left out. Printed: held-out reprojection error
(RMS per point, px), fx, seconds. Programs that cannot be imported are left out of the table; images with fewer than 8 corners take no part.
"""
import csv
import json
import os
import shutil
import subprocess
import sys
import time
import tomllib

import numpy as np

import made_with

try:
    import cv2
    cv2.setNumThreads(1)
except ImportError:
    cv2 = None
try:
    import mrcal
except ImportError:
    mrcal = None


def aside(image, marker):
    return (marker + 7 * image) % 4 == 0


def corners(program, series, work):
    """Markers of the plate (id -> x, y, z) and, for every image, (id, u, v)."""
    subprocess.run([program, "detect", "--series", series, "--out", work], check=True, capture_output=True)
    rows = list(csv.DictReader(open(os.path.join(work, "observations.csv"))))
    plate = tomllib.load(open(os.path.join(series, "plate.toml"), "rb"))
    columns, pitch = plate["columns"], plate["pitch_m"]
    size = None
    images = {}
    for r in rows:
        if r.get("reason"):
            continue
        images.setdefault(r["image"], []).append((int(r["marker"]), float(r["u"]), float(r["v"])))
    rows_down = plate["rows"]
    place = lambda m: ((m % columns - (columns - 1) / 2) * pitch, ((rows_down - 1) / 2 - m // columns) * pitch, 0.0)
    return place, {k: v for k, v in sorted(images.items()) if len(v) >= 8}, size


def split(place, images):
    kept, left = [], []
    for i, seen in enumerate(images.values()):
        for part, want in ((kept, False), (left, True)):
            own = [s for s in seen if aside(i, s[0]) == want]
            part.append((np.array([place(s[0]) for s in own]).reshape(-1, 3), np.array([s[1:] for s in own]).reshape(-1, 2)))
    return kept, left


def rms(errors):
    errors = np.concatenate(errors)
    return float(np.sqrt((errors ** 2).sum(axis=1).mean()))


def by_opencv(kept, left, size, flags):
    start = time.time()
    points = [k[0].astype(np.float32) for k in kept]
    pixels = [k[1].astype(np.float32).reshape(-1, 1, 2) for k in kept]
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 200, 1e-12)
    _, k, d, rs, ts = cv2.calibrateCamera(points, pixels, size, None, None, flags=flags, criteria=criteria)
    errors = []
    for (x, uv), (xl, uvl), r, t in zip(kept, left, rs, ts):
        _, r, t = cv2.solvePnP(x, uv, k, d, r, t, True, cv2.SOLVEPNP_ITERATIVE)
        errors.append(cv2.projectPoints(xl, r, t, k, d)[0].reshape(-1, 2) - uvl)
    return rms(errors), k[0, 0], time.time() - start


def by_mrcal(kept, left, size, model, warp):
    start = time.time()
    n = max(len(k[0]) for k in kept)
    count = len(kept)
    # Boards with every marker; those that are left out have weight -1.
    everything = sorted({tuple(p) for k in kept + left for p in k[0]})
    index = {p: i for i, p in enumerate(everything)}
    xs, ys = sorted({p[0] for p in everything}), sorted({p[1] for p in everything})
    w, h, pitch = len(xs), len(ys), xs[1] - xs[0]
    observations = -np.ones((count, h, w, 3))
    for o, (x, uv) in zip(observations, kept):
        for p, q in zip(x, uv):
            o[round((p[1] - ys[0]) / pitch), round((p[0] - xs[0]) / pitch)] = [*q, 1.0]
    # Starting values are those of OpenCV: pinhole and poses, in the frame of the board's first corner.
    _, k, _, rs, ts = cv2.calibrateCamera([x.astype(np.float32) for x, _ in kept], [uv.astype(np.float32).reshape(-1, 1, 2) for _, uv in kept],
                                          size, None, None)
    start = time.time()
    seed = np.array([k[0, 0], k[1, 1], k[0, 2], k[1, 2]])
    corner = np.array([xs[0], ys[0], 0.0])
    frames = np.array([np.concatenate([r.ravel(), (cv2.Rodrigues(r)[0] @ corner) + t.ravel()]) for r, t in zip(rs, ts)])
    inputs = dict(extrinsics_rt_fromref=np.zeros((0, 6)), frames_rt_toref=frames, observations_board=observations,
                  indices_frame_camintrinsics_camextrinsics=np.array([[i, 0, -1] for i in range(count)], dtype=np.int32),
                  points=None, observations_point=None, indices_point_camintrinsics_camextrinsics=None,
                  imagersizes=np.array([size], dtype=np.int32), calibration_object_spacing=pitch, verbose=False)
    intrinsics = seed[None, :].copy()
    mrcal.optimize(intrinsics=intrinsics, lensmodel="LENSMODEL_PINHOLE", do_optimize_intrinsics_core=True, do_optimize_intrinsics_distortions=False,
                   do_optimize_extrinsics=False, do_optimize_frames=True, do_optimize_calobject_warp=False, do_apply_regularization=False,
                   do_apply_outlier_rejection=False, **inputs)
    full = np.zeros((1, 4 + mrcal.lensmodel_num_params(model) - 4))
    full[0, :4] = intrinsics[0, :4]
    bend = np.zeros(2)
    for reject in (False, True):
        mrcal.optimize(intrinsics=full, lensmodel=model, do_optimize_intrinsics_core=True, do_optimize_intrinsics_distortions=True,
                       do_optimize_extrinsics=False, do_optimize_frames=True, do_optimize_calobject_warp=warp, calobject_warp=bend,
                       do_apply_regularization=True, do_apply_outlier_rejection=reject, **inputs)
    board = mrcal.ref_calibration_object(w, h, pitch, calobject_warp=bend)
    errors = []
    for (x, uv), frame in zip(left, frames):
        at = [board[round((p[1] - ys[0]) / pitch), round((p[0] - xs[0]) / pitch)] for p in x]
        seen = mrcal.project(mrcal.transform_point_rt(frame, np.array(at).reshape(-1, 3)), model, full[0])
        errors.append(seen - uv)
    return rms(errors), full[0, 0], time.time() - start


def by_robotcal(program, series, images, left, work, camera):
    """Calibrates on the corners that are kept, as a series with observations.csv, and predicts what was left out by its files."""
    os.makedirs(work, exist_ok=True)
    for name in ("plate.toml",):
        shutil.copy(os.path.join(series, name), os.path.join(work, name))
    size = camera["size"]
    open(os.path.join(work, "series.toml"), "w").write(
        f'format = 1\ncamera_mount = "hand"\nplate = "plate.toml"\n[camera]\nwidth_px = {size[0]}\nheight_px = {size[1]}\n')
    with open(os.path.join(work, "observations.csv"), "w") as f:
        f.write("image,marker,u,v\n")
        for i, (name, seen) in enumerate(images.items()):
            f.writelines(f"{name},{m},{u!r},{v!r}\n" for m, u, v in seen if not aside(i, m))
    out = os.path.join(work, "out")
    start = time.time()
    lens = ["--camera", camera["lens"]] if camera["lens"] else []
    done = subprocess.run([program, "poses", "--series", work, "--out", out, "-q", *lens], capture_output=True, text=True)
    seconds = time.time() - start
    if done.returncode > 1:
        return None, None, done.stderr.strip()[:100]
    record = json.load(open(os.path.join(out, "poses.json")))
    p = {k: v["value"] for k, v in record["cameras"][0]["parameters"].items()}
    lens = record["cameras"][0]["lens"]
    plate = {int(r["id"]): [float(r[c]) for c in ("x_m", "y_m", "z_m")] for r in csv.DictReader(open(os.path.join(out, "plate.csv")))}
    poses = {r["image"]: r for r in csv.DictReader(open(os.path.join(out, "poses.csv")))}
    errors = []
    for i, (name, seen) in enumerate(images.items()):
        if name not in poses:
            continue
        row = poses[name]
        x, y, z, w = (float(row[k]) for k in ("qx", "qy", "qz", "qw"))
        r = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                      [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                      [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
        t = np.array([float(row[k]) for k in ("x_m", "y_m", "z_m")])
        own = [s for s in seen if aside(i, s[0])]
        at = (np.array([plate[s[0]] for s in own]).reshape(-1, 3) - t) @ r
        errors.append(project(lens, p, at) - np.array([s[1:] for s in own]).reshape(-1, 2))
    return rms(errors), p["fx"], seconds, lens


def project(lens, p, x):
    """The lens formulas of the guide, written again."""
    y = x[:, :2] / x[:, 2:]
    r2 = (y ** 2).sum(axis=1)
    g = lambda k: p.get(k, 0.0)
    if lens == "fisheye":
        r = np.sqrt(r2)
        t = np.arctan(r)
        d = y * (t * (1 + g("k1") * t**2 + g("k2") * t**4 + g("k3") * t**6 + g("k4") * t**8) / np.maximum(r, 1e-12))[:, None]
    else:
        k1, k2 = g("k1") + g("k1z") / x[:, 2], g("k2") + g("k2z") / x[:, 2]
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * g("k3")))) / (1 + r2 * (g("k4") + r2 * (g("k5") + r2 * g("k6"))))
        u, v = y.T
        d = y * radial[:, None] + np.column_stack([
            2 * g("p1") * u * v + g("p2") * (r2 + 2 * u * u) + g("s1") * r2 + g("s2") * r2**2,
            g("p1") * (r2 + 2 * v * v) + 2 * g("p2") * u * v + g("s3") * r2 + g("s4") * r2**2])
    return d * [p["fx"], p["fy"]] + [p["cx"], p["cy"]]


def main():
    program, work, folder = sys.argv[1:4]
    made_with.say(program)
    print("| series | program | held out, px | fx | s |\n|---|---|---|---|---|", flush=True)
    for name in sys.argv[4:]:
        series = os.path.join(folder, name)
        own = os.path.join(work, name)
        os.makedirs(own, exist_ok=True)
        place, images, _ = corners(program, series, os.path.join(own, "detect"))
        first = next(f for f in sorted(os.listdir(os.path.join(series, "images"))))
        size = picture_size(os.path.join(series, "images", first))
        kept, left = split(place, images)

        def row(label, found):
            if found[0] is None:
                print(f"| {name} | {label} | {found[2]} | | |", flush=True)
            else:
                print(f"| {name} | {label} | {found[0]:.4f} | {found[1]:.2f} | {found[2]:.2f} |", flush=True)

        for lens in (None, "auto", "brown"):
            found = by_robotcal(program, series, images, left, os.path.join(own, f"robotcal-{lens}"), {"lens": lens, "size": size})
            row(f"robotcal poses{' --camera ' + lens if lens else ''}" + (f" ({found[3]})" if len(found) > 3 else ""), found)
        if cv2:
            row("OpenCV, 5 coefficients", by_opencv(kept, left, size, 0))
            row("OpenCV, 8 coefficients", by_opencv(kept, left, size, cv2.CALIB_RATIONAL_MODEL))
        if mrcal:
            for model, warp in (("LENSMODEL_OPENCV5", False), ("LENSMODEL_OPENCV8", False), ("LENSMODEL_OPENCV8", True)):
                try:
                    row(f"mrcal, {model[10:]}{', board warp' if warp else ''}", by_mrcal(kept, left, size, model, warp))
                except Exception as e:  # noqa: BLE001 (what a peer cannot do stands in the table)
                    row(f"mrcal, {model[10:]}", (None, None, str(e)[:80]))


def picture_size(path):
    """Width and height of a PNG or JPEG."""
    data = open(path, "rb").read()
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    at = 2
    while data[at + 1] not in (0xC0, 0xC1, 0xC2):
        at += 2 + int.from_bytes(data[at + 2:at + 4], "big")
    return int.from_bytes(data[at + 7:at + 9], "big"), int.from_bytes(data[at + 5:at + 7], "big")


if __name__ == "__main__":
    main()
