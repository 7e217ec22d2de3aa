// Keeps the point of the surface that a pixel sees for draw.comp.
in Surface {
  vec3 position;
  vec3 normal;
  vec3 tangent;
  vec2 uv;
} surface;

layout(location = 0) out uvec4 place;
layout(location = 1) out uvec4 at;

void main() {
  place = uvec4(floatBitsToUint(surface.position), packHalf2x16(fwidth(surface.uv)));
  at = uvec4(floatBitsToUint(surface.uv), word_of_direction(surface.normal),
             word_of_direction(surface.tangent));
}
