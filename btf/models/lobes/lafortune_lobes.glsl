uniform sampler2DArray Lobes;

// light.z (diffuse + specular sum of lobes). The double-precision counterpart is
// LafortuneLobes::evaluate(); change both or none. Before it stands the constant kLobes.
vec3 lafortune(ivec2 texel, vec3 view, vec3 light) {
  float sum = 0.0;
  for (int i = 0; i < kLobes; ++i)
    sum += lobe(texelFetch(Lobes, ivec3(texel, 2 + i), 0), view * light);
  return light.z * (texelFetch(Lobes, ivec3(texel, 0), 0).rgb +
                    SPECULAR_WEIGHT * sum * texelFetch(Lobes, ivec3(texel, 1), 0).rgb);
}
