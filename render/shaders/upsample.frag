// What was drawn on a smaller raster, on the projector's (upsample_pass.h).
layout(binding = 0) uniform sampler2D drawn_texture;
uniform vec2 pixels;  // of the smaller raster in one of the projector's

layout(location = 0) out vec4 target;

void main() {
#ifdef PART
  if (!is_in_part(gl_FragCoord.xy)) discard;
#endif
  ivec2 last = textureSize(drawn_texture, 0) - 1;
  vec2 place = gl_FragCoord.xy * pixels - 0.5;  // between centres
  ivec2 low = ivec2(floor(place));
  vec2 f = place - vec2(low);
  ivec2 from = max(low, 0);
  ivec2 to = min(low + 1, last);
  vec4 a = texelFetch(drawn_texture, from, 0);
  vec4 b = texelFetch(drawn_texture, ivec2(to.x, from.y), 0);
  vec4 c = texelFetch(drawn_texture, ivec2(from.x, to.y), 0);
  vec4 d = texelFetch(drawn_texture, to, 0);
  vec4 nearest = f.y < 0.5 ? (f.x < 0.5 ? a : b) : (f.x < 0.5 ? c : d);
  // What is not covered is 0 throughout, so that it only has to be left out of the divisor. A factor
  // that is no number counts as covered and stays a fault, which compensation shows dark.
  vec4 covered = vec4(a.a <= 0.0 ? 0.0 : 1.0, b.a <= 0.0 ? 0.0 : 1.0, c.a <= 0.0 ? 0.0 : 1.0,
                      d.a <= 0.0 ? 0.0 : 1.0);
  vec4 sum = mix(mix(a, b, f.x), mix(c, d, f.x), f.y);
  float weight = mix(mix(covered.x, covered.y, f.x), mix(covered.z, covered.w, f.x), f.y);
  target = nearest.a <= 0.0 ? vec4(0.0) : weight < 1.0 ? sum / weight : sum;
}
