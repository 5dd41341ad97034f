// The picture in space: scans, surfaces, lines and a section, drawn with three.js.
'use strict';

/**
 * How much nearer to the eye things are drawn, in the scene. The surface stands behind the scan wherever that is seen; lines stand before
 * both as far as most of the scan is off.
 */
const between = (x, low, high) => Math.min(high, Math.max(low, x));
const NEARER = {
  surface: -between(1.2 * report.largest * 2 / diagonal, 0.004, 0.06),
  scan: 0,
  points: between(report.tolerance * 2 / diagonal, 0.002, 0.006),
  lines: between(3 * report.tolerance * 2 / diagonal, 0.004, 0.012),
  net: 0.014,
};

/** Whether there is no graphics card: smooth edges then take as long as all the rest. */
function drawsInSoftware() {
  const gl = document.createElement('canvas').getContext('webgl2');
  if (!gl) return true;
  const names = gl.getExtension('WEBGL_debug_renderer_info');
  const name = String(gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  const context = gl.getExtension('WEBGL_lose_context');
  if (context) context.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

class Viewer {
  constructor(canvas, arrays) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !drawsInSoftware(), alpha: true, preserveDrawingBuffer: true });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(30, 1, 0.01, 50);
    this.controls = new THREE.TrackballControls(this.camera, canvas);
    Object.assign(this.controls, { staticMoving: true, rotateSpeed: 2.4, zoomSpeed: 0.9, panSpeed: 0.5, minDistance: 0.02, maxDistance: 20 });
    this.parts = report.parts.map((part, number) => this.readPart(arrays, number, part));
    this.shared = this.sharedUniforms();
    this.layers = new Map();
    this.parts.forEach((part, number) => { this.number = number; this.addPart(part); });
    this.number = undefined;
    this.sectionLine = this.addLines('section', new Float32Array(0), null, [0, 0, 0], NEARER.net, 1);
    this.onDraw = () => {};
    this.isStale = true;
    this.isAtHome = true;
    this.controls.addEventListener('change', () => { this.isStale = true; });
    this.controls.addEventListener('start', () => { this.isAtHome = false; });
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.resize();
  }

  readPart(arrays, number, part) {
    const of = (name) => arrays.get(`${number}.${name}`);
    const found = {
      name: part.name,
      points: places(of('points')),
      deviations: deviations(of('deviations')),
      triangles: of('triangles') || new Uint32Array(0),
      parameters: of('parameters'),
      setAside: of('set-aside') || new Uint32Array(0),
      leftOut: places(of('left-out')),
      vertices: places(of('vertices')),
      normals: directions(of('normals')),
      faces: of('faces'),
      cellLines: of('cell-lines'),
      faceLines: of('face-lines'),
      control: places(of('control')),
      controlLines: of('control-lines'),
      cells: of('cells'),
    };
    found.isAside = new Uint8Array(found.deviations.length);
    found.setAside.forEach((i) => { found.isAside[i] = 1; });
    const shading = of('shading');
    found.pointNormals = shading ? directions(shading) : vertexNormals(found.points, found.triangles);
    return found;
  }

  sharedUniforms() {
    const colours = report.bands.map((band) => new THREE.Vector3(...band.colour.map((c) => c / 255)));
    return {
      tolerance: { value: report.tolerance || 1 },
      onlyBeyond: { value: false },
      uppers: { value: report.bands.slice(0, -1).map((band) => band.upper) },
      colours: { value: colours },
      section: { value: new THREE.Vector4(0, 0, 0, 1) },
      reflects: { value: false },
      pointSize: { value: 4 },
    };
  }

  material(vertexShader, fragmentShader, uniforms, nearer) {
    return new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader, fragmentShader, side: THREE.DoubleSide,
      uniforms: { ...this.shared, nearer: { value: nearer }, ...uniforms },
    });
  }

  add(layer, object) {
    object.frustumCulled = false;
    object.userData.part = this.number;
    if (!this.layers.has(layer)) this.layers.set(layer, []);
    this.layers.get(layer).push(object);
    this.scene.add(object);
    return object;
  }

  addPart(part) {
    const kept = (i) => !part.isAside[i];
    const scan = new THREE.BufferGeometry();
    scan.setAttribute('position', new THREE.BufferAttribute(part.points, 3));
    scan.setAttribute('deviation', new THREE.BufferAttribute(part.deviations, 1));
    if (part.pointNormals) scan.setAttribute('normal', new THREE.BufferAttribute(part.pointNormals, 3));
    const scanMaterial = (isDisc, nearer) => this.material(SCAN_VERTEX, SCAN_FRAGMENT, { isDisc: { value: isDisc } }, nearer);
    if (part.triangles.length) {
      const geometry = scan.clone();
      geometry.setIndex(new THREE.BufferAttribute(part.triangles.filter((_, i, all) => {
        const first = i - i % 3;
        return kept(all[first]) && kept(all[first + 1]) && kept(all[first + 2]);
      }), 1));
      this.add('scan', new THREE.Mesh(geometry, scanMaterial(false, NEARER.scan)));
    }
    const indices = Uint32Array.from({ length: part.deviations.length }, (_, i) => i);
    scan.setIndex(new THREE.BufferAttribute(indices.filter(kept), 1));
    this.add(part.triangles.length ? 'points' : 'scan', new THREE.Points(scan, scanMaterial(true, NEARER.points)));
    if (part.setAside.length) {
      const aside = scan.clone();
      aside.setIndex(new THREE.BufferAttribute(part.setAside, 1));
      this.add('set-aside', new THREE.Points(aside, scanMaterial(true, NEARER.net)));
    }
    this.spacing = Math.max(this.spacing || 0, meanSpacing(part));
    const surface = new THREE.BufferGeometry();
    surface.setAttribute('position', new THREE.BufferAttribute(part.vertices, 3));
    surface.setAttribute('normal', new THREE.BufferAttribute(part.normals, 3));
    surface.setIndex(new THREE.BufferAttribute(part.faces, 1));
    this.add('surface', new THREE.Mesh(surface, this.material(SURFACE_VERTEX, SURFACE_FRAGMENT, {}, NEARER.surface)));
    this.addLines('cells', part.vertices, part.cellLines, [0.2, 0.2, 0.2], NEARER.lines, part.cellLines.length > 20000 ? 0.3 : 0.55);
    this.addLines('cells', part.vertices, part.faceLines, [0.1, 0.1, 0.1], NEARER.lines, 0.9);
    this.addLines('net', part.control, part.controlLines, [0.5, 0.25, 1], NEARER.net, 0.8);
    if (part.leftOut.length) {
      const geometry = new THREE.BufferGeometry().setAttribute('position', new THREE.BufferAttribute(part.leftOut, 3));
      const uniforms = { ink: { value: new THREE.Vector3(0.75, 0.15, 0.66) }, opacity: { value: 1 }, pointSize: { value: 4 } };
      this.add('left-out', new THREE.Points(geometry, this.material(LINE_VERTEX, LINE_FRAGMENT, uniforms, NEARER.points)));
    }
  }

  addLines(layer, vertices, lines, ink, nearer, opacity) {
    const geometry = new THREE.BufferGeometry().setAttribute('position', new THREE.BufferAttribute(vertices, 3));
    if (lines) geometry.setIndex(new THREE.BufferAttribute(lines, 1));
    const uniforms = { ink: { value: new THREE.Vector3(...ink) }, opacity: { value: opacity }, pointSize: { value: 3 } };
    const material = this.material(LINE_VERTEX, LINE_FRAGMENT, uniforms, nearer);
    material.transparent = opacity < 1;
    material.depthWrite = false;
    return this.add(layer, new THREE.LineSegments(geometry, material));
  }

  show(layer, isShown) {
    (this.layers.get(layer) || []).forEach((object) => { object.visible = isShown; });
    this.isStale = true;
  }

  isShown(layer) { return (this.layers.get(layer) || []).some((object) => object.visible); }

  /** Shows one part alone, or all of them for -1. */
  isolate(number) {
    this.isolated = number;
    this.layers.forEach((objects) => objects.forEach((object) => {
      if (object.userData.part !== undefined) object.layers[number < 0 || object.userData.part === number ? 'enable' : 'disable'](0);
    }));
    this.home();
  }

  shownParts() { return this.parts.filter((_, i) => !(this.isolated >= 0) || i === this.isolated); }

  ink(layer, [r, g, b]) {
    (this.layers.get(layer) || []).forEach((object) => object.material.uniforms.ink.value.set(r, g, b));
    this.isStale = true;
  }

  set(name, value) { this.shared[name].value = value; this.isStale = true; }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.controls.handleResize();
    if (this.isAtHome) this.home();
    this.isStale = true;
  }

  draw() {
    this.isStale = false;
    const distance = this.camera.position.distanceTo(this.controls.target);
    this.camera.near = Math.max(0.002, distance - 3);
    this.camera.far = distance + 4;
    this.camera.updateProjectionMatrix();
    const pixels = this.renderer.domElement.height / (2 * Math.tan(this.camera.fov * Math.PI / 360));
    this.shared.pointSize.value = 2 * this.spacing * pixels;
    this.renderer.render(this.scene, this.camera);
    this.onDraw();
  }

  /** Draws whenever something has changed. */
  run() {
    const step = () => {
      this.controls.update();
      if (this.isStale) this.draw();
      requestAnimationFrame(step);
    };
    step();
  }

  /** Looks from where `eye` points to, so that all is seen. */
  look(eye, up) {
    const [e, u] = [new THREE.Vector3(...eye), new THREE.Vector3(...up)];
    const right = new THREE.Vector3().crossVectors(u, e);
    const tangent = Math.tan(this.camera.fov * Math.PI / 360);
    // The distance from which every point lies within the picture, and the middle of what is seen.
    const box = { r: [Infinity, -Infinity], u: [Infinity, -Infinity] };
    const each = (visit) => this.shownParts().forEach((part) => [part.vertices, part.points].forEach((all) => {
      const step = 3 * Math.max(1, Math.floor(all.length / 3 / 20000));
      for (let i = 0; i + 2 < all.length; i += step) visit(all[i], all[i + 1], all[i + 2]);
    }));
    each((x, y, z) => {
      const a = x * right.x + y * right.y + z * right.z, b = x * u.x + y * u.y + z * u.z;
      box.r = [Math.min(box.r[0], a), Math.max(box.r[1], a)];
      box.u = [Math.min(box.u[0], b), Math.max(box.u[1], b)];
    });
    const target = new THREE.Vector3();
    if (box.r[0] <= box.r[1]) target.addScaledVector(right, (box.r[0] + box.r[1]) / 2).addScaledVector(u, (box.u[0] + box.u[1]) / 2);
    let distance = 0.2;
    each((x, y, z) => {
      const [dx, dy, dz] = [x - target.x, y - target.y, z - target.z];
      const a = Math.abs(dx * right.x + dy * right.y + dz * right.z) / (tangent * this.camera.aspect);
      const b = Math.abs(dx * u.x + dy * u.y + dz * u.z) / tangent;
      distance = Math.max(distance, Math.max(a, b) + dx * e.x + dy * e.y + dz * e.z);
    });
    this.controls.target.copy(target);
    this.camera.position.copy(target).addScaledVector(e, 1.12 * distance);
    this.camera.up.copy(u);
    this.camera.lookAt(target);
    this.controls.update();
    this.isAtHome = false;
    this.isStale = true;
  }

  home() {
    this.look(report.view.eye, report.view.up);
    this.isAtHome = true;
  }

  /** Moves to a place within a moment, to look at it from before the surface. */
  flyTo(place) {
    const to = new THREE.Vector3(...place);
    const [from, start] = [this.controls.target.clone(), this.camera.position.clone()];
    const normal = new THREE.Vector3(...this.normalNear(place));
    const eye = start.clone().sub(from).normalize();
    if (normal.dot(eye) < 0.3 && normal.lengthSq() > 0) eye.addScaledVector(normal, 1 - normal.dot(eye)).normalize();
    const end = to.clone().addScaledVector(eye, 0.75);
    const began = performance.now();
    this.isAtHome = false;
    const step = () => {
      const t = Math.min(1, (performance.now() - began) / 450), smooth = t * t * (3 - 2 * t);
      this.controls.target.lerpVectors(from, to, smooth);
      this.camera.position.lerpVectors(start, end, smooth);
      this.camera.lookAt(this.controls.target);
      this.isStale = true;
      if (t < 1) requestAnimationFrame(step);
    };
    step();
  }

  normalNear([x, y, z]) {
    return this.nearest([x, y, z]).normal;
  }

  /** The normal of the surface nearest to a place, and the number of its part. */
  nearest([x, y, z]) {
    let best = [Infinity, [0, 0, 0], 0];
    for (const [number, { vertices: v, normals: n }] of this.parts.entries()) {
      for (let i = 0; i < v.length; i += 3) {
        const squared = (v[i] - x) ** 2 + (v[i + 1] - y) ** 2 + (v[i + 2] - z) ** 2;
        if (squared < best[0]) best = [squared, [n[i], n[i + 1], n[i + 2]], number];
      }
    }
    return { normal: best[1], part: best[2] };
  }

  /** Where a place is in the picture, in pixels of the page; null behind the eye. */
  onScreen(place) {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    const at = new THREE.Vector3(...place).project(this.camera);
    if (at.z > 1 || this.isCut(place)) return null;
    return [(at.x + 1) / 2 * width, (1 - at.y) / 2 * height];
  }

  /** Whether a place is on the far side of a surface that faces so. */
  facesAway(place, facing) {
    const { x, y, z } = this.camera.position;
    return (x - place[0]) * facing[0] + (y - place[1]) * facing[1] + (z - place[2]) * facing[2] < -0.05;
  }

  isCut([x, y, z]) {
    const s = this.shared.section.value;
    return s.x * x + s.y * y + s.z * z > s.w;
  }

  /** The place of the scan that is seen at a pixel: its coordinates in the scene, and its deviation; null if there is none. */
  pick(x, y) {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    const toward = new THREE.Vector3(x / width * 2 - 1, 1 - y / height * 2, 0.5).unproject(this.camera);
    const origin = this.camera.position, ray = toward.sub(origin).normalize();
    const onlyBeyond = this.shared.onlyBeyond.value ? this.shared.tolerance.value : -1;
    let best = null;
    for (const part of this.shownParts()) {
      const found = part.triangles.length && this.isShown('scan')
        ? pickTriangle(part, origin, ray, onlyBeyond, (p) => this.isCut(p))
        : pickPoint(part, origin, ray, onlyBeyond, (p) => this.isCut(p), this.spacing, 6 / height * 2 * Math.tan(this.camera.fov * Math.PI / 360));
      if (found && (!best || found.distance < best.distance)) best = found;
    }
    return best;
  }
}

/** Normals at the points of triangles, each weighed by area; null without triangles. */
function vertexNormals(points, triangles) {
  if (!triangles.length) return null;
  const normals = new Float32Array(points.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t], b = 3 * triangles[t + 1], c = 3 * triangles[t + 2];
    const [px, py, pz] = [points[b] - points[a], points[b + 1] - points[a + 1], points[b + 2] - points[a + 2]];
    const [qx, qy, qz] = [points[c] - points[a], points[c + 1] - points[a + 1], points[c + 2] - points[a + 2]];
    const [nx, ny, nz] = [py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx];
    for (const v of [a, b, c]) { normals[v] += nx; normals[v + 1] += ny; normals[v + 2] += nz; }
  }
  return normals;
}

/** About how far points are apart: the root of the surface's area for each. */
function meanSpacing(part) {
  let area = 0;
  for (let t = 0; t < part.faces.length; t += 3) {
    const v = part.vertices, a = 3 * part.faces[t], b = 3 * part.faces[t + 1], c = 3 * part.faces[t + 2];
    const [px, py, pz] = [v[b] - v[a], v[b + 1] - v[a + 1], v[b + 2] - v[a + 2]];
    const [qx, qy, qz] = [v[c] - v[a], v[c + 1] - v[a + 1], v[c + 2] - v[a + 2]];
    area += Math.hypot(py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx) / 2;
  }
  return Math.sqrt(area / Math.max(1, part.deviations.length)) || 0.01;
}

function pickTriangle({ points: v, triangles, deviations: d, isAside }, o, r, onlyBeyond, isCut) {
  let best = null;
  for (let t = 0; t < triangles.length; t += 3) {
    const [i, j, k] = [triangles[t], triangles[t + 1], triangles[t + 2]];
    const a = 3 * i, b = 3 * j, c = 3 * k;
    const ex = v[b] - v[a], ey = v[b + 1] - v[a + 1], ez = v[b + 2] - v[a + 2];
    const fx = v[c] - v[a], fy = v[c + 1] - v[a + 1], fz = v[c + 2] - v[a + 2];
    const px = r.y * fz - r.z * fy, py = r.z * fx - r.x * fz, pz = r.x * fy - r.y * fx;
    const det = ex * px + ey * py + ez * pz;
    if (Math.abs(det) < 1e-18) continue;
    const sx = o.x - v[a], sy = o.y - v[a + 1], sz = o.z - v[a + 2];
    const w1 = (sx * px + sy * py + sz * pz) / det;
    if (w1 < 0 || w1 > 1) continue;
    const qx = sy * ez - sz * ey, qy = sz * ex - sx * ez, qz = sx * ey - sy * ex;
    const w2 = (r.x * qx + r.y * qy + r.z * qz) / det;
    if (w2 < 0 || w1 + w2 > 1) continue;
    const distance = (fx * qx + fy * qy + fz * qz) / det;
    if (distance <= 0 || (best && distance >= best.distance)) continue;
    if (isAside[i] || isAside[j] || isAside[k]) continue;
    const place = [o.x + distance * r.x, o.y + distance * r.y, o.z + distance * r.z];
    const deviation = (1 - w1 - w2) * d[i] + w1 * d[j] + w2 * d[k];
    if (isCut(place) || Math.abs(deviation) <= onlyBeyond) continue;
    best = { distance, place, deviation };
  }
  return best;
}

/** The foremost of the points that are about as near to the ray as the eye can tell. */
function pickPoint({ points: v, deviations: d }, o, r, onlyBeyond, isCut, spacing, perDistance) {
  let best = null;
  for (let i = 0; i < d.length; i++) {
    const x = v[3 * i] - o.x, y = v[3 * i + 1] - o.y, z = v[3 * i + 2] - o.z;
    const distance = x * r.x + y * r.y + z * r.z;
    if (distance <= 0) continue;
    const off = Math.sqrt(Math.max(0, x * x + y * y + z * z - distance * distance));
    const reach = Math.max(0.75 * spacing, perDistance * distance);
    if (off > reach || Math.abs(d[i]) <= onlyBeyond) continue;
    const rank = distance + 2 * off;
    if (best && rank >= best.rank) continue;
    const place = [v[3 * i], v[3 * i + 1], v[3 * i + 2]];
    if (!isCut(place)) best = { rank, distance, place, deviation: d[i] };
  }
  return best;
}

/** The section of triangles with a plane across an axis: pairs of ends [x, y, z, value, x, y, z, value]. */
function sectionOf(points, triangles, values, axis, at) {
  const found = [];
  for (let t = 0; t < triangles.length; t += 3) {
    const corners = [triangles[t], triangles[t + 1], triangles[t + 2]];
    const ends = [];
    for (let k = 0; k < 3; k++) {
      const [a, b] = [corners[k], corners[(k + 1) % 3]];
      const [da, db] = [points[3 * a + axis] - at, points[3 * b + axis] - at];
      if ((da < 0) === (db < 0)) continue;
      const s = da / (da - db);
      for (let j = 0; j < 3; j++) ends.push(points[3 * a + j] + s * (points[3 * b + j] - points[3 * a + j]));
      ends.push(values ? values[a] + s * (values[b] - values[a]) : 0);
    }
    if (ends.length === 8) found.push(ends);
  }
  return found;
}
