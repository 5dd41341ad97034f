// What the graphics card runs. Things are moved a little along the line to the eye, so that lines lie on surfaces and the scan before
// the surface, wherever one looks from.

const VERTEX_START = `
precision highp float;
uniform mat4 modelViewMatrix, projectionMatrix;
uniform float nearer;
in vec3 position;
out vec3 place;
vec4 seen() {
  place = position;
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  seen.xyz *= max(0.1, 1.0 - nearer / length(seen.xyz));
  return seen;
}`;

const FRAGMENT_START = `
precision highp float;
uniform vec4 section;
in vec3 place;
out vec4 colour;
void cut() { if (dot(section.xyz, place) > section.w) discard; }`;

const BANDS = `
uniform float tolerance;
uniform bool onlyBeyond;
uniform float uppers[8];
uniform vec3 colours[9];
vec3 banded(float deviation) {
  float relative = deviation / tolerance;
  if (onlyBeyond && abs(relative) <= 1.0) discard;
  for (int i = 0; i < 8; i++) if (relative <= uppers[i]) return colours[i];
  return colours[8];
}
float shade(vec3 normal, vec3 towards) { return 0.5 + 0.5 * abs(dot(normalize(normal), normalize(towards))); }`;

const SCAN_VERTEX = VERTEX_START + `
uniform float pointSize;
in float deviation;
in vec3 normal;
out float off;
out vec3 facing, towards;
void main() {
  vec4 eye = seen();
  off = deviation;
  facing = mat3(modelViewMatrix) * normal;
  towards = -eye.xyz;
  gl_Position = projectionMatrix * eye;
  gl_PointSize = clamp(pointSize / gl_Position.w, 2.0, 14.0);
}`;

const SCAN_FRAGMENT = FRAGMENT_START + BANDS + `
uniform bool isDisc;
in float off;
in vec3 facing, towards;
void main() {
  cut();
  if (isDisc && length(gl_PointCoord - 0.5) > 0.5) discard;
  float light = dot(facing, facing) > 0.0 ? shade(facing, towards) : 1.0;
  colour = vec4(banded(off) * light, 1.0);
}`;

const SURFACE_VERTEX = VERTEX_START + `
in vec3 normal;
out vec3 facing, towards;
void main() {
  vec4 eye = seen();
  facing = mat3(modelViewMatrix) * normal;
  towards = -eye.xyz;
  gl_Position = projectionMatrix * eye;
}`;

// Reflection lines: what parallel bright tubes overhead would show on a polished surface. Where neighbours join with a kink the lines
// break, where curvature jumps they have a corner.
const SURFACE_FRAGMENT = FRAGMENT_START + `
uniform bool reflects;
in vec3 facing, towards;
void main() {
  cut();
  vec3 normal = normalize(facing), eye = normalize(towards);
  if (dot(normal, eye) < 0.0) normal = -normal;
  float light = 0.45 + 0.55 * dot(normal, eye);
  colour = vec4(vec3(0.74, 0.76, 0.79) * light, 1.0);
  if (reflects) {
    vec3 back = reflect(-eye, normal);
    float angle = atan(back.x, back.z + 1.05) * 9.0;
    float width = max(fwidth(angle), 1e-4);
    float line = smoothstep(-width, width, sin(6.2831853 * angle) * 0.16);
    colour = vec4(mix(vec3(0.09, 0.11, 0.14), vec3(0.95, 0.96, 0.97), line) * (0.7 + 0.3 * light), 1.0);
  }
}`;

const LINE_VERTEX = VERTEX_START + `
uniform float pointSize;
void main() { gl_Position = projectionMatrix * seen(); gl_PointSize = pointSize; }`;

const LINE_FRAGMENT = FRAGMENT_START + `
uniform vec3 ink;
uniform float opacity;
void main() { cut(); colour = vec4(ink, opacity); }`;
