// The first layer holds the diffuse colour and the strength of the highlight, the second its
// exponent.
uniform sampler2DArray Texels;

vec3 btf_radiance(vec2 uv, vec3 view, vec3 light) {
  ivec2 texel = texel_at(uv);
  view.z = max(view.z, 0.0);
  vec4 colours = texelFetch(Texels, ivec3(texel, 0), 0);
  float exponent = texelFetch(Texels, ivec3(texel, 1), 0).r;
  float highlight = lobe(vec4(-1.0, -1.0, 1.0, exponent), view * light);
  return light.z > 0.0 ? colours.rgb * light.z + SPECULAR_WEIGHT * colours.a * highlight : vec3(0.0);
}
