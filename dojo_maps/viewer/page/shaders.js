// How surfaces look: the textures and the light of the cameras' pictures, on the graphics card. z is up.
// Without a graphics card what moves is drawn without FINE.
const LIGHT = `
precision highp float;
precision highp sampler2DShadow;
uniform vec3 eye;
uniform vec3 sun;
uniform sampler2DShadow stillShadows, movingShadows;
uniform bool hasMoving;
uniform float shadowBias, haze;
const vec3 SUN = vec3(1.30, 1.17, .96), SKY = vec3(.40, .47, .60), GROUND = vec3(.15, .145, .13);
const vec3 HORIZON = vec3(.70, .79, .88), ZENITH = vec3(.20, .36, .66);

float hashed(vec2 p) {
  vec3 q = fract(vec3(p.xyx) * .1031);
  q += dot(q, q.yzx + 33.33);
  return fract((q.x + q.y) * q.z);
}
float noise(vec2 p) {
  vec2 i = floor(p), f = fract(p);
  f = f * f * (3. - 2. * f);
  return mix(mix(hashed(i), hashed(i + vec2(1, 0)), f.x), mix(hashed(i + vec2(0, 1)), hashed(i + vec2(1, 1)), f.x), f.y) - .5;
}
vec3 skyAt(vec3 ray) {
  float up = max(0., ray.z), glow = max(0., dot(ray, sun)), open = 1. / (1. + 4.5 * up * (1. + 2.2 * up));
  glow *= glow * glow;
  glow *= glow;
  vec3 clear = mix(ZENITH, HORIZON, open) + SUN * .12 * glow * glow;
#ifdef FINE
  clear += SUN * .3 * pow(glow, 50.);
  if (ray.z < .02) return clear;
  vec2 p = 1.3 * ray.xy / (ray.z + .16);
  float cloud = .5 * noise(p) + .28 * noise(2.3 * p) + .17 * noise(5.1 * p) + .1 * noise(11. * p);
  clear = mix(clear, vec3(.98, .99, 1.02), .75 * smoothstep(.06, .38, cloud) * min(1., 5. * (ray.z - .02)));
#endif
  return clear;
}
float fifth(float x) { float square = x * x; return square * square * x; }
// Takes a place as the sun sees it.
float sunlit(vec3 at) {
  vec2 edge = abs(at.xy - .5);
  float inside = 1. - smoothstep(.42, .49, max(edge.x, edge.y));
  if (inside <= 0. || at.z > 1.) return 1.;
#ifdef FINE
  const float d = .8 / 2048.;
  float open = .25 * (texture(stillShadows, at + vec3(d, d, -shadowBias)) + texture(stillShadows, at + vec3(-d, d, -shadowBias))
      + texture(stillShadows, at + vec3(d, -d, -shadowBias)) + texture(stillShadows, at + vec3(-d, -d, -shadowBias)));
#else
  float open = texture(stillShadows, at - vec3(0, 0, shadowBias));
#endif
  if (hasMoving) open = min(open, texture(movingShadows, at - vec3(0, 0, shadowBias)));
  return mix(1., open, inside);
}
vec3 lit(vec3 albedo, vec3 normal, vec3 at) {
  float facing = dot(normal, sun);
  vec3 soft = mix(GROUND, SKY, .5 + .5 * normal.z);
  return albedo * (soft + SUN * (facing > .02 ? facing * sunlit(at) : 0.));
}
vec4 shown(vec3 colour, vec3 place, float alpha) {
  float away = distance(place, eye);
  float veil = max(0., away - haze) / (2600. + 4. * haze);
  colour = min(mix(HORIZON, colour, 1. / (1. + veil + .5 * veil * veil)), 1.);
  // sRGB by roots. Source: I. Taylor, "sRGB Approximations for HLSL", 2010.
  vec3 a = sqrt(colour), b = sqrt(a), c = sqrt(b);
  return vec4(.662002687 * a + .684122060 * b - .323583601 * c - .0225411470 * colour, alpha);
}
`;

const PLASTER = `
vec3 plasterOf(float own) {
  int k = int(own * 7919.) % 10;
  return k == 0 ? vec3(.672,.604,.479) : k == 1 ? vec3(.552,.468,.371) : k == 2 ? vec3(.761,.716,.631)
    : k == 3 ? vec3(.617,.491,.262) : k == 4 ? vec3(.445,.392,.342) : k == 5 ? vec3(.515,.342,.238)
    : k == 6 ? vec3(.305,.117,.072) : k == 7 ? vec3(.392,.423,.445) : k == 8 ? vec3(.731,.617,.381) : vec3(.216,.156,.122);
}
`;

const surfaceVertex = surface => `
precision highp float;
uniform mat4 modelMatrix, viewMatrix, projectionMatrix, shadowMatrix;
in vec4 position, normal;
in vec4 spans;
out vec3 place, facing, shade;
out float along;
flat out float own;
flat out vec2 span;
flat out vec3 plaster;
${surface === "facade" ? PLASTER : ""}
void main() {
  vec4 world = modelMatrix * vec4(position.xyz, 1.);
  place = world.xyz;
  facing = normal.xyz;
  shade = (shadowMatrix * vec4(place + .09 * facing, 1.)).xyz * .5 + .5;
  own = position.w / 32767.;
  plaster = ${surface === "facade" ? "plasterOf(own)" : "vec3(0)"};
  along = spans.z / 64.;
  span = vec2(modelMatrix[2][2] * spans.xy + modelMatrix[3][2]);
  gl_Position = projectionMatrix * viewMatrix * world;
}`;

// What each surface does with `albedo`; `pixel` is about how many metres a pixel covers there.
const SURFACES = {
  plain: "",
  grass: `tone = 1. + .22 * noise(.06 * place.xy);
    albedo *= vec3(1.04, 1.01, .93);
#ifdef FINE
    tone += .16 * noise(.45 * place.xy) + near * (.3 * noise(3.1 * place.xy) + .42 * noise(11. * place.xy));
    albedo *= mix(vec3(1), vec3(1.1, 1.02, .8), .6 * noise(.11 * place.xy + 7.));
#endif`,
  asphalt: `
#ifdef FINE
    tone = 1. + .1 * noise(.21 * place.xy) + .09 * noise(.9 * place.xy) + near * (.2 * noise(9. * place.xy) + .2 * noise(31. * place.xy));
#endif`,
  ballast: `
#ifdef FINE
    tone = 1. + near * 1.1 * noise(6. * place.xy) + .2 * noise(place.xy);
#endif`,
  paving: `
#ifdef FINE
    tone = 1. + .08 * noise(.5 * place.xy);
    if (n.z > .5) {
      vec2 slab = place.xy / vec2(.6, .4);
      slab.x += .5 * mod(floor(slab.y), 2.);
      vec2 joint = abs(fract(slab) - .5);
      tone += near * (.14 * (hashed(floor(slab)) - .5) - .22 * step(.485, max(joint.x, joint.y)));
    } else tone *= 1.08;
#endif`,
  paint: `
#ifdef FINE
    tone = .97 + .1 * noise(2. * place.xy) - near * .3 * max(0., noise(7. * place.xy) + noise(23. * place.xy) - .25);
#endif`,
  foliage: `float high = clamp((place.z - span.x) / max(1., span.y - span.x), 0., 1.);
    vec3 p = place;
    float leaves = 0., twigs = 0.;
#ifdef FINE
    leaves = noise(vec2(p.x - .43 * p.z, p.y + .71 * p.z) * 1.7);
    twigs = noise(vec2(p.x + p.y, 1.3 * p.z + p.x - p.y) * 4.);
#endif
    tone = (.66 + .46 * high) * (1. + .7 * leaves + .7 * twigs);
    albedo *= vec3((.75 + .5 * own) * (.7 + .6 * fract(7.3 * own)), .75 + .5 * own, .75 + .5 * own);
    n = normalize(n + .5 * vec3(leaves, twigs, .3 * leaves));`,
  water: "shine = .05 + .9 * fifth(1. - max(0., dot(n, -ray))); n = normalize(n + .03 * vec3(noise(place.xy), noise(place.yx), 0));",
  glass: "shine = .1 + .9 * fifth(1. - abs(dot(n, ray))); alpha = .3 + shine;",
  facade: `if (n.z > .2) {
      albedo = n.z > .95 ? vec3(.231, .223, .209) : vec3(.231, .072, .045);
#ifdef FINE
      if (n.z > .95) tone = 1. + .3 * noise(3. * place.xy) * near + .1 * noise(.3 * place.xy);
      else tone = 1. + .15 * noise(vec2(along, place.z)) - .3 * near * step(.86, fract(place.z / .24));
#endif
    } else facade();`
};

// The painter of the cameras' facades: plaster, windows in frames on each floor, a cornice, shops.
const FACADE = `
#ifndef FINE
void facade() {
  float height = place.z - span.x, left = span.y - place.z;
  vec2 bay = abs(fract(vec2(along / 2.4, (height - .5) / 3.)) - vec2(.5, .545));
  albedo = height > .6 && left > 1. && bay.x < .23 && bay.y < .27 ? vec3(.11, .13, .16) : plaster;
}
#else
void pane(float behind, float tint) {
  albedo = vec3(.03 + .1 * behind);
  shine = .1 + .9 * fifth(1. - abs(dot(n, ray))) + .12 * tint;
}
void facade() {
  int house = int(own * 32767.);
  float height = place.z - span.x, left = span.y - place.z;
  albedo = plaster;
#ifdef FINE
  tone += .1 * noise(.4 * vec2(along, height));
#endif
  tone -= .12 * max(0., 1. - .5 * left);
  if (left < .5) { tone = left < .32 ? 1.12 : .62; return; }
  if (height < 3.5 && house % 5 < 3 && left > 3.) {
    float i = floor(along / 3.6), u = along / 3.6 - i, edge = min(u - .05, .95 - u);
    if (height > 2.65) { bool sign = height > 2.75 && height < 3.35 && u > .06 && u < .94;
      tone = sign ? .35 + .9 * hashed(vec2(i + float(house % 97), 5)) : .9 * tone; return; }
    if (edge < 0. || height < .35) { tone *= .75; return; }
    if (edge < .014 || abs(u - .5) < .008 || height > 2.58) { tone = .4; return; }
    pane(.3 + .6 * hashed(vec2(floor(along / .7), floor(2.2 * height))), .3); return;
  }
  if (height < .6) { tone *= .7; return; }
  float i = floor(along / 2.4), j = floor((height - .5) / 3.), u = along / 2.4 - i - .5, v = (height - .5) / 3. - j;
  float wide = .2 + .05 * float(house % 3);
  if (abs(u) > wide + .03 || v < .22 || v > .86 || left < 1.) return;
  if (v < .27) { tone = 1.1; return; }
  float border = min(wide - abs(u), .6 * min(v - .27, .82 - v));
  if (border < 0.) { tone *= .92; return; }
  if (border < .025 || abs(u) < .014) { albedo = vec3(.8); tone = 1.; return; }
  float own = hashed(vec2(i + float(house % 89), j));
  pane(own > .5 ? .6 * step(1.3 - own, abs(u) / wide) : own > .3 ? step(own * 2., (v - .27) / .55) : 0., own);
}
#endif`;

function surfaceFragment(surface) {
  return LIGHT + `
in vec3 place, facing, shade;
in float along;
flat in float own;
flat in vec2 span;
flat in vec3 plaster;
uniform vec3 colour;
out vec4 pixelColour;
vec3 albedo, n, ray;
float tone, shine, near;
${surface === "facade" ? FACADE : ""}
void main() {
  float alpha = 1.;
  ray = normalize(place - eye);
  n = normalize(facing);
  if (dot(n, ray) > 0. ) n = -n;
  albedo = colour; tone = 1.; shine = 0.;
  near = clamp(1.4 - distance(place, eye) / 90., 0., 1.);
  ${SURFACES[surface]}
  vec3 seen = lit(albedo * max(.05, tone), n, shade);
  if (shine > 0.) seen = mix(seen, skyAt(reflect(ray, n)), min(1., shine));
  pixelColour = shown(seen, place, alpha);
}`;
}

const SKY_VERTEX = `
precision highp float;
uniform mat4 viewMatrix, projectionMatrix;
in vec3 position;
out vec3 way;
void main() {
  // Corners of the picture, as directions.
  vec4 seen = vec4(position.xy, 1., 1.);
  way = transpose(mat3(viewMatrix)) * vec3(position.x / projectionMatrix[0][0], position.y / projectionMatrix[1][1], -1.);
  gl_Position = seen;
}`;
const SKY_FRAGMENT = LIGHT + `
in vec3 way;
out vec4 pixelColour;
void main() { pixelColour = shown(skyAt(normalize(way)), eye, 1.); }`;

const SHADOW_VERTEX = `
precision highp float;
uniform mat4 modelMatrix, viewMatrix, projectionMatrix;
in vec4 position;
void main() {
  vec4 world = modelMatrix * vec4(position.xyz, 1.);
  gl_Position = projectionMatrix * viewMatrix * world;
}`;
const SHADOW_FRAGMENT = "precision highp float; out vec4 nothing; void main() { nothing = vec4(1); }";

const USER_PLACE = `
in vec4 position;
in vec4 where, turned;
in vec3 size;
vec3 placed() {
  float c = turned.x, s = turned.y, cs = cos(turned.z), ss = sin(turned.z);
  vec3 p = position.xyz / 8192. * size;
  return where.xyz + p.x * vec3(c * cs, s * cs, ss) + p.y * vec3(-s, c, 0) + p.z * vec3(-c * ss, -s * ss, cs);
}`;
const userVertex = parts => `
precision highp float;
precision highp int;
uniform mat4 viewMatrix, projectionMatrix, shadowMatrix;
uniform vec3 palette[${parts}];
uniform int own[${parts}];
uniform int lamp[${parts}];
uniform int ownColours;
uniform highp sampler2D colours;
${USER_PLACE}
out vec3 place, shade;
flat out vec3 paint;
flat out int part, shines;
void main() {
  part = int(position.w);
  paint = palette[part];
  if (own[part] >= 0) {
    int k = int(turned.w) * ownColours + own[part];
    paint = texelFetch(colours, ivec2(k & 1023, k >> 10), 0).rgb;
    paint = pow(paint, vec3(2.2));
  }
  shines = (int(where.w) & lamp[part]) != 0 ? 1 : 0;
  place = placed();
  shade = (shadowMatrix * vec4(place, 1.)).xyz * .5 + .5;
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.);
}`;
const USER_FRAGMENT = LIGHT + `
in vec3 place, shade;
flat in vec3 paint;
flat in int part, shines;
out vec4 pixelColour;
void main() {
  vec3 n = normalize(cross(dFdx(place), dFdy(place))), ray = normalize(place - eye);
  if (shines == 1) { pixelColour = shown(min(vec3(1), paint * 5. + .08), place, 1.); return; }
  vec3 seen = lit(paint, n, shade);
  float share = part == 1 ? .14 : part == 12 ? .4 : part == 0 ? .05 : 0.;
  if (share > 0.) seen = mix(seen, skyAt(reflect(ray, n)), share + (1. - share) * .6 * fifth(1. - abs(dot(n, ray))));
  pixelColour = shown(seen, place, 1.);
}`;
const USER_SHADOW_VERTEX = `
precision highp float;
uniform mat4 viewMatrix, projectionMatrix;
${USER_PLACE}
void main() { gl_Position = projectionMatrix * viewMatrix * vec4(placed(), 1.); }`;

// Paint that shines by itself: movements, lamps, what is selected or measured.
const FLAT_VERTEX = `
precision highp float;
uniform mat4 viewMatrix, projectionMatrix;
in vec3 position;
in vec4 tint;
out vec4 shade;
void main() { shade = tint; gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.); }`;
const FLAT_FRAGMENT = `
precision highp float;
in vec4 shade;
out vec4 pixelColour;
void main() { if (shade.a < .01) discard; pixelColour = shade; }`;
const GLOW_VERTEX = `
precision highp float;
uniform mat4 viewMatrix, projectionMatrix;
uniform float lens;
uniform vec3 eye;
in vec3 position;
in vec4 tint;
in vec2 heading;
out vec4 shade;
void main() {
  shade = tint;
  vec3 towards = normalize(eye - position);
  shade.a *= smoothstep(-.05, .35, dot(towards.xy, heading));
  gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.);
  gl_PointSize = clamp(.9 * lens / gl_Position.w, 5., 46.);
}`;
const GLOW_FRAGMENT = `
precision highp float;
in vec4 shade;
out vec4 pixelColour;
void main() {
  float away = 2. * length(gl_PointCoord - .5);
  float light = shade.a * (smoothstep(.36, .22, away) + .55 * pow(max(0., 1. - away), 2.));
  if (light < .01) discard;
  pixelColour = vec4(shade.rgb * light, 1.);
}`;
