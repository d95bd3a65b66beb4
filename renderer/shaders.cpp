#include <renderer/shaders.hpp>

namespace piecework::render::shaders {

// Light colours and strengths are chosen so that a lit surface shows about its own colour.

const char* const kClothVertex = R"glsl(
layout(location = 0) in vec3 a_position;
layout(location = 1) in vec3 a_normal;
layout(location = 2) in vec4 a_ambient;
layout(location = 3) in float a_key;
uniform mat4 u_clip;
#ifdef BODY
uniform vec3 u_eye;
// Triangles of cloth cut a little into bodies that only their vertices keep off; this far behind
// itself, seen from the eye, a body does not show through them. Display units.
const float kBehind = 0.004;
#endif
out vec3 v_position;
out vec3 v_normal;
out vec4 v_ambient;
out float v_key;
void main() {
  v_position = a_position;
  v_normal = a_normal;
  v_ambient = a_ambient;
  v_key = a_key;
#ifdef BODY
  gl_Position = u_clip * vec4(a_position + kBehind * normalize(a_position - u_eye), 1.0);
#else
  gl_Position = u_clip * vec4(a_position, 1.0);
#endif
}
)glsl";

const char* const kClothFragment = R"glsl(
in vec3 v_position;
in vec3 v_normal;
in vec4 v_ambient;
in float v_key;
uniform vec3 u_eye;
uniform vec3 u_key_direction;
uniform vec3 u_fill_direction;
uniform samplerBuffer u_colors;   // per drawn triangle, square root of linear light
uniform int u_first_triangle;
uniform float u_back;             // factor of the colour on the back side
uniform vec3 u_body;              // colour of bodies, linear light
uniform float u_pixel;            // size of a pixel at depth 1
uniform float u_samples;          // per pixel and axis
out vec4 o_color;

const vec3 kKey = vec3(0.98, 0.91, 0.80);
const vec3 kFill = vec3(0.13, 0.15, 0.18);
const vec3 kSky = vec3(0.36, 0.405, 0.48);
const vec3 kBounce = vec3(0.32, 0.30, 0.28);

vec3 compress(vec3 x) {  // identity below the knee, then a soft shoulder towards 1
  const float knee = 0.55;
  vec3 t = max(x - knee, 0.0) * (1.0 / (1.0 - knee));
  return min(x, vec3(knee)) + (1.0 - knee) * t / (1.0 + t);
}

float segment_distance(vec3 p, vec3 a, vec3 b) {
  vec3 along = b - a;
  vec3 offset = p - a;
  float t = clamp(dot(offset, along) / max(dot(along, along), 1e-20), 0.0, 1.0);
  return length(offset - t * along);
}

// Part of the sample that a line of half width `half_width` covers at distance d from its middle.
// On surfaces seen edge-on the line keeps about a pixel.
float line_cover(float d, float half_width, float pixel) {
  float step = pixel / u_samples;
  float footprint = clamp(fwidth(d), 0.7 * step, 6.0 * step);
  float width = max(half_width, 0.5 * u_samples * footprint);
  return clamp((width - d) / footprint + 0.5, 0.0, 1.0);
}

#ifdef BORDERS
uniform isamplerBuffer u_ranges;
uniform samplerBuffer u_segments;
uniform float u_border_pixels;    // half width of a border line

float border_ink(float pixel) {
  ivec2 range = texelFetch(u_ranges, gl_PrimitiveID).xy;
  float d = 1e9;
  for (int i = 0; i < range.y; ++i) {
    int at = 2 * (range.x + i);
    d = min(d, segment_distance(v_position, texelFetch(u_segments, at).xyz,
                                texelFetch(u_segments, at + 1).xyz));
  }
  return line_cover(d, u_border_pixels * pixel, pixel);
}
#endif

#ifdef MESH_LINES
uniform samplerBuffer u_corners;  // three per drawn triangle, of its source; w of the first: size
uniform float u_line_pixels;

float mesh_ink(float pixel) {
  int at = 3 * (gl_PrimitiveID + u_first_triangle);
  vec4 a = texelFetch(u_corners, at);
  vec3 b = texelFetch(u_corners, at + 1).xyz;
  vec3 c = texelFetch(u_corners, at + 2).xyz;
  float d = min(segment_distance(v_position, a.xyz, b),
                min(segment_distance(v_position, b, c), segment_distance(v_position, c, a.xyz)));
  // Where triangles are only a few pixels large, lines fade instead of turning the cloth black.
  return line_cover(d, u_line_pixels * pixel, pixel) * clamp(a.w / (5.0 * pixel) - 0.5, 0.0, 1.0);
}
#endif

void main() {
#ifdef BODY
  vec3 albedo = u_body;
#else
  vec3 code = texelFetch(u_colors, gl_PrimitiveID + u_first_triangle).rgb;
  vec3 albedo = code * code;
#endif
#if defined(BORDERS) || defined(MESH_LINES)
  float pixel = u_pixel / gl_FragCoord.w;
#endif
#ifdef MESH_LINES
  albedo *= 1.0 - 0.55 * mesh_ink(pixel);
#endif
#ifdef BORDERS
  albedo *= mix(vec3(1.0), vec3(0.085, 0.085, 0.10), border_ink(pixel));
#endif
  vec3 normal = normalize(v_normal);
  vec2 ambient = v_ambient.xy;
  if (!gl_FrontFacing) {
    normal = -normal;
    ambient = v_ambient.zw;
#ifndef BODY
    albedo *= u_back;
#endif
  }
  vec3 view = normalize(u_eye - v_position);
  float facing = dot(normal, u_key_direction);
  float lit = max(facing, 0.0) * v_key;
#ifdef BODY
  const float through = 0.0;
#else
  float through = max(-facing, 0.0) * v_key;   // thin cloth glows a little against the light
#endif
  float fill = 0.5 + 0.5 * dot(normal, u_fill_direction);
  vec3 light = kKey * (lit + 0.16 * through) + kSky * ambient.x + kBounce * ambient.y +
               kFill * (fill * (ambient.x + ambient.y));
  float gloss = max(dot(normal, normalize(view + u_key_direction)), 0.0);
  gloss *= gloss; gloss *= gloss; gloss *= gloss; gloss *= gloss;   // to the power of 16
  float rim = 1.0 - max(dot(normal, view), 0.0);
  rim *= rim;
  float sheen = 0.05 * gloss * v_key + 0.10 * rim * rim * ambient.x;
  o_color = vec4(sqrt(compress(albedo * light + sheen)), 1.0);
}
)glsl";

// The gradient behind everything, shared by background and ground.
#define PIECEWORK_BACKDROP                                                           \
  "uniform float u_bottom;   // first row of the tile, from below, in samples\n"     \
  "uniform float u_rows;     // rows of the whole picture, in samples\n"             \
  "vec3 backdrop() {\n"                                                              \
  "  float y = (gl_FragCoord.y + u_bottom) / u_rows;\n"                              \
  "  return mix(vec3(0.955, 0.950, 0.940), vec3(0.800, 0.835, 0.875),\n"             \
  "             y * y * (3.0 - 2.0 * y));\n"                                         \
  "}\n"                                                                              \
  "// Ordered dither of half a step: 256 shades of a wide gradient show as bands.\n" \
  "vec4 encode(vec3 linear) {\n"                                                     \
  "  ivec2 p = ivec2(gl_FragCoord.xy) & 3;\n"                                        \
  "  int x = p.x ^ p.y;\n"                                                           \
  "  int rank = ((x & 1) << 3) | ((p.y & 1) << 2) | (x & 2) | (p.y >> 1);\n"         \
  "  return vec4(sqrt(linear) + (float(rank) - 7.5) / (16.0 * 255.0), 1.0);\n"       \
  "}\n"

const char* const kBackgroundVertex = R"glsl(
void main() {
  vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  gl_Position = vec4(corner, 1.0, 1.0);
}
)glsl";

const char* const kBackgroundFragment = PIECEWORK_BACKDROP R"glsl(
out vec4 o_color;
void main() { o_color = encode(backdrop()); }
)glsl";

const char* const kGroundVertex = R"glsl(
uniform mat4 u_clip;
uniform float u_ground_height;
uniform float u_radius;
out vec2 v_ground;
void main() {
  v_ground = u_radius * vec2((gl_VertexID & 1) == 0 ? -1.0 : 1.0, gl_VertexID < 2 ? -1.0 : 1.0);
  gl_Position = u_clip * vec4(v_ground.x, u_ground_height, v_ground.y, 1.0);
}
)glsl";

const char* const kGroundFragment = PIECEWORK_BACKDROP R"glsl(
in vec2 v_ground;
uniform sampler2D u_light;        // key, sky
uniform vec4 u_rectangle;         // low x, low z, 1 / width, 1 / depth of the texture
uniform float u_radius;
out vec4 o_color;
const vec3 kKeyPart = vec3(0.455, 0.44, 0.415);   // of a white ground's light; the sky has the rest
void main() {
  vec2 light = texture(u_light, (v_ground - u_rectangle.xy) * u_rectangle.zw).rg;
  float fade = 1.0 - smoothstep(0.35 * u_radius, 0.95 * u_radius, length(v_ground));
  vec3 shade = kKeyPart * light.x + (1.0 - kKeyPart) * light.y;
  o_color = encode(backdrop() * mix(vec3(1.0), shade, fade));
}
)glsl";

const char* const kDotVertex = R"glsl(
layout(location = 0) in vec4 a_ball;    // centre, radius
layout(location = 1) in vec4 a_color;   // square root of linear light
uniform mat4 u_clip;
uniform vec3 u_eye;
uniform vec3 u_right;
uniform vec3 u_up;
out vec2 v_corner;
out vec3 v_color;
void main() {
  v_corner = 1.15 * vec2((gl_VertexID & 1) == 0 ? -1.0 : 1.0, gl_VertexID < 2 ? -1.0 : 1.0);
  v_color = a_color.rgb * a_color.rgb;
  vec3 towards = normalize(u_eye - a_ball.xyz);
  vec3 p = a_ball.xyz + a_ball.w * (v_corner.x * u_right + v_corner.y * u_up + 1.2 * towards);
  gl_Position = u_clip * vec4(p, 1.0);
}
)glsl";

const char* const kDotFragment = R"glsl(
in vec2 v_corner;
in vec3 v_color;
out vec4 o_color;
void main() {
  float r = length(v_corner);
  float edge = max(fwidth(r), 1e-4);
  float cover = clamp((1.0 - r) / edge + 0.5, 0.0, 1.0);
  if (cover <= 0.0) discard;
  float height = sqrt(max(1.0 - r * r, 0.0));
  float lit = 0.72 + 0.40 * max(dot(vec3(v_corner, height), vec3(-0.45, 0.62, 0.64)), 0.0);
  float outline = 1.0 - 0.75 * clamp((r - 0.80) / max(edge, 0.06), 0.0, 1.0);
  float glint = max(dot(vec3(v_corner, height), vec3(-0.40, 0.55, 0.733)), 0.0);
  glint *= glint; glint *= glint; glint *= glint; glint *= glint;
  o_color = vec4(sqrt(min(v_color * lit * outline + 0.25 * glint * outline, 1.0)), cover);
}
)glsl";

#undef PIECEWORK_BACKDROP

}  // namespace piecework::render::shaders
