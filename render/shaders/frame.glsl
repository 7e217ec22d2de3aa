// What one frame needs to know; everything in the object's frame, metres. DrawPass fills it.
layout(std140, binding = 0) uniform Frame {
  mat4 clip_from_object;
  mat4 xyz_from_rgb;         // upper left 3 x 3; linear sRGB with 1 cd/m^2 each to XYZ
  vec4 eye;                  // position
  vec4 projector;            // position; w: reference distance squared
  vec2 texture_repeats;
  float specular_weight;     // of the highlights, 0 to 1
  vec4 lights[LIGHT_COUNT];  // w = 1: position; w = 0: unit direction to the light
  vec4 light_rgb[LIGHT_COUNT];  // illuminance (w = 0) or intensity (w = 1) over pi, linear sRGB
} frame;
// What models with a specular term multiply it by (btf/model_shader.h).
#define SPECULAR_WEIGHT frame.specular_weight
