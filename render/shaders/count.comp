// Adds up what compensate.frag left in alpha. Every invocation takes a tile of its own first, so that
// the few atomic additions that follow cost nothing.
layout(local_size_x = 8, local_size_y = 8) in;

layout(binding = 0) uniform usampler2D codes_texture;

layout(std430, binding = 1) buffer Counters {
  uint covered;
  uint out_of_gamut;
  uint out_of_reach;
  uint loss_low;  // gamut loss in units of 1/32, 64 bits in two words
  uint loss_high;
  uint held;
} counters;

const ivec2 kTile = ivec2(16, 8);

void main() {
  ivec2 size = textureSize(codes_texture, 0);
  ivec2 from = ivec2(gl_GlobalInvocationID.xy) * kTile;
  ivec2 to = min(from + kTile, size);
  uvec4 sum = uvec4(0u);
  uint held = 0u;
  for (int y = from.y; y < to.y; ++y) {
    for (int x = from.x; x < to.x; ++x) {
      uint a = texelFetch(codes_texture, ivec2(x, y), 0).a;
      uint state = a >> 14;
      sum += uvec4(state != 0u, state == 2u, state == 3u, a & 0x1fffu);
      held += (a >> 13) & 1u;
    }
  }
  if (sum.x == 0u) return;
  atomicAdd(counters.covered, sum.x);
  if (sum.y != 0u) atomicAdd(counters.out_of_gamut, sum.y);
  if (sum.z != 0u) atomicAdd(counters.out_of_reach, sum.z);
  if (held != 0u) atomicAdd(counters.held, held);
  if (sum.w != 0u) {
    uint before = atomicAdd(counters.loss_low, sum.w);
    if (before + sum.w < before) atomicAdd(counters.loss_high, 1u);
  }
}
