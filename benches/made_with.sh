#!/usr/bin/env bash
# The line at the head of what benches print: version of robotcal and commit of this clone; "-dirty" where files were changed.
#
#   benches/made_with.sh [BINARY]      (default: the version that Cargo.toml states)
set -euo pipefail
binary=${1:+$(realpath "$1")}
cd "$(dirname "$0")/.."
if [ -n "$binary" ]; then version=$("$binary" --version); else version="robotcal $(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)"; fi
printf 'Made with %s, commit %s.\n\n' "$version" "$(git describe --always --dirty --exclude='*' 2> /dev/null || echo unknown)"
