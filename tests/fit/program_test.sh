#!/usr/bin/env bash
# The program of fits as users meet it: where it finds its material, and what it says of one that is none.
#   program_test.sh SUPPLE_FIT SCRATCH
set -u
fit=$1
rm -rf "$2"
mkdir -p "$2"
cd "$2" || exit 1
failures=0

# refused WORDS OPTIONS...: the whole of standard error.
refused() {
  local words=$1
  shift
  "$fit" data.off -o object.yaml "$@" > out.txt 2> err.txt < /dev/null
  local found=$?
  if [[ $found != 3 || $(cat err.txt) != "$words" ]]; then
    echo "supple fit $*: expected exit 3 and '$words', found exit $found and:"
    cat err.txt
    failures=$((failures + 1))
  fi
}

names='jelly, rubber, foam, clay, steel'
refused "--material: expected the name of a material, or a file of scenes with the key 'material', found 'jely'; did you mean 'jelly'? (known: $names)" --material jely
refused "--material: expected a readable scene file, found no file 'absent.yaml'" --material absent.yaml
echo 'material: {youngs_modulus: -20 kPa, density: 1050 kg/m^3}' > gum.yaml
refused "gum.yaml:1:28: material.youngs_modulus: expected a pressure > 0 [Pa], found '-20 kPa'" --material gum.yaml
exit $((failures > 0))
