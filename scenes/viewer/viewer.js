// The viewer of a run: reads the frames of this page, or of its server, and draws them. The format is described in README.md.
"use strict";
(() => {
  const byId = (id) => document.getElementById(id);
  const head = JSON.parse(byId("head").textContent);
  const frames = [];   // decoded, in the order of time
  let shown = -1;      // index of the frame in view
  let playing = false;

  // ---- Reading ----

  /** Undoes append_differences: `count` values of `width` bytes, as differences to the value `stride` places before. */
  function values(bytes, cursor, count, width, stride, out) {
    const at = cursor.at;
    for (let i = 0; i < count; ++i) {
      let folded = 0;
      for (let k = 0; k < width; ++k) folded += bytes[at + k * count + i] * 2 ** (8 * k);
      const difference = folded % 2 ? -(folded + 1) / 2 : folded / 2;
      out[i] = difference + (i < stride ? 0 : out[i - stride]);
    }
    cursor.at += count * width;
    return out;
  }

  function differenceWidth(count) {
    return 2 * count <= 0x100 ? 1 : 2 * count <= 0x10000 ? 2 : 2 * count <= 0x1000000 ? 3 : 4;
  }

  function readMesh(entry, bytes, cursor, before) {
    if (entry.kept) return before;
    const n = entry.vertices;
    const mesh = { origin: entry.origin, step: entry.step, vertices: n };
    mesh.node = values(bytes, cursor, 3 * n, 2, 3, new Uint16Array(3 * n));
    mesh.normal = values(bytes, cursor, 2 * n, 2, 2, new Uint8Array(2 * n));
    mesh.largest = entry.pressure || 0;
    mesh.pressure = entry.pressure ? values(bytes, cursor, n, 2, 1, new Uint8Array(n)) : null;
    const corners = 3 * (entry.triangles || 0);
    mesh.triangle = entry.triangles !== undefined ? values(bytes, cursor, corners, differenceWidth(n), 1, new Uint32Array(corners))
      : before ? before.triangle : new Uint32Array(0);
    return mesh;
  }

  function readGrid(entry, bytes, cursor) {
    const n = entry.count;
    const out = { origin: entry.origin || [0, 0, 0], step: entry.step || 0, count: n };
    if (n > 0) out.node = values(bytes, cursor, 3 * n, 2, 3, new Uint16Array(3 * n));
    return out;
  }

  function readFrame(buffer, before) {
    const bytes = new Uint8Array(buffer);
    const length = new DataView(buffer).getUint32(0, true);
    const frame = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
    const cursor = { at: 4 + length };
    frame.meshes = frame.meshes.map((entry, i) => readMesh(entry, bytes, cursor, before && before.meshes[i]));
    const points = readGrid(frame.points, bytes, cursor);
    points.largest = frame.points.pressure;
    if (points.count) points.pressure = values(bytes, cursor, points.count, 2, 1, new Uint8Array(points.count));
    frame.points = points;
    frame.particles = readGrid(frame.particles, bytes, cursor);
    return frame;
  }

  async function inflate(bytes) {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  }

  async function addFrames(bytes) {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    for (let at = 0; at + 4 <= bytes.length;) {
      const length = view.getUint32(at, true);
      const frame = readFrame(await inflate(bytes.subarray(at + 4, at + 4 + length)), frames[frames.length - 1]);
      frames.push(frame);
      at += 4 + length;
      if (frames.length === 1) arrive();
      if (frames.length % 16 === 0) grow();
    }
    grow();
  }

  function fromBase64(text) {
    const binary = atob(text);
    const bytes = new Uint8Array(binary.length);
    for (let i = 0; i < binary.length; ++i) bytes[i] = binary.charCodeAt(i);
    return bytes;
  }

  // ---- Scene ----

  const T = THREE;
  const renderer = new T.WebGLRenderer({ canvas: byId("view"), antialias: true, alpha: true, preserveDrawingBuffer: true });
  renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = T.PCFSoftShadowMap;
  renderer.toneMapping = T.ACESFilmicToneMapping;
  renderer.toneMappingExposure = 1.1;
  const scene = new T.Scene();
  const camera = new T.PerspectiveCamera(35, 1, 0.01, 1000);
  camera.up.fromArray(head.up);
  const controls = new T.OrbitControls(camera, renderer.domElement);
  const sun = new T.DirectionalLight(0xffffff, 2.6);
  sun.castShadow = true;
  sun.shadow.mapSize.set(2048, 2048);
  sun.shadow.bias = -0.0005;
  scene.add(sun, sun.target, new T.HemisphereLight(0xe8f0ff, 0xb8a890, 1.5));
  const srgb = (c) => new T.Color().setRGB(c[0], c[1], c[2], T.SRGBColorSpace);
  const css = (c) => `rgb(${c.map((v) => Math.round(255 * v)).join(",")})`;
  byId("stage").style.background = `linear-gradient(${css(head.background[0])}, ${css(head.background[1])})`;

  const items = head.meshes.map((look) => {
    const material = new T.MeshStandardMaterial({
      color: srgb(look.colour), roughness: look.roughness, metalness: look.metallic || 0,
      transparent: (look.opacity ?? 1) < 1, opacity: look.opacity ?? 1, side: T.DoubleSide });
    const mesh = new T.Mesh(new T.BufferGeometry(), material);
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.frustumCulled = false;
    mesh.visible = false;  // three.js gives a material flat shading for good where its first geometry has no normals
    scene.add(mesh);
    return { look, mesh, material, wanted: true, drawn: null };
  });
  const dots = (size, colours) => {
    const material = new T.PointsMaterial({ size, sizeAttenuation: false, vertexColors: colours, depthTest: false, transparent: true });
    const points = new T.Points(new T.BufferGeometry(), material);
    points.renderOrder = 2;
    points.frustumCulled = false;
    scene.add(points);
    return points;
  };
  const contactDots = dots(5, true), particleDots = dots(4, true);
  const arrows = new T.Group();
  scene.add(arrows);
  const arrowMaterial = new T.MeshBasicMaterial({ color: 0xd01050, depthTest: false, transparent: true, opacity: 0.85 });
  const shaft = new T.CylinderGeometry(1, 1, 1, 12).translate(0, 0.5, 0), tip = new T.ConeGeometry(1, 1, 16).translate(0, 0.5, 0);
  const limits = { low: new T.Vector3(Infinity, Infinity, Infinity), high: new T.Vector3(-Infinity, -Infinity, -Infinity), size: 1, pressure: 0, force: 0 };
  let ground = null;

  /** Viridis (van der Walt & Smith 2015), by five of its colours. */
  const map = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
  byId("scale").querySelector("i").style.background = `linear-gradient(90deg, ${map.map((c) => `rgb(${c})`).join(",")})`;
  function mapped(share) {
    const at = Math.min(Math.max(share, 0), 1) * (map.length - 1), k = Math.min(Math.floor(at), map.length - 2), w = at - k;
    return map[k].map((c, i) => c * (1 - w) + map[k + 1][i] * w);
  }
  const linear = Array.from({ length: 256 }, (_, i) => { const c = i / 255; return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4; });

  /** Widens the limits of space and of colours by a frame. */
  function widen(frame) {
    for (const mesh of frame.meshes) {
      if (!mesh || !mesh.vertices) continue;
      let box = mesh.box;
      if (!box) {
        const most = [0, 0, 0];
        for (let i = 0; i < mesh.node.length; ++i) most[i % 3] = Math.max(most[i % 3], mesh.node[i]);
        box = mesh.box = most.map((m, k) => mesh.origin[k] + m * mesh.step);
      }
      limits.low.min(new T.Vector3(...mesh.origin));
      limits.high.max(new T.Vector3(...box));
      limits.pressure = Math.max(limits.pressure, mesh.largest);
    }
    for (const pair of frame.pairs) limits.force = Math.max(limits.force, Math.hypot(...pair.force));
  }

  function placeLights() {
    const middle = limits.low.clone().add(limits.high).multiplyScalar(0.5);
    limits.size = Math.max(limits.high.distanceTo(limits.low), 1e-6);
    sun.target.position.copy(middle);
    sun.shadow.normalBias = 6 * limits.size / sun.shadow.mapSize.width;  // three of the map's pixels
    sun.position.copy(middle).addScaledVector(new T.Vector3(...head.light).normalize(), -2 * limits.size);
    const box = sun.shadow.camera;
    box.left = box.bottom = -limits.size;
    box.right = box.top = limits.size;
    box.near = 0.1 * limits.size;
    box.far = 6 * limits.size;
    box.updateProjectionMatrix();
    camera.near = 0.002 * limits.size;
    camera.far = 60 * limits.size;
    camera.updateProjectionMatrix();
    if (!head.ground) return;
    if (ground) { scene.remove(ground); ground.geometry.dispose(); }
    const disc = new T.CircleGeometry(6 * limits.size, 96), count = disc.attributes.position.count;
    const colours = new Float32Array(4 * count).fill(1);
    for (let i = 1; i < count; ++i) colours[4 * i + 3] = 0;  // fades out at its rim
    disc.setAttribute("color", new T.BufferAttribute(colours, 4));
    ground = new T.Mesh(disc, new T.MeshStandardMaterial({ color: srgb(head.ground.colour), roughness: 0.9, vertexColors: true, transparent: true, depthWrite: false, dithering: true }));
    ground.receiveShadow = true;
    ground.renderOrder = -1;
    ground.position.set(middle.x, middle.y, head.ground.height);
    scene.add(ground);
  }

  let lens = 0.6;  // vertical angle of the scene's camera [rad]
  /** The film's picture fits into the view, also where that is narrower. */
  function fitLens() {
    const half = Math.tan(0.5 * lens) * Math.max(1, head.aspect / camera.aspect);
    camera.fov = 2 * Math.atan(half) * 180 / Math.PI;
    camera.updateProjectionMatrix();
  }

  function goHome() {
    const [from, to, angle] = frames[Math.max(shown, 0)].camera;
    camera.position.fromArray(from);
    controls.target.fromArray(to);
    lens = angle;
    fitLens();
    controls.update();
  }

  function normalsOf(mesh) {
    const out = new Float32Array(3 * mesh.vertices);
    for (let i = 0; i < mesh.vertices; ++i) {
      let x = mesh.normal[2 * i] / 127.5 - 1, y = mesh.normal[2 * i + 1] / 127.5 - 1;
      const z = 1 - Math.abs(x) - Math.abs(y);
      if (z < 0) [x, y] = [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)];
      const length = Math.hypot(x, y, z) || 1;
      out.set([x / length, y / length, z / length], 3 * i);
    }
    return out;
  }

  /** Colours by pressure; the object's own colour where nothing presses. */
  function coloursOf(mesh, own) {
    const out = new Float32Array(3 * mesh.vertices);
    for (let i = 0; i < mesh.vertices; ++i) {
      const share = mesh.pressure[i] / 255 * mesh.largest / limits.pressure;
      const rgb = share > 0 ? mapped(share).map((c) => linear[Math.round(c)]) : [own.r, own.g, own.b];
      out.set(rgb, 3 * i);
    }
    return out;
  }

  function showMesh(item, mesh) {
    const coloured = byId("pressure").checked && mesh && mesh.pressure;
    const key = mesh && [mesh, coloured ? limits.pressure : 0];
    item.mesh.visible = item.wanted && Boolean(mesh && mesh.vertices);
    item.material.wireframe = byId("wires").checked;
    if (!item.mesh.visible || (item.drawn && item.drawn[0] === key[0] && item.drawn[1] === key[1])) return;
    const geometry = new T.BufferGeometry();
    geometry.setAttribute("position", new T.BufferAttribute(new Float32Array(mesh.node), 3));
    geometry.setAttribute("normal", new T.BufferAttribute(normalsOf(mesh), 3));
    geometry.setIndex(new T.BufferAttribute(mesh.triangle, 1));
    if (coloured) geometry.setAttribute("color", new T.BufferAttribute(coloursOf(mesh, srgb(item.look.colour)), 3));
    item.mesh.geometry.dispose();
    item.mesh.geometry = geometry;
    item.mesh.position.fromArray(mesh.origin);
    item.mesh.scale.setScalar(mesh.step || 1);
    if (item.material.vertexColors !== Boolean(coloured)) {
      item.material.vertexColors = Boolean(coloured);
      item.material.needsUpdate = true;
    }
    item.material.color = coloured ? new T.Color(1, 1, 1) : srgb(item.look.colour);
    item.drawn = key;
  }

  function showDots(points, grid, colourOf) {
    points.visible = Boolean(grid && grid.count);
    if (!points.visible) return;
    const at = new Float32Array(3 * grid.count), colours = new Float32Array(3 * grid.count);
    for (let i = 0; i < grid.count; ++i) {
      for (let k = 0; k < 3; ++k) at[3 * i + k] = grid.origin[k] + grid.step * grid.node[3 * i + k];
      colours.set(colourOf(i), 3 * i);
    }
    points.geometry.dispose();
    points.geometry = new T.BufferGeometry();
    points.geometry.setAttribute("position", new T.BufferAttribute(at, 3));
    points.geometry.setAttribute("color", new T.BufferAttribute(colours, 3));
  }

  /** The largest arrow is as long as a share of what the scene's camera sees, or of the whole scene where that is smaller. */
  function addArrow(at, force, sign) {
    const [from, to, angle] = frames[shown].camera, seen = 2 * Math.tan(0.5 * angle) * Math.hypot(...from.map((x, k) => x - to[k]));
    const unit = Math.min(limits.size, seen), size = Math.hypot(...force), length = 0.3 * unit * byId("length").value * size / limits.force;
    if (!(length > 1e-4 * unit)) return;
    const arrow = new T.Group(), width = 0.0028 * unit, cone = Math.min(0.4 * length, 8 * width);
    const body = new T.Mesh(shaft, arrowMaterial), end = new T.Mesh(tip, arrowMaterial);
    body.scale.set(width, length - cone, width);
    end.scale.set(2.6 * width, cone, 2.6 * width);
    end.position.y = length - cone;
    arrow.add(body, end);
    arrow.position.fromArray(at);
    arrow.quaternion.setFromUnitVectors(new T.Vector3(0, 1, 0), new T.Vector3(...force).multiplyScalar(sign / size));
    for (const part of [body, end]) part.renderOrder = 3;
    arrows.add(arrow);
  }

  function isShown(name) {
    const item = items.find((i) => name === i.look.name || name.startsWith(i.look.name + "."));
    return !item || item.wanted;
  }

  function showFrame(index) {
    if (!frames.length) return;
    shown = Math.min(Math.max(index, 0), frames.length - 1);
    const frame = frames[shown];
    items.forEach((item, i) => showMesh(item, frame.meshes[i]));
    arrows.clear();
    if (byId("forces").checked) {
      for (const pair of frame.pairs) {
        if (isShown(pair.a)) addArrow(pair.at, pair.force, 1);
        if (isShown(pair.b)) addArrow(pair.at, pair.force, -1);
      }
    }
    showDots(contactDots, byId("points").checked && frame.points, (i) =>
      mapped(frame.points.pressure[i] / 255 * frame.points.largest / (limits.pressure || 1)).map((c) => linear[Math.round(c)]));
    showDots(particleDots, byId("particles").checked && frame.particles, (i) => {
      const item = items.find((it) => it.look.particles && i >= it.look.particles[0] && i < it.look.particles[1]);
      return item ? item.material.color.clone().multiplyScalar(0.4).toArray() : [0, 0, 0];
    });
    byId("scrub").value = shown;
    byId("clock").textContent = `frame ${frame.frame} of ${head.frame_count}, ${frame.time.toFixed(3)} s`;
    document.body.dataset.frame = frame.frame;
    drawPlots();
    draw();
  }

  function draw() { renderer.render(scene, camera); }

  // ---- Plots ----

  const palette = ["#1f5fae", "#c2571a", "#2a8f5b", "#8a3fa0", "#b08900", "#00838f", "#ad1457", "#546e7a"];
  const plots = [];

  function seriesOf(kind) {
    if (kind === "Energy [J]") {
      const laws = frames[0].laws.map(([name]) => name).filter((name) => name.includes("/"));
      return [...["kinetic", "interaction", "contact", "total"].map((name) => ({ name, of: (f) => f.energy[name] })),
        { name: "dissipated", of: (f) => f.dissipated, off: true }, { name: "work of loads", of: (f) => f.work, off: true },
        ...laws.map((name) => ({ name, of: (f) => (f.laws.find((l) => l[0] === name) || [0, 0])[1], off: true }))];
    }
    if (kind === "Momentum [N s]") {
      return [{ name: "size", of: (f) => Math.hypot(...f.momentum) },
        ...["x", "y", "z"].map((name, k) => ({ name, of: (f) => f.momentum[k] })),
        ...["x", "y", "z"].map((axis, k) => ({ name: `angular ${axis} [N m s]`, of: (f) => f.spin[k], off: true }))];
    }
    const most = new Map();
    for (const f of frames) {
      for (const p of f.pairs) {
        const name = `${p.a} – ${p.b}`;
        most.set(name, Math.max(most.get(name) || 0, Math.hypot(...p.force)));
      }
    }
    const named = [...most.entries()].sort((a, b) => b[1] - a[1]).map(([name]) => name);
    const forces = named.slice(0, 40).map((name, k) => ({ name, off: k >= 4, of: (f) => {
      const pair = f.pairs.find((p) => `${p.a} – ${p.b}` === name);
      return pair ? Math.hypot(...pair.force) : 0;
    } }));
    const pin = (f, i) => i === 0 ? 0 : Math.hypot(...f.pins.map((v, k) => v - frames[i - 1].pins[k])) / (f.time - frames[i - 1].time);
    if (frames.some((f) => Math.hypot(...f.pins) > 0)) forces.push({ name: "pins (mean of a frame)", of: pin, off: true });
    return forces;
  }

  function makePlots() {
    for (const kind of ["Energy [J]", "Momentum [N s]", "Contact force [N]"]) {
      const figure = document.createElement("figure"), caption = document.createElement("figcaption");
      const canvas = document.createElement("canvas"), list = document.createElement("ul");
      caption.textContent = kind;
      figure.append(caption, canvas, list);
      byId("plots").append(figure);
      const plot = { kind, canvas, list, series: [], chosen: new Map() };
      const seek = (event) => {
        const box = canvas.getBoundingClientRect(), left = 46, share = (event.clientX - box.left - left) / (box.width - left - 6);
        const time = frames[0].time + share * (frames[frames.length - 1].time - frames[0].time);
        let best = 0;
        frames.forEach((f, i) => { if (Math.abs(f.time - time) < Math.abs(frames[best].time - time)) best = i; });
        pause();
        showFrame(best);
      };
      canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); seek(event); });
      canvas.addEventListener("pointermove", (event) => { if (event.buttons) seek(event); });
      plots.push(plot);
    }
  }

  function updateSeries() {
    for (const plot of plots) {
      plot.series = seriesOf(plot.kind);
      plot.series.forEach((s, i) => {
        s.colour = palette[i % palette.length];
        s.value = frames.map(s.of);
        if (!plot.chosen.has(s.name)) plot.chosen.set(s.name, !s.off);
      });
      plot.list.replaceChildren(...plot.series.map((s) => {
        const item = document.createElement("li"), label = document.createElement("label"), box = document.createElement("input"), mark = document.createElement("i");
        box.type = "checkbox";
        box.checked = plot.chosen.get(s.name);
        box.addEventListener("change", () => { plot.chosen.set(s.name, box.checked); drawPlots(); });
        mark.style.background = s.colour;
        label.append(box, mark, s.name);
        item.append(label);
        return item;
      }));
    }
  }

  function niceStep(range, parts) {
    const rough = range / parts, unit = 10 ** Math.floor(Math.log10(rough));
    return unit * [1, 2, 5, 10].find((k) => k * unit >= rough);
  }

  function drawPlot(plot) {
    const { canvas } = plot, ratio = Math.min(window.devicePixelRatio, 2), width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const g = canvas.getContext("2d");
    g.scale(ratio, ratio);
    g.font = "10px system-ui, sans-serif";
    const chosen = plot.series.filter((s) => plot.chosen.get(s.name));
    let low = 0, high = 0;
    for (const s of chosen) for (const v of s.value) { low = Math.min(low, v); high = Math.max(high, v); }
    if (!(high > low)) high = low + 1;
    const left = 46, right = 6, top = 6, bottom = 16, t0 = frames[0].time, t1 = Math.max(frames[frames.length - 1].time, t0 + 1e-9);
    const x = (t) => left + (t - t0) / (t1 - t0) * (width - left - right), y = (v) => height - bottom - (v - low) / (high - low) * (height - top - bottom);
    const line = (x0, y0, x1, y1, colour) => { g.strokeStyle = colour; g.beginPath(); g.moveTo(x0, y0); g.lineTo(x1, y1); g.stroke(); };
    g.fillStyle = "#5d6875";
    g.textAlign = "right";
    g.textBaseline = "middle";
    const stepY = niceStep(high - low, 4), stepX = niceStep(t1 - t0, 5);
    for (let v = Math.ceil(low / stepY - 1e-9) * stepY; v <= high + 1e-9 * stepY; v += stepY) {
      line(left, y(v), width - right, y(v), "#e4e7eb");
      g.fillText(Number(v.toPrecision(3)).toString(), left - 4, y(v));
    }
    g.textAlign = "center";
    g.textBaseline = "top";
    for (let t = Math.ceil(t0 / stepX - 1e-9) * stepX; t <= t1 + 1e-9 * stepX; t += stepX) {
      g.fillText(`${Number(t.toPrecision(3))} s`, Math.min(x(t), width - 14), height - bottom + 3);
    }
    g.lineWidth = 1.4;
    for (const s of chosen) {
      g.strokeStyle = s.colour;
      g.beginPath();
      s.value.forEach((v, i) => g.lineTo(x(frames[i].time), y(v)));
      g.stroke();
    }
    g.lineWidth = 1;
    if (shown >= 0) line(x(frames[shown].time), top, x(frames[shown].time), height - bottom, "#c2571a");
  }

  function drawPlots() { plots.forEach(drawPlot); }

  // ---- Controls ----

  function pause() { playing = false; byId("play").textContent = "▶"; }

  function play() {
    if (frames.length < 2) return;
    if (shown === frames.length - 1) showFrame(0);
    playing = true;
    byId("play").textContent = "❚❚";
    let begin = performance.now(), time = frames[shown].time;
    const tick = (now) => {
      if (!playing) return;
      const at = time + (now - begin) / 1000 * Number(byId("rate").value);
      let next = shown;
      while (next + 1 < frames.length && frames[next + 1].time <= at) ++next;
      if (next !== shown) { showFrame(next); begin = now; time = at; }
      if (shown === frames.length - 1) { pause(); return; }
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  function listObjects() {
    byId("objects").replaceChildren(...items.map((item) => {
      const entry = document.createElement("li"), label = document.createElement("label"), box = document.createElement("input"), mark = document.createElement("i");
      box.type = "checkbox";
      box.checked = true;
      box.addEventListener("change", () => { item.wanted = box.checked; showFrame(shown); });
      mark.style.background = css(item.look.colour);
      label.append(box, mark, item.look.name + (item.look.solid ? " (obstacle)" : ""));
      entry.append(label);
      return entry;
    }));
  }

  function arrive() {
    widen(frames[0]);
    placeLights();
    listObjects();
    makePlots();
    goHome();
    resize();
  }

  let seen = 0;
  /** After frames were added: limits, plots and the slider follow. */
  function grow() {
    if (!frames.length) return;
    const atEnd = shown < 0 || shown === seen - 1;
    for (; seen < frames.length; ++seen) widen(frames[seen]);
    placeLights();
    byId("scrub").max = frames.length - 1;
    byId("most").textContent = limits.pressure > 0 ? `${Number(limits.pressure.toPrecision(3))} Pa` : "no contact";
    byId("note").textContent = head.follows ? "" : `Reading frames: ${frames.length}`;
    updateSeries();
    showFrame(head.follows && atEnd && !playing ? frames.length - 1 : Math.max(shown, 0));
  }

  function resize() {
    const { clientWidth, clientHeight } = byId("stage");
    renderer.setSize(clientWidth, clientHeight, false);
    camera.aspect = clientWidth / Math.max(clientHeight, 1);
    fitLens();
    drawPlots();
    draw();
  }

  /** Shows the frame of an address such as page.html#frame=12. */
  function followAddress() {
    const wanted = new URLSearchParams(location.hash.slice(1)).get("frame");
    if (wanted === null) return;
    const index = frames.findIndex((f) => f.frame >= Number(wanted));
    showFrame(index < 0 ? frames.length - 1 : index);
  }

  async function follow() {
    for (;;) {
      try {
        const last = frames.length ? frames[frames.length - 1].frame : 0;
        const answer = await fetch(`frames?from=${last + 1}`, { cache: "no-store" });
        if (!answer.ok) throw new Error(await answer.text());
        const bytes = new Uint8Array(await answer.arrayBuffer());
        await addFrames(bytes);
        byId("note").textContent = frames.length ? "" : "Waiting for the first frame ...";
        if (bytes.length === 0 && answer.headers.get("X-Run-Ended") === "true") return;
        if (bytes.length === 0) await new Promise((done) => setTimeout(done, 500));
      } catch (error) {
        byId("note").textContent = `The server does not answer: ${error.message}`;
        await new Promise((done) => setTimeout(done, 2000));
      }
    }
  }

  async function start() {
    document.title = byId("title").textContent = head.title || head.name;
    byId("summary").textContent = `${head.name}, ${head.meshes.length} object${head.meshes.length === 1 ? "" : "s"}, ${head.frame_rate} frames per second`;
    controls.addEventListener("change", draw);
    new ResizeObserver(resize).observe(byId("stage"));
    for (const id of ["pressure", "forces", "points", "particles", "wires"]) byId(id).addEventListener("change", () => showFrame(shown));
    byId("length").addEventListener("input", () => showFrame(shown));
    byId("home").addEventListener("click", goHome);
    byId("play").addEventListener("click", () => playing ? pause() : play());
    byId("scrub").addEventListener("input", () => { pause(); showFrame(Number(byId("scrub").value)); });
    window.addEventListener("hashchange", followAddress);
    document.addEventListener("keydown", (event) => {
      const slides = event.target.type === "range";  // a slider moves by arrows, but has no use for space
      if (["INPUT", "SELECT", "BUTTON"].includes(event.target.tagName) && event.key === " " && !slides) return;
      const to = { ArrowLeft: shown - 1, ArrowRight: shown + 1, Home: 0, End: frames.length - 1 }[event.key];
      if (event.key === " ") { playing ? pause() : play(); event.preventDefault(); }
      if (to !== undefined && !slides) { pause(); showFrame(to); }
    });
    if (head.follows) { await follow(); return; }
    await addFrames(fromBase64(byId("frames").textContent));
    byId("note").textContent = "";
    followAddress();
    document.body.dataset.ready = frames.length;
  }

  start().catch((error) => { byId("note").textContent = `This page cannot be shown: ${error.message}`; });
})();
