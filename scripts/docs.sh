#!/usr/bin/env bash
# Builds the documentation site in build/docs/site, without warnings: pages by MkDocs, the C++ reference by Doxygen.
#   scripts/docs.sh [BUILD]    a build with SUPPLE_BUILD_PYTHON=ON (default: build/release), for the Python reference
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$(realpath "${1:-$root/build/release}")
work=$root/build/docs
source "$root/scripts/dependencies.sh"
install_packages docs
mkdir -p "$work"
[[ -x $work/tools/bin/mkdocs ]] || python3 -m venv "$work/tools"
"$work/tools/bin/pip" install --quiet --disable-pip-version-check "mkdocs>=1.6,<2" "mkdocs-material>=9.5,<10"

python=$(sed -n 's/^_\?Python_EXECUTABLE:[A-Z]*=//p' "$build/CMakeCache.txt" | head -n 1)
PYTHONPATH=$build/python "$python" -B "$root/scripts/docs_pages.py" "$work/pages"
(cd "$root" && NO_MKDOCS_2_WARNING=1 "$work/tools/bin/mkdocs" build --quiet --strict --clean)

# Undocumented members are no fault: private ones and obvious ones have no comment here. Wrong commands and references are.
(cd "$root" && doxygen - <<SETTINGS
PROJECT_NAME = supple
INPUT = core/include implicit/include collision/include render/include scenes/include
RECURSIVE = YES
OUTPUT_DIRECTORY = $work
HTML_OUTPUT = site/cpp
GENERATE_LATEX = NO
QUIET = YES
EXTRACT_ALL = YES
JAVADOC_AUTOBRIEF = YES
SORT_MEMBER_DOCS = NO
WARN_IF_UNDOCUMENTED = NO
WARN_IF_INCOMPLETE_DOC = NO
WARN_NO_PARAMDOC = NO
WARN_AS_ERROR = FAIL_ON_WARNINGS
STRIP_FROM_INC_PATH = core/include implicit/include collision/include render/include scenes/include
MACRO_EXPANSION = YES
HAVE_DOT = NO
SETTINGS
)
[[ -s $work/site/index.html && -s $work/site/cpp/index.html ]]
echo "$work/site/index.html"
