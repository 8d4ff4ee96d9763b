#!/usr/bin/env bash
# Bundles three.js for the viewer: scenes/viewer/three.js and its licence. Needs npm; run it to change the version or the parts.
set -euo pipefail
version=0.187.0
esbuild=0.28.2
viewer=$(cd "$(dirname "${BASH_SOURCE[0]}")/../scenes/viewer" && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch"
npm install --silent --ignore-scripts "three@$version" "esbuild@$esbuild"
cat > entry.js <<'PARTS'
export {
  ACESFilmicToneMapping, BufferAttribute, BufferGeometry, CircleGeometry, Color, ConeGeometry, CylinderGeometry, DirectionalLight, DoubleSide, Group,
  HemisphereLight, Mesh, MeshBasicMaterial, MeshStandardMaterial, PCFSoftShadowMap, PerspectiveCamera, Points, PointsMaterial, Scene, SRGBColorSpace,
  Vector3, WebGLRenderer
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
PARTS
bundler=$(find node_modules/@esbuild -path '*/bin/esbuild' | head -n 1)
"$bundler" entry.js --bundle --minify --format=iife --global-name=THREE --legal-comments=none --outfile=bundle.js \
  --banner:js="// three.js $version, MIT licence: see LICENSE.three. Bundled by scripts/vendor_three.sh."
cp bundle.js "$viewer/three.js"
cp node_modules/three/LICENSE "$viewer/LICENSE.three"
ls -l "$viewer/three.js"
