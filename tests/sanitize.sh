#!/usr/bin/env bash
# The compiled kernels under AddressSanitizer and UndefinedBehaviorSanitizer: their tests, and mutants of EXRs.
#
#     tests/sanitize.sh [PYTHON]       in an environment with `.[test]`; needs gcc; some minutes
#
# The library is built in a copy of the sources: what is installed stays as it is.
set -euo pipefail
cd "$(dirname "$0")/.."
python=$(command -v "${1:-python3}")
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cp -r itmo_video tests configs sample_clips pyproject.toml "$scratch/"
cd "$scratch"
rm -f itmo_video/kernels/_native.so
# As in hatch_build.py, with its lines; shifts, sizes and alignment are what integers are checked for.
gcc -O1 -g -std=c11 -ffp-contract=off -fno-math-errno -fno-trapping-math -fno-omit-frame-pointer \
  -fsanitize=address,undefined -fno-sanitize-recover=all -DITMO_ONE_TARGET -shared -fPIC \
  itmo_video/kernels/*.c -o itmo_video/kernels/_native.so -lm
export PYTHONPATH="$scratch:$scratch/tests" PYTHONDONTWRITEBYTECODE=1 PYTHONMALLOC=malloc OMP_NUM_THREADS=1
# Leaks are Python's and OpenCV's own; C++ exceptions of libraries loaded later need libstdc++ beside it.
export ASAN_OPTIONS=detect_leaks=0:abort_on_error=1 UBSAN_OPTIONS=print_stacktrace=1
LD_PRELOAD="$(gcc -print-file-name=libasan.so) $(gcc -print-file-name=libubsan.so) $(g++ -print-file-name=libstdc++.so)"
export LD_PRELOAD
"$python" -c "
from itmo_video.kernels import library
assert library.library() is not None, library.state()
assert library.__file__.startswith('$scratch'), library.__file__
print('kernels under sanitizers:', library.state())"
"$python" -m pytest -q -x -p no:cacheprovider -p no:xdist tests/kernels/test_native.py tests/kernels/test_deflate.py tests/kernels/test_kernel_arguments.py \
  tests/kernels/test_kernel_extremes.py tests/kernels/test_area_means.py tests/operators/test_auto_network.py \
  tests/operators/test_near_white.py tests/delivery/test_to_codes.py tests/output/test_exr.py
"$python" tests/faults/exr_mutants.py --count "${MUTANTS:-200}" --seed 22 2>&1 | grep -v EXR_ERR_
echo "nothing found"
