// What a pixel shows of the texels under it. Before this stand SAMPLE, what is read of one texel, and
// kSampleTexels; MIP_LEVELS, where the material has more than one, and AVERAGE_TEXELS, where asked for.

#ifdef MIP_LEVELS
// The level whose texels come nearest to a pixel in size; magnified, the sample itself.
int level_under_pixel() {
  vec2 width = uv_width * vec2(kSampleTexels);
  float most = clamp(max(width.x, width.y), 1.0, exp2(float(MIP_LEVELS)));
  return min(int(log2(most) + 0.5), MIP_LEVELS - 1);
}
#endif

vec3 over_texels(vec2 uv, vec3 view, vec3 light) {
  ivec2 size = kSampleTexels;
#ifdef MIP_LEVELS
  texel_level = level_under_pixel();
  size >>= texel_level;
#endif
#ifdef AVERAGE_TEXELS
  // The mean over the pixel. Texels are squares of one colour; a pixel no larger than a texel sees at
  // most two along each side, and here come their shares. Larger pixels are taken as one texel wide.
  vec2 place = uv * vec2(size);
  vec2 width = clamp(uv_width * vec2(size), 1e-3, 1.0);
  vec2 edge = floor(place + 0.5);  // the nearest between texels
  vec2 beyond = clamp((place - edge) / width + 0.5, 0.0, 1.0);
  vec2 near = (edge - 0.5) / vec2(size);
  vec2 far = (edge + 0.5) / vec2(size);
  return mix(mix(SAMPLE(near, view, light), SAMPLE(vec2(far.x, near.y), view, light), beyond.x),
             mix(SAMPLE(vec2(near.x, far.y), view, light), SAMPLE(far, view, light), beyond.x),
             beyond.y);
#else
  return SAMPLE(uv, view, light);
#endif
}
