// The three measured directions around any direction, and their weights. The double-precision
// counterpart is DirectionLookup::weights(); change both or none.
struct DirectionWeights {
  ivec3 index;
  vec3 weight;
  float scale;
};

DirectionWeights direction_weights(usampler2D cells, sampler2D regions, vec3 direction) {
  ivec2 size = textureSize(cells, 0);
  ivec2 cell = min(ivec2(concentric_square(direction) * vec2(size)), size - 1);
  int region = int(texelFetch(cells, cell, 0).r);
  ivec2 at = ivec2((region & 63) * 4, region >> 6);
  vec4 a = texelFetch(regions, at, 0);
  vec4 b = texelFetch(regions, at + ivec2(1, 0), 0);
  vec4 c = texelFetch(regions, at + ivec2(2, 0), 0);
  DirectionWeights result;
  result.index = ivec3(texelFetch(regions, at + ivec2(3, 0), 0).xyz);
  vec3 above = vec3(direction.xy, max(direction.z, 1e-6));
  vec3 weight = max(vec3(dot(a.xyz, above), dot(b.xyz, above), dot(c.xyz, above)), 0.0);
  float sum = weight.x + weight.y + weight.z;
  result.weight = sum > 0.0 ? weight / sum : vec3(1.0, 0.0, 0.0);
  float border = max(dot(result.weight, vec3(a.w, b.w, c.w)), 1e-6);
  result.scale = clamp(direction.z / border, 0.0, 1.0);
  return result;
}
