"""Boards on real photographs: `robotcal detect` beside OpenCV, judged by cv2.calibrateCamera. Called by boards.sh."""

import csv
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time
import tomllib

import cv2
import numpy as np

LEAST_CORNERS = 12
SAME_CORNER = 0.3  # of the distance to the next corner


def series_of(folder):
    folder = pathlib.Path(folder)
    manifest = tomllib.loads((folder / "series.toml").read_text()) if (folder / "series.toml").is_file() else {}
    plate = tomllib.loads((folder / manifest.get("plate", "plate.toml")).read_text())
    images = sorted(p for p in (folder / "images").iterdir() if p.suffix.lower() in {".png", ".jpg", ".jpeg", ".tif", ".bmp", ".pgm"})
    return folder, plate, images


def robotcal(binary, folder, plate_file, images):
    """Corners by image and id, CPU seconds."""
    with tempfile.TemporaryDirectory() as out:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [binary, "detect", "--plate", plate_file, "--out", f"{out}/r", *map(str, images)]
        done = subprocess.run(command, capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        found = {p.name: {} for p in images}
        path = pathlib.Path(out) / "r" / "observations.csv"
        if path.is_file():
            for row in csv.DictReader(open(path)):
                if row.get("edge", "outer") in ("outer", "", None) and not row.get("reason"):
                    found[row["image"]][int(row["marker"])] = (float(row["u"]), float(row["v"]))
        elif done.returncode not in (0, 1):
            print(done.stderr.strip(), file=sys.stderr)
    return found, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def opencv(plate, images):
    """As `robotcal`, with OpenCV's detector for the kind of the plate."""
    size = (plate["columns"], plate["rows"])
    kind = plate["kind"]
    detector = None
    if kind == "charuco":
        name = plate["aruco"]["dictionary"]
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
        board = cv2.aruco.CharucoBoard((size[0] + 1, size[1] + 1), plate["pitch_m"], plate["aruco"]["side_m"], dictionary)
        detector = cv2.aruco.CharucoDetector(board)
    found, seconds = {}, 0.0
    for path in images:
        start = time.process_time()
        grey = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        ids, corners = None, None
        if kind == "charuco":
            corners, ids, _, _ = detector.detectBoard(grey)
        elif kind == "circle-grid":
            ok, corners = cv2.findCirclesGrid(grey, size, flags=cv2.CALIB_CB_SYMMETRIC_GRID)
            corners = corners if ok else None
        else:
            flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
            ok, corners = cv2.findChessboardCornersSB(grey, size, flags=flags)
            corners = corners if ok else None
        seconds += time.process_time() - start
        places = [] if corners is None else [tuple(map(float, c)) for c in np.reshape(corners, (-1, 2))]
        ids = range(len(places)) if ids is None else [int(i) for i in np.ravel(ids)]
        found[path.name] = dict(zip(ids, places))
    return found, seconds


def turns(columns, rows):
    """Renumberings of a grid seen from the front: none and half a turn, and the quarters of a square one."""
    grid = np.arange(columns * rows).reshape(rows, columns)
    grids = [np.rot90(grid, k) for k in range(4)]
    return [g.ravel() for g in grids if g.shape == grid.shape]


def in_common(ours, theirs, columns, rows):
    """Ids of `theirs` that both found in one image, with both places; how many of them bear contradicting ids."""
    if not ours or not theirs:
        return {}, 0
    ids, places = list(ours), np.array(list(ours.values()))
    pairs = {}
    for index, place in theirs.items():
        distances = np.linalg.norm(places - place, axis=1)
        beside = theirs.get(index + 1 if (index + 1) % columns else index - 1)
        reach = SAME_CORNER * (np.linalg.norm(np.subtract(place, beside)) if beside else 10.0)
        if (k := distances.argmin()) is not None and distances[k] < reach:
            pairs[index] = (ids[k], tuple(places[k]), place)
    wrong = min(sum(turn[i] != own for i, (own, _, _) in pairs.items()) for turn in turns(columns, rows))
    return {i: (ours_at, theirs_at) for i, (_, ours_at, theirs_at) in pairs.items()}, wrong


def judge(views, size, plate):
    """Rms of a plain calibration with the five parameters of OpenCV's lens."""
    views = [v for v in views if len(v) >= LEAST_CORNERS]
    if len(views) < 3:
        return float("nan")
    at = lambda i: (i % plate["columns"] * plate["pitch_m"], i // plate["columns"] * plate["pitch_m"], 0.0)
    board = [np.array([at(i) for i in v], np.float32) for v in views]
    pixels = [np.array(list(v.values()), np.float32) for v in views]
    return cv2.calibrateCamera(board, pixels, size, None, None)[0]


def row(binary, folder):
    folder, plate, images = series_of(folder)
    columns, rows = plate["columns"], plate["rows"]
    height, width = cv2.imread(str(images[0]), cv2.IMREAD_GRAYSCALE).shape
    plate_file = str(folder / "plate.toml")
    detectors = {"robotcal": robotcal(binary, folder, plate_file, images), "OpenCV": opencv(plate, images)}
    common, wrong = {}, 0
    for image in (p.name for p in images):
        common[image], bad = in_common(*(found[image] for found, _ in detectors.values()), columns, rows)
        wrong += bad
    for k, (name, (found, seconds)) in enumerate(detectors.items()):
        complete = sum(len(c) == columns * rows for c in found.values())
        corners = sum(map(len, found.values()))
        views = [{i: places[k] for i, places in common[image].items()} for image in common]
        rms = judge(views, (width, height), plate)
        print(
            f"| {folder.name} | {name} | {complete}/{len(images)} | {corners}/{len(images) * columns * rows} | {rms:.4f}"
            f" | {sum(map(len, common.values()))} | {wrong if k == 0 else ''} | {1000 * seconds / len(images):.0f} |",
            flush=True,
        )


def main():
    cv2.setNumThreads(1)
    print("| series | detector | complete | corners | judge px | in common | labels apart | CPU ms |\n|---|---|---|---|---|---|---|---|")
    binary = os.path.abspath(sys.argv[1])
    for folder in sys.argv[2:]:
        row(binary, folder)


if __name__ == "__main__":
    main()
