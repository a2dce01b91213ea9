#!/usr/bin/env bash
# The solver beside Ceres: same series, same start, same unknowns and priors, one thread each, in one run.
#
#   benches/ceres.sh PEERS [IMAGES ...]      (default: 100 1000)
#
# PEERS is a folder with gen.py, init_poses.py and ceres/build/rc_ceres, built as its README says. Every pair is run
# REPEATS times (default 5) in turn; printed are the medians, their ratio, and the relative difference of the cost.
set -euo pipefail
peers=$(cd "${1:?folder of the peers}" && pwd); shift
images=("$@"); [ ${#images[@]} -gt 0 ] || images=(100 1000)
cd "$(dirname "$0")/.."
export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 CARGO_TERM_COLOR=never
repeats=${REPEATS:-5}
bench=$(cargo bench --bench ceres --no-run 2>&1 | sed -n 's/.*Executable.*(\(.*\)).*/\1/p')
work=$(mktemp -d); trap 'rm -rf "$work"' EXIT

median() { sort -g | awk '{v[NR]=$1} END {print v[int((NR+1)/2)]}'; }

pair() { # folder, name, mode of ours, arguments of rc_ceres
  local folder=$1 name=$2 mode=$3; shift 3
  : > "$work/ours"; : > "$work/theirs"
  for _ in $(seq "$repeats"); do
    "$bench" "$folder" "$mode" >> "$work/ours"
    "$peers/ceres/build/rc_ceres" "$folder" "$work/out.txt" "$@" >> "$work/theirs"
  done
  local t u cost_t cost_u
  u=$(sed -n 's/.* solve \([0-9.]*\) s.*/\1/p' "$work/ours" | median)
  t=$(sed -n 's/.*(cpu \([0-9.]*\);.*/\1/p' "$work/theirs" | median)
  cost_u=$(sed -n 's/.* cost \([0-9.]*\),.*/\1/p' "$work/ours" | tail -1)
  cost_t=$(sed -n 's/.* cost \([0-9.]*\),.*/\1/p' "$work/theirs" | tail -1)
  awk -v n="$name" -v t="$t" -v u="$u" -v ct="$cost_t" -v cu="$cost_u" \
    -v m="$(sed -n 's/.*peak \([0-9]*\) MB/\1/p' "$work/ours" | tail -1)" \
    -v i="$(sed -n 's/.*iterations \([0-9]*\) .*/\1/p' "$work/ours" | tail -1)" \
    -v j="$(sed -n 's/.*iters \([0-9]*\),.*/\1/p' "$work/theirs" | tail -1)" \
    'BEGIN {printf "| %s | %.3f | %d | %.3f | %d | %.1f | %.1e | %d |\n", n, t, j, u, i, t / u, (cu - ct) / ct, m}'
}

benches/made_with.sh
echo "| problem | Ceres s | steps | robotcal s | steps | ratio | relative cost | MB |"
echo "|---|---|---|---|---|---|---|---|"
for n in "${images[@]}"; do
  data="$work/n$n"
  if [ -d "$peers/data/n$n" ]; then data="$peers/data/n$n"; else
    "$peers/venv/bin/python" "$peers/gen.py" "$data" --images "$n" > /dev/null
  fi
  [ -f "$data/init_poses.csv" ] || "$peers/venv/bin/python" "$peers/init_poses.py" "$data" > /dev/null
  if [ "$n" -gt 250 ]; then
    poses=(solver=SPARSE_NORMAL_CHOLESKY); exact=(solver=DENSE_SCHUR elim=markers); joint=(solver=SPARSE_NORMAL_CHOLESKY)
  else
    poses=(solver=DENSE_SCHUR elim=markers); exact=("${poses[@]}"); joint=("${poses[@]}")
  fi
  pair "$data" "$n images, poses" poses mode=pose "${poses[@]}"
  pair "$data" "$n images, joint, readings exact" exact mode=joint "${exact[@]}"
  pair "$data" "$n images, joint with joint noise" joint mode=eiv "${joint[@]}"
done
