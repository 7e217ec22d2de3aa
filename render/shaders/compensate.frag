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
  ivec4 first_level;  // of each channel in levels_texture
  ivec4 level_count;
  float geometry_floor;
  float gamut_tolerance;
  float dither;  // 1: on
  int gamut_steps;
  vec4 correction_full;   // DriveCorrection::Axes; read with RESIDUAL alone
  ivec4 correction_axes;  // steps, below, nodes - 1
  vec4 nits;              // LuminanceCeiling, read with CEILING alone: Y of the primaries; w: of black
  float ceiling_limit;
  int ceiling_steps;
  int code_count;          // of a channel
  int last_residual_node;  // 0: no residual
} constants;

layout(binding = 0) uniform sampler2D target_texture;
layout(binding = 1) uniform sampler2D vignetting_texture;
layout(binding = 2) uniform usampler2D seeds_texture;  // row: channel; lowest and highest level
layout(binding = 3) uniform sampler2D levels_texture;  // output and code, LEVELS_WIDTH to a row
layout(binding = 4) uniform sampler2D reflectance_texture;  // of the raster's size, or one texel
#ifdef RESIDUAL
layout(binding = 5) uniform sampler3D correction_texture;  // tau - t* of every node
#endif
#ifdef CEILING
layout(binding = 6) uniform sampler2D light_texture;  // t of every code, LEVELS_WIDTH to a row
layout(binding = 7) uniform sampler3D residual_texture;  // rho of every node
#endif
uniform uint dither_seed;

// a: PixelState << 14 | held under the ceiling << 13 | gamut loss in units of 1/32
layout(location = 0) out uvec4 codes;

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

#if defined(RESIDUAL) || defined(CEILING)
// A table of tetrahedra: ColourResidual, DriveCorrection.
vec3 between_nodes(sampler3D table, vec3 node, int last_node) {
  node = clamp(node, 0.0, float(last_node));
  ivec3 cell = min(ivec3(node), last_node - 1);
  vec3 f = node - vec3(cell);
  // From the cell's lowest corner to its highest, along the axis with the largest part first.
  float most = largest(f);
  float least = smallest(f);
  float middle = f.x + f.y + f.z - most - least;
  const ivec3 kX = ivec3(1, 0, 0);
  const ivec3 kY = ivec3(0, 1, 0);
  const ivec3 kZ = ivec3(0, 0, 1);
  ivec3 first = f.x >= f.y ? (f.x >= f.z ? kX : kZ) : (f.y >= f.z ? kY : kZ);
  ivec3 last = f.x < f.y ? (f.x < f.z ? kX : kZ) : (f.y < f.z ? kY : kZ);
  vec3 value = (1.0 - most) * texelFetch(table, cell, 0).rgb;
  value += (most - middle) * texelFetch(table, cell + first, 0).rgb;
  value += (middle - least) * texelFetch(table, cell + 1 - last, 0).rgb;
  value += least * texelFetch(table, cell + 1, 0).rgb;
  return value;
}
#endif

#ifdef RESIDUAL
const bool kCorrects = true;

// tau of a wanted linear drive: DriveCorrection.
vec3 corrected(vec3 wanted) {
  vec3 part = wanted / constants.correction_full.xyz;
  vec3 node = sign(part) * sqrt(abs(part)) * float(constants.correction_axes.x) +
              float(constants.correction_axes.y);
  return wanted + between_nodes(correction_texture, node, constants.correction_axes.z);
}
vec3 full_drive() { return constants.correction_full.xyz; }
#else
const bool kCorrects = false;
vec3 corrected(vec3 wanted) { return wanted; }
vec3 full_drive() { return vec3(1.0); }
#endif

// The drive nearest to the target in its own hue, and the loss in IPT x 100.
vec4 map_to_gamut(vec3 target, vec3 wanted_drive, vec3 drive, float g, vec3 reflectance,
                  int steps) {
  vec3 gain = g * reflectance;
  vec3 offset = constants.drive_of_ambient.xyz / g + constants.drive_of_black.xyz;
  vec3 wanted = kIptFromPowers * signed_power(mat3(constants.cones_from_target) * target, kIptExponent);

  vec3 neutral = constants.drive_of_white.xyz / gain;
  vec3 at_zero = offset / neutral;
  vec3 at_one = (full_drive() + offset) / neutral;
  float darkest = max(0.0, largest(min(at_zero, at_one)));
  float brightest = smallest(max(at_zero, at_one));
  bool any_neutral = darkest <= brightest;
  float low = pow(darkest, kIptExponent);
  float high = pow(brightest, kIptExponent);
  if (kCorrects && any_neutral) {
    float way_left = 0.5 * (high - low);
    float highest = low;
    low = high;
    high = highest;
    for (int i = 0; i < steps; ++i) {
      vec3 darker = corrected(neutral * pow(low - way_left, 1.0 / kIptExponent) - offset);
      vec3 brighter = corrected(neutral * pow(high + way_left, 1.0 / kIptExponent) - offset);
      if (smallest(darker) >= 0.0) low -= way_left;
      if (largest(brighter) <= 1.0) high += way_left;
      way_left *= 0.5;
    }
    any_neutral = low <= high;
  }
  if (!any_neutral) {
    vec3 clamped = clamp(drive, 0.0, 1.0);
    vec3 shown_drive = kCorrects ? wanted_drive + (clamped - drive) : clamped;
    vec3 shown = mat3(constants.cones_from_drive) * ((shown_drive + offset) * gain);
    return vec4(clamped,
                100.0 * distance(wanted, kIptFromPowers * signed_power(shown, kIptExponent)));
  }
  float quarter = 0.25 * (high - low);
  vec3 anchor = vec3(clamp(wanted.x, low + quarter, high - quarter), 0.0, 0.0);
  vec3 way = wanted - anchor;

  // Along the way the powers are linear, and the drive is linear in the cones.
  mat3 powers_from_ipt = inverse(kIptFromPowers);
  vec3 powers_at_anchor = vec3(anchor.x);  // on the axis the three are equal
  vec3 powers_along_way = powers_from_ipt * way;
  vec3 per_gain = 1.0 / gain;  // of each row
  mat3 drive_from_cones = matrixCompMult(mat3(per_gain, per_gain, per_gain),
                                         mat3(constants.drive_from_cones));
  float kept = 0.0;
  float part = 0.5;
  vec3 mapped = neutral * pow(anchor.x, 1.0 / kIptExponent) - offset;
  // A count that is no constant keeps compilers from unrolling: software rasterisers do not skip a
  // branch that no pixel takes, but they leave a loop, even one of a single turn.
  for (int i = 0; kCorrects && i < min(steps, 1); ++i) mapped = corrected(mapped);
  for (int i = 0; i < steps; ++i) {
    vec3 powers = powers_at_anchor + (kept + part) * powers_along_way;
    vec3 tried =
        corrected(drive_from_cones * signed_power(powers, 1.0 / kIptExponent) - offset);
    if (is_inside(tried, 0.0)) {
      kept += part;
      mapped = tried;
    }
    part *= 0.5;
  }
  return vec4(clamp(mapped, 0.0, 1.0), 100.0 * (1.0 - kept) * length(way));
}

vec3 dither_thresholds(uvec2 pixel) {
  uint u = pixel.x * 0xC13FA9A9u + pixel.y * 0x91E10DA5u + dither_seed * 0x9E3779B9u;
  uvec3 channels = u + uvec3(0u, 0x55555555u, 0xAAAAAAAAu);
  return constants.dither != 0.0 ? (vec3(channels >> 8) + 0.5) / 16777216.0 : vec3(0.5);
}

vec2 level(int index) {
  return texelFetch(levels_texture, ivec2(index % LEVELS_WIDTH, index / LEVELS_WIDTH), 0).rg;
}

// The two codes of each channel whose outputs enclose a drive.
struct Brackets {
  vec3 below;
  vec3 above;
  uvec3 lower;
  uvec3 upper;
};

Brackets brackets_of(vec3 drive) {
  ivec3 piece = min(ivec3(sqrt(drive) * SEED_COUNT), SEED_COUNT - 1);
  ivec3 low;
  ivec3 high;
  for (int i = 0; i < 3; ++i) {
    ivec2 range = ivec2(texelFetch(seeds_texture, ivec2(piece[i], i), 0).rg);
    low[i] = range.x;
    high[i] = range.y;
  }
  ivec3 first = constants.first_level.xyz;
  ivec3 last = constants.level_count.xyz - 1;
  while (any(lessThan(low, high))) {
    ivec3 middle = (low + high + 1) >> 1;
    vec3 outputs = vec3(level(first.x + middle.x).x, level(first.y + middle.y).x,
                        level(first.z + middle.z).x);
    bvec3 above = greaterThan(outputs, drive);
    low = mix(middle, low, above);
    high = mix(high, max(middle - 1, low), above);
  }
  Brackets b;
  for (int i = 0; i < 3; ++i) {
    vec2 lower = level(first[i] + low[i]);
    vec2 upper = level(first[i] + min(low[i] + 1, last[i]));
    b.below[i] = lower.x;
    b.above[i] = upper.x;
    b.lower[i] = uint(lower.y);
    b.upper[i] = uint(upper.y);
  }
  return b;
}

// For each channel one of the two.
uvec3 chosen(Brackets b, vec3 drive, vec3 threshold) {
  uvec3 result;
  for (int i = 0; i < 3; ++i) {
    // The highest level has none above it: there both are the same, and the lower one is taken.
    bool up = drive[i] - b.below[i] > threshold[i] * (b.above[i] - b.below[i]) &&
              b.above[i] > b.below[i];
    result[i] = up ? b.upper[i] : b.lower[i];
  }
  return result;
}

#ifdef CEILING
// The highest that any threshold chooses.
uvec3 highest(Brackets b, vec3 drive) { return chosen(b, drive, vec3(0.0)); }

#if defined(COMPENSATE) && !defined(RESIDUAL)
vec3 residual_of(vec3 t) { return vec3(0.0); }
#else
vec3 residual_of(vec3 t) {
  int last_node = constants.last_residual_node;
  if (last_node == 0) return vec3(0.0);
  return between_nodes(residual_texture, sqrt(t) * float(last_node), last_node);
}
#endif

bool is_allowed(uvec3 code) {
  vec3 t;
  for (int i = 0; i < 3; ++i) {
    int at = i * constants.code_count + int(code[i]);
    t[i] = texelFetch(light_texture, ivec2(at % LEVELS_WIDTH, at / LEVELS_WIDTH), 0).r;
  }
  return dot(constants.nits.xyz, t + residual_of(t)) + constants.nits.w <= constants.ceiling_limit;
}

// Holds codes under the ceiling, and says whether they had to be: Compensation::hold().
bool hold(vec3 drive, Brackets wanted, vec3 threshold, inout uvec3 code) {
  uvec3 before = highest(wanted, drive);
  bool is_over = !is_allowed(before);
  vec3 sent = kCorrects ? drive + residual_of(drive) : drive;
  float root = 0.0;
  float way_left = 0.5;
  // All that is done for what is over is in the loop, and its count is no constant: software
  // rasterisers skip no branch, but they leave a loop.
  int steps = constants.ceiling_steps;
  for (int i = 0; i < (is_over ? steps + 1 : 0); ++i) {
    bool is_last = i == steps;
    float tried = is_last ? root : root + way_left;
    vec3 scaled = tried > 0.0 ? clamp(corrected(tried * tried * sent), 0.0, 1.0) : vec3(0.0);
    Brackets b = brackets_of(scaled);
    uvec3 most = highest(b, scaled);
    uvec3 asked = is_last ? chosen(b, scaled, threshold) : most;
    bool allowed = is_allowed(asked);
    if (is_last) {
      code = allowed ? asked : most;
    } else if (allowed) {
      root = tried;
    }
    way_left *= 0.5;
  }
  if (!is_over) return false;
  return before != uvec3(0u);
}
#endif

void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 texel = texelFetch(target_texture, pixel, 0);
  codes = uvec4(0u);
  if (texel.a <= 0.0) return;
#ifdef COMPENSATE
  float g = texel.a * texelFetch(vignetting_texture, pixel, 0).r;
  ivec2 last = textureSize(reflectance_texture, 0) - 1;
  vec3 reflectance = texelFetch(reflectance_texture, min(pixel, last), 0).rgb;
#else
  float g = 1.0;
  const vec3 reflectance = vec3(1.0);
#endif
  bool finite = dot(abs(texel), vec4(1.0)) < kFinite;
  bool reached = g >= constants.geometry_floor;
  if (!(finite && reached)) {
    codes.a = kOutOfReach << 14;
    return;
  }
  vec3 wanted_drive = (mat3(constants.drive_from_target) * texel.rgb / reflectance -
                       constants.drive_of_ambient.xyz) / g -
                      constants.drive_of_black.xyz;
  vec3 drive = corrected(wanted_drive);
  uint state = kInGamut;
  float loss = 0.0;
  if (!is_inside(drive, constants.gamut_tolerance)) {
    state = kOutOfGamut;
#ifdef COMPENSATE
    vec4 mapped =
        map_to_gamut(texel.rgb, wanted_drive, drive, g, reflectance, constants.gamut_steps);
    drive = mapped.xyz;
    loss = mapped.w;
#endif
  }
  drive = clamp(drive, 0.0, 1.0);
  vec3 threshold = dither_thresholds(uvec2(pixel));
  Brackets brackets = brackets_of(drive);
  uvec3 code = chosen(brackets, drive, threshold);
  uint held = 0u;
#ifdef CEILING
  if (hold(drive, brackets, threshold, code)) held = 1u;
#endif
  codes.rgb = code;
  codes.a = (state << 14) | (held << 13) | min(uint(loss * 32.0 + 0.5), 0x1fffu);
}
