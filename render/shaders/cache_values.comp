// Evaluates what depends on directions at every node: for each light, kClusters clusters of
// kCacheLayers layers. An invocation takes some clusters of one node and one light, so that finding the
// directions' place is shared by them.
layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba16f, binding = 0) writeonly uniform image2DArray values_image;
uniform sampler2DArray NodeDirections;

const int kChunk = 8;
const int kChunks = (kClusters + kChunk - 1) / kChunk;

void main() {
  ivec2 node = ivec2(gl_GlobalInvocationID.xy);
  int light = int(gl_WorkGroupID.z) / kChunks;
  int first = int(gl_WorkGroupID.z) % kChunks * kChunk;
  if (any(greaterThanEqual(node, imageSize(values_image).xy))) return;
  vec4 view = texelFetch(NodeDirections, ivec3(node, 0), 0);
  if (view.w == 0.0) return;  // no cell reads it
  EigenPlace place =
      eigen_place(view.xyz, texelFetch(NodeDirections, ivec3(node, 1 + light), 0).xyz);
  for (int cluster = first; cluster < min(first + kChunk, kClusters); ++cluster) {
    vec4 values[kCacheLayers];
    eigen_values(place, cluster, values);
    for (int layer = 0; layer < kCacheLayers; ++layer)
      imageStore(values_image, ivec3(node, (light * kClusters + cluster) * kCacheLayers + layer),
                 values[layer]);
  }
}
