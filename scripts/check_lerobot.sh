#!/usr/bin/env bash
# Whether LeRobot reads what bootifol exports: its own LeRobotDataset loads a set, and pictures, times and episodes are
# compared with bootifol's arrays of the same videos.
#
#   bash scripts/check_lerobot.sh [DEMOS]
#
# DEMOS is a directory of demo sets; without it 3 videos of drawn_reach are recorded.
#
#   LEROBOT_VENV    where LeRobot is installed, if it is not there yet; by default a folder beside the temporary files.
#                   Never bootifol's own environment: LeRobot wants other versions of PyTorch and PyAV.
#   LEROBOT_PYTHON  a Python that has LeRobot already; nothing is installed then.
#   TORCH_INDEX     where PyTorch comes from. PyPI's for Linux brings CUDA, several gigabytes to download;
#                   https://download.pytorch.org/whl/cpu has one without.
set -euo pipefail
cd "$(dirname "$0")/.."
python=${PYTHON:-.venv/bin/python}
work=$(mktemp --directory)
trap 'rm -rf "$work"' EXIT

if [ -z "${LEROBOT_PYTHON:-}" ]; then
  venv=${LEROBOT_VENV:-${TMPDIR:-/tmp}/bootifol-lerobot}
  LEROBOT_PYTHON=$venv/bin/python
  if ! [ -f "$venv/complete" ]; then
    echo "installing LeRobot in $venv"
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet ${TORCH_INDEX:+--extra-index-url "$TORCH_INDEX"} 'lerobot>=0.4,<0.5'
    touch "$venv/complete"
  fi
fi

demos=${1:-}
if [ -z "$demos" ]; then
  demos=$work/demos
  "$python" -m bootifol demos record --task drawn_reach --episodes 3 --behaviors expert --out "$demos"
fi
"$python" -m bootifol demos export "$demos" --format lerobot --videos 3 --out "$work/lerobot"
"$python" -m bootifol demos export "$demos" --format npy --videos 3 --out "$work/npy"
"$LEROBOT_PYTHON" scripts/check_lerobot.py "$work/lerobot" "$work/npy"
