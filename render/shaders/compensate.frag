// Which codes make the real surface send the target. Compensation (compensation.h) is the same in
// double precision and says what each step means.
layout(std140, binding = 1) uniform Compensation {
  mat4 drive_from_target;  // of the mat4, the upper left 3 x 3 counts
  mat4 cones_from_target;
  mat4 drive_from_cones;
  mat4 cones_from_drive;
  vec4 drive_of_ambient;
  vec4 drive_of_black;
  vec4 drive_of_white;
  ivec4 first_level;  // of each channel in Tones.levels
  ivec4 level_count;
  float geometry_floor;
  float gamut_tolerance;
  float dither;  // 1: on
} constants;

layout(std430, binding = 0) readonly buffer Tones {
  uint seeds[3 * SEED_COUNT];  // lowest level | highest level << 16
  vec2 levels[];               // output, code
} tones;

layout(binding = 0) uniform sampler2D target_texture;
layout(binding = 1) uniform sampler2D vignetting_texture;
uniform uint dither_seed;

layout(location = 0) out uvec4 codes;  // a: PixelState << 14 | gamut loss in units of 1/64

const uint kNotCovered = 0u;
const uint kInGamut = 1u;
const uint kOutOfGamut = 2u;
const uint kOutOfReach = 3u;
const float kIptExponent = 0.43;
// Larger is infinite or came from something that is: half floats end at 65504.
const float kFinite = 1e30;

const mat3 kIptFromPowers = mat3(0.4000, 4.4550, 0.8056,    // columns
                                 0.4000, -4.8510, 0.3572,
                                 0.2000, 0.3960, -1.1628);

vec3 signed_power(vec3 v, float exponent) { return sign(v) * pow(abs(v), vec3(exponent)); }
float smallest(vec3 v) { return min(v.x, min(v.y, v.z)); }
float largest(vec3 v) { return max(v.x, max(v.y, v.z)); }
bool is_inside(vec3 drive, float tolerance) {
  return smallest(drive) >= -tolerance && largest(drive) <= 1.0 + tolerance;
}

// The drive nearest to the target in its own hue, and the loss in IPT x 100.
vec4 map_to_gamut(vec3 target, vec3 drive, float g) {
  vec3 offset = constants.drive_of_ambient.xyz / g + constants.drive_of_black.xyz;
  vec3 wanted = kIptFromPowers * signed_power(mat3(constants.cones_from_target) * target, kIptExponent);

  vec3 neutral = constants.drive_of_white.xyz / g;
  vec3 at_zero = offset / neutral;
  vec3 at_one = (1.0 + offset) / neutral;
  float darkest = max(0.0, largest(min(at_zero, at_one)));
  float brightest = smallest(max(at_zero, at_one));
  if (!(darkest <= brightest)) {
    drive = clamp(drive, 0.0, 1.0);
    vec3 shown = mat3(constants.cones_from_drive) * ((drive + offset) * g);
    return vec4(drive, 100.0 * distance(wanted, kIptFromPowers * signed_power(shown, kIptExponent)));
  }
  float low = pow(darkest, kIptExponent);
  float high = pow(brightest, kIptExponent);
  float quarter = 0.25 * (high - low);
  vec3 anchor = vec3(clamp(wanted.x, low + quarter, high - quarter), 0.0, 0.0);
  vec3 way = wanted - anchor;

  // Along the way the powers are linear, and the drive is linear in the cones.
  mat3 powers_from_ipt = inverse(kIptFromPowers);
  vec3 powers_at_anchor = powers_from_ipt * anchor;
  vec3 powers_along_way = powers_from_ipt * way;
  mat3 drive_from_cones = mat3(constants.drive_from_cones) / g;
  float kept = 0.0;
  float part = 0.5;
  vec3 mapped = drive_from_cones * signed_power(powers_at_anchor, 1.0 / kIptExponent) - offset;
  for (int i = 0; i < GAMUT_STEPS; ++i) {
    vec3 powers = powers_at_anchor + (kept + part) * powers_along_way;
    vec3 tried = drive_from_cones * signed_power(powers, 1.0 / kIptExponent) - offset;
    if (is_inside(tried, 0.0)) {
      kept += part;
      mapped = tried;
    }
    part *= 0.5;
  }
  return vec4(clamp(mapped, 0.0, 1.0), 100.0 * (1.0 - kept) * length(way));
}

float dither_threshold(uvec2 pixel, uint channel) {
  uint u = pixel.x * 0xC13FA9A9u + pixel.y * 0x91E10DA5u + dither_seed * 0x9E3779B9u +
           channel * 0x55555555u;
  return constants.dither != 0.0 ? (float(u >> 8) + 0.5) / 16777216.0 : 0.5;
}

// One of the two codes that bracket t in linear light.
uint code_of(int channel, float t, float threshold) {
  uint seed = tones.seeds[channel * SEED_COUNT + min(int(sqrt(t) * SEED_COUNT), SEED_COUNT - 1)];
  int first = constants.first_level[channel];
  int low = first + int(seed & 0xffffu);
  int high = first + int(seed >> 16);
  while (low < high) {
    int middle = (low + high + 1) >> 1;
    if (tones.levels[middle].x <= t) {
      low = middle;
    } else {
      high = middle - 1;
    }
  }
  vec2 lower = tones.levels[low];
  vec2 upper = tones.levels[min(low + 1, first + constants.level_count[channel] - 1)];
  // The highest level has none above it; levels rise strictly, so that nothing else divides by 0.
  bool up = (t - lower.x) > threshold * (upper.x - lower.x) && upper.x > lower.x;
  return uint(up ? upper.y : lower.y);
}

void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 texel = texelFetch(target_texture, pixel, 0);
  codes = uvec4(0u);
  if (texel.a <= 0.0) return;
#ifdef COMPENSATE
  float g = texel.a * texelFetch(vignetting_texture, pixel, 0).r;
#else
  float g = 1.0;
#endif
  bool finite = dot(abs(texel), vec4(1.0)) < kFinite;
  bool reached = g >= constants.geometry_floor;
  if (!(finite && reached)) {
    codes.a = kOutOfReach << 14;
    return;
  }
  vec3 drive = (mat3(constants.drive_from_target) * texel.rgb - constants.drive_of_ambient.xyz) / g -
               constants.drive_of_black.xyz;
  uint state = kInGamut;
  float loss = 0.0;
  if (!is_inside(drive, constants.gamut_tolerance)) {
    state = kOutOfGamut;
#ifdef COMPENSATE
    vec4 mapped = map_to_gamut(texel.rgb, drive, g);
    drive = mapped.xyz;
    loss = mapped.w;
#endif
  }
  drive = clamp(drive, 0.0, 1.0);
  uvec2 position = uvec2(pixel);
  codes = uvec4(code_of(0, drive.r, dither_threshold(position, 0u)),
                code_of(1, drive.g, dither_threshold(position, 1u)),
                code_of(2, drive.b, dither_threshold(position, 2u)),
                (state << 14) | min(uint(loss * 64.0 + 0.5), 0x3fffu));
}
