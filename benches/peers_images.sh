#!/usr/bin/env bash
# The image stage beside OpenCV and scikit-image: same pictures, one thread each, in one run.
#
#   PYTHON=venv/bin/python benches/peers_images.sh PEERS [PICTURES]      (default: 5)
#
# PEERS is a folder with images/render.py and images/detect.py; PYTHON needs numpy, scipy, scikit-image and OpenCV. Printed are
# the medians of the time for a picture, the rms to the true centroid of the outer contour, and the ratio of the times.
# Nobody is asked for identities: every third marker of those pictures is an annulus, a pattern that repeats.
set -euo pipefail
peers=$(cd "${1:?folder of the peers}" && pwd); pictures=${2:-5}
python=$(command -v "${PYTHON:-python3}"); python=$(cd "$(dirname "$python")" && pwd)/$(basename "$python")
cd "$(dirname "$0")/.."
export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 RAYON_NUM_THREADS=1 CARGO_TERM_COLOR=never
bench=$(cargo bench --bench detect --no-run 2>&1 | sed -n 's/.*Executable.*(\(.*\)).*/\1/p')
work=$(mktemp -d); trap 'rm -rf "$work"' EXIT

benches/made_with.sh
for size in "" --mp5; do
  images="$work/pictures$size"
  "$python" "$peers/images/render.py" "$images" "$pictures" $size > /dev/null
  DETECT_IMAGES="$images" "$bench"
  "$python" "$peers/images/detect.py" "$images" 5 > "$work/peers.txt"
  "$python" - "$images" "$work/peers.txt" <<'PY'
import csv, json, re, statistics, sys
import numpy as np

folder, peers = sys.argv[1:]
times = [float(r["ms"]) for r in csv.DictReader(open(f"{folder}/times.csv"))]
found = {}
for r in csv.DictReader(open(f"{folder}/markers.csv")):
    found.setdefault(r["image"], []).append((float(r["u"]), float(r["v"])))
errors, wanted = [], 0
for image, centres in found.items():
    truth = json.load(open(f"{folder}/{image[:-4]}.json"))
    true = np.array(truth["contour"])
    wanted += len(true)
    d = true[:, None] - np.array(centres)[None]
    nearest = np.linalg.norm(d, axis=2).argmin(1)
    e = d[np.arange(len(true)), nearest]
    errors.append(e[np.linalg.norm(e, axis=1) < np.minimum(3, np.array(truth["radius"]) / 2)])
errors = np.concatenate(errors)
ours = statistics.median(times)
print(f"\n{folder.rsplit('/', 1)[1]}\n| detector | ms | rms px | found | time over ours |\n|---|---|---|---|---|")
print(f"| robotcal | {ours:.1f} | {np.sqrt((errors**2).mean()):.4f} | {len(errors)}/{wanted} | 1 |")
name = None
for line in open(peers):
    if m := re.match(r"(\S.*?)\s+([\d.]+) ms/image, found (\d+/\d+)", line):
        name, ms, seen = m[1], float(m[2]), m[3]
    elif name and (m := re.search(r"vs contour centroid\s+rms/axis ([\d.]+)", line)):
        print(f"| {name} | {ms:.1f} | {m[1]} | {seen} | {ms / ours:.2f} |")
        name = None
PY
done
