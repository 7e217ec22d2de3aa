// The sample over a pixel's footprint instead of at its centre. Texels are squares of one colour; a pixel
// no larger than a texel sees at most two along each side, and here come their shares. Larger pixels are
// taken as one texel wide. Before this stand kSampleTexels and
// SAMPLE, what is averaged.
vec3 over_texels(vec2 uv, vec3 view, vec3 light) {
  vec2 place = uv * kSampleTexels;
  vec2 width = clamp(fwidth(place), 1e-3, 1.0);
  vec2 edge = floor(place + 0.5);  // the nearest between texels
  vec2 beyond = clamp((place - edge) / width + 0.5, 0.0, 1.0);
  vec2 near = (edge - 0.5) / kSampleTexels;
  vec2 far = (edge + 0.5) / kSampleTexels;
  return mix(mix(SAMPLE(near, view, light), SAMPLE(vec2(far.x, near.y), view, light), beyond.x),
             mix(SAMPLE(vec2(near.x, far.y), view, light), SAMPLE(far, view, light), beyond.x),
             beyond.y);
}
