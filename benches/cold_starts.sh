#!/usr/bin/env bash
# Cold starts: how often does the fit of the robot reach the optimum from rough starting values?
#
#   benches/cold_starts.sh PEERS [TRIALS]      (default: 8)
#
# PEERS is a folder with gen.py and common.py, as its README says. Two series of 40 images (80 degrees and 290 markers an image; 30 degrees and
# 12 markers) with 20 urad of joint noise, nominal robot, focal length 4 % off. At scale 1 the errors of the start are 5 mm and 1 degree
# of the hand-camera pose and 20 mm and 2 degrees of the plate pose (one sigma an axis). `guess` starts from these values, `images` from the images
# alone. Counted is what ends at the cost that the start at the truth leads to, to 1e-8.
set -euo pipefail
peers=$(cd "${1:?folder of the peers}" && pwd)
trials=${2:-8}
cd "$(dirname "$0")/.."
export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 CARGO_TERM_COLOR=never
bench=$(cargo bench --bench ceres --no-run 2>&1 | sed -n 's/.*Executable.*(\(.*\)).*/\1/p')
work=$(mktemp -d); trap 'rm -rf "$work"' EXIT
python=${PYTHON:-$peers/venv/bin/python}

series() { # name, arguments of gen.py
  local folder="$work/$1"; shift
  "$python" "$peers/gen.py" "$folder/data" --images 40 --seed 11 "$@" > /dev/null
}
series plain
series weak --fov 30 --max-markers 12 --tilt 25 --dist 0.35 0.6 --noise 0.1

PYTHONPATH=$peers "$python" - "$work" "$trials" <<'PYTHON'
import json, os, sys
import numpy as np
from common import expso3, mk
work, trials = sys.argv[1], int(sys.argv[2])
rng = np.random.default_rng(0)
for series in ("plain", "weak"):
    data = f"{work}/{series}/data"
    truth, guess = (json.load(open(f"{data}/{name}.json")) for name in ("truth", "guess"))
    q = np.array(truth["q_true"])
    q += np.random.default_rng(1011).normal(0, 20e-6, q.shape)
    np.savetxt(f"{data}/joints.csv", np.c_[np.arange(len(q)), q], delimiter=",", fmt=["%d"] + ["%.9f"] * 6,
               header="image_id,q1,q2,q3,q4,q5,q6", comments="")
    guess["joint_sigma"] = 20e-6
    def write(name, **start):
        folder = f"{work}/{series}/{name}"
        os.makedirs(folder)
        for file in ("plate.csv", "observations.csv", "joints.csv", "nominal.urdf"):
            os.symlink(f"{data}/{file}", f"{folder}/{file}")
        json.dump({**guess, **start}, open(f"{folder}/guess.json", "w"))
    write("truth", **{key: truth[key] for key in ("camera", "T_flange_cam", "T_base_plate")})
    rough = lambda pose, angle, shift: (np.array(pose) @ mk(expso3(rng.normal(0, angle, 3)), rng.normal(0, shift, 3))).tolist()
    for scale in (0.2, 1, 2, 4, 8):
        for trial in range(trials):
            camera = rough(truth["T_flange_cam"], 0.017 * scale, 5e-3 * scale)
            plate = rough(truth["T_base_plate"], 0.035 * scale, 20e-3 * scale)
            write(f"{scale}_{trial}", T_flange_cam=camera, T_base_plate=plate)
PYTHON

cost() { { "$bench" "$@" 2> /dev/null || true; } | sed -n 's/.* cost \([0-9.]*\),.*/\1/p'; }

reached() { # series, scale, mode, start, cost of the optimum
  local n=0 got
  for trial in $(seq 0 $((trials - 1))); do
    got=$(cost "$work/$1/$2_$trial" "$3" "$4")
    n=$((n + $(awk -v a="${got:-inf}" -v b="$5" 'BEGIN {d = a / b - 1; print (d < 1e-8 && d > -1e-8)}')))
  done
  echo "$n"
}

benches/made_with.sh
echo "| series | start error | exact, guess | exact, images | joint, guess | joint, images |"
echo "|---|---|---|---|---|---|"
for name in plain weak; do
  exact=$(cost "$work/$name/truth" exact guess); joint=$(cost "$work/$name/truth" joint guess)
  for scale in 0.2 1 2 4 8; do
    row="| $name | $scale |"
    row+=" $(reached "$name" "$scale" exact guess "$exact") | $(reached "$name" "$scale" exact images "$exact") |"
    row+=" $(reached "$name" "$scale" joint guess "$joint") | $(reached "$name" "$scale" joint images "$joint") |"
    echo "$row"
  done
done
