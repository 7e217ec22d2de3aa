// Behind draw.frag: evaluates it at the pixels that store_surface.frag reached.
layout(local_size_x = 8, local_size_y = 8) in;

uniform usampler2D SurfacePlaces;
uniform usampler2D SurfaceFrames;
uniform sampler2D SurfaceDepth;
uniform float nearest;  // depth from which on a pixel is not ours: FadeMask
layout(binding = 0) writeonly uniform image2D target_image;

void main() {
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, imageSize(target_image)))) return;
  target = vec4(0.0);
  float depth = texelFetch(SurfaceDepth, pixel, 0).r;
  if (depth >= nearest) return;
  if (depth > 0.0) {
    uvec4 place = texelFetch(SurfacePlaces, pixel, 0);
    uvec4 at = texelFetch(SurfaceFrames, pixel, 0);
    surface.position = uintBitsToFloat(place.xyz);
    uv_width = unpackHalf2x16(place.w);
    surface.uv = uintBitsToFloat(at.xy);
    surface.normal = direction_of_word(at.z);
    surface.tangent = direction_of_word(at.w);
    shade();
  }
  imageStore(target_image, pixel, target);
}
