// Brings the codes of compensate.frag into a buffer of the display: as they are, or widened to its
// bits.
layout(binding = 0) uniform usampler2D codes_texture;
uniform uint code_maximum;    // 2^bits - 1 of the codes,
uniform uint buffer_maximum;  // and of the buffer, which is no less

layout(location = 0) out vec4 colour;

void main() {
  uvec3 code = min(texelFetch(codes_texture, ivec2(gl_FragCoord.xy), 0).rgb, uvec3(code_maximum));
  // round(code * buffer_maximum / code_maximum), in whole numbers; a normalised channel then stores
  // the whole number that its value stands for.
  uvec3 wide = (2u * code * buffer_maximum + code_maximum) / (2u * code_maximum);
  colour = vec4(vec3(wide) / float(buffer_maximum), 1.0);
}
